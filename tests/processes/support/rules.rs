//! What must hold of every recording, whatever the host did.

use std::collections::HashMap;

use hexad::control::state::Cause;
use hexad::ipc::messages::{ForceMessage, MeasuredMessage, Message};

use super::machine::{PERIOD_NS, TIMEOUT_NS};
use super::recorder::Recording;

/// Every rule, for a machine of [`super::machine::Machine::patient`].
pub fn hold(recording: &Recording) {
    forces_are_zero_unless_valid(&recording.forces);
    valid_forces_are_fresh(recording);
    releases_are_in_phase(&recording.forces);
    every_grid_point_is_counted(recording);
}

/// Whether the platform stands.
pub fn stands(measured: &MeasuredMessage) -> bool {
    measured.length_rate_m_s == [0.0; 6]
}

fn forces_are_zero_unless_valid(forces: &[ForceMessage]) {
    for force in forces {
        let valid = force.valid == 1;
        assert_eq!(valid, force.state == 1 && force.fault == Cause::None as u32, "{force:#?}");
        assert!(valid || (force.force_n == [0.0; 6] && force.fault != Cause::None as u32), "{force:#?}");
        assert!(force.force_n.iter().all(|newton| newton.is_finite()), "{force:#?}");
    }
}

/// A force marked valid was computed from a measurement and a setpoint younger than the timeouts, and was
/// not itself older than that when it was sent.
fn valid_forces_are_fresh(recording: &Recording) {
    let measured = Instants::of(&recording.measured);
    let setpoints = Instants::of(&recording.setpoints);
    for force in recording.forces.iter().filter(|force| force.valid == 1) {
        let (release_ns, sent_ns) = (force.release_ns, force.header.time_ns);
        for (instants, what) in [(&measured, "measurement"), (&setpoints, "setpoint")] {
            let newest_ns = instants.newest_until(sent_ns);
            let age_ns = newest_ns.map(|newest_ns| release_ns.saturating_sub(newest_ns));
            assert!(
                age_ns.is_some_and(|age_ns| age_ns <= TIMEOUT_NS),
                "a valid force, and the newest {what} was {age_ns:?} ns old: {force:#?}"
            );
        }
        let age_ns = sent_ns.saturating_sub(release_ns);
        assert!(
            age_ns <= TIMEOUT_NS,
            "a force was sent as valid {age_ns} ns after the cycle that computed it: {force:#?}"
        );
    }
}

/// The grid is absolute: every cycle of every life of the daemon is half a period after a multiple of it.
fn releases_are_in_phase(forces: &[ForceMessage]) {
    for force in forces.iter().filter(|force| force.release_ns != 0) {
        assert_eq!(force.release_ns % PERIOD_NS, PERIOD_NS / 2, "{force:#?}");
    }
}

/// Between any two cycles of one life, the grid points that passed are the cycles that ran plus those
/// counted as skipped. Exact, however long the host or a signal held the daemon.
fn every_grid_point_is_counted(recording: &Recording) {
    let released: HashMap<_, _> = recording
        .forces
        .iter()
        .filter(|force| force.fault != Cause::Stopping as u32)
        .map(|force| ((force.header.epoch, force.header.sequence), force.release_ns))
        .collect();
    let mut first = HashMap::new();
    for status in &recording.statuses {
        let Some(release_ns) = released.get(&(status.header.epoch, status.header.sequence)) else { continue };
        let counted = status.cycles + status.skipped;
        let (release_0, counted_0) = *first.entry(status.header.epoch).or_insert((*release_ns, counted));
        assert_eq!(
            (release_ns - release_0) / PERIOD_NS,
            counted - counted_0,
            "grid points passed, and counted since the first status of this life: {status:#?}"
        );
    }
    assert!(!first.is_empty(), "no force and status of the same cycle");
}

/// The instants at which messages hold, in order.
struct Instants(Vec<u64>);

impl Instants {
    fn of<T: Message>(messages: &[T]) -> Self {
        let mut instants: Vec<_> = messages.iter().map(|message| message.header().time_ns).collect();
        instants.sort_unstable();
        Self(instants)
    }

    fn newest_until(&self, instant_ns: u64) -> Option<u64> {
        let after = self.0.partition_point(|time_ns| *time_ns <= instant_ns);
        after.checked_sub(1).map(|newest| self.0[newest])
    }
}
