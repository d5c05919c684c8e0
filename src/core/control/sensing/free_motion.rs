//! Motion of a platform without force: pose and twist at the instant at which this cycle's force, and with it
//! control, would begin.
//!
//! A measurement is older than that instant. In between, closing brakes change the twist: by 0.2 m/s within
//! 20 ms at twice gravity. A reference that began with the measured twist would leave the platform at once.
//! Therefore two measurements without force give the deceleration, and the motion is extrapolated with it:
//!
//! ```text
//! speed(t) = |v| + d t, at least 0       d = (|v| - |v0|) / (t - t0)
//! the twist keeps its direction, as all legs come to rest at once
//! ```
//!
//! Control does not begin in these cases:
//!
//! - The platform moves and has no two such measurements yet: its motion is unknown.
//! - The driver sends no rates, and the lengths do not show rest ([`super::standstill`]).
//! - Brakes take a large part of the velocity limit within a period. The force may act some part of a period
//!   late, and the platform would then have another velocity than its reference. Such brakes soon stop the
//!   platform.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::sensing::localization::{Localization, Located, PlatformState};
use crate::control::sensing::standstill::{Standstill, max_standing_speed_m_s};
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::limits::largest_ratio_or_nan;
use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Largest change of the twist within a period at which control may begin, as a ratio of the velocity limits.
/// A force that acts a fifth of a period late then causes an error of 2 % of them.
const MAX_CHANGE_RATIO: f64 = 0.1;

/// State of the platform at a measurement without force.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
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
        Self { time_ns: measurement.time_ns, pose, twist, speed: speed(constants, &twist) }
    }
}

/// Bound on the speed of a joint \[m/s\].
fn speed(constants: &Constants, twist: &Twist) -> f64 {
    twist.linear.norm() + constants.arm_m * twist.angular.norm()
}

/// The last measurements without force.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct FreeMotion {
    /// Instant until which the last force was held \[ns\].
    held_until_ns: u64,
    /// Time stamp of the newest measurement \[ns\].
    newest_ns: Option<u64>,
    /// The last two measurements; `None` without rates.
    before: Option<Sample>,
    last: Option<Sample>,
    /// Test for rest by the lengths of all measurements.
    standstill: Standstill,
}

impl FreeMotion {
    /// Motion at the instant at which this cycle's force would begin, in a cycle that begins without control.
    /// If the motion is unknown, returns the reason why control does not begin.
    pub fn update(
        &mut self,
        cycle: &Cycle<'_>,
        localization: &Localization,
        located: Option<&Located<'_>>,
    ) -> Result<Motion, Diagnostic> {
        let Cycle { constants, release_ns, state } = *cycle;
        let begin_ns = release_ns.saturating_add(constants.parameters.force_delay_ns);
        // Under control or with an unknown pose, earlier measurements belong to another motion.
        let Some(located) = located.filter(|_| !state.has_control()) else {
            // The previous force is held until this cycle's force would begin, at most a period late.
            let held_until_ns = begin_ns.saturating_add(constants.parameters.period_ns);
            let held_until_ns = if state.has_control() { held_until_ns } else { self.held_until_ns };
            *self = Self { held_until_ns, ..Self::default() };
            return Err(DiagnosticCode::PlatformMoving.into());
        };
        let measurement = located.measurement;
        let is_new = self.newest_ns.is_none_or(|newest_ns| measurement.time_ns > newest_ns);
        if measurement.time_ns >= self.held_until_ns && is_new {
            self.newest_ns = Some(measurement.time_ns);
            self.standstill.add(&constants.parameters, constants.rest_window_s, measurement);
            let new = measurement.rate_m_s.is_some().then(|| Sample::new(constants, located));
            (self.before, self.last) = (new.and(self.last), new);
        }
        match self.at(constants, begin_ns) {
            Some(motion) => Ok(motion),
            None if measurement.rate_m_s.is_some() => Err(DiagnosticCode::PlatformMoving.into()),
            None => self.at_rest(constants, localization, &located.platform.pose),
        }
    }

    /// Motion at rest, if the lengths show rest.
    fn at_rest(
        &self,
        constants: &Constants,
        localization: &Localization,
        pose: &Pose,
    ) -> Result<Motion, Diagnostic> {
        let largest = max_standing_speed_m_s(&constants.parameters);
        let found = self.standstill.latest();
        let speed = found.map_or(f64::INFINITY, |rates| {
            let twist = localization.twist_of(constants, &rates.rate_m_s.into());
            twist.map_or(f64::INFINITY, |twist| speed(constants, &twist) + rates.uncertainty_m_s)
        });
        if self.standstill.rates().is_some() && speed <= largest {
            let (twist, acceleration) = (Twist::default(), Acceleration::default());
            return Ok(Motion { pose: *pose, twist, acceleration });
        }
        Err(Diagnostic::new(DiagnosticCode::RestNotShown, speed, largest))
    }

    fn at(&self, constants: &Constants, instant_ns: u64) -> Option<Motion> {
        let last = self.last?;
        let standing = max_standing_speed_m_s(&constants.parameters);
        let change = match self.before {
            Some(before) => (last.speed - before.speed) / seconds_between(before.time_ns, last.time_ns),
            None if last.speed <= standing => 0.0,
            None => return None,
        };
        let age_s = seconds_between(last.time_ns, instant_ns).max(0.0);
        let moves_s = if change < 0.0 { age_s.min(last.speed / -change) } else { age_s };
        let share = if last.speed > 0.0 { (1.0 + change * moves_s / last.speed).max(0.0) } else { 0.0 };
        let scaled = |factor: f64| Twist::from_vector(&(last.twist.vector() * factor));
        let limits = constants.parameters.unscaled_limits();
        let in_period = scaled(change / last.speed * constants.parameters.period_ns as f64 * 1e-9);
        let change_ratio = largest_ratio_or_nan([
            in_period.linear.norm() / limits.position.velocity,
            in_period.angular.norm() / limits.orientation.velocity,
        ]);
        // If the platform will be at rest by then, its speed is known.
        if share > 0.0 && change_ratio > MAX_CHANGE_RATIO {
            return None;
        }
        Some(Motion {
            pose: last.pose.displaced(&scaled(0.5 * (1.0 + share) * moves_s)),
            twist: scaled(share),
            // The deceleration by the brakes ends when they open; the drives begin without acceleration.
            acceleration: Acceleration::default(),
        })
    }
}
