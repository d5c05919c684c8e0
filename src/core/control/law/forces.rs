//! Forces at the legs of a commanded motion, by the terms of the dynamics that the control mode includes.

use crate::control::constants::Constants;
use crate::control::law::ControlMode;
use crate::control::law::feedback_law::LegAccelerations;
use crate::control::parameters::Parameters;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::CommandedAcceleration;
use crate::model::LEGS;
use crate::model::fidelity::Fidelity;
use crate::model::rigid::Motion;

/// Forces \[N\] of the motion that the law commands. Modes on legs add the forces of the leg accelerations.
pub(in crate::control) fn forces(
    constants: &Constants,
    motion: &Motion,
    acceleration: &CommandedAcceleration,
) -> Result<[f64; LEGS], Diagnostic> {
    let Parameters { law, fidelity, .. } = &constants.parameters;
    let fidelity = match law.mode {
        ControlMode::ComputedTorque | ControlMode::FeedforwardJointPd => Some(*fidelity),
        ControlMode::GravityJointPd => Some(Fidelity::Gravity),
        ControlMode::JointPd => None,
    };
    let mut force = match law.mode.acts_on_legs() {
        true => law.uncoupled_leg_forces(&LegAccelerations(acceleration.0)),
        false => [0.0; LEGS],
    };
    if let Some(fidelity) = fidelity {
        let modelled = constants.dynamics.forces_of(fidelity, motion).ok_or(DiagnosticCode::SingularPose)?;
        force.iter_mut().zip(modelled).for_each(|(force, modelled)| *force += modelled);
    }
    if force.iter().any(|value| !value.is_finite()) {
        return Err(DiagnosticCode::ForceNotFinite.into());
    }
    Ok(force)
}
