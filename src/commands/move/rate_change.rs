//! Change of the rate of a motion's own time, from one to zero or back. So the platform comes to rest, and
//! continues, on the path that was checked.

use crate::control::signals::limits::{DerivativeLimits, Limits};
use crate::model::task::TaskState;
use crate::motion::minimum_jerk::{Profile, rise};

/// Shortest change \[s\], factor to the next longer one, and number of candidates: up to half a minute.
const SHORTEST_S: f64 = 0.1;
const FACTOR: f64 = 1.4;
const CANDIDATES: i32 = 17;

/// Instants at which a candidate is checked against the limits.
const SAMPLES: u32 = 100;

/// Share of each limit that a change may use. The rest is for the instants between the samples.
const USABLE_SHARE: f64 = 0.98;

/// Change of the rate of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateChange {
    /// Beginning, in the motion's own time \[s\].
    pub began_s: f64,
    /// Duration \[s\]; the motion's own time advances by half of it.
    pub duration_s: f64,
    /// Whether the rate rises from zero to one.
    pub is_rising: bool,
}

impl RateChange {
    /// The shortest slowdown that keeps the limits of velocity, acceleration and jerk; the longest candidate
    /// if none does.
    pub fn to_rest(began_s: f64, limits: &Limits, at: impl Fn(f64) -> TaskState) -> Self {
        Self::shortest(began_s, false, limits, at)
    }

    /// The shortest return from rest, in the same way.
    pub fn from_rest(began_s: f64, limits: &Limits, at: impl Fn(f64) -> TaskState) -> Self {
        Self::shortest(began_s, true, limits, at)
    }

    fn shortest(began_s: f64, is_rising: bool, limits: &Limits, at: impl Fn(f64) -> TaskState) -> Self {
        let change = |k| Self { began_s, duration_s: SHORTEST_S * FACTOR.powi(k), is_rising };
        (0..CANDIDATES).map(change).find(|change| change.keeps(limits, &at)).unwrap_or(change(CANDIDATES))
    }

    /// The motion's own time at a time since the beginning \[s\].
    pub fn own_time_s(&self, since_s: f64) -> f64 {
        let u = (since_s / self.duration_s).clamp(0.0, 1.0);
        let beyond_s = if self.is_rising { (since_s - self.duration_s).max(0.0) } else { 0.0 };
        // Integral of s(u).
        let risen = u * u * u * u * (2.5 + u * (-3.0 + u));
        let share = if self.is_rising { risen } else { u - risen };
        self.began_s + self.duration_s * share + beyond_s
    }

    /// X, X', X'' at a time since the beginning \[s\].
    pub fn at(&self, since_s: f64, at: impl FnOnce(f64) -> TaskState) -> TaskState {
        let Profile { value, rate, .. } = rise(since_s, self.duration_s);
        let (time_rate, time_accel) = if self.is_rising { (value, rate) } else { (1.0 - value, -rate) };
        let TaskState { x, xd, xdd } = at(self.own_time_s(since_s));
        TaskState { x, xd: xd * time_rate, xdd: xdd * (time_rate * time_rate) + xd * time_accel }
    }

    /// Whether the rate has reached its new value.
    pub fn has_ended(&self, since_s: f64) -> bool {
        since_s >= self.duration_s
    }

    fn keeps(&self, limits: &Limits, at: &impl Fn(f64) -> TaskState) -> bool {
        let dt = self.duration_s / f64::from(SAMPLES);
        let motions = (0..=SAMPLES).map(|k| self.at(f64::from(k) * dt, at).motion());
        let mut before = None;
        motions.into_iter().all(|motion| {
            let (twist, acceleration) = (motion.twist, motion.acceleration);
            let (linear, angular) = before.unwrap_or((acceleration.linear, acceleration.angular));
            let linear_jerk = (acceleration.linear - linear).norm() / dt;
            let angular_jerk = (acceleration.angular - angular).norm() / dt;
            before = Some((acceleration.linear, acceleration.angular));
            let linear = [twist.linear.norm(), acceleration.linear.norm(), linear_jerk];
            let angular = [twist.angular.norm(), acceleration.angular.norm(), angular_jerk];
            is_within(linear, &limits.position) && is_within(angular, &limits.orientation)
        })
    }
}

fn is_within([velocity, acceleration, jerk]: [f64; 3], limits: &DerivativeLimits) -> bool {
    velocity <= USABLE_SHARE * limits.velocity
        && acceleration <= USABLE_SHARE * limits.acceleration
        && jerk <= USABLE_SHARE * limits.jerk
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use crate::commands::r#move::precheck::Precheck;
    use crate::commands::r#move::trajectory::Trajectory;
    use crate::config::Config;
    use crate::motion::built_in::BuiltInMotion;

    /// At every instant of a motion near its limits, the daemon's own rules accept the path to rest and the
    /// continuation.
    #[test]
    fn the_daemon_follows_a_slowdown_from_anywhere_and_on() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let seconds = 4.0;
        let trajectory = Trajectory::built_in(&config, BuiltInMotion::Sines, seconds).unwrap();
        let at = |t: f64| trajectory.at(t.min(seconds));
        let limits = &config.deployment.limits.reference;
        let mut longest: f64 = 0.0;
        for k in 1..40 {
            let began_s = seconds * f64::from(k) / 40.0;
            let slowdown = RateChange::to_rest(began_s, limits, at);
            longest = longest.max(slowdown.duration_s);
            let paused_s = slowdown.own_time_s(slowdown.duration_s);
            let speedup = RateChange::from_rest(paused_s, limits, at);
            longest = longest.max(speedup.duration_s);
            let rest_s = began_s + slowdown.duration_s;
            let path = |t: f64| match t {
                _ if t < began_s => at(t),
                _ if t < rest_s + 0.1 => slowdown.at(t - began_s, at),
                _ => speedup.at(t - rest_s - 0.1, at),
            };
            let end_s = rest_s + 0.1 + speedup.duration_s;
            let refusal = Precheck::new(&config).refusal(path, [0.0, end_s + 0.1]);
            let on_s = speedup.own_time_s(speedup.duration_s + 0.25);
            assert!((on_s - paused_s - 0.5 * speedup.duration_s - 0.25).abs() < 1e-12, "{on_s}");
            assert!(refusal.is_none(), "from {began_s}: {refusal:?}");
            let rest = slowdown.at(slowdown.duration_s, at);
            assert!(rest.xd.amax() == 0.0 && rest.xdd.amax() < 1e-12, "{rest:?}");
            assert!((rest.x - at(began_s + 0.5 * slowdown.duration_s).x).amax() < 1e-12, "on the path");
        }
        assert!(longest < 3.0, "{longest} s");
    }

    #[test]
    fn derivatives_belong_to_the_path() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let trajectory = Trajectory::built_in(&config, BuiltInMotion::Sines, 4.0).unwrap();
        let changes = [false, true].map(|is_rising| RateChange { began_s: 1.0, duration_s: 1.5, is_rising });
        let h = 1e-5;
        for (change, k) in changes.into_iter().flat_map(|change| (1..30).map(move |k| (change, k))) {
            let path = |t: f64| change.at(t, |t| trajectory.at(t));
            let t = 0.05 * f64::from(k);
            let (a, b, c) = (path(t - h), path(t), path(t + h));
            assert!(((c.x - a.x) / (2.0 * h) - b.xd).amax() < 1e-6);
            assert!(((c.xd - a.xd) / (2.0 * h) - b.xdd).amax() < 1e-4);
        }
    }
}
