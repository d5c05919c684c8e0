//! The minimum-jerk profile `s(u) = 10 u^3 - 15 u^4 + 6 u^5`, `u = t / T` in \[0, 1\]: from rest to rest without a step
//! in acceleration.
//!
//! Source: Flash and Hogan (1985), "The coordination of arm movements". Its jerk has steps at both ends.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector6;

use crate::model::task::TaskState;

/// Peak of s' for a unit duration: peak velocity of a move over its mean.
pub const PEAK_RATE_RATIO: f64 = 1.875;

/// Peaks of the second and third derivative of s for a unit duration: 10 / sqrt 3, and 60 at both ends.
const PEAK_ACCEL: f64 = 5.773502691896258;
const PEAK_JERK: f64 = 60.0;

/// Shortest duration \[s\] of a minimum-jerk move of length `distance` within limits of velocity, acceleration and jerk.
///
/// ```
/// use hexad_core::motion::minimum_jerk::{PEAK_RATE_RATIO, shortest_duration};
/// // 0.3 m at 0.1 m/s at most, other limits far: 1.875 times as long as at constant velocity.
/// let duration = shortest_duration(0.3, [0.1, 1e9, 1e9]);
/// assert!((duration - PEAK_RATE_RATIO * 0.3 / 0.1).abs() < 1e-12);
/// ```
pub fn shortest_duration(distance: f64, [velocity, acceleration, jerk]: [f64; 3]) -> f64 {
    let by_rate = PEAK_RATE_RATIO * distance / velocity;
    by_rate.max((PEAK_ACCEL * distance / acceleration).sqrt()).max((PEAK_JERK * distance / jerk).cbrt())
}

/// Value of a profile and its first two time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// s
    pub value_share: f64,
    /// s' \[1/s\]
    pub rate_per_s: f64,
    /// s'' \[1/s^2\]
    pub accel_per_s2: f64,
}

/// The profile from 0 at `t_s = 0` to 1 at `t_s = duration_s`; constant outside.
///
/// ```
/// use hexad_core::motion::minimum_jerk::{Profile, rise};
/// assert_eq!(rise(0.0, 2.0), Profile::default());
/// assert_eq!(rise(2.0, 2.0), Profile { value_share: 1.0, ..Profile::default() });
/// // Symmetric: halfway at half the time, fastest there, and no acceleration.
/// assert_eq!(rise(1.0, 2.0), Profile { value_share: 0.5, rate_per_s: 1.875 / 2.0, accel_per_s2: 0.0 });
/// ```
pub fn rise(t_s: f64, duration_s: f64) -> Profile {
    let u = t_s / duration_s;
    if !(u > 0.0) {
        return Profile::default();
    }
    if u >= 1.0 {
        return Profile { value_share: 1.0, ..Profile::default() };
    }
    Profile {
        value_share: u * u * u * (10.0 + u * (-15.0 + u * 6.0)),
        rate_per_s: u * u * (30.0 + u * (-60.0 + u * 30.0)) / duration_s,
        accel_per_s2: u * (60.0 + u * (-180.0 + u * 120.0)) / (duration_s * duration_s),
    }
}

/// Rises during the first `fade_s` seconds, is 1, and falls during the last `fade_s` seconds before `end_s`.
pub fn window(t_s: f64, end_s: f64, fade_s: f64) -> Profile {
    let (up, down) = (rise(t_s, fade_s), rise(t_s - (end_s - fade_s), fade_s));
    Profile {
        value_share: up.value_share - down.value_share,
        rate_per_s: up.rate_per_s - down.rate_per_s,
        accel_per_s2: up.accel_per_s2 - down.accel_per_s2,
    }
}

/// The straight move in task coordinates along this profile.
pub fn straight_move(from: &Vector6<f64>, to: &Vector6<f64>, s: &Profile) -> TaskState {
    let change = to - from;
    TaskState { x: from + change * s.value_share, xd: change * s.rate_per_s, xdd: change * s.accel_per_s2 }
}

/// `s(t) d(t)` with both derivatives, by the product rule.
pub fn scaled_by_profile(d: &TaskState, s: &Profile) -> TaskState {
    TaskState {
        x: d.x * s.value_share,
        xd: d.xd * s.value_share + d.x * s.rate_per_s,
        xdd: d.xdd * s.value_share + d.xd * (2.0 * s.rate_per_s) + d.x * s.accel_per_s2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_belong_to_the_value_and_ends_are_at_rest() {
        let h = 1e-5;
        for k in 0..=100 {
            let t = -0.5 + 0.04 * f64::from(k);
            let (a, b, c) = (window(t - h, 3.0, 0.8), window(t, 3.0, 0.8), window(t + h, 3.0, 0.8));
            assert!(((c.value_share - a.value_share) / (2.0 * h) - b.rate_per_s).abs() < 1e-8);
            assert!(((c.rate_per_s - a.rate_per_s) / (2.0 * h) - b.accel_per_s2).abs() < 1e-3);
        }
        assert_eq!(window(0.0, 3.0, 0.8), Profile::default());
        let end = window(3.0, 3.0, 0.8);
        assert!(
            end.value_share.abs() < 1e-15 && end.rate_per_s.abs() < 1e-12 && end.accel_per_s2.abs() < 1e-12,
            "{end:?}"
        );
        assert_eq!(rise(0.5, 1.0).rate_per_s, PEAK_RATE_RATIO);
        let strongest = (0..=1000).map(|k| rise(f64::from(k) / 1000.0, 1.0).accel_per_s2).fold(0.0, f64::max);
        assert!((strongest - PEAK_ACCEL).abs() < 1e-4);
        assert!((rise(1e-6, 1.0).accel_per_s2 / 1e-6 - PEAK_JERK).abs() < 1e-3);
    }

    #[test]
    fn the_shortest_duration_is_that_of_the_limit_that_binds() {
        let way = 0.3;
        for limits in [[0.1, 1e9, 1e9], [1e9, 0.1, 1e9], [1e9, 1e9, 0.1]] {
            let t = shortest_duration(way, limits);
            let peaks =
                [PEAK_RATE_RATIO * way / t, PEAK_ACCEL * way / (t * t), PEAK_JERK * way / (t * t * t)];
            let share = peaks.iter().zip(limits).map(|(peak, limit)| peak / limit).fold(0.0, f64::max);
            assert!((share - 1.0).abs() < 1e-12, "{share}");
        }
    }
}
