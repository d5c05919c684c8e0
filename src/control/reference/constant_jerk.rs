//! Step of a motion with constant jerk in base axes.

use nalgebra::Vector3;

use crate::model::rigid::{Acceleration, Motion, Twist};

/// The motion `h` seconds later if the acceleration changes linearly to another one.
pub(super) fn moved(motion: &Motion, angular: &Vector3<f64>, linear: &Vector3<f64>, h: f64) -> Motion {
    let Motion { pose, twist, acceleration } = motion;
    let shift = |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| (v + (a * 2.0 + a1) * (h / 6.0)) * h;
    let velocity = |v: &Vector3<f64>, a: &Vector3<f64>, a1: &Vector3<f64>| v + (a + a1) * (0.5 * h);
    // Magnus: the axis of rotation turns meanwhile.
    let commutator = twist.angular.cross(&acceleration.angular) * (h * h * h / 12.0);
    Motion {
        pose: pose.displaced(&Twist {
            angular: shift(&twist.angular, &acceleration.angular, angular) - commutator,
            linear: shift(&twist.linear, &acceleration.linear, linear),
        }),
        twist: Twist {
            angular: velocity(&twist.angular, &acceleration.angular, angular),
            linear: velocity(&twist.linear, &acceleration.linear, linear),
        },
        acceleration: Acceleration { angular: *angular, linear: *linear },
    }
}
