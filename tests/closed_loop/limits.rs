//! Forces stay within what the actuators can do, whatever comes in, and lose what they must lose evenly.

use hexad::config::Config;
use hexad::control::signals::limits::{DerivativeLimits, Limits};
use hexad::model::LEGS;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::rig::{Rig, in_motion};
use hexad_support::{deployed, largest};

/// With bounds beyond all that a setpoint or feedback asks for here.
fn unbounded(name: &str) -> Config {
    let mut config = deployed(name);
    let axis = DerivativeLimits { velocity: 10.0, acceleration: 1e3, jerk: 1e6 };
    let limits = &mut config.deployment.limits;
    limits.reference = Limits { position: axis, orientation: axis, ..limits.reference };
    limits.force_rate_n_s = 1e12;
    config
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
        let limit = config.machine.actuator.max_force_n;
        let mut platform = config.machine.clone();
        platform.platform.mass_kg *= 5.0;
        platform.platform.center_of_mass_m.x += config.machine.joints.radius_m;
        let mut rig = Rig::new(&config, &platform);
        let scene = fit(&config.machine, BuiltInMotion::Sines, 4.0);
        rig.play(&scene, |_, output| {
            assert!(largest(&output.command_n) <= limit, "{name}: {:?}", output.command_n);
            limited += u32::from(largest(&output.command_n) > limit * (1.0 - 1e-9));
            assert!(output.state.has_control() || output.command_n == [0.0; LEGS]);
        });
    }
    assert!(limited > 100, "{limited}");
}

/// Noise of every size on every measured number.
#[test]
fn noise_gets_no_more_than_the_limit() {
    let config = deployed("fried2008");
    let limit = config.machine.actuator.max_force_n;
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
            measurement.length_m.iter_mut().for_each(|length| *length += size * random());
            measurement
                .rate_m_s
                .as_mut()
                .unwrap()
                .iter_mut()
                .for_each(|rate| *rate += 100.0 * size * random());
            let output = rig.cycle(&input);
            assert!(largest(&output.command_n) <= limit);
            assert!(output.state.has_control() || output.command_n == [0.0; LEGS]);
            active += u32::from(output.state.has_control());
        }
    }
    assert!((500..2900).contains(&active), "{active} of 3000 cycles in control");
}
