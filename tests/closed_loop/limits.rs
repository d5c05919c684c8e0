//! Forces stay within what the actuators can do, whatever comes in.

use hexad::control::controller::{Controller, Input};
use hexad::control::state::{Cause, State};
use hexad::model::machine::LEGS;
use hexad::scene::motions::{Motion, fit};

use super::common::{deployed, largest};
use super::rig::{Rig, in_motion, parameters};

/// The forces without a limit, and those with the machine's own.
#[test]
fn forces_are_cut_at_the_limit_and_say_so() {
    let config = deployed("fried2008");
    let (rig, task) = in_motion(&config);
    let limit = config.machine.actuator.max_force;
    let mut unlimited = config.machine.clone();
    unlimited.actuator.max_force = f64::MAX;
    let mut cut = 0;
    for push in 0..60 {
        let mut input = rig.input(&task);
        input.setpoint.as_mut().unwrap().task.xdd[push % 6] += 10.0 * push as f64 - 300.0;
        let wanted = engaged(Controller::new(&unlimited, parameters(&config)), &rig.input(&task), &input);
        let output = rig.controller.clone().step(&input);
        assert_eq!(output.state, State::Active);
        for (force, wanted) in output.force.iter().zip(wanted) {
            assert!((force - wanted.clamp(-limit, limit)).abs() < 1e-9 * limit, "{force} for {wanted}");
        }
        assert_eq!(output.limited, largest(&wanted) > limit, "{wanted:?}");
        cut += u32::from(output.limited);
    }
    assert!((10..50).contains(&cut), "{cut} of 60 were cut");
}

/// Forces of a new controller that engages on a good input and then gets another.
fn engaged(mut controller: Controller, good: &Input, input: &Input) -> [f64; LEGS] {
    while controller.step(good).state == State::Waiting {}
    let output = controller.step(input);
    assert!(output.state == State::Active && !output.limited);
    output.force
}

/// A platform five times as heavy, shaken hard: the loop may fail to track, never to respect the limit.
#[test]
fn a_hopeless_platform_gets_no_more_than_the_limit() {
    let mut limited = 0;
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let mut config = deployed(name);
        config.deployment.control.following_position_m = f64::INFINITY;
        config.deployment.control.following_orientation_rad = f64::INFINITY;
        let limit = config.machine.actuator.max_force;
        let mut platform = config.machine.clone();
        platform.platform.mass *= 5.0;
        platform.platform.center_of_mass.x += config.machine.joints.radius;
        let mut rig = Rig::new(&config, &platform);
        let scene = fit(&config.machine, Motion::Sines, 4.0);
        rig.play(&config.machine, &scene, |_, output| {
            assert!(largest(&output.force) <= limit, "{name}: {:?}", output.force);
            assert_eq!(output.limited, largest(&output.force) == limit);
            assert!(output.state == State::Active || output.force == [0.0; LEGS]);
            limited += u32::from(output.limited);
        });
    }
    assert!(limited > 500, "{limited}");
}

/// Noise of every size on every measured number.
#[test]
fn noise_gets_no_more_than_the_limit() {
    let config = deployed("fried2008");
    let (mut rig, task) = in_motion(&config);
    let limit = config.machine.actuator.max_force;
    let mut seed = 2008_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    let mut active = 0;
    for k in 0..3000 {
        let mut input = rig.input(&task);
        let size = 10f64.powf(f64::from(k % 30) / 3.0 - 8.0);
        let measurement = input.measurement.as_mut().unwrap();
        measurement.length.iter_mut().for_each(|length| *length += size * random());
        measurement.rate.iter_mut().for_each(|rate| *rate += 100.0 * size * random());
        let output = rig.controller.step(&input);
        assert!(largest(&output.force) <= limit);
        assert!(output.state == State::Active || output.force == [0.0; LEGS]);
        active += u32::from(output.state == State::Active);
    }
    assert!((1000..2900).contains(&active), "{active} of 3000 cycles in control");
}

/// A setpoint anywhere at all, in control.
#[test]
fn a_setpoint_far_away_gets_no_more_than_the_limit() {
    let config = deployed("motion_base");
    let (rig, task) = in_motion(&config);
    let limit = config.machine.actuator.max_force;
    for away in [1e-3, 1.0, 1e3, 1e100, 1e300, f64::MAX, -1.0, -1e300] {
        for k in 0..18 {
            let mut input = rig.input(&task);
            let task = &mut input.setpoint.as_mut().unwrap().task;
            [&mut task.x, &mut task.xd, &mut task.xdd][k / 6][k % 6] += away;
            let output = rig.controller.clone().step(&input);
            assert!(largest(&output.force) <= limit);
            let off_path = k < 6 && away.abs() >= 1.0;
            assert_eq!(output.cause == Cause::OffPath, off_path, "{away} on {k}: {output:?}");
            assert!(output.state == State::Active || output.force == [0.0; LEGS]);
        }
    }
}
