//! The forces of a cycle, within what the actuators and the deployment allow.

use nalgebra::Vector6;

use super::{Controller, Output, Parameters};
use crate::control::law::{ControlMode, Deviation};
use crate::control::limits::Limit;
use crate::control::state::{Cause, Trouble};
use crate::model::fidelity::{Fidelity, Gravity};
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::machine::LEGS;
use crate::model::rigid::{Motion, Pose, Wrench};

impl Controller {
    /// The forces of this cycle, or why there are none.
    pub(super) fn control(&mut self, release_ns: u64, output: &mut Output) -> Result<(), Trouble> {
        let error = output.error.ok_or(Cause::SetpointLost)?;
        let Parameters { period_ns, law, fidelity, .. } = &self.parameters;
        // The force is held for one period from about the release on.
        let middle_of_hold_ns = release_ns.saturating_add(period_ns / 2);
        let desired = self.reference_at(middle_of_hold_ns);
        // Motions are long: borrowed, not copied.
        let desired = desired.as_ref().ok_or(Cause::SetpointLost)?;
        let deviation = self.known_error.map_or(Deviation::from(&error), |known| known.acted_on);
        let asked = self.observer.asks(law, &deviation, *period_ns as f64 * 1e-9);
        let command;
        let (motion, fidelity) = match law.mode {
            ControlMode::ComputedTorque => {
                command = law.command(desired, &error, &asked);
                (&command, Some(*fidelity))
            }
            ControlMode::FeedforwardJointPd => (desired, Some(*fidelity)),
            ControlMode::GravityJointPd => (desired, Some(Fidelity::Gravity)),
            ControlMode::JointPd => (desired, None),
        };
        let mut force = if law.mode.acts_on_legs() { law.leg_forces(&asked) } else { [0.0; LEGS] };
        if let Some(fidelity) = fidelity {
            let modelled = self.model.forces_of(fidelity, motion).ok_or(Cause::SingularPose)?;
            force.iter_mut().zip(modelled).for_each(|(force, modelled)| *force += modelled);
        }
        if force.iter().any(|value| !value.is_finite()) {
            return Err(Cause::ForceNotFinite.into());
        }
        let limited = self.within_limit(&force, motion)?;
        output.force = self.within_rate(limited);
        output.limiting = output
            .limiting
            .with(Limit::Force, limited != force)
            .with(Limit::ForceRate, output.force != limited);
        if output.force != force {
            self.observer.expect_nothing();
            output.wrench_error = self.wrench_error(&motion.pose, &output.force, &force);
        }
        Ok(())
    }

    /// What the platform gets more than was asked for.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn wrench_error(&self, pose: &Pose, force: &[f64; LEGS], asked: &[f64; LEGS]) -> Wrench {
        let more = Vector6::from(*force) - Vector6::from(*asked);
        Wrench::from_vector(&(leg_wrenches(self.model.machine(), pose) * more))
    }

    /// Forces beyond the limit keep what holds the platform up and lose the same share of all else, so that
    /// what is left pushes in the direction that was meant.
    fn within_limit(&self, force: &[f64; LEGS], motion: &Motion) -> Result<[f64; LEGS], Trouble> {
        let limit = self.model.machine().actuator.max_force;
        if force.iter().all(|value| value.abs() <= limit) {
            return Ok(*force);
        }
        let weight = self.model.forces::<Gravity>(motion).ok_or(Cause::SingularPose)?;
        Ok(toward(&weight.map(|value| value.max(-limit).min(limit)), force, |_| (-limit, limit)))
    }

    /// Forces that change no faster than they may, all by the same share of the change that was meant.
    fn within_rate(&self, force: [f64; LEGS]) -> [f64; LEGS] {
        let Some(before) = &self.force else { return force };
        let most = self.parameters.force_rate * self.parameters.period_ns as f64 * 1e-9;
        toward(before, &force, |before| (before - most, before + most))
    }
}

/// From `start`, which is within its bounds, so far toward `end` as all bounds allow.
fn toward(start: &[f64; LEGS], end: &[f64; LEGS], bounds: impl Fn(f64) -> (f64, f64)) -> [f64; LEGS] {
    let share = |(start, end): (&f64, &f64)| {
        let ((low, high), way) = (bounds(*start), end - start);
        let room = if way > 0.0 { high - start } else { low - start };
        if way == 0.0 { 1.0 } else { room / way }
    };
    let share = start.iter().zip(end).map(share).fold(1.0, f64::min).max(0.0);
    let mut reached = *end;
    if share < 1.0 {
        for (reached, start) in reached.iter_mut().zip(start) {
            let (low, high) = bounds(*start);
            *reached = (start + share * (*reached - start)).max(low).min(high);
        }
    }
    reached
}
