//! Straight motion of a tool, in advance: within the workspace, and as fast as the limits of autonomous motions allow.
//!
//! All limits of the platform hold in the base frame. Forces and the reference's stops are not checked here.

use super::target_motion::{Survey, TargetMotion, TargetRefusal, check_duration, check_target};
use hexad_core::control::constants::Constants;
use hexad_core::control::signals::limits::{DerivativeLimits, LimitSet};
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::rigid::Motion;
use hexad_core::model::task::TaskState;
use hexad_core::motion::minimum_jerk::rise;
use hexad_core::motion::tool_path::ToolPath;

/// Instants of the path that are examined: a hundredth of the way at most between two of them.
const SAMPLES: u32 = 200;

/// Shortest motion \[s\], for a way of nothing.
const SHORTEST_S: f64 = 0.1;

/// Minimum-jerk motion along a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMotion {
    path: ToolPath,
    /// Duration \[s\].
    pub duration_s: f64,
}

impl ToolMotion {
    /// The fastest motion within a share of the limits of autonomous motions. An error if the path leaves the workspace.
    pub fn fastest(constants: &Constants, path: ToolPath, speed: f64) -> Result<Self, TargetRefusal> {
        let unit = Self { path, duration_s: 1.0 };
        let (_, end) = unit.samples().last().unwrap_or((1.0, unit.at(1.0)));
        check_target(constants, &end.pose).map_err(TargetRefusal::Target)?;
        for (t, motion) in unit.samples() {
            let share = rise(t, 1.0).value_share;
            check_target(constants, &motion.pose).map_err(|bound| TargetRefusal::Way { bound, share })?;
        }
        let duration_s = unit.shortest_s(constants, speed).max(SHORTEST_S);
        check_duration(duration_s)?;
        Ok(Self { path, duration_s })
    }

    /// The same motion in a multiple of the time.
    pub fn slower(&self, factor: f64) -> Self {
        Self { duration_s: factor * self.duration_s, ..*self }
    }

    /// Motion of the platform at a time since the beginning \[s\].
    pub fn at(&self, t: f64) -> Motion {
        self.path.at(&rise(t, self.duration_s))
    }

    /// The same in task coordinates near `near`; `None` where these have no rates.
    pub fn task_state(&self, t: f64, near: &[f64; 6]) -> Option<TaskState> {
        self.path.task_state(&rise(t, self.duration_s), near)
    }

    /// Largest quantities on the way.
    pub fn survey(&self, constants: &Constants) -> TargetMotion {
        let mut survey = Survey::new(constants, &self.at(0.0));
        self.samples().for_each(|(_, motion)| survey.add(constants, &motion, LimitSet::default()));
        survey.result(self.duration_s)
    }

    /// Motions from the beginning to the end, with their times.
    pub fn samples(&self) -> impl Iterator<Item = (f64, Motion)> {
        let time = |k| self.duration_s * f64::from(k) / f64::from(SAMPLES);
        (0..=SAMPLES).map(move |k| (time(k), self.at(time(k))))
    }

    /// Shortest duration \[s\] of a motion of which this one takes a second. On one path velocities are as 1/T, accelerations as
    /// 1/T^2 and jerks as 1/T^3.
    fn shortest_s(&self, constants: &Constants, speed: f64) -> f64 {
        let (machine, limits) = (constants.machine(), &constants.parameters.limits);
        let share = limits.autonomous_scale * speed;
        let duration = |[velocity, acceleration, jerk]: [f64; 3], limits: &DerivativeLimits| {
            let limits = limits.scaled(share);
            let by_acceleration = (acceleration / limits.acceleration).sqrt();
            (velocity / limits.velocity).max(by_acceleration).max((jerk / limits.jerk).cbrt())
        };
        let (mut shortest, mut before) = (0.0_f64, self.at(0.0).acceleration);
        for (_, Motion { pose, twist, acceleration }) in self.samples() {
            let jerk = (acceleration.vector() - before.vector()) * f64::from(SAMPLES);
            let linear =
                [twist.linear, acceleration.linear, jerk.fixed_rows::<3>(3).into()].map(|x| x.norm());
            let angular =
                [twist.angular, acceleration.angular, jerk.fixed_rows::<3>(0).into()].map(|x| x.norm());
            let legs = leg_motion(machine, &Motion { pose, twist, acceleration }).rate_m_s;
            let fastest = legs.into_iter().map(f64::abs).fold(0.0, f64::max);
            shortest = shortest
                .max(duration(linear, &limits.position))
                .max(duration(angular, &limits.orientation))
                .max(fastest / machine.actuator.max_rate_m_s);
            before = acceleration;
        }
        shortest
    }
}
