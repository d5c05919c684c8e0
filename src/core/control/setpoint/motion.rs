//! Motion of the platform that a setpoint describes, and its continuation until the force acts.

use nalgebra::{Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::control::parameters::Parameters;
use crate::control::signals::inputs::{Setpoint, SetpointKind};
use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Longest interval between two setpoints from whose accelerations a jerk is computed \[s\].
const MAX_JERK_INTERVAL_S: f64 = 0.025;
/// Time for which a jerk lasts, as a ratio of the interval between setpoints: two messages may be lost. The
/// time to the end of the force's hold is added. Afterwards the acceleration is constant.
const JERK_INTERVALS: f64 = 3.0;

/// A setpoint with the motion of the platform that it describes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetpointMotion {
    /// The setpoint as received: time stamp and X, X', X''.
    pub setpoint: Setpoint,
    /// Pose, twist and acceleration of the platform at its time stamp, base axes.
    pub motion: Motion,
    /// Jerk after the setpoint, from the change of acceleration since the previous setpoint; zero after a gap
    /// \[rad/s^3\], \[m/s^3\].
    jerk: Vector6<f64>,
    /// Time for which the jerk lasts \[s\].
    jerk_s: f64,
}

/// A motion whose pose is given relative to another pose. Twist and acceleration are its own, in base axes.
#[derive(Clone, Copy, Debug)]
pub(in crate::control) struct RelativeMotion {
    /// Displacement from the pose to the pose of the motion \[rad\], \[m\].
    pub displacement: Vector6<f64>,
    pub twist: Twist,
    pub acceleration: Acceleration,
}

impl AsRef<Setpoint> for SetpointMotion {
    fn as_ref(&self) -> &Setpoint {
        &self.setpoint
    }
}

impl SetpointMotion {
    /// Evaluates the motion of a setpoint. A setpoint of a pose alone has neither twist nor acceleration.
    pub fn new(setpoint: Setpoint) -> Self {
        let motion = setpoint.task.motion();
        let mut new = Self { setpoint, motion, jerk: Vector6::zeros(), jerk_s: 0.0 };
        if matches!(setpoint.kind, SetpointKind::Pose | SetpointKind::Target) {
            (new.motion.twist, new.motion.acceleration) = (Twist::default(), Acceleration::default());
        }
        new
    }

    /// Sets the jerk from the change of acceleration since the setpoint `before`. An acceleration that is
    /// held until the instant of the force would lag by the time between; the error would be `jerk dt / Kp`.
    pub fn set_jerk_from_previous(&mut self, parameters: &Parameters, before: Option<&Self>) {
        let Some(before) = before.filter(|_| self.setpoint.kind == SetpointKind::Motion) else { return };
        let dt = seconds_between(before.setpoint.time_ns, self.setpoint.time_ns);
        if !(dt > 0.0 && dt <= MAX_JERK_INTERVAL_S) || before.setpoint.kind != SetpointKind::Motion {
            return;
        }
        let limits = &parameters.limits;
        let clamped = |change: Vector3<f64>, limit: f64| {
            let jerk = change / dt;
            jerk * (limit / jerk.norm().max(limit))
        };
        let (now, then) = (&self.motion.acceleration, &before.motion.acceleration);
        let angular = clamped(now.angular - then.angular, limits.orientation.jerk);
        let linear = clamped(now.linear - then.linear, limits.position.jerk);
        self.jerk = Acceleration { angular, linear }.vector();
        let ahead_s = parameters.force_delay_ns.saturating_add(parameters.period_ns) as f64 * 1e-9;
        self.jerk_s = JERK_INTERVALS * dt + ahead_s;
    }

    /// Motion after `dt_s` seconds relative to the pose of the setpoint, to first order in the angle covered.
    pub(in crate::control) fn continued(&self, dt_s: f64) -> RelativeMotion {
        let (v, a, j) = (self.motion.twist.vector(), self.motion.acceleration.vector(), &self.jerk);
        let t = dt_s.max(0.0).min(self.jerk_s);
        let rest = dt_s.max(0.0) - t;
        let by_jerk = t * (t * t / 6.0 + rest * (0.5 * t + 0.5 * rest));
        RelativeMotion {
            displacement: (v + a * (0.5 * dt_s)) * dt_s + j * by_jerk,
            twist: Twist::from_vector(&(v + a * dt_s + j * (t * (0.5 * t + rest)))),
            acceleration: Acceleration::from_vector(&(a + j * t)),
        }
    }

    /// Motion at another instant. The extrapolation is bounded, see `bounded_extrapolation_s`.
    pub(in crate::control) fn motion_at(&self, parameters: &Parameters, instant_ns: u64) -> Motion {
        if instant_ns == self.setpoint.time_ns {
            return self.motion;
        }
        // Extrapolates the motion and not X, because rates of the angles are unbounded near gimbal lock.
        let continued = self.continued(self.bounded_extrapolation_s(parameters, instant_ns));
        Motion {
            pose: self.motion.pose.extrapolated(&Twist::from_vector(&continued.displacement)),
            twist: continued.twist,
            acceleration: continued.acceleration,
        }
    }

    /// Time from the setpoint to another instant \[s\], bounded by the longest extrapolation of a setpoint.
    pub(in crate::control) fn bounded_extrapolation_s(
        &self,
        parameters: &Parameters,
        instant_ns: u64,
    ) -> f64 {
        let longest = parameters.max_setpoint_extrapolation_s();
        seconds_between(self.setpoint.time_ns, instant_ns).max(-longest).min(longest)
    }
}
