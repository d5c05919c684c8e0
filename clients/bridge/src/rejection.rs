//! Reasons why messages from a network are not followed, and their log.

use std::mem::{Discriminant, discriminant};
use std::time::{Duration, Instant};

use hexad_client::messages::source_clock::NoInstant;
use tracing::warn;

/// Shortest time between two lines of the log with one reason.
const LOG_INTERVAL: Duration = Duration::from_secs(1);

/// Reason why a message is not followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// Another encoding.
    #[error("it cannot be decoded: {0}; is it of the same type?")]
    Format(String),
    /// NaN or infinite.
    #[error("a number is not finite")]
    NotFinite,
    /// No rotation.
    #[error("the norm of its quaternion is {0}, not 1")]
    Norm(f64),
    /// Another frame.
    #[error("frame_id = {0:?} is not {1:?}")]
    Frame(String, String),
    /// A program instead of a setpoint.
    #[error("it has {0} points instead of one: send each setpoint when it is due")]
    Points(usize),
    /// An incomplete motion.
    #[error("its point has not one transform, one velocity and one acceleration")]
    Derivatives,
    /// No rates of X.
    #[error("at beta = 90 deg the angles have no rates")]
    AngleRates,
    /// Another kind of setpoint.
    #[error("its kind is {0}; must be 0 (motion) or 1 (pose); send a target as the request goto")]
    Kind(u64),
    /// Beyond the present.
    #[error("its point is {0:.3} s after its stamp; must be in [0, timeouts.setpoint_ms = {1:.0} ms]")]
    Ahead(f64, f64),
    /// Late, or of a stamp that has no instant.
    #[error(transparent)]
    Clock(#[from] NoInstant),
    /// A message from before the present life of its source.
    #[error(
        "its epoch {0} is before that of the source, {1}: it was sent before, or the clock was set back; start the source again"
    )]
    PastEpoch(u64, u64),
    /// Too many.
    #[error("more than {0} messages arrive in a second")]
    Flood(u64),
    /// One source at a time.
    #[error("another source is followed until it has been silent for timeouts.setpoint_ms: {0}")]
    OtherSource(String),
    /// The machine file admits no poses alone.
    #[error("poses alone need setpoint.on_violation = \"limit\" in the machine file (now \"stop\")")]
    Policy,
    /// No topic of the machine.
    #[error("they cannot be published: {0}")]
    Port(String),
    /// The list of the file does not permit it.
    #[error("not permitted: {0}")]
    Denied(String),
    /// A certificate of the authority that the file does not name.
    #[error("not permitted: the file names no client with this certificate")]
    UnnamedCertificate,
    /// A remote side that was not admitted.
    #[error("the remote side is not admitted: {0}")]
    Connection(String),
}

/// Log of rejections: each reason at most once in a second, with the number of messages since.
#[derive(Debug, Default)]
pub struct RejectionLog(Vec<(Discriminant<Rejection>, u64, Instant)>);

impl RejectionLog {
    /// Counts a rejection, and logs it if its reason was not logged within the last second. `source` names the sender.
    pub fn add(&mut self, rejection: &Rejection, source: impl FnOnce() -> String) {
        if let Some(count) = self.due(rejection, Instant::now()) {
            warn!(source = source(), count, "messages are rejected: {rejection}");
        }
    }

    /// Number of rejections to be logged now with a reason.
    fn due(&mut self, rejection: &Rejection, now: Instant) -> Option<u64> {
        let reason = discriminant(rejection);
        let Some((_, count, logged)) = self.0.iter_mut().find(|(known, ..)| *known == reason) else {
            self.0.push((reason, 0, now));
            return Some(1);
        };
        *count += 1;
        let is_due = now.duration_since(*logged) >= LOG_INTERVAL;
        is_due.then(|| {
            *logged = now;
            std::mem::take(count)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_logged_once_a_second_with_its_number() {
        let (mut log, began) = (RejectionLog::default(), Instant::now());
        let mut logged = vec![];
        for k in 0..3000 {
            let now = began + Duration::from_millis(k);
            logged.extend(log.due(&Rejection::Norm(k as f64), now));
            if k == 1500 {
                assert_eq!(log.due(&Rejection::NotFinite, now), Some(1));
            }
        }
        assert_eq!(logged, [1, 1000, 1000]);
    }
}
