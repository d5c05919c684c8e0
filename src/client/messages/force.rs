//! The force message.

use core::mem::offset_of;

use iceoryx2::prelude::ZeroCopySend;

use super::Message as _;
use super::layout::{Declared as _, message};
use hexad_core::control::controller::Output;

message! {
    /// Actuator forces of one cycle. A driver brakes at a message that is not `valid`, and when its own watchdog has seen no
    /// applicable message for too long. A message is applicable only if schema and checksum are right, the sequence
    /// number increases and `time_ns` is neither in the future nor too old.
    ForceMessage = "hexad_force" on "force" schema 5 sealed by checksum {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// Gamma; positive pushes the platform away from the base. Zero unless valid.
        force_n: [f64; 6] ["N"],
        /// 1 if the forces may be applied, else 0.
        valid: u32,
        /// Number of the `State`.
        state: u32,
        /// Number of the `DiagnosticCode` of the state.
        diagnostic_code: u32,
        /// Bits of the `Limit`s that this cycle has reached, or nearly.
        active_limits: u32,
        /// Instant for which the forces were computed: the cycle's release, or with external release the time of the
        /// measurement that released it.
        release_ns: u64 ["ns"],
        /// CRC-32 (of zlib, PNG, Ethernet) of the bytes before it.
        checksum: u32,
        /// Zero.
        reserved: u32,
    }
}

impl ForceMessage {
    /// Forces of a cycle that was computed for an instant \[ns\]; valid in the states under control.
    pub fn new(output: &Output, release_ns: u64) -> Self {
        Self {
            force_n: output.command_n,
            valid: u32::from(output.state.has_control()),
            state: output.state as u32,
            diagnostic_code: output.diagnostic.code as u32,
            active_limits: output.active_limits.0,
            release_ns,
            ..Self::default()
        }
    }

    /// Whether a driver may apply the forces now, by a message that is not from the future and at most so old: a driver that was
    /// stopped finds messages of the time before \[ns\]. In simulated time now is that of the measurement.
    pub fn may_be_applied(&self, now_ns: u64, longest_age_ns: u64) -> bool {
        let age_ns = now_ns.checked_sub(self.header.time_ns);
        age_ns.is_some_and(|age_ns| age_ns <= longest_age_ns) && self.has_valid_content()
    }

    /// Whether the content may be applied at any time: schema, checksum, valid, finite.
    pub fn has_valid_content(&self) -> bool {
        self.header.schema == Self::SCHEMA
            && self.is_intact()
            && self.valid == 1
            && self.force_n.iter().all(|force| force.is_finite())
    }

    /// CRC-32 of the fields before `checksum`.
    pub fn computed_checksum(&self) -> u32 {
        self.checksum_before(offset_of!(Self, checksum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::control::signals::diagnostic::DiagnosticCode;
    use hexad_core::control::signals::limits::LimitSet;
    use hexad_core::control::signals::state::State;

    #[test]
    fn a_force_is_valid_only_under_control() {
        let command_n = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut output = Output {
            diagnostic: DiagnosticCode::SetpointTooFar.into(),
            command_n,
            active_limits: LimitSet(6),
            ..Output::default()
        };
        for state in State::ALL {
            output.state = state;
            let message = ForceMessage::new(&output, 91);
            let numbers = [message.valid, message.state, message.diagnostic_code, message.active_limits];
            assert_eq!(
                numbers,
                [u32::from(state.has_control()), state as u32, DiagnosticCode::SetpointTooFar as u32, 6],
                "{state:?}"
            );
            assert_eq!((message.force_n, message.release_ns), (command_n, 91));
        }
    }

    #[test]
    fn a_force_is_applied_only_while_it_is_recent_and_not_from_the_future() {
        let output = Output { state: State::Active, ..Output::default() };
        let mut message = ForceMessage::new(&output, 0);
        (message.header.schema, message.header.time_ns) = (ForceMessage::SCHEMA, 1_000);
        message.checksum = message.computed_checksum();
        for (now_ns, may_be_applied) in
            [(999, false), (1_000, true), (1_020, true), (1_021, false), (u64::MAX, false)]
        {
            assert_eq!(message.may_be_applied(now_ns, 20), may_be_applied, "{now_ns}");
        }
        message.force_n[3] = 1.0;
        assert!(!message.may_be_applied(1_000, 20), "the checksum is that of other forces");
        for (force_n, may_be_applied) in [(1.0, true), (f64::NAN, false), (f64::INFINITY, false)] {
            message.force_n[3] = force_n;
            message.checksum = message.computed_checksum();
            assert_eq!(message.may_be_applied(1_000, 20), may_be_applied, "{force_n} N");
        }
    }

    #[test]
    fn the_checksum_covers_the_bytes_before_it_and_no_other() {
        let mut message = ForceMessage::default();
        let zeros = crc32fast::hash(&[0; offset_of!(ForceMessage, checksum)]);
        assert_eq!(message.computed_checksum(), zeros);
        (message.checksum, message.reserved) = (7, 8);
        assert_eq!(message.computed_checksum(), zeros);
        message.release_ns = 1;
        assert_ne!(message.computed_checksum(), zeros);
    }
}
