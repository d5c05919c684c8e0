//! Force limits: magnitude and rate of change of the actuator forces.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::limits::{Limit, LimitSet};
use crate::model::LEGS;
use crate::model::fidelity::Gravity;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::rigid::{Motion, Pose, Wrench};

/// Forces of one cycle, after the limits.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control) struct LimitedForces {
    /// Actuator forces \[N\].
    pub force: [f64; LEGS],
    /// Wrench of the limited forces minus wrench of the commanded forces, about C; zero if no limit acts.
    pub wrench_error: Wrench,
    pub active_limits: LimitSet,
}

/// Last stage of the cycle: limits magnitude and rate of the forces.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct ForceLimiter {
    /// Forces of the last cycle under control \[N\].
    last: [f64; LEGS],
    /// Whether a limit changed them.
    is_limited: bool,
}

impl ForceLimiter {
    /// Limits the forces of a motion. Fails if the weight cannot be computed.
    /// The rate is limited from the second cycle under control on.
    pub fn limit(
        &mut self,
        cycle: &Cycle<'_>,
        commanded: &[f64; LEGS],
        motion: &Motion,
        limited: &mut LimitedForces,
    ) -> Result<(), Diagnostic> {
        let Cycle { constants, state, .. } = *cycle;
        let possible = limit_magnitude(constants, commanded, motion)?;
        let force = if state.has_control() { self.limit_rate(constants, &possible) } else { possible };
        limited.force = force;
        limited.active_limits = LimitSet::default()
            .with(Limit::Force, possible != *commanded)
            .with(Limit::ForceRate, force != possible);
        (self.last, self.is_limited) = (force, force != *commanded);
        if self.is_limited {
            limited.wrench_error = wrench_error(constants, &motion.pose, &force, commanded);
        }
        Ok(())
    }

    /// Limits the change of force since the last cycle. All legs are scaled by one factor.
    fn limit_rate(&self, constants: &Constants, force: &[f64; LEGS]) -> [f64; LEGS] {
        let parameters = &constants.parameters;
        let change = parameters.force_rate * parameters.period_ns as f64 * 1e-9;
        scale_into_bounds(&self.last, force, |last| (last - change, last + change))
    }
}

// Rarely called, hence out of line: the cycle stays short.
#[inline(never)]
fn wrench_error(constants: &Constants, pose: &Pose, force: &[f64; LEGS], commanded: &[f64; LEGS]) -> Wrench {
    let difference = Vector6::from(*force) - Vector6::from(*commanded);
    Wrench::from_vector(&(leg_wrenches(constants.machine(), pose) * difference))
}

/// Limits the magnitude. The share of the forces that carries the weight is kept; one factor reduces the
/// rest, so that the rest keeps its direction.
fn limit_magnitude(
    constants: &Constants,
    force: &[f64; LEGS],
    motion: &Motion,
) -> Result<[f64; LEGS], Diagnostic> {
    let limit = constants.machine().actuator.max_force;
    if force.iter().all(|value| value.abs() <= limit) {
        return Ok(*force);
    }
    let weight = constants.dynamics.forces::<Gravity>(motion).ok_or(DiagnosticCode::SingularPose)?;
    Ok(scale_into_bounds(&weight.map(|value| value.max(-limit).min(limit)), force, |_| (-limit, limit)))
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
