//! Control law: six accelerations from six errors, and the motion that each mode commands.
//!
//! ```text
//! a = Kp e + Kd e' + B^-1 d      e, e', d: estimated error, rate, disturbance; B: input matrix, mostly 1
//! ```
//!
//! | mode | errors | force |
//! | --- | --- | --- |
//! | [`ComputedTorque`](ControlMode::ComputedTorque) | pose | inverse dynamics at the predicted pose and the reference twist, acceleration `desired + a` |
//! | [`FeedforwardJointPd`](ControlMode::FeedforwardJointPd) | legs | inverse dynamics of the desired motion + `m_i a_i` |
//! | [`GravityJointPd`](ControlMode::GravityJointPd) | legs | weight at the desired pose + `m_i a_i` |
//! | [`JointPd`](ControlMode::JointPd) | legs | `m_i a_i` |
//!
//! Pose errors are `e_p = C_d - C` and `e_R = log(R_d R^T)`, a rotation vector in base axes, never angles.
//! Leg errors are desired lengths and rates, by inverse geometry, minus measured ones. The laws on legs need
//! no forward kinematics: they take the weight at the desired pose, which has no noise. Supervision
//! (following error, condition, stopping, parking) uses the measured pose in every mode. Legs have no angles,
//! so leg errors use the position gains. `m_i`: see [`super::leg_masses`]; d: see [`super::estimator`].
//!
//! The law combines two instants. Feedback acts on the error when the force begins. The dynamics are
//! evaluated in the middle of the hold, at the reference minus the error there. The estimator predicts both
//! errors from the instant of the measurement, where reference and platform are known. Quantities of
//! different instants are never subtracted.

use nalgebra::Vector6;

use crate::control::law::gains::Gains;
use crate::control::law::input_matrix::InputMatrix;
use crate::control::law::leg_masses::LegMasses;
use crate::control::law::mode::ControlMode;
use crate::control::signals::errors::{CommandedAcceleration, ErrorCoordinates, ErrorEstimate};
use crate::control::signals::limits::Limits;
use crate::control::signals::pair::Pair;
use crate::model::LEGS;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Gravity;
use crate::model::machine::Machine;
use crate::model::rigid::{Acceleration, Motion, Twist};
use crate::model::task::TaskState;

/// Accelerations of the legs \[m/s^2\].
#[derive(Clone, Copy, Debug)]
pub struct LegAccelerations(pub Vector6<f64>);

/// Control law of one deployment: mode and gains.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    /// Control mode: errors that feedback acts on, and terms of the dynamics that are added.
    pub mode: ControlMode,
    /// Gains of the position and of the legs.
    pub position: Gains,
    /// Gains of the orientation; not used in modes that act on the legs.
    pub orientation: Gains,
    /// Whether the estimated disturbance is compensated. Without compensation a payload that the model lacks
    /// causes a steady error, and a person can push the platform away as far as the gains permit.
    pub compensates_disturbance: bool,
    /// Effective mass of each drive, and the loop gains of the leg modes.
    pub leg_masses: LegMasses,
    /// Largest disturbance that the estimator compensates: \[rad/s^2\] and \[m/s^2\], or \[m/s^2\] of each
    /// leg.
    pub max_compensated_acceleration: Vector6<f64>,
}

/// Largest disturbance, relative to the acceleration limit: a payload or friction that the model lacks.
/// A larger disturbance is a collision.
const COMPENSATED_DISTURBANCE_PER_ACCELERATION_LIMIT: f64 = 0.5;

impl Law {
    /// Builds the law of a machine.
    pub fn new(
        machine: &Machine,
        mode: ControlMode,
        gains: Pair<Gains>,
        leg_masses: LegMasses,
        compensates_disturbance: bool,
        limits: &Limits,
    ) -> Self {
        let [angular, linear] = [&limits.orientation, &limits.position]
            .map(|limits| COMPENSATED_DISTURBANCE_PER_ACCELERATION_LIMIT * limits.acceleration);
        let mut max_compensated_acceleration = Vector6::repeat(linear);
        match mode {
            ControlMode::ComputedTorque => max_compensated_acceleration.fixed_rows_mut::<3>(0).fill(angular),
            // The model of this mode lacks the weight as well.
            ControlMode::JointPd => {
                let home = TaskState::at_rest(machine.home).motion();
                let weight = InverseDynamics::new(machine).forces::<Gravity>(&home).unwrap_or_default();
                max_compensated_acceleration +=
                    Vector6::from(weight).abs().component_div(&leg_masses.mass_kg);
            }
            ControlMode::FeedforwardJointPd | ControlMode::GravityJointPd => {}
        }
        let Pair { angular: orientation, linear: position } = gains;
        Self {
            mode,
            position,
            orientation,
            compensates_disturbance,
            leg_masses,
            max_compensated_acceleration,
        }
    }

    /// Largest acceleration of a leg that a mode without inertia leaves to feedback: the reference's largest
    /// acceleration plus the largest disturbance.
    pub(in crate::control) fn max_leg_acceleration_without_feedforward(
        &self,
        limits: &Limits,
        arm_m: f64,
        disturbance_acceleration: &Vector6<f64>,
    ) -> f64 {
        if self.mode.includes_inertia() {
            return 0.0;
        }
        limits.position.acceleration
            + arm_m * limits.orientation.acceleration
            + disturbance_acceleration.amax()
    }

    /// Kp and Kd of the six errors.
    pub(in crate::control) fn gains(&self) -> (Vector6<f64>, Vector6<f64>) {
        let Self { position, orientation, .. } = self;
        let first = if self.mode.acts_on_legs() { position } else { orientation };
        let all = |first: f64, second: f64| Vector6::new(first, first, first, second, second, second);
        (all(first.kp_per_s2, position.kp_per_s2), all(first.kd_per_s, position.kd_per_s))
    }

    /// Commanded acceleration `Kp e + Kd e' + B^-1 d`, from the estimate at the instant at which the force
    /// begins.
    pub fn commanded_acceleration(
        &self,
        estimate: &ErrorEstimate,
        input_matrix: &InputMatrix,
    ) -> CommandedAcceleration {
        let (stiffness, damping) = self.gains();
        let feedback = estimate.value.component_mul(&stiffness) + estimate.rate.component_mul(&damping);
        if !self.compensates_disturbance {
            return CommandedAcceleration(feedback);
        }
        CommandedAcceleration(feedback + input_matrix.command(&estimate.disturbance_acceleration))
    }

    /// Largest ratio of the compensated disturbance to its bound.
    pub(in crate::control) fn compensation_ratio(&self, estimate: &ErrorEstimate) -> f64 {
        if !self.compensates_disturbance {
            return 0.0;
        }
        estimate.disturbance_acceleration.component_div(&self.max_compensated_acceleration).amax()
    }

    /// Motion whose forces the mode commands. Computed torque: the predicted pose (reference minus predicted
    /// error), the reference twist, and reference plus commanded acceleration. The twist is not the estimated
    /// one, because friction forces of estimated rates would shake a platform at rest. Modes on legs: the
    /// desired motion.
    pub(in crate::control) fn motion_for_inverse_dynamics(
        &self,
        desired: Motion,
        error: &ErrorCoordinates,
        CommandedAcceleration(acceleration): &CommandedAcceleration,
    ) -> Motion {
        if self.mode.acts_on_legs() {
            return desired;
        }
        let Acceleration { angular, linear } = Acceleration::from_vector(acceleration);
        Motion {
            pose: desired.pose.extrapolated(&Twist::from_vector(&-error.value)),
            twist: desired.twist,
            acceleration: Acceleration {
                angular: desired.acceleration.angular + angular,
                linear: desired.acceleration.linear + linear,
            },
        }
    }

    /// Drive forces `m_i a_i` for leg accelerations, with the effective mass of each drive.
    pub fn uncoupled_leg_forces(&self, LegAccelerations(acceleration): &LegAccelerations) -> [f64; LEGS] {
        acceleration.component_mul(&self.leg_masses.mass_kg).into()
    }
}
