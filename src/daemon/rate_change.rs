//! Change of the rate of a motion's own time, from one to zero or back. So the platform comes to rest, and
//! continues, on the path that was checked.

use hexad_core::control::signals::limits::{DerivativeLimits, Limits};
use hexad_core::model::task::TaskState;
use hexad_core::motion::minimum_jerk::{Profile, rise};

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
        let Profile { value_share, rate_per_s, .. } = rise(since_s, self.duration_s);
        let (time_rate, time_accel) =
            if self.is_rising { (value_share, rate_per_s) } else { (1.0 - value_share, -rate_per_s) };
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
