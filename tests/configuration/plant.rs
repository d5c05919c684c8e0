//! `[plant]` and its imperfections: where values go, and what is refused.

use hexad::config::Config;
use hexad::model::rigid::Wrench;
use hexad::plant::imperfections::{
    BuildErrors, DriveErrors, ElasticLeg, ExternalWrench, Friction, Imperfections, SensorErrors,
};
use nalgebra::Vector3;

use super::{messages, refused_each};

const MOTION_BASE: &str = include_str!("../../config/motion_base.toml");

const EVERYTHING: &str = "
[plant]
tolerance_um = 0.5
seed = 7
[plant.drive]
force_step_n = 1
dead_time_us = 1500.5
bandwidth_hz = 80
[plant.friction]
viscous_n_s_m = 2
coulomb_n = 3
stiction_n = 4
stribeck_speed_m_s = 0.05
[plant.leg]
stiffness_n_m = 5e7
damping_n_s_m = 6
backlash_m = 7e-5
[plant.sensor]
length_step_m = 1e-6
rate_step_m_s = 2e-6
length_noise_m = 3e-6
rate_noise_m_s = 4e-6
[plant.build]
payload_kg = 8
payload_position_m = [1, 2, 3]
joint_error_m = 9e-5
[plant.external]
force_n = [4, 5, 6]
torque_n_m = [7, 8, 9]
frequency_hz = 10
";

#[test]
fn imperfections_arrive_where_they_belong() {
    let plant = Config::parse(&format!("{MOTION_BASE}{EVERYTHING}"), "test.toml").unwrap().deployment.plant;
    assert_eq!(plant.tolerance_m, 0.5e-6);
    let expected = Imperfections {
        seed: 7,
        drive: DriveErrors { bandwidth_hz: Some(80.0), force_step_n: 1.0, dead_time_ns: 1_500_500 },
        friction: Friction { viscous_n_s_m: 2.0, coulomb_n: 3.0, stiction_n: 4.0, stribeck_speed_m_s: 0.05 },
        leg: Some(ElasticLeg { stiffness_n_per_m: 5e7, damping_n_s_m: 6.0, backlash_m: 7e-5 }),
        sensor: SensorErrors {
            length_step_m: 1e-6,
            rate_step_m_s: 2e-6,
            length_noise_m: 3e-6,
            rate_noise_m_s: 4e-6,
        },
        build: BuildErrors {
            payload_kg: 8.0,
            payload_at_m: Vector3::new(1.0, 2.0, 3.0),
            joint_deviation_m: 9e-5,
        },
        external: ExternalWrench {
            wrench: Wrench { force: Vector3::new(4.0, 5.0, 6.0), torque: Vector3::new(7.0, 8.0, 9.0) },
            frequency_hz: 10.0,
        },
    };
    assert_eq!(plant.imperfections, expected);
}

#[test]
fn imperfections_are_refused_with_key_value_and_bound() {
    let everything = format!("{MOTION_BASE}{EVERYTHING}");
    let rows = "plant.seed = -1: must be an integer in [0, 2147483647]
        plant.tolerance_um = 0: must be greater than 0 and at most 1000
        plant.drive.dead_time_us = 1e5: must be in [0, 10000]
        plant.drive.bandwidth_hz = 0: must be greater than 0
        plant.friction.coulomb_n = -3: must be at least 0
        plant.friction.stribeck_speed_m_s = 0: must be greater than 0
        plant.sensor.rate_step_m_s = -2e-6: must be at least 0
        plant.build.payload_position_m = 3: must be an array of 3 numbers
        plant.external.torque_n_m[3] = inf: must be a finite number, at most 1e12 in magnitude
        plant.external.frequency = 10: unknown key, probably frequency_hz, must be one of: force_n, torque_n_m, frequency_hz";
    refused_each(&everything, rows.lines());
    for (from, to, message) in [
        (
            "stiffness_n_m = 5e7\n",
            "",
            "plant.leg.backlash_m = 7e-5: must be 0 without stiffness_n_m: the flanks of a backlash are springs",
        ),
        // Too fast to be simulated in real time.
        (
            "viscous_n_s_m = 2\n",
            "viscous_n_s_m = 1e8\n",
            "plant.step_us = 3.99994 needed by plant.drive, plant.leg and plant.friction: must be at least 10: \
             more tolerance_um, a softer leg, less friction",
        ),
        (
            "reflected_mass_kg = 400.0",
            "reflected_mass_kg = 0",
            "plant.leg.stiffness_n_m = 5e7: must not be given with actuator.reflected_mass_kg = 0: a drive behind a \
             spring has mass",
        ),
        // What is wrong with the machine is not held against its plant.
        ("mass_kg = 1150.0", "mass_kg = -1", "platform.mass_kg = -1: must be greater than 0"),
    ] {
        assert_eq!(everything.matches(from).count(), 1, "{from}");
        assert_eq!(messages(&everything.replace(from, to)), [message]);
    }
}
