//! Forces stay within what the actuators can do, whatever comes in, and lose what they must lose evenly.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::limits::{DerivativeLimits, Limit, Limits};
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Gravity;
use hexad::model::rigid::Motion as Moving;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};
use nalgebra::Vector6;

use super::common::rig::{Rig, in_motion};
use super::common::{deployed, largest};

/// With bounds beyond all that a setpoint or feedback asks for here.
fn unbounded(name: &str) -> Config {
    let mut config = deployed(name);
    let axis = DerivativeLimits { velocity: 10.0, acceleration: 1e3, jerk: 1e6 };
    let limits = &mut config.deployment.limits;
    limits.reference = Limits { position: axis, orientation: axis, ..limits.reference };
    limits.force_rate_n_s = 1e12;
    config
}

fn has(output: &Output, limit: Limit) -> bool {
    output.active_limits.contains(limit)
}

/// How much of `whole` is left in `part`, and what of it is not in its direction, as a share.
fn share(part: [f64; LEGS], whole: [f64; LEGS], from: [f64; LEGS]) -> (f64, f64) {
    let (part, whole) =
        (Vector6::from(part) - Vector6::from(from), Vector6::from(whole) - Vector6::from(from));
    let share = part.dot(&whole) / whole.norm_squared();
    (share, (part - whole * share).norm() / whole.norm())
}

/// An input with this much more X'' than the motion has.
fn pushed(rig: &Rig, task: &TaskState, push: i32) -> Input {
    let mut input = rig.input(task);
    input.setpoint.as_mut().unwrap().task.xdd[push as usize % 6] += 10.0 * f64::from(push) - 300.0;
    input
}

/// The forces without a limit, and those with the machine's own.
#[test]
fn beyond_the_limit_all_legs_lose_the_same_share_of_what_is_not_weight() {
    let config = unbounded("fried2008");
    let limit = config.machine.actuator.max_force;
    let mut strong = config.clone();
    strong.machine.actuator.max_force = 1e9;
    let ((rig, task), (strong, _)) = (in_motion(&config), in_motion(&strong));
    let here = Moving { pose: rig.simulator.state().pose, ..TaskState::default().motion() };
    let weight = InverseDynamics::new(&config.machine).forces::<Gravity>(&here).unwrap();
    let mut cut = 0;
    for push in 0..60 {
        let input = pushed(&rig, &task, push);
        let wanted = strong.controller.clone().step(&input);
        let output = rig.controller.clone().step(&input);
        assert!(output.state.has_control() && !has(&wanted, Limit::Force));
        assert_eq!(has(&output, Limit::Force), largest(&wanted.force) > limit);
        if !has(&output, Limit::Force) {
            assert_eq!(output.force, wanted.force);
            continue;
        }
        cut += 1;
        let (share, astray) = share(output.force, wanted.force, weight);
        assert!((0.0..1.0).contains(&share) && astray < 1e-4, "{share} {astray}");
        assert!((largest(&output.force) - limit).abs() < 1e-9 * limit, "no more is lost than must be");
    }
    assert!((10..50).contains(&cut), "{cut} of 60 were cut");
}

#[test]
fn forces_change_no_faster_than_they_may_and_all_by_the_same_share() {
    let mut config = unbounded("fried2008");
    let free = in_motion(&config).0;
    config.deployment.limits.force_rate_n_s = 2e4;
    let most = 2e4 * 1e-3;
    let (mut rig, task) = in_motion(&config);
    let before = rig.cycle(&rig.input(&task)).force;
    let mut free = free;
    free.cycle(&free.input(&task));
    let mut cut = 0;
    for push in 0..60 {
        let input = pushed(&rig, &task.after(1e-3), push);
        let wanted = free.controller.clone().step(&input);
        let output = rig.controller.clone().step(&input);
        let step = core::array::from_fn::<_, LEGS, _>(|leg| output.force[leg] - before[leg]);
        assert!(largest(&step) <= most * (1.0 + 1e-9));
        if has(&output, Limit::ForceRate) {
            cut += 1;
            let (share, astray) = share(output.force, wanted.force, before);
            assert!((0.0..1.0).contains(&share) && astray < 1e-9, "{share} {astray}");
            assert!(largest(&step) > most * (1.0 - 1e-9), "no slower than it must be");
        } else {
            assert_eq!(output.force, wanted.force);
        }
    }
    assert!((10..60).contains(&cut), "{cut} of 60 were cut");
}

/// A platform five times as heavy, shaken hard: the loop may fail to track, never to respect the limit.
#[test]
fn a_hopeless_platform_gets_no_more_than_the_limit() {
    let mut limited = 0;
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let mut config = unbounded(name);
        config.deployment.control.following_position_m = f64::INFINITY;
        config.deployment.control.following_orientation_rad = f64::INFINITY;
        config.deployment.control.following_velocity_m_s = f64::INFINITY;
        config.deployment.control.following_velocity_rad_s = f64::INFINITY;
        let limit = config.machine.actuator.max_force;
        let mut platform = config.machine.clone();
        platform.platform.mass *= 5.0;
        platform.platform.center_of_mass.x += config.machine.joints.radius;
        let mut rig = Rig::new(&config, &platform);
        let scene = fit(&config.machine, BuiltInMotion::Sines, 4.0);
        rig.play(&config.machine, &scene, |_, output| {
            assert!(largest(&output.force) <= limit, "{name}: {:?}", output.force);
            if has(output, Limit::Force) {
                assert!((largest(&output.force) - limit).abs() < 1e-9 * limit);
                limited += 1;
            }
            assert!(output.state.has_control() || output.force == [0.0; LEGS]);
        });
    }
    assert!(limited > 100, "{limited}");
}

/// Noise of every size on every measured number.
#[test]
fn noise_gets_no_more_than_the_limit() {
    let config = deployed("fried2008");
    let limit = config.machine.actuator.max_force;
    let mut seed = 2008_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    let (start, task) = in_motion(&config);
    let task = TaskState::at_rest(task.x.into());
    let mut active = 0;
    for size in (0..30).map(|k| 10f64.powf(f64::from(k) / 3.0 - 8.0)) {
        let mut rig = start.clone();
        for _ in 0..100 {
            let mut input = rig.input(&task);
            let measurement = input.measurement.as_mut().unwrap();
            measurement.length.iter_mut().for_each(|length| *length += size * random());
            measurement.rate.as_mut().unwrap().iter_mut().for_each(|rate| *rate += 100.0 * size * random());
            let output = rig.cycle(&input);
            assert!(largest(&output.force) <= limit);
            assert!(output.state.has_control() || output.force == [0.0; LEGS]);
            active += u32::from(output.state.has_control());
        }
    }
    assert!((500..2900).contains(&active), "{active} of 3000 cycles in control");
}
