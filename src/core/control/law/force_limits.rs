//! Force limits: magnitude and rate of change of the commands to the drives.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::limits::{Limit, LimitSet};
use crate::model::LEGS;
use crate::model::fidelity::Gravity;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::rigid::{Motion, Wrench};
use crate::model::transmission::Transmission;

/// Commands of one cycle, after the limits.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control) struct LimitedForces {
    /// Commands to the drives \[N\].
    pub command_n: [f64; LEGS],
    /// Wrench of the limited commands minus that of the wanted ones, about C; zero if no limit acts.
    pub wrench_error: Wrench,
    pub active_limits: LimitSet,
}

/// Last stage of the cycle: limits magnitude and rate of the commands.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct ForceLimiter {
    /// Commands of the last cycle under control \[N\].
    last: [f64; LEGS],
    /// Whether a limit changed them.
    is_limited: bool,
}

impl ForceLimiter {
    /// Limits the commands of a motion. Fails if the weight cannot be computed.
    /// The rate is limited from the second cycle under control on.
    pub fn limit(
        &mut self,
        cycle: &Cycle<'_>,
        wanted_n: &[f64; LEGS],
        (motion, transmission): (&Motion, &Transmission),
        limited: &mut LimitedForces,
    ) -> Result<(), Diagnostic> {
        let Cycle { constants, state, .. } = *cycle;
        let possible = limit_magnitude(constants, wanted_n, (motion, transmission))?;
        let command = if state.has_control() { self.limit_rate(constants, &possible) } else { possible };
        limited.command_n = command;
        limited.active_limits = LimitSet::default()
            .with(Limit::Force, possible != *wanted_n)
            .with(Limit::ForceRate, command != possible);
        (self.last, self.is_limited) = (command, command != *wanted_n);
        if self.is_limited {
            limited.wrench_error = wrench_error(constants, (motion, transmission), &command, wanted_n);
        }
        Ok(())
    }

    /// Limits the change since the last cycle. All legs are scaled by one factor.
    fn limit_rate(&self, constants: &Constants, command: &[f64; LEGS]) -> [f64; LEGS] {
        let parameters = &constants.parameters;
        let change = parameters.force_rate_n_s * parameters.period_ns as f64 * 1e-9;
        scale_into_bounds(&self.last, command, |last| (last - change, last + change))
    }
}

// Rarely called, hence out of line: the cycle stays short.
#[inline(never)]
fn wrench_error(
    constants: &Constants,
    (motion, transmission): (&Motion, &Transmission),
    command: &[f64; LEGS],
    wanted: &[f64; LEGS],
) -> Wrench {
    let [force, wanted] = [command, wanted].map(|command| Vector6::from(transmission.leg_forces(command)));
    Wrench::from_vector(&(leg_wrenches(constants.machine(), &motion.pose) * (force - wanted)))
}

/// Limits the magnitude. The share of the commands that carries the weight is kept; one factor reduces the
/// rest, so that the rest keeps its direction.
fn limit_magnitude(
    constants: &Constants,
    command: &[f64; LEGS],
    (motion, transmission): (&Motion, &Transmission),
) -> Result<[f64; LEGS], Diagnostic> {
    let limit = constants.machine().actuator.max_force_n;
    if command.iter().all(|value| value.abs() <= limit) {
        return Ok(*command);
    }
    let weight = constants.dynamics.forces::<Gravity>(motion).ok_or(DiagnosticCode::SingularPose)?;
    let weight = transmission.commands(&weight).map(|value| value.max(-limit).min(limit));
    Ok(scale_into_bounds(&weight, command, |_| (-limit, limit)))
}

/// Moves from `start`, which is within its bounds, toward `end` as far as all bounds allow.
fn scale_into_bounds(
    start: &[f64; LEGS],
    end: &[f64; LEGS],
    bounds: impl Fn(f64) -> (f64, f64),
) -> [f64; LEGS] {
    let is_within = |(start, end): (&f64, &f64)| {
        let (low, high) = bounds(*start);
        (low..=high).contains(end)
    };
    if start.iter().zip(end).all(is_within) {
        return *end;
    }
    let fraction = |(start, end): (&f64, &f64)| {
        let ((low, high), way) = (bounds(*start), end - start);
        let room = if way > 0.0 { high - start } else { low - start };
        if way == 0.0 { 1.0 } else { room / way }
    };
    let fraction = start.iter().zip(end).map(fraction).fold(1.0, f64::min).max(0.0);
    let mut reached = *end;
    if fraction < 1.0 {
        for (reached, start) in reached.iter_mut().zip(start) {
            let (low, high) = bounds(*start);
            *reached = (start + fraction * (*reached - start)).max(low).min(high);
        }
    }
    reached
}
