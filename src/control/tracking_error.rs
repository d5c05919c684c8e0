//! Tracking error of the platform, and the deviation that feedback acts on.
//!
//! The error is taken at the instant of the measurement, where both sides are known. Without a new measurement it
//! continues by the error dynamics of the law.

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector6;

use super::controller::Cycle;
use super::input_validation::ValidatedSetpoint;
use super::law::ControlMode;
use super::localization::Located;
use super::parameters::Parameters;
use super::reference::ReferenceGenerator;
use crate::model::inverse_geometry::{LegMotion, leg_motion};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Motion, Pose, Twist};

/// Tracking error of pose and twist, desired minus measured, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingError {
    /// `[e_R; e_p]` \[rad\], \[m\].
    pub pose: Twist,
    /// `[omega_d - omega; v_d - v]` \[rad/s\], \[m/s\].
    pub twist: Twist,
}

impl TrackingError {
    /// The error at one instant.
    pub fn new(desired: &Motion, pose: &Pose, twist: &Twist) -> Self {
        Self {
            pose: pose.displacement_to(&desired.pose),
            twist: Twist {
                angular: desired.twist.angular - twist.angular,
                linear: desired.twist.linear - twist.linear,
            },
        }
    }

    /// The error over the engage tolerance, the largest of its four parts. A velocity error is
    /// divided by `wn = sqrt(Kp)`, so that it compares with a pose error.
    pub(super) fn tolerance_ratio(&self, parameters: &Parameters) -> f64 {
        let Parameters { law, engage_position, engage_orientation, .. } = parameters;
        let ratio = |pose: f64, rate: f64, tolerance: f64, stiffness: f64| {
            pose.max(rate / stiffness.sqrt()) / tolerance
        };
        let Self { pose, twist } = self;
        ratio(pose.linear.norm(), twist.linear.norm(), *engage_position, law.position.stiffness).max(ratio(
            pose.angular.norm(),
            twist.angular.norm(),
            *engage_orientation,
            law.orientation.stiffness,
        ))
    }
}

/// FeedbackError that feedback acts on, desired minus measured: angles and positions, or leg lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeedbackError {
    /// Desired minus measured: angles \[rad\] and position \[m\], or leg lengths \[m\].
    pub value: Vector6<f64>,
    /// Its time derivative.
    pub rate: Vector6<f64>,
}

impl FeedbackError {
    /// Of the legs.
    pub fn of_legs(machine: &Machine, desired: &Motion, length: &[f64; LEGS], rate: &[f64; LEGS]) -> Self {
        let LegMotion { length: desired, rate: desired_rate, .. } = leg_motion(machine, desired);
        Self {
            value: Vector6::from(desired) - Vector6::from(*length),
            rate: Vector6::from(desired_rate) - Vector6::from(*rate),
        }
    }
}

impl From<&TrackingError> for FeedbackError {
    fn from(error: &TrackingError) -> Self {
        Self { value: error.pose.vector(), rate: error.twist.vector() }
    }
}

impl From<&FeedbackError> for TrackingError {
    fn from(deviation: &FeedbackError) -> Self {
        Self { pose: Twist::from_vector(&deviation.value), twist: Twist::from_vector(&deviation.rate) }
    }
}

/// Tracking error and deviation of one cycle, and the instant of the measurement they come from.
#[derive(Clone, Copy, Debug)]
pub(super) struct ErrorSample {
    time_ns: u64,
    pub error: TrackingError,
    pub deviation: FeedbackError,
}

impl ErrorSample {
    /// The error of the platform against the reference, without control against the setpoint; `None` if there is none.
    fn measure(
        cycle: &Cycle<'_>,
        has_control: bool,
        reference: &ReferenceGenerator,
        setpoint: &ValidatedSetpoint<'_>,
        Located { measurement, platform }: &Located<'_>,
    ) -> Option<Self> {
        let constants = cycle.constants;
        let time_ns = measurement.time_ns;
        let desired = match has_control {
            true => reference.motion_at(time_ns),
            false => setpoint.target.as_ref()?.motion_at(&constants.parameters, time_ns)?,
        };
        let error = TrackingError::new(&desired, &platform.pose, &platform.twist);
        let deviation = match constants.parameters.law.mode {
            ControlMode::ComputedTorque => FeedbackError::from(&error),
            _ => {
                FeedbackError::of_legs(constants.machine(), &desired, &measurement.length, &measurement.rate)
            }
        };
        Some(Self { time_ns: measurement.time_ns, error, deviation })
    }

    /// A period later, without a new measurement.
    fn predicted(&self, parameters: &Parameters) -> Self {
        let after = |deviation: &FeedbackError| parameters.law.predicted(deviation, parameters.period_s());
        let error = TrackingError::from(&after(&FeedbackError::from(&self.error)));
        Self { error, deviation: after(&self.deviation), ..*self }
    }
}

/// Keeps the error of the last measurement under control.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ErrorTracker {
    last: Option<ErrorSample>,
}

impl ErrorTracker {
    /// The error against the reference followed so far; while there is no new measurement, its prediction. Without
    /// control the result is `None` unless the setpoint is valid and recent.
    pub fn update(
        &mut self,
        cycle: &Cycle<'_>,
        reference: &ReferenceGenerator,
        setpoint: &ValidatedSetpoint<'_>,
        located: Option<&Located<'_>>,
    ) -> Option<ErrorSample> {
        let has_control = cycle.state.has_control();
        let located = located.filter(|_| has_control || setpoint.status.is_ok())?;
        // A measurement from before control began shows another motion.
        let sample = match self.last.filter(|last| last.time_ns >= located.measurement.time_ns) {
            Some(last) => last.predicted(&cycle.constants.parameters),
            None => ErrorSample::measure(cycle, has_control, reference, setpoint, located)?,
        };
        self.last = Some(sample).filter(|_| has_control);
        Some(sample)
    }

    /// The error against the reference that begins at an instant, with the motion that the platform has then.
    pub fn restart(&mut self, time_ns: u64) -> ErrorSample {
        let (error, deviation) = (TrackingError::default(), FeedbackError::default());
        *self.last.insert(ErrorSample { time_ns, error, deviation })
    }
}
