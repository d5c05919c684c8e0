//! Requests of the operator while the platform moves.

use super::super::cells::PARKED_OUT_OF_THE_BRAKES;
use super::*;

const STOPS: (State, DiagnosticCode) = (State::Stopping, DiagnosticCode::OperatorRequest);
const PARKS: (State, DiagnosticCode) = (State::Parking, DiagnosticCode::OperatorRequest);

#[test]
fn stop_in_motion() {
    let mut world = moving_fast(ViolationPolicy::default());
    world.ask(Request::Stop);
    world.until(|output| output.state == State::Standby);
    world.run(200);
    let picture = Picture {
        name: "stop_in_motion",
        title: "stop in motion: to rest within the limits, then the brakes close",
        window_s: [0.5, 0.8],
    };
    assert_smooth(
        picture,
        &world,
        &[&ENGAGES[..], &[STOPS, (State::Standby, DiagnosticCode::SetpointTooFar)]].concat(),
    );
}

#[test]
fn park_from_motion() {
    let mut world = moving_fast(ViolationPolicy::default());
    world.ask(Request::Park);
    world.until(|output| output.state == State::Off);
    world.run(100);
    let picture = Picture {
        name: "park_from_motion",
        title: "park from motion: to rest, then home",
        window_s: [0.45, 10.0],
    };
    assert_smooth(picture, &world, &[&ENGAGES[..], &[STOPS, PARKS]].concat());
    assert_is_home(&world);
}

/// The drives' brakes have begun to stop the platform when the operator decides otherwise.
#[test]
fn off_and_park_in_motion() {
    let mut world = moving_slowly();
    world.ask(Request::Off);
    world.run(10);
    let speed = world.rig.simulator().state().twist.linear.norm();
    assert!(speed > 0.05, "{speed}");
    world.ask(Request::Park);
    world.until(|output| output.state == State::Off);
    world.run(100);
    let picture = Picture {
        name: "off_and_park",
        title: "off in motion, and park 10 ms later, while the brakes decelerate the platform",
        window_s: [1.0, 10.0],
    };
    let expected = [&ENGAGES[..], &[STOPS, PARKS]].concat();
    let peaks = assert_within(&PARKED_OUT_OF_THE_BRAKES, picture, &world, &expected);
    assert!(peaks.force_rate < 1.0, "never cut: {peaks:?}");
    assert_is_home(&world);
}

fn assert_is_home(world: &World) {
    let home = Vector6::from(world.machine.home);
    assert!((world.x() - home).norm() < 1e-4, "{}", world.x() - home);
}
