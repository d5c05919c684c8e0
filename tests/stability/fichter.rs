//! A motion base that works near its singular pose: a quarter turn about the vertical, as Fichter found.
//!
//! `distance` is the angle that is left to that pose; beyond it, it is negative.

use super::*;

/// Of home: the condition is 10.8 there.
pub const AT_HOME: f64 = 0.3;

/// Times the distance, where that is small: the condition, as `passing.rs` shows.
pub const CONDITION: f64 = 3.237;

/// Times the distance, where that is small: the largest of the forces that hold the platform \[N\].
pub const HOLDING_N: f64 = 5101.0;

/// No condition: what is left are the bounds of the model itself.
pub const ANY: f64 = 1e12;

/// Home so near to it, legs and drives for a quarter turn, strong enough for any pose that is found.
pub fn motion_base(condition: f64) -> Config {
    let mut config = deployed("motion_base");
    let axis = DerivativeLimits { velocity: 10.0, acceleration: 50.0, jerk: 5000.0 };
    let limits = &mut config.deployment.limits;
    limits.reference = Limits { position: axis, orientation: axis, ..limits.reference };
    (limits.condition, limits.force_rate_n_s) = (condition, f64::MAX);
    let machine = &mut config.machine;
    machine.home = at(AT_HOME).x.into();
    machine.joints = Legs::of(machine).joints(&machine.home);
    let actuator = &mut machine.actuator;
    (actuator.min_length_m, actuator.max_length_m) = (0.9, 4.0);
    (actuator.max_rate_m_s, actuator.max_force_n) = (5.0, 1e9);
    config
}

/// At rest at a distance.
pub fn at(distance: f64) -> TaskState {
    TaskState::at_rest([0.0, 0.0, FRAC_PI_2 - distance, 0.0, 0.0, 1.25])
}

/// How the last cycle ended.
pub fn reason(output: &Output) -> (State, DiagnosticCode) {
    (output.state, output.diagnostic.code)
}

/// From home to a distance in a time, and back from an instant on.
pub fn there_and_back(t: f64, time_s: f64, distance: f64, back_s: f64) -> TaskState {
    let (up, down) = (rise(t, time_s), rise(t - back_s, time_s));
    let s = Profile {
        value_share: up.value_share - down.value_share,
        rate_per_s: up.rate_per_s - down.rate_per_s,
        accel_per_s2: up.accel_per_s2 - down.accel_per_s2,
    };
    on_the_way(distance, &s)
}

/// From home to a distance, along a profile from 0 to 1.
pub fn on_the_way(distance: f64, s: &Profile) -> TaskState {
    let way = AT_HOME - distance;
    let mut task = at(AT_HOME - way * s.value_share);
    (task.xd[2], task.xdd[2]) = (way * s.rate_per_s, way * s.accel_per_s2);
    task
}

/// Whether a pose is on the side of home.
pub fn before(machine: &Machine, pose: &Pose) -> bool {
    let side = |pose: &Pose| KinematicState::new(machine, *pose).sensitivity().determinant;
    side(pose) * side(&at(AT_HOME).motion().pose) > 0.0
}
