//! Engaging at rest and in motion.

use super::super::cells::OUT_OF_THE_BRAKES;
use super::*;

#[test]
fn engage_at_rest() {
    let mut world = standby();
    let aside = world.x() + along_z(0.0019);
    world.source = still(aside);
    world.run(100);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(300);
    let picture = Picture {
        name: "engage_at_rest",
        title: "engage at rest, the setpoint 1.9 mm away",
        window_s: [0.25, 0.55],
    };
    assert_smooth(picture, &world, &ENGAGES);
    assert!((world.x() - aside).norm() < 1e-5);
}

#[test]
fn engage_in_motion() {
    let mut world = standby();
    let (home, way) = (world.x(), along_z(0.1));
    world.source = Source::Moves([home - way, home + way], world.rig.now_ns, 4.0);
    // The setpoint passes by at 94 mm/s; the platform stands.
    let passing = world.until(|output| output.diagnostic.code == DiagnosticCode::ReadyToEngage);
    assert!(passing.error.unwrap().twist.linear.norm() > 0.09, "{passing:?}");
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(2300);
    let expected = [&[(State::Standby, DiagnosticCode::SetpointTooFar)], &ENGAGES[..]].concat();
    let picture = Picture {
        name: "engage_in_motion",
        title: "engage in motion: the platform stands, the setpoint passes by at 94 mm/s",
        window_s: [2.14, 2.34],
    };
    assert_smooth(picture, &world, &expected);
    assert!((world.x() - home - way).norm() < 1e-5);
}

/// The brakes decelerate the platform for three cycles.
#[test]
fn off_and_engage_in_motion() {
    let mut world = moving_slowly();
    world.ask(Request::Off);
    world.run(3);
    let speed = world.rig.simulator().state().twist.linear.norm();
    assert!(speed > 0.05, "{speed}");
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(700);
    let picture = Picture {
        name: "off_and_engage",
        title: "off in motion, and engage 3 ms later, while the brakes decelerate the platform",
        window_s: [1.07, 1.22],
    };
    assert_within(&OUT_OF_THE_BRAKES, picture, &world, &twice(&[]));
}

#[test]
fn engage_with_a_wrong_setpoint_is_refused() {
    let mut world = standby();
    world.source = still(world.x() + along_z(0.01));
    world.run(100);
    world.ask(Request::Engage);
    let output = world.run(500);
    assert_eq!(
        (output.state, output.request_diagnostic.code),
        (State::Standby, DiagnosticCode::SetpointTooFar)
    );
    // Told with the distance: five times the tolerance of 2 mm.
    assert!((output.diagnostic.value - 5.0).abs() < 1e-3 && output.diagnostic.bound == 1.0, "{output:?}");
    let picture = Picture {
        name: "engage_refused",
        title: "engage with the setpoint 10 mm away, five times the tolerance: refused",
        window_s: [0.0, 0.8],
    };
    assert_smooth(picture, &world, &[(State::Standby, DiagnosticCode::SetpointTooFar)]);
    assert_eq!(world.recording.time_to_rest(), Some(0.0));
}
