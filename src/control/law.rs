//! Computed torque on the pose error.
//!
//! ```text
//! e_p = C_d - C                 e_R = log(R_d R^T)       rotation vector in base axes, never angles
//! v'_c     = v'_d     + Kd (v_d - v)           + Kp e_p
//! omega'_c = omega'_d + Kd_r (omega_d - omega) + Kp_r e_R
//! Gamma    = inverse dynamics at the present R, C, omega, v with (v'_c, omega'_c)
//! ```
//!
//! Two instants meet here. The error is taken at the instant of the measurement, where both sides are
//! known. The force is needed for the middle of the interval in which it will be held, about a period
//! later. Mixing them would make every delay look like a tracking error of speed times delay. So the
//! error is carried over unchanged, and "the present" is where the platform will be if the error stays as
//! it is: the desired motion at that later instant, displaced by minus the error.
//!
//! An integral term `Ki` times the integral of e may be added to both lines; it is off by default. It goes
//! on only while no force is limited, and never beyond a share of the acceleration limits: no wind-up.

use super::gains::Gains;
use super::limits::Limits;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Gains for position and orientation.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    pub position: Gains,
    pub orientation: Gains,
    /// Ki / Kp \[1/s\].
    pub integral: f64,
}

/// Largest part of the acceleration limit that the integral may ask for: what it removes is a payload or a
/// friction unknown to the model, and what is more than that is a collision.
const INTEGRAL_SHARE: f64 = 0.5;

/// The integral of the pose error, times Ki: an acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integral {
    acceleration: Acceleration,
}

impl Integral {
    /// Goes on with an error for `dt` seconds.
    pub fn add(&mut self, law: &Law, error: &Twist, dt: f64, limits: &Limits) {
        let Acceleration { angular, linear } = &mut self.acceleration;
        for (sum, error, gains, limit) in [
            (angular, &error.angular, &law.orientation, &limits.orientation),
            (linear, &error.linear, &law.position, &limits.position),
        ] {
            *sum += error * (law.integral * gains.stiffness * dt);
            let beyond = sum.norm() / (INTEGRAL_SHARE * limit.acceleration);
            if beyond > 1.0 {
                *sum /= beyond;
            }
        }
    }
}

/// Desired minus measured, base axes.
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
}

impl Law {
    /// The error after `dt` seconds without a measurement, if the platform does what the model says:
    /// `e'' = -Kd e' - Kp e`, by one step of the semi-implicit Euler method, stable at these gains.
    pub fn predicted(&self, error: &TrackingError, dt: f64) -> TrackingError {
        let mut next = *error;
        for (e, e_rate, gains) in [
            (&mut next.pose.angular, &mut next.twist.angular, &self.orientation),
            (&mut next.pose.linear, &mut next.twist.linear, &self.position),
        ] {
            *e_rate -= (*e_rate * gains.damping + *e * gains.stiffness) * dt;
            *e += *e_rate * dt;
        }
        next
    }

    /// The motion whose inverse dynamics are the forces: where the platform will be at the instant of
    /// `desired` if `error` stays as it is, with the commanded acceleration.
    pub fn command(&self, desired: &Motion, error: &TrackingError, integral: &Integral) -> Motion {
        let Integral { acceleration: sum } = integral;
        let (e, e_rate) = (&error.pose, &error.twist);
        Motion {
            pose: desired.pose.displaced(&Twist { angular: -e.angular, linear: -e.linear }),
            twist: Twist {
                angular: desired.twist.angular - e_rate.angular,
                linear: desired.twist.linear - e_rate.linear,
            },
            acceleration: Acceleration {
                angular: desired.acceleration.angular
                    + e_rate.angular * self.orientation.damping
                    + e.angular * self.orientation.stiffness
                    + sum.angular,
                linear: desired.acceleration.linear
                    + e_rate.linear * self.position.damping
                    + e.linear * self.position.stiffness
                    + sum.linear,
            },
        }
    }
}
