//! Why a message is rejected whatever it contains, where its sender has to be corrected.

use core::fmt;

/// Mistake of a sender that all of its messages have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// The version of the message is another one.
    Schema {
        /// In the message.
        found: u32,
        /// Of this process.
        expected: u32,
    },
    /// The sender's life begins in the future: it stamps with another clock.
    Clock {
        /// By how much \[ns\].
        ahead_ns: u64,
    },
}

impl Rejection {
    /// Whether both are the same mistake, whatever the numbers.
    pub fn is_same_kind(&self, other: &Self) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other)
    }
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Schema { found, expected } => write!(
                f,
                "messages have schema {found}, must be {expected}; build the sender with the declarations of hexad messages"
            ),
            Self::Clock { ahead_ns } => write!(
                f,
                "messages are {:.1} s ahead, must not be in the future; epoch and time_ns are CLOCK_MONOTONIC",
                *ahead_ns as f64 * 1e-9
            ),
        }
    }
}
