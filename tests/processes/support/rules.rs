//! What must hold of every recording, whatever the host did.

use std::collections::{HashMap, HashSet};

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::{Request, State};
use hexad::messages::{ForceMessage, MeasuredMessage, Message, SetpointMessage};
use hexad::realtime::request_word;
use hexad_support::not_run::not_run;

use super::machine::{PERIOD_NS, TIMEOUT_NS};
use super::recorder::Recording;
use super::trio::fastest;

/// `actuator.max_force_n` of the paper's machine, and the default of `limits.force_rate_n_s` \[N, N/s\].
const MAX_FORCE: f64 = 500.0;
const FORCE_RATE: f64 = 100.0 * MAX_FORCE;

/// A leg slower than this is at rest, also where it is held by control \[m/s\]. A tenth of what counts as
/// in motion.
const AT_REST: f64 = 0.01;

/// How hard the daemon brings the platform to rest, at the most: the default of `limits.acceleration_m_s2`.
const DECELERATION: f64 = 5.0;

/// Every rule, for a machine of [`super::machine::Machine::patient`].
pub fn hold(recording: &Recording) {
    forces_are_whole_and_in_order(recording);
    forces_are_zero_unless_valid(&recording.forces);
    forces_keep_their_limits(&recording.forces);
    nothing_moves_unasked(recording);
    valid_forces_are_fresh(recording);
    releases_are_in_phase(&recording.forces);
    every_grid_point_is_counted(recording);
}

/// Whether the platform stands.
pub fn stands(measured: &MeasuredMessage) -> bool {
    measured.length_rate_m_s == [0.0; 6]
}

/// For a daemon that was stopped in order: the platform was at rest before nobody controlled it any more.
pub fn ends_at_rest(recording: &Recording) {
    let last = recording.forces.last().expect("forces");
    assert_eq!((last.valid, last.diagnostic_code), (0, DiagnosticCode::DaemonEnding as u32), "{last:#?}");
    let valid = recording.forces.iter().rfind(|force| force.valid == 1).expect("a valid force");
    let next = recording.forces.iter().find(|force| force.header.time_ns > valid.header.time_ns);
    let next = next.expect("the last one is not valid");
    // The stop of a platform at rest takes a few cycles: a paused recorder has lost them.
    if next.header.sequence > valid.header.sequence + 1 {
        return not_run("the host pauses the recorder: forces at the end of control are lost");
    }
    assert_eq!(State::from_number(valid.state), Some(State::Stopping), "the last valid one: {valid:#?}");
    let until_then = |measured: &&MeasuredMessage| measured.header.time_ns <= valid.header.time_ns;
    let measured = recording.measured.iter().rfind(until_then).expect("a measurement");
    if measured.header.time_ns + 10 * PERIOD_NS < valid.header.time_ns {
        return not_run("the host pauses the recorder: measurements at the end of control are lost");
    }
    // If a process was held during the stop, the platform continued under the last force.
    let before = recording
        .forces
        .iter()
        .rfind(|force| force.state != valid.state && force.header.time_ns < valid.header.time_ns);
    let stop_ns = before.expect("the stop began").header.time_ns..=next.header.time_ns;
    let held_ns = recording.longest_silence_ns(stop_ns).saturating_sub(3 * PERIOD_NS);
    let slowest = AT_REST + DECELERATION * (held_ns as f64 * 1e-9);
    assert!(fastest(measured) < slowest, "under {valid:#?}, held {held_ns} ns: {measured:#?}");
}

/// A driver can check each by itself, and within a life everything goes forward.
fn forces_are_whole_and_in_order(recording: &Recording) {
    let hexad::messages::RejectionCounts { schema, repeated, damaged, .. } = recording.passed_over;
    assert_eq!((schema, repeated, damaged), (0, 0, 0), "forces passed over: {:?}", recording.passed_over);
    for force in &recording.forces {
        assert_eq!(force.checksum, force.computed_checksum(), "{force:#?}");
        assert_eq!(
            (force.header.schema, force.header.reserved, force.reserved),
            (ForceMessage::SCHEMA, 0, 0),
            "{force:#?}"
        );
    }
    for [a, b] in pairs(&recording.forces) {
        let order = |force: &ForceMessage| (force.header.sequence, force.header.time_ns, force.release_ns);
        let (of_a, of_b) = (order(a), order(b));
        let forward = of_a.0 < of_b.0 && of_a.1 <= of_b.1 && of_a.2 <= of_b.2;
        assert!(forward, "{a:#?} and then {b:#?}");
    }
}

/// Messages one after the other of the same life of the daemon.
fn pairs(forces: &[ForceMessage]) -> impl Iterator<Item = [&ForceMessage; 2]> {
    let pairs = forces.iter().zip(forces.iter().skip(1));
    pairs.filter(|(a, b)| a.header.epoch == b.header.epoch).map(|(a, b)| [a, b])
}

fn forces_are_zero_unless_valid(forces: &[ForceMessage]) {
    for force in forces {
        let state = State::from_number(force.state).expect("a state");
        assert_eq!(force.valid, u32::from(state.has_control()), "{force:#?}");
        let cause = DiagnosticCode::from_number(force.diagnostic_code).expect("a cause");
        match state {
            State::Engaging | State::Active => assert_eq!(cause, DiagnosticCode::None, "{force:#?}"),
            State::Fault => assert!(cause.is_fault(), "{force:#?}"),
            // The one cycle after a fault was cleared, too.
            State::Off => {}
            _ => assert_ne!(cause, DiagnosticCode::None, "{force:#?}"),
        }
        assert!(force.valid == 1 || force.force_n == [0.0; 6], "{force:#?}");
        assert!(force.force_n.iter().all(|newton| newton.abs() <= MAX_FORCE), "{force:#?}");
    }
}

/// From one valid force to the next each changes no faster than it may.
fn forces_keep_their_limits(forces: &[ForceMessage]) {
    for [a, b] in pairs(forces).filter(|[a, b]| a.valid == 1 && b.valid == 1) {
        let most = FORCE_RATE * (b.release_ns - a.release_ns) as f64 * 1e-9 * (1.0 + 1e-9);
        let change = a.force_n.iter().zip(&b.force_n).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
        assert!(change <= most, "{change} N of {most} N: {a:#?} and then {b:#?}");
    }
}

/// Force comes only after somebody has asked for it (to engage, or to park), since there was none; a fault goes only after somebody
/// has asked to clear it, and then engaging is to be asked for anew.
fn nothing_moves_unasked(recording: &Recording) {
    let asked = |is_it: fn(Request) -> bool, from_ns: u64, until_ns: u64| {
        let words = recording.requests.iter().copied();
        let words = words.filter(|word| Request::from_number(request_word::number(*word)).is_some_and(is_it));
        words.map(request_word::time_ns).find(|time_ns| (from_ns..=until_ns).contains(time_ns))
    };
    let engaged = |from_ns, until_ns| asked(Request::can_begin_control, from_ns, until_ns).is_some();
    for life in recording.forces.chunk_by(|a, b| a.header.epoch == b.header.epoch) {
        let first = &life[0];
        let begins_unasked = first.header.sequence == 1
            && first.valid == 1
            && !engaged(first.header.epoch, first.header.time_ns);
        assert!(!begins_unasked, "a daemon begins with force: {first:#?}");
        // Requests count from here on.
        let mut since_ns = first.header.epoch;
        for [a, b] in pairs(life) {
            let is_fault = [a, b].map(|force| force.state == State::Fault as u32);
            if (a.valid == 1 && b.valid == 0) || is_fault == [false, true] {
                since_ns = a.header.time_ns;
            }
            if is_fault == [true, false] && b.diagnostic_code != DiagnosticCode::DaemonEnding as u32 {
                let cleared_ns = asked(|request| request == Request::Clear, since_ns, b.header.time_ns);
                since_ns = cleared_ns.unwrap_or_else(|| panic!("not cleared: {a:#?} and then {b:#?}"));
            }
            let unasked = a.valid == 0 && b.valid == 1 && !engaged(since_ns, b.header.time_ns);
            assert!(!unasked, "nobody engaged: {a:#?} and then {b:#?}");
        }
    }
}

/// A force marked valid was computed from a measurement younger than the timeout, and from a setpoint as young
/// where it follows one that is no target, which holds without end; and it was not itself older than that when it was sent.
fn valid_forces_are_fresh(recording: &Recording) {
    let measured = Instants::of(&recording.measured);
    let setpoints = Instants::of(&recording.setpoints);
    let is_target = |setpoint: &&SetpointMessage| setpoint.kind == SetpointKind::Target as u64;
    let targets: HashSet<_> =
        recording.setpoints.iter().filter(is_target).map(|setpoint| setpoint.header.time_ns).collect();
    for force in recording.forces.iter().filter(|force| force.valid == 1) {
        let (release_ns, sent_ns) = (force.release_ns, force.header.time_ns);
        let follows =
            [State::Engaging, State::Active].contains(&State::from_number(force.state).expect("one"));
        for (instants, what) in
            [(&measured, "measurement"), (&setpoints, "setpoint")].into_iter().take(1 + usize::from(follows))
        {
            let newest_ns = instants.newest_until(sent_ns);
            if what == "setpoint" && newest_ns.is_some_and(|newest_ns| targets.contains(&newest_ns)) {
                continue;
            }
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
        .filter(|force| force.diagnostic_code != DiagnosticCode::DaemonEnding as u32)
        .map(|force| ((force.header.epoch, force.header.sequence), force.release_ns))
        .collect();
    let mut first = HashMap::new();
    for status in &recording.statuses {
        let Some(release_ns) = released.get(&(status.header.epoch, status.header.sequence)) else { continue };
        let counted = status.counters.cycles + status.counters.skipped;
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
