//! Step of a motion with constant jerk in base axes.

use nalgebra::Vector3;

use crate::model::rigid::{Motion, Twist};

/// Advances a motion by `h` seconds, in which its acceleration changes linearly to `angular` and `linear`. In
/// place, because a copy would have to wait for the values just written.
pub(in crate::control::reference) fn step_constant_jerk(
    motion: &mut Motion,
    angular: &Vector3<f64>,
    linear: &Vector3<f64>,
    h: f64,
) {
    let Motion { pose, twist, acceleration } = motion;
    let shift = |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| (v + (a * 2.0 + a1) * (h / 6.0)) * h;
    let velocity = |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| v + (a + a1) * (0.5 * h);
    // Magnus expansion: the axis of rotation turns during the step.
    let commutator = twist.angular.cross(&acceleration.angular) * (h * h * h / 12.0);
    *pose = pose.displaced(&Twist {
        angular: shift(&twist.angular, &acceleration.angular, angular) - commutator,
        linear: shift(&twist.linear, &acceleration.linear, linear),
    });
    twist.angular = velocity(&twist.angular, &acceleration.angular, angular);
    twist.linear = velocity(&twist.linear, &acceleration.linear, linear);
    (acceleration.angular, acceleration.linear) = (*angular, *linear);
}
