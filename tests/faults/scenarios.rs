//! What happens on ordinary bad days, from beginning to end: acceleration and jerk of the platform stay below
//! their limits in every cycle under control, and forces have no steps.
//!
//! With `HEXAD_CHARTS=FOLDER` each is drawn into a picture.

use super::cells::{Bounds, GENTLE, PARKED_OUT_OF_THE_BRAKES};
use super::common::rig::{Rig, parameters};
use super::pictures::draw;
use super::situations::{Situation, machine};
use super::world::{Grip, Source, World};
use hexad::control::diagnostic::DiagnosticCode;
use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::state::{Request, State};

/// Without a force from the daemon for this long, the drives brake \[cycles\].
const DRIVES_WAIT: u32 = 50;

fn standby() -> World {
    standby_under(ViolationPolicy::default())
}

fn standby_under(policy: ViolationPolicy) -> World {
    let (mut config, _) = machine(ControlMode::default());
    config.deployment.setpoint.on_violation = policy;
    let parameters = parameters(&config);
    let mut world = World::new(Rig::new(&config, &config.machine), &config.machine, parameters);
    world.run(200);
    world
}

/// Engages where the platform stands, and is on the way for a second and a half.
fn moving() -> World {
    let mut world = standby();
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    up(&mut world);
    world.run(900);
    world
}

/// 150 mm up in 1.5 s.
fn up(world: &mut World) {
    let from = world.x();
    let to = from + nalgebra::Vector6::new(0.0, 0.0, 0.1, 0.05, 0.0, 0.15);
    world.source = Source::Moves([from, to], world.rig.now_ns, 1.5);
}

/// From a fault: clear, engage where it stands, and move again.
fn begins_again(world: &mut World) {
    world.source_at_platform();
    world.run(200);
    world.ask(Request::Clear);
    world.run(200);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(200);
    let from = world.x();
    world.source = Source::Moves([from, world.machine.home.into()], world.rig.now_ns, 1.5);
    world.run(1700);
}

/// The limits are kept, the states are these, and in the end the platform is where it should be.
fn assert_smooth(name: &str, title: &str, world: &World, expected: &[(State, DiagnosticCode)]) {
    assert_within(&GENTLE, name, title, world, expected);
}

fn assert_within(
    bounds: &Bounds,
    name: &str,
    title: &str,
    world: &World,
    expected: &[(State, DiagnosticCode)],
) {
    let peaks = world.recording.peaks(&world.parameters, world.machine.actuator.max_force);
    println!("{title}: {peaks:?}");
    draw(name, title, world);
    // The reference keeps the limits exactly, the platform but for what held forces add.
    let Bounds { acceleration, jerk, .. } = *bounds;
    assert!(peaks.acceleration <= acceleration && peaks.jerk <= jerk && peaks.force < 1.0, "{peaks:?}");
    assert!(peaks.force_rate < 1.0, "never cut: {peaks:?}");
    let path = world.recording.path();
    let states = path.iter().filter(|(state, cause)| {
        state.has_control() || cause.is_fault() || *cause == DiagnosticCode::SetpointTooFar
    });
    let mut states: Vec<_> = states.copied().collect();
    states.dedup();
    assert_eq!(states, expected);
}

const ENGAGES: [(State, DiagnosticCode); 2] =
    [(State::Engaging, DiagnosticCode::None), (State::Active, DiagnosticCode::None)];

/// Engages, loses control in these states, and engages again.
fn twice(between: &[(State, DiagnosticCode)]) -> Vec<(State, DiagnosticCode)> {
    [&ENGAGES[..], between, &ENGAGES[..]].concat()
}

#[test]
fn engage_at_rest() {
    let mut world = standby();
    let mut aside = world.x();
    aside[5] += 0.0019;
    world.source = Source::Still(hexad::model::task::TaskState::at_rest(aside.into()));
    world.run(100);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(300);
    assert_smooth("engage_at_rest", "engage at rest, the setpoint 1.9 mm away", &world, &ENGAGES);
    assert!((world.x() - aside).norm() < 1e-5);
}

#[test]
fn engage_in_motion() {
    let mut world = standby();
    let home = world.x();
    let way = nalgebra::Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.1);
    world.source = Source::Moves([home - way, home + way], world.rig.now_ns, 4.0);
    // The setpoint passes by at 94 mm/s; the platform stands.
    let passing = world.until(|output| output.diagnostic.code == DiagnosticCode::ReadyToEngage);
    assert!(passing.error.unwrap().twist.linear.norm() > 0.09, "{passing:?}");
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(2300);
    let expected = [&[(State::Standby, DiagnosticCode::SetpointTooFar)], &ENGAGES[..]].concat();
    let title = "engage in motion, the setpoint passes by at 94 mm/s";
    assert_smooth("engage_in_motion", title, &world, &expected);
    assert!((world.x() - home - way).norm() < 1e-5);
}

#[test]
fn engage_with_a_wrong_setpoint_is_refused() {
    let mut world = standby();
    let mut aside = world.x();
    aside[5] += 0.01;
    world.source = Source::Still(hexad::model::task::TaskState::at_rest(aside.into()));
    world.run(100);
    world.ask(Request::Engage);
    let output = world.run(500);
    assert_eq!(
        (output.state, output.request_diagnostic.code),
        (State::Standby, DiagnosticCode::SetpointTooFar)
    );
    // Told with the distance: five times the tolerance of 2 mm.
    assert!((output.diagnostic.value - 5.0).abs() < 1e-3 && output.diagnostic.bound == 1.0, "{output:?}");
    let expected = [(State::Standby, DiagnosticCode::SetpointTooFar)];
    assert_smooth(
        "engage_refused",
        "engage with the setpoint 10 mm away, five times the tolerance: refused",
        &world,
        &expected,
    );
    assert_eq!(world.recording.time_to_rest(), Some(0.0));
}

#[test]
fn setpoint_source_killed_in_motion_and_restarted() {
    let mut world = moving();
    world.source = Source::Silent;
    world.until(|output| output.state == State::Fault);
    world.run(300);
    begins_again(&mut world);
    let lost =
        [(State::Stopping, DiagnosticCode::SetpointLost), (State::Fault, DiagnosticCode::SetpointLost)];
    let title = "setpoint source killed in motion and restarted";
    assert_smooth("setpoint_source_killed", title, &world, &twice(&lost));
}

#[test]
fn plant_killed_in_motion_and_restarted() {
    let mut world = moving();
    let silence = world.last.measurement;
    // A driver that is gone sends nothing on: its drives brake.
    for cycle in 0..500 {
        if cycle == DRIVES_WAIT {
            world.grip = Grip::Held;
        }
        world.cycle(|_, input| input.measurement = silence);
    }
    world.grip = Grip::Free;
    world.run(100);
    begins_again(&mut world);
    let lost = [(State::Fault, DiagnosticCode::MeasurementLost)];
    assert_smooth(
        "plant_killed",
        "driver killed in motion and restarted; forces are disabled after 20 ms",
        &world,
        &twice(&lost),
    );
}

#[test]
fn daemon_killed_in_motion_and_restarted() {
    let mut world = moving();
    world.without_daemon(500, DRIVES_WAIT);
    world.restart_daemon();
    world.run(100);
    begins_again(&mut world);
    let expected = twice(&[(State::Standby, DiagnosticCode::SetpointTooFar)]);
    assert_smooth(
        "daemon_killed",
        "daemon killed in motion and restarted; the drives brake after 50 ms",
        &world,
        &expected,
    );
}

/// The drives' brakes have begun to stop the platform when the operator decides otherwise.
#[test]
fn off_and_park_in_motion() {
    let mut world = moving();
    world.ask(Request::Off);
    world.run(10);
    let speed = world.rig.simulator.state().twist.linear.norm();
    assert!(speed > 0.05, "{speed}");
    world.ask(Request::Park);
    world.until(|output| output.state == State::Off);
    world.run(100);
    let parks = [
        (State::Stopping, DiagnosticCode::OperatorRequest),
        (State::Parking, DiagnosticCode::OperatorRequest),
    ];
    let title = "off in motion, and park 10 ms later";
    let expected = [&ENGAGES[..], &parks].concat();
    assert_within(&PARKED_OUT_OF_THE_BRAKES, "off_and_park", title, &world, &expected);
    let home = nalgebra::Vector6::from(world.machine.home);
    assert!((world.x() - home).norm() < 1e-4, "{}", world.x() - home);
}

#[test]
fn under_limit_a_source_that_dies_and_begins_elsewhere_is_no_fault() {
    let mut world = standby_under(ViolationPolicy::Limit);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    up(&mut world);
    world.run(700);
    world.source = Source::Silent;
    world.run(600);
    let mut aside = world.x();
    aside[3] += 0.05;
    world.source = Source::Still(hexad::model::task::TaskState::at_rest(aside.into()));
    world.run(1000);
    let holds = [(State::Engaging, DiagnosticCode::HoldingPose)];
    let title = "on_violation = limit: the source dies in motion, another begins 5 cm beside";
    assert_smooth("source_elsewhere", title, &world, &twice(&holds));
    assert!((world.x() - aside).norm() < 1e-5);
}

/// None of this is worth anything if the worlds it begins with are not what they say.
#[test]
fn situations_are_what_they_say() {
    for mode in ControlMode::ALL {
        for situation in Situation::ALL {
            let mut world = situation.world(mode, ViolationPolicy::default());
            let output = world.cycle(|_, _| {});
            assert_eq!(output.state, situation.state());
            assert_eq!(output.force != [0.0; 6], situation.state().has_control());
        }
    }
}
