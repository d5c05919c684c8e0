//! Motion of a platform without force: its pose and twist at the instant at which the force of this cycle begins, and with it
//! control.
//!
//! A measurement is older than that, and meanwhile closing brakes have changed the twist: by 0.2 m/s within 20 ms at
//! twice gravity. A reference that began with the measured twist would leave the platform at once. So two measurements
//! without force give the deceleration, and the motion goes on with it:
//!
//! ```text
//! speed(t) = |v| + d t, at least 0       d = (|v| - |v0|) / (t - t0), along the twist, as all legs come to rest at once
//! ```
//!
//! Until there are two, the motion of a platform that moves is unknown, and control does not begin. Nor does it where brakes take a
//! large part of the velocity limit within a period: until the force acts, which may be some part of a period late, the platform would
//! have another velocity than its reference. Such brakes soon have it at rest.

use super::controller::Cycle;
use super::input_validation::seconds_between;
use super::limits::largest_ratio;
use super::localization::{Located, PlatformState};
use super::parameters::{Constants, Parameters};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Speed of a joint at which a platform without force counts as standing, as a ratio of the velocity limit: above the noise
/// of rates, and below what feedback could not take up at once.
const STANDING_RATIO: f64 = 1e-3;

/// Largest change of the twist within a period with which control begins, over the limits of velocity: a force that acts a fifth of a
/// period late makes 2 % of them.
const MAX_CHANGE_RATIO: f64 = 0.1;

/// What a measurement without force has shown.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
struct Sample {
    time_ns: u64,
    pose: Pose,
    twist: Twist,
    /// Bound on the speed of a joint \[m/s\].
    speed: f64,
}

impl Sample {
    fn new(constants: &Constants, Located { measurement, platform, .. }: &Located<'_>) -> Self {
        let PlatformState { pose, twist, .. } = *platform;
        let speed = twist.linear.norm() + constants.arm * twist.angular.norm();
        Self { time_ns: measurement.time_ns, pose, twist, speed }
    }
}

/// The last measurements without force.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct FreeMotion {
    /// The instant until which the last force was held \[ns\].
    held_until_ns: u64,
    before: Option<Sample>,
    last: Option<Sample>,
}

impl FreeMotion {
    /// The motion at the instant at which the force of a cycle that begins without one would begin; `None` if it is unknown.
    pub fn update(&mut self, cycle: &Cycle<'_>, located: Option<&Located<'_>>) -> Option<Motion> {
        let Cycle { constants, release_ns, state } = *cycle;
        let begin_ns = release_ns.saturating_add(constants.parameters.force_delay_ns);
        if state.has_control() {
            // The force of the cycle before is held until that of this one would begin, at most a period late.
            let held_until_ns = begin_ns.saturating_add(constants.parameters.period_ns);
            *self = Self { held_until_ns, ..Self::default() };
            return None;
        }
        let new = located.map(|located| Sample::new(constants, located));
        // Where the pose is unknown, what came before is another motion.
        let Some(new) = new else {
            (self.before, self.last) = (None, None);
            return None;
        };
        let is_new = self.last.is_none_or(|last| last.time_ns < new.time_ns);
        if is_new && new.time_ns >= self.held_until_ns {
            (self.before, self.last) = (self.last, Some(new));
        }
        self.at(constants, begin_ns)
    }

    fn at(&self, constants: &Constants, instant_ns: u64) -> Option<Motion> {
        let last = self.last?;
        let standing = STANDING_RATIO * constants.parameters.limits.position.velocity;
        let change = match self.before {
            Some(before) => (last.speed - before.speed) / seconds_between(before.time_ns, last.time_ns),
            None if last.speed <= standing => 0.0,
            None => return None,
        };
        let age_s = seconds_between(last.time_ns, instant_ns).max(0.0);
        let moves_s = if change < 0.0 { age_s.min(last.speed / -change) } else { age_s };
        let share = if last.speed > 0.0 { (1.0 + change * moves_s / last.speed).max(0.0) } else { 0.0 };
        let scaled = |factor: f64| Twist::from_vector(&(last.twist.vector() * factor));
        let Parameters { limits, period_ns, .. } = &constants.parameters;
        let in_period = scaled(change / last.speed * *period_ns as f64 * 1e-9);
        let change_ratio = largest_ratio([
            in_period.linear.norm() / limits.position.velocity,
            in_period.angular.norm() / limits.orientation.velocity,
        ]);
        // Of a platform that will be at rest, the speed is known.
        if share > 0.0 && change_ratio > MAX_CHANGE_RATIO {
            return None;
        }
        Some(Motion {
            pose: last.pose.displaced(&scaled(0.5 * (1.0 + share) * moves_s)),
            twist: scaled(share),
            // That of the brakes ends with them: the drives take over from none.
            acceleration: Acceleration::default(),
        })
    }
}
