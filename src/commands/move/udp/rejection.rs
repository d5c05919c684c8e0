//! Why a datagram is not followed, and how many there were of each kind.

use core::fmt;
use core::mem::discriminant;
use core::net::SocketAddr;

use hexad_client::messages::source_clock::NoInstant;
use hexad_machine::text::excerpt::{excerpt, stranger};
use hexad_machine::text::numbers::significant;

/// Reason why a datagram is not followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// From an address that is not permitted.
    #[error("its sender is not among --from")]
    Sender,
    /// Of a second program beside the first.
    #[error("{0} sends while {1} does: end one of the two programs")]
    Second(SocketAddr, SocketAddr),
    /// Another kind of datagram.
    #[error("it has not the bytes that the format's mark states: another kind of datagram")]
    Mark,
    /// The same, or another format.
    #[error(
        "it has {found} bytes, must have {expected} (length_bytes): another kind of datagram, or another format"
    )]
    Length { found: usize, expected: usize },
    /// No DATA of X-Plane.
    #[error("it is no DATA of X-Plane with whole records")]
    NoXPlane,
    /// A row that is not switched on.
    #[error("it has no record {0}: is the row switched on in X-Plane, Settings, Data Output?")]
    NoRecord(u32),
    /// Bytes that are no text.
    #[error("it is no UTF-8 text: encoding = \"binary\"?")]
    NoText,
    /// A part of a text.
    #[error("it does not end with the format's end: it is cut, or has another format")]
    End,
    /// Another number of fields.
    #[error(
        "it has {found} fields, must have {expected} (fields): another separator, or a decimal comma where commas separate? {text:?}"
    )]
    Fields { found: usize, expected: usize, text: String },
    /// A decimal comma where it is none.
    #[error("{0:?} has a decimal comma, which is read only with separator = \";\"")]
    DecimalComma(String),
    /// No number.
    #[error("{0:?} is no number{1}")]
    NoNumber(String, String),
    /// NaN or infinite.
    #[error("{0} is {1}, which is no number")]
    NotFinite(&'static str, f64),
    /// Beyond the range of the format.
    #[error("{name} = {} {unit} is not in its range [{}, {}]", significant(*value), significant(*low), significant(*high))]
    Range { name: &'static str, value: f64, low: f64, high: f64, unit: String },
    /// Late, or of a stamp that has no instant.
    #[error(transparent)]
    Clock(#[from] NoInstant),
}

impl Rejection {
    /// Of a word that is no number.
    pub fn no_number(word: &str) -> Self {
        let with_point = word.replacen(',', ".", 1);
        if with_point != word && with_point.parse::<f64>().is_ok() {
            return Self::DecimalComma(excerpt(word));
        }
        Self::NoNumber(excerpt(word), stranger(word))
    }
}

/// Number of rejected datagrams of each kind, with the first of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RejectionCounts(Vec<(Rejection, u64)>);

impl RejectionCounts {
    /// Counts one. Whether it is the first of its kind.
    pub fn add(&mut self, rejection: &Rejection) -> bool {
        let kind = |rejection: &Rejection| match rejection {
            Rejection::Clock(reason) => (discriminant(rejection), Some(discriminant(reason))),
            other => (discriminant(other), None),
        };
        let known = self.0.iter_mut().find(|(known, _)| kind(known) == kind(rejection));
        let Some((_, count)) = known else {
            self.0.push((rejection.clone(), 1));
            return true;
        };
        *count += 1;
        false
    }
}

impl fmt::Display for RejectionCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|(first, count)| write!(f, "; {count} rejected: {first}"))
    }
}
