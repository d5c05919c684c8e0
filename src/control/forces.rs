//! Forces of the drives for a commanded motion, by the terms of the dynamics that the control mode has.

use super::diagnostic::{Diagnostic, DiagnosticCode};
use super::law::ControlMode;
use super::parameters::{Constants, Parameters};
use crate::model::fidelity::Fidelity;
use crate::model::machine::LEGS;
use crate::model::rigid::Motion;

use nalgebra::Vector6;

/// Forces \[N\] for the motion that the law commands, and in a mode on legs for the acceleration of the legs.
pub(super) fn forces(
    constants: &Constants,
    motion: &Motion,
    acceleration: &Vector6<f64>,
) -> Result<[f64; LEGS], Diagnostic> {
    let Parameters { law, fidelity, .. } = &constants.parameters;
    let fidelity = match law.mode {
        ControlMode::ComputedTorque | ControlMode::FeedforwardJointPd => Some(*fidelity),
        ControlMode::GravityJointPd => Some(Fidelity::Gravity),
        ControlMode::JointPd => None,
    };
    let mut force = if law.mode.acts_on_legs() { law.feedback_leg_forces(acceleration) } else { [0.0; LEGS] };
    if let Some(fidelity) = fidelity {
        let modelled = constants.dynamics.forces_of(fidelity, motion).ok_or(DiagnosticCode::SingularPose)?;
        force.iter_mut().zip(modelled).for_each(|(force, modelled)| *force += modelled);
    }
    if force.iter().any(|value| !value.is_finite()) {
        return Err(DiagnosticCode::ForceNotFinite.into());
    }
    Ok(force)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::daemon;
    use crate::model::task::TaskState;

    /// In every mode, for every leg and kind of number: the last check before the drives.
    #[test]
    fn a_force_that_is_not_finite_is_refused() {
        let config = Config::parse(include_str!("../../config/fried2008.toml"), "fried2008.toml").unwrap();
        let machine = &config.machine;
        let motion = TaskState::at_rest(machine.home).motion();
        for mode in ControlMode::ALL {
            let mut parameters = daemon::parameters(machine, &config.deployment, Fidelity::Exact);
            parameters.law.mode = mode;
            let constants = Constants::new(machine, parameters);
            let with = |motion: &Motion, acceleration| forces(&constants, motion, &acceleration);
            assert!(with(&motion, Vector6::zeros()).is_ok(), "{mode:?}");
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                for k in 0..LEGS {
                    let mut acceleration = Vector6::zeros();
                    acceleration[k] = number;
                    let mut moved = motion;
                    moved.acceleration.linear[k % 3] = number;
                    let found = match mode.acts_on_legs() {
                        true => with(&motion, acceleration),
                        false => with(&moved, Vector6::zeros()),
                    };
                    assert_eq!(
                        found,
                        Err(DiagnosticCode::ForceNotFinite.into()),
                        "{mode:?}: {number} in {k}"
                    );
                }
            }
        }
    }
}
