//! Parameters of a controller, chosen by a deployment.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use serde::{Deserialize, Serialize};

use crate::control::law::Law;
use crate::control::law::estimator::ReadingErrors;
use crate::control::law::estimator::covariance::NoiseModel;
use crate::control::signals::errors::PoseError;
use crate::control::signals::limits::Limits;
use crate::control::signals::limits::largest_ratio_or_nan;
use crate::control::signals::state::AfterStop;
use crate::model::fidelity::Fidelity;

/// Parameters that a deployment chooses for a controller. Times are in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    /// Time from one cycle to the next \[ns\]; each force is held this long.
    pub period_ns: u64,
    /// Control law with its gains.
    pub law: Law,
    /// Noise from which the gains of the estimator are computed.
    pub noise: NoiseModel,
    /// Errors of the measured lengths.
    pub reading_errors: ReadingErrors,
    /// Time from the release to the instant at which its force begins to act \[ns\].
    pub force_delay_ns: u64,
    /// Terms of the dynamics that are evaluated. Inertia must be one of them: the law commands an
    /// acceleration, and without inertia there would be no feedback.
    pub fidelity: Fidelity,
    /// Limits of every reference.
    pub limits: Limits,
    /// Factor that `limits` contain, `limits.scale`.
    pub limits_scale: f64,
    /// Range of the setpoints; `None` means no bounds.
    pub envelope: Option<Envelope>,
    /// Largest condition of the pose, see [`crate::model::sensitivity`].
    pub max_condition: f64,
    /// Largest change of a force \[N/s\].
    pub force_rate_n_s: f64,
    /// Reaction to a setpoint that the limits do not allow to follow.
    pub on_violation: ViolationPolicy,
    /// Whether control may begin beyond the engage tolerance of a setpoint in motion.
    pub approach: bool,
    /// Whether a platform that holds its pose follows a setpoint beyond the engage tolerance only after the request `engage`.
    pub holds_on_return: bool,
    /// Acceleration that feedback may add to the limits, as a ratio of them.
    pub feedback_scale: f64,
    /// Change of the payload under control that is no fault \[kg\]; `None` means the default of the machine.
    pub payload_change_kg: Option<f64>,
    /// Sudden disturbance that is no impact \[m/s^2\]; `None` means the default, which follows from the
    /// acceleration limit.
    pub disturbance_step_m_s2: Option<f64>,
    /// Distance that the reference keeps from the ends of the stroke \[m\].
    pub stroke_margin_m: f64,
    /// Largest velocity error under control \[m/s\].
    pub following_velocity_m_s: f64,
    /// Largest angular velocity error under control \[rad/s\].
    pub following_angular_velocity_rad_s: f64,
    /// Goal of the stop of a platform that lost its setpoint.
    pub after_loss: AfterStop,
    /// Time for which a platform without setpoints holds its pose before it parks or stops, if that is the goal \[ns\].
    pub lost_hold_ns: u64,
    /// Largest position error at which control may begin \[m\].
    pub engage_position_m: f64,
    /// Largest orientation error at which control may begin \[rad\].
    pub engage_orientation_rad: f64,
    /// Largest position error under control \[m\].
    pub following_position_m: f64,
    /// Largest orientation error under control \[rad\].
    pub following_orientation_rad: f64,
    /// Age from which on a setpoint counts as lost \[ns\].
    pub setpoint_timeout_ns: u64,
    /// Age from which on a measurement counts as lost \[ns\].
    pub measured_timeout_ns: u64,
    /// Longest wait for drives that are not ready when control begins \[ns\].
    pub ready_timeout_ns: u64,
    /// Largest difference between a measured length and the length at the pose of another sensor \[m\].
    pub pose_tolerance_m: f64,
    /// Largest age of a measurement on arrival \[ns\]: the loop is stable if all measurements are as old.
    pub max_age_at_arrival_ns: u64,
    /// Longest time between two cycles of a running daemon, also without messages \[ns\].
    pub longest_cycle_gap_ns: u64,
}

impl Parameters {
    /// The period \[s\].
    pub(super) fn period_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// Limits without `limits_scale`, for bounds on disturbances and on measured motion, which do not become smaller
    /// when the reference becomes slower.
    pub(super) fn unscaled_limits(&self) -> Limits {
        self.limits.scaled(1.0 / self.limits_scale)
    }

    /// Error as a ratio of the engage tolerance, the largest of its four parts. A velocity error is divided
    /// by `wn = sqrt(Kp)`, so that it compares with a pose error.
    pub fn engage_tolerance_ratio(&self, error: &PoseError) -> f64 {
        let Self { law, engage_position_m, engage_orientation_rad, .. } = self;
        let PoseError { pose, twist } = error;
        largest_ratio_or_nan([
            pose.linear.norm() / engage_position_m,
            pose.angular.norm() / engage_orientation_rad,
            twist.linear.norm() / (law.position.kp_per_s2.sqrt() * engage_position_m),
            twist.angular.norm() / (law.orientation.kp_per_s2.sqrt() * engage_orientation_rad),
        ])
    }

    /// Longest extrapolation of a setpoint \[s\]: until the first cycle that finds it too old.
    pub(super) fn max_setpoint_extrapolation_s(&self) -> f64 {
        self.setpoint_timeout_ns.saturating_add(self.period_ns) as f64 * 1e-9
    }
}

/// Reaction to a setpoint that the limits do not allow to follow: `[setpoint] on_violation`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViolationPolicy {
    /// The platform comes to rest, which is a fault. For trajectories that were checked before.
    #[default]
    Stop,
    /// The platform follows as near as the limits allow, without a fault. For people, joysticks and
    /// simulators.
    Limit,
}

/// Range of the setpoint: lowest and highest X.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Lowest value of each coordinate of X \[rad\], \[m\].
    pub lowest: [f64; 6],
    /// Highest value of each coordinate of X \[rad\], \[m\].
    pub highest: [f64; 6],
}
