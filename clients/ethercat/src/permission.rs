//! Whether the drives may apply forces: what the daemon has sent, and what has happened on the bus since.

use hexad_client::messages::ForceMessage;
use hexad_core::control::signals::state::State;

/// Newest force message and its permission.
#[derive(Clone, Copy, Debug)]
pub struct Permission {
    newest: ForceMessage,
    longest_age_ns: u64,
    /// A failure of the bus or a drive has ended the permission.
    is_stopped: bool,
    /// Faults of the drives wait until the daemon is in no fault: it had one, or drives had some when this driver began.
    awaits_clear: bool,
    /// The driver ends.
    is_ended: bool,
}

impl Permission {
    /// No permission until a message grants it. A message counts for no longer than `longest_age_ns`.
    pub fn new(longest_age_ns: u64) -> Self {
        Self {
            newest: ForceMessage::default(),
            longest_age_ns,
            is_stopped: true,
            awaits_clear: true,
            is_ended: false,
        }
    }

    /// Takes in a message. After a failure forces may be applied again once the daemon has sent one that is not valid: it has
    /// noticed, and an operator engages anew. Whether faults of the drives are acknowledged with it: an operator has cleared the
    /// daemon's, also before this driver began.
    pub fn receive(&mut self, message: ForceMessage) -> bool {
        self.newest = message;
        if message.valid == 1 {
            return false;
        }
        self.is_stopped = false;
        let has_fault = message.state == State::Fault as u32;
        core::mem::replace(&mut self.awaits_clear, has_fault) && !has_fault
    }

    /// Ends the permission; whether there was one.
    pub fn stop(&mut self) -> bool {
        let was_stopped = core::mem::replace(&mut self.is_stopped, true);
        !was_stopped && self.newest.valid == 1
    }

    /// Ends the permission for good.
    pub fn end(&mut self) {
        self.is_ended = true;
    }

    /// Forces that may be applied now \[N\].
    pub fn forces(&self, now_ns: u64) -> Option<[f64; 6]> {
        let is_permitted = !self.is_stopped && !self.is_ended;
        let may_be_applied = is_permitted && self.newest.may_be_applied(now_ns, self.longest_age_ns);
        may_be_applied.then_some(self.newest.force_n)
    }

    /// Instant of the measurement that the newest message responds to \[ns\].
    pub fn release_ns(&self) -> u64 {
        self.newest.release_ns
    }
}

#[cfg(test)]
mod tests {
    use hexad_client::messages::Message;

    use super::*;

    fn message(sequence: u64, is_valid: bool, state: State) -> ForceMessage {
        let mut message = ForceMessage { valid: is_valid.into(), state: state as u32, ..Default::default() };
        let header = message.header_mut();
        (header.schema, header.sequence, header.time_ns) = (ForceMessage::SCHEMA, sequence, 1000 * sequence);
        message.seal();
        message
    }

    #[test]
    fn a_failure_ends_the_permission_until_the_daemon_has_noticed() {
        let mut permission = Permission::new(5000);
        permission.receive(message(1, true, State::Active));
        assert!(permission.forces(1000).is_none(), "the daemon was in control before this driver began");
        assert!(permission.receive(message(2, false, State::Standby)), "cleared before this driver began");
        assert!(permission.forces(2000).is_none(), "not valid");
        permission.receive(message(3, true, State::Engaging));
        assert!(permission.forces(3000).is_some());
        assert!(permission.forces(8001).is_none(), "too old");
        assert!(permission.stop());
        assert!(!permission.stop(), "once");
        permission.receive(message(4, true, State::Active));
        assert!(permission.forces(4000).is_none(), "stopped");
        permission.receive(message(5, false, State::Fault));
        assert!(!permission.receive(message(6, false, State::Fault)));
        assert!(permission.receive(message(7, false, State::Off)), "cleared");
        permission.receive(message(8, true, State::Engaging));
        assert!(permission.forces(8000).is_some());
    }
}
