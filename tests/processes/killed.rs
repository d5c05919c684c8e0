//! SIGKILL in full motion, then a restart and one `engage`, without anybody cleaning up.

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::Request;
use hexad::messages::MeasuredMessage;
use hexad::messages::clock::monotonic_ns;
use hexad::realtime::request_word::{number, time_ns};

use crate::support::children::Hexad;
use crate::support::machine::PERIOD_NS;
use crate::support::operator;
use crate::support::recorder::Recording;
use crate::support::rules::stands;
use crate::support::trio::{Trio, start_daemon, start_plant, start_setpoints, valid_after};

/// An outage: from the kill to the restart \[ns\].
struct Outage {
    from_ns: u64,
    to_ns: u64,
}

#[test]
#[apply(beside_others)]
fn a_killed_plant_comes_back() {
    let mut trio = Trio::in_motion("killed-plant");
    let from_ns = monotonic_ns();
    trio.plant.kill();
    trio.loses_force_for(DiagnosticCode::MeasurementLost);
    trio.daemon.says("fault: measurement lost");
    trio.setpoints().says("the daemon gave up control or is gone");
    let to_ns = monotonic_ns();
    trio.plant = start_plant(&trio.machine);
    operator::clear_and_engage(&trio.machine);
    trio.moves_after(to_ns);
    let recording = trio.finish();
    lost_for(DiagnosticCode::MeasurementLost, &Outage { from_ns, to_ns }, &recording);
}

#[test]
#[apply(beside_others)]
fn a_killed_setpoint_source_comes_back() {
    let mut trio = Trio::in_motion("killed-setpoints");
    let from_ns = monotonic_ns();
    trio.setpoints().kill();
    trio.loses_force_for(DiagnosticCode::SetpointLost);
    trio.daemon.says("stopping: setpoint lost in motion");
    trio.daemon.says("fault: setpoint lost in motion");
    trio.plant.says("no valid force (setpoint lost in motion): brakes closing");
    trio.stands();
    let to_ns = monotonic_ns();
    operator::clear(&trio.machine);
    // Who waits does so from before the source is back.
    let engages = Hexad::start(&trio.machine, "engage", &["--wait"]);
    trio.recorder.until("it is asked to engage", |recording| {
        let asked = *recording.requests.last()?;
        (number(asked) == Request::Engage as u32 && time_ns(asked) > to_ns).then_some(())
    });
    trio.setpoints = Some(start_setpoints(&trio.machine));
    engages.ends().succeeds();
    trio.moves_after(to_ns);
    let recording = trio.finish();
    let outage = Outage { from_ns, to_ns };
    lost_for(DiagnosticCode::SetpointLost, &outage, &recording);
    comes_to_rest_and_stays(&outage, &recording);
}

#[test]
#[apply(beside_others)]
fn a_killed_daemon_comes_back() {
    let mut trio = Trio::in_motion("killed-daemon");
    let from_ns = monotonic_ns();
    trio.daemon.kill();
    let killed_ns = monotonic_ns();
    trio.plant.says("forces stopped arriving: brakes closing");
    trio.setpoints().says("the daemon gave up control or is gone");
    trio.stands();
    let to_ns = monotonic_ns();
    trio.daemon = start_daemon(&trio.machine);
    operator::engage(&trio.machine);
    trio.moves_after(to_ns);
    let recording = trio.finish();
    let outage = Outage { from_ns, to_ns };
    let silent = |time_ns: u64| (killed_ns..to_ns).contains(&time_ns);
    assert!(!recording.forces.iter().any(|force| silent(force.header.time_ns)), "the dead do not push");
    comes_to_rest_and_stays(&outage, &recording);
    let lives: Vec<_> = recording.forces.chunk_by(|a, b| a.header.epoch == b.header.epoch).collect();
    assert_eq!(lives.len(), 2, "forces of one life, then of the other");
    assert_eq!(lives[1][0].header.sequence, 1, "nothing was said before it was heard");
}

/// The last cause during the outage was this one, and control came back after it.
fn lost_for(cause: DiagnosticCode, outage: &Outage, recording: &Recording) {
    let during = |time_ns: u64| (outage.from_ns..outage.to_ns).contains(&time_ns);
    let last =
        recording.forces.iter().rfind(|force| during(force.header.time_ns)).expect("the daemon ran on");
    assert_eq!((last.valid, last.diagnostic_code), (0, cause as u32), "{last:#?}");
    assert!(recording.forces.iter().any(|force| valid_after(force, outage.to_ns)));
}

/// From the kill to the first valid force after the restart: the platform comes to rest and then stands.
fn comes_to_rest_and_stays(outage: &Outage, recording: &Recording) {
    let again = recording.forces.iter().find(|force| valid_after(force, outage.to_ns)).expect("it came back");
    // A plant that was late applies a force from the last tick before it was sent on.
    let until_ns = again.header.time_ns.min(again.release_ns) - PERIOD_NS;
    let during: Vec<&MeasuredMessage> = recording
        .measured
        .iter()
        .filter(|measured| (outage.from_ns..until_ns).contains(&measured.header.time_ns))
        .collect();
    let rest = during.iter().position(|measured| stands(measured)).expect("the platform comes to rest");
    let moves = during[rest..].iter().find(|measured| !stands(measured));
    assert!(moves.is_none(), "without a force, and it moves again: {moves:#?}");
    assert!(during[0].length_rate_m_s != [0.0; 6], "the kill was to come in motion");
}
