//! Step of a motion with constant jerk in base axes.

use nalgebra::Vector3;

use crate::model::rigid::{Motion, Twist};

/// Advances a motion by `dt_s` seconds, in which its acceleration changes linearly to `angular_at_end` and `linear_at_end`. In
/// place, because a copy would have to wait for the values just written.
pub(in crate::control::reference) fn step_to_acceleration(
    motion: &mut Motion,
    angular_at_end: &Vector3<f64>,
    linear_at_end: &Vector3<f64>,
    dt_s: f64,
) {
    let Motion { pose, twist, acceleration } = motion;
    let shift =
        |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| (v + (a * 2.0 + a1) * (dt_s / 6.0)) * dt_s;
    let velocity = |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| v + (a + a1) * (0.5 * dt_s);
    // Magnus expansion: the axis of rotation turns during the step.
    let commutator = twist.angular.cross(&acceleration.angular) * (dt_s * dt_s * dt_s / 12.0);
    *pose = pose.displaced(&Twist {
        angular: shift(&twist.angular, &acceleration.angular, angular_at_end) - commutator,
        linear: shift(&twist.linear, &acceleration.linear, linear_at_end),
    });
    twist.angular = velocity(&twist.angular, &acceleration.angular, angular_at_end);
    twist.linear = velocity(&twist.linear, &acceleration.linear, linear_at_end);
    (acceleration.angular, acceleration.linear) = (*angular_at_end, *linear_at_end);
}
