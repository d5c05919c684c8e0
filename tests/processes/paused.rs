//! SIGSTOP and SIGCONT: a process that is away for a while and does not know it.

use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::messages::ForceMessage;
use hexad::messages::clock::monotonic_ns;

use crate::support::machine::{PERIOD_NS, TIMEOUT_NS};
use crate::support::operator;
use crate::support::trio::{Trio, let_pass, valid_after};

/// Longer than every timeout of the machine file.
const PAUSE: Duration = Duration::from_nanos(TIMEOUT_NS + TIMEOUT_NS / 2);

/// Longer than the loop stands old measurements, shorter than every timeout.
const SHORT_PAUSE: Duration = Duration::from_nanos(TIMEOUT_NS / 4);

/// Longest silence in that pause. After 200 ms the setpoints have departed from the continuation of the last one before by more
/// than the tolerance, and control ends for that reason.
const LONGEST_SILENCE_NS: u64 = TIMEOUT_NS / 8 * 3;

/// A busy machine can keep the test itself from ending a pause in time; not each time.
const ATTEMPTS: usize = 5;

/// Grid points within the pause, less those that a signal needs to arrive.
const LEAST_SKIPPED: u64 = (TIMEOUT_NS + TIMEOUT_NS / 2) / PERIOD_NS - 10;

#[test]
#[ignore = "second tier: needs real-time rights"]
#[apply(beside_others)]
fn a_paused_daemon_counts_what_it_missed_and_recovers() {
    let trio = Trio::in_motion("paused-daemon");
    let before = trio.recorder.so_far().statuses.last().copied().expect("a status");
    trio.daemon.hold();
    let (from_ns, _) = let_pass(PAUSE);
    trio.daemon.signal("CONT");
    trio.plant.says("forces stopped arriving: brakes closing");
    trio.recorder.until("skipped cycles are counted", |recording| {
        let status = recording.statuses.last()?;
        (status.counters.skipped >= before.counters.skipped + LEAST_SKIPPED).then_some(())
    });
    brakes_held_until_control_was_taken_anew(trio, from_ns, DiagnosticCode::DaemonHeld);
}

/// As a host that takes the processors away: the platform moves on under the last forces. The daemon is back before the
/// plant, so that the measurement that waited is too old. Those after it are not.
#[test]
#[ignore = "second tier: needs real-time rights"]
#[apply(beside_others)]
fn a_pause_shorter_than_the_timeouts_keeps_control() {
    let trio = Trio::in_motion("paused-shortly");
    for _ in 0..ATTEMPTS {
        let (lost, silent_ns) = pause_shortly(&trio);
        if silent_ns < LONGEST_SILENCE_NS {
            assert_eq!(lost, None);
            trio.moves_after(monotonic_ns());
            trio.finish();
            return;
        }
        println!("silent for {silent_ns} ns, again; lost: {lost:?}");
        if lost.is_some() {
            operator::clear_and_engage(&trio.machine);
        }
        trio.moves_after(monotonic_ns());
    }
    panic!("the pause was too long in each of {ATTEMPTS} attempts");
}

/// The first force behind the pause that is not valid, and the longest silence in it \[ns\].
fn pause_shortly(trio: &Trio) -> (Option<ForceMessage>, u64) {
    trio.daemon.hold();
    trio.plant.hold();
    let (from_ns, _) = let_pass(SHORT_PAUSE);
    trio.daemon.signal("CONT");
    trio.recorder.until("the daemon is back", |recording| {
        recording.forces.last().filter(|force| force.release_ns > from_ns + PERIOD_NS).map(drop)
    });
    trio.plant.signal("CONT");
    let_pass(Duration::from_nanos(2 * TIMEOUT_NS));
    let is_lost = |force: &&ForceMessage| force.release_ns > from_ns && force.valid == 0;
    let recording = trio.recorder.so_far();
    (recording.forces.iter().find(is_lost).copied(), recording.longest_silence_ns(from_ns..))
}

#[test]
#[ignore = "second tier: needs real-time rights"]
#[apply(beside_others)]
fn a_paused_plant_recovers() {
    let trio = Trio::in_motion("paused-plant");
    trio.plant.signal("STOP");
    let (from_ns, _) = let_pass(PAUSE);
    trio.plant.signal("CONT");
    trio.daemon.says("fault: measurement lost");
    brakes_held_until_control_was_taken_anew(trio, from_ns, DiagnosticCode::MeasurementLost);
}

/// Whoever was away, the plant's brakes closed: the loop may not go on as if nothing had happened, but is in a
/// fault until it is cleared and engaged from where the platform stands.
fn brakes_held_until_control_was_taken_anew(trio: Trio, from_ns: u64, code: DiagnosticCode) {
    operator::clear_and_engage(&trio.machine);
    let (_, recovered_ns) = let_pass(Duration::from_millis(500));
    trio.moves_after(recovered_ns);
    let recording = trio.finish();
    println!("after a pause of {PAUSE:?}: {:?}", recording.statuses.last().map(|status| status.counters));
    let after: Vec<_> = recording.forces.iter().filter(|force| force.release_ns > from_ns).collect();
    let let_go = after.iter().position(|force| force.valid == 0).expect("the daemon let go of the platform");
    let first = after[let_go];
    assert_eq!((first.state, first.diagnostic_code), (State::Fault as u32, code as u32), "{first:#?}");
    let again = after[let_go..].iter().any(|force| valid_after(force, from_ns));
    assert!(again, "the loop became active again");
}
