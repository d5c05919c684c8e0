//! Processes that end while the platform moves, and others that take their places.

use super::super::world::Grip;
use super::*;

/// Without a force from the daemon for this long, the drives brake \[cycles\].
const DRIVES_WAIT: u32 = 50;

#[test]
fn setpoint_source_killed_in_motion_and_restarted() {
    let mut world = moving_slowly();
    world.source = Source::Silent;
    world.until(|output| output.state == State::Fault);
    world.run(300);
    begins_again(&mut world);
    let lost =
        [(State::Stopping, DiagnosticCode::SetpointLost), (State::Fault, DiagnosticCode::SetpointLost)];
    let picture = Picture {
        name: "setpoint_source_killed",
        title: "setpoint source killed in motion and restarted",
        window_s: [0.9, 2.4],
    };
    assert_smooth(picture, &world, &twice(&lost));
}

#[test]
fn plant_killed_in_motion_and_restarted() {
    let mut world = moving_slowly();
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
    let picture = Picture {
        name: "plant_killed",
        title: "driver killed in motion and restarted; forces are disabled after 20 ms",
        window_s: [0.9, 2.6],
    };
    let lost = [(State::Fault, DiagnosticCode::MeasurementLost)];
    assert_smooth(picture, &world, &twice(&lost));
}

#[test]
fn daemon_killed_in_motion_and_restarted() {
    let mut world = moving_slowly();
    world.without_daemon(500, DRIVES_WAIT);
    world.restart_daemon();
    world.run(100);
    begins_again(&mut world);
    let picture = Picture {
        name: "daemon_killed",
        title: "daemon killed in motion and restarted; the drives brake after 50 ms",
        window_s: [0.9, 2.6],
    };
    assert_smooth(picture, &world, &twice(&[(State::Standby, DiagnosticCode::SetpointTooFar)]));
}
