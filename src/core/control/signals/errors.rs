//! Errors of the platform, desired minus true: of pose and twist, in the coordinates of feedback, and
//! estimated.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::model::LEGS;
use crate::model::inverse_geometry::leg_lengths_and_rates;
use crate::model::machine::Machine;
use crate::model::rigid::{Motion, Pose, Twist};

/// Tracking error of pose and twist, desired minus measured, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseError {
    /// `[e_R; e_p]` \[rad\], \[m\].
    pub pose: Twist,
    /// `[omega_d - omega; v_d - v]` \[rad/s\], \[m/s\].
    pub twist: Twist,
}

impl PoseError {
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
}

/// Error that feedback acts on, desired minus measured: of the pose, or of the leg lengths in modes that act
/// on legs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorCoordinates {
    /// Desired minus measured: angles \[rad\] and position \[m\], or leg lengths \[m\].
    pub value: Vector6<f64>,
    /// Its time derivative.
    pub rate: Vector6<f64>,
}

impl ErrorCoordinates {
    /// Error of leg lengths and rates.
    pub fn of_legs(
        machine: &Machine,
        desired: &Motion,
        length_m: &[f64; LEGS],
        rate_m_s: &[f64; LEGS],
    ) -> Self {
        let (desired, desired_rate) = leg_lengths_and_rates(machine, &desired.pose, &desired.twist);
        Self {
            value: Vector6::from(desired) - Vector6::from(*length_m),
            rate: Vector6::from(desired_rate) - Vector6::from(*rate_m_s),
        }
    }
}

impl From<&PoseError> for ErrorCoordinates {
    fn from(error: &PoseError) -> Self {
        Self { value: error.pose.vector(), rate: error.twist.vector() }
    }
}

impl From<&ErrorCoordinates> for PoseError {
    fn from(deviation: &ErrorCoordinates) -> Self {
        Self { pose: Twist::from_vector(&deviation.value), twist: Twist::from_vector(&deviation.rate) }
    }
}

/// Acceleration that the law commands, before the coupling of the legs: of the platform \[rad/s^2, m/s^2\], or of
/// each leg \[m/s^2\] in modes that act on legs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommandedAcceleration(pub Vector6<f64>);

/// Acceleration u by feedback forces, in the coordinates of the error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackAcceleration(pub Vector6<f64>);

/// Estimate of error, rate and disturbance at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// e, desired minus true: angles \[rad\] and position \[m\], or leg lengths \[m\].
    pub value: Vector6<f64>,
    /// w, its rate.
    pub rate: Vector6<f64>,
    /// d, the acceleration that the model does not contain.
    pub disturbance_acceleration: Vector6<f64>,
}

impl ErrorEstimate {
    /// Advances the estimate by `dt_s` seconds, in which feedback accelerates the platform by u.
    pub fn advance(&mut self, dt_s: f64, FeedbackAcceleration(u): &FeedbackAcceleration) {
        let acceleration = self.disturbance_acceleration - u;
        self.value += (self.rate + acceleration * (0.5 * dt_s)) * dt_s;
        self.rate += acceleration * dt_s;
    }

    /// Estimate `dt_s` seconds later.
    pub fn after(&self, dt_s: f64, u: &FeedbackAcceleration) -> Self {
        let mut after = *self;
        after.advance(dt_s, u);
        after
    }

    /// Error and its rate, without the disturbance.
    pub fn error(&self) -> ErrorCoordinates {
        ErrorCoordinates { value: self.value, rate: self.rate }
    }
}
