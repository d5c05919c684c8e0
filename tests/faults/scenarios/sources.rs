//! Setpoint sources that are replaced in motion.

use super::*;

/// Of the velocity of the first source, the second one's.
const SLOWER: f64 = 0.8;

/// The second source begins within the tolerance: 1.5 mm behind, slower, and on its way to another goal.
#[test]
fn source_replaced_in_motion() {
    let mut world = moving(ViolationPolicy::default(), SLOW_S, 750);
    // Both are in the middle of their ways.
    let middle = world.x() - along_z(0.0015);
    let half = 0.5 * SLOWER * Vector6::from(WAY);
    let start_ns = world.rig.now_ns - (0.5e9 * SLOW_S) as u64;
    world.source = Source::Moves([middle - half, middle + half], start_ns, SLOW_S);
    world.run(1000);
    let picture = Picture {
        name: "source_replaced",
        title: "source replaced in motion: the next one is 1.5 mm behind and a fifth slower",
        window_s: [0.9, 1.15],
    };
    assert_smooth(picture, &world, &ENGAGES);
    assert!((world.x() - middle - half).norm() < 1e-5);
}

/// The second source moves the other way, from where the platform is not.
#[test]
fn under_limit_a_source_in_motion_is_replaced_by_any_other() {
    let mut world = moving_fast(ViolationPolicy::Limit);
    let (from, home) = (world.x() + along_z(0.05), world.machine.home.into());
    world.source = Source::Moves([from, home], world.rig.now_ns, SLOW_S);
    world.run(1700);
    let picture = Picture {
        name: "source_replaced_under_limit",
        title: "on_violation = limit: source replaced in motion by one 50 mm ahead that moves back",
        window_s: [0.5, 1.1],
    };
    assert_smooth(picture, &world, &ENGAGES);
    assert!((world.x() - home).norm() < 1e-5);
}

#[test]
fn under_limit_a_source_that_dies_and_begins_elsewhere_is_no_fault() {
    let mut world = moving_fast(ViolationPolicy::Limit);
    world.source = Source::Silent;
    world.run(500);
    let aside = world.x() - along_z(0.05);
    world.source = still(aside);
    world.run(1000);
    let picture = Picture {
        name: "source_elsewhere",
        title: "on_violation = limit: the source is lost in motion, and back 50 mm below",
        window_s: [0.5, 1.6],
    };
    assert_smooth(picture, &world, &twice(&[(State::Engaging, DiagnosticCode::HoldingPose)]));
    assert!((world.x() - aside).norm() < 1e-5);
}
