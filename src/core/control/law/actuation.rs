//! Actuation: commands of one cycle under control, from the reference and the estimated error.

use crate::control::cycle::Cycle;
use crate::control::law::error_tracker::ErrorTracker;
use crate::control::law::feedback_limiter::FeedbackLimiter;
use crate::control::law::force_limits::{ForceLimiter, LimitedForces};
use crate::control::law::forces::forces;
use crate::control::signals::diagnostic::Diagnostic;
use crate::control::signals::limits::Limit;
use crate::model::rigid::Motion;
use crate::model::transmission::Transmission;

/// Evaluates the control law. The commands act from `begin_ns` on; `desired` is the reference in the middle of
/// their hold. The acceleration that remains after all limits is recorded for the estimator.
#[inline(always)]
pub(in crate::control) fn actuate(
    cycle: &Cycle<'_>,
    begin_ns: u64,
    desired: Motion,
    errors: &mut ErrorTracker,
    (feedback, limiter): (&mut FeedbackLimiter, &mut ForceLimiter),
    limited: &mut LimitedForces,
) -> Result<(), Diagnostic> {
    let constants = cycle.constants;
    let parameters = &constants.parameters;
    let estimator = errors.estimator();
    let mut at_begin = *estimator.estimate_at_last_measurement();
    estimator.predict(&mut at_begin, begin_ns);
    let wanted = parameters.law.commanded_acceleration(&at_begin, &constants.acceleration_by_command);
    let acceleration = feedback.limit(cycle, &desired.acceleration, &wanted);
    let mut sent = constants.acceleration_by_command.feedback_acceleration(&acceleration);
    let in_middle = at_begin.after(0.5 * parameters.period_s(), &sent);
    let error = errors.corrected_to_last_measurement(&in_middle);
    let motion = parameters.law.motion_for_inverse_dynamics(desired, &error, &acceleration);
    let force = forces(constants, &motion, &acceleration)?;
    let transmission = Transmission::of_motion(constants.machine(), &motion);
    let command = transmission.commands(&force);
    limiter.limit(cycle, &command, (&motion, &transmission), limited)?;
    limited.active_limits.check(Limit::Compensation, parameters.law.compensation_ratio(&at_begin));
    if limited.command_n != command {
        let (machine, missing) = (constants.machine(), &limited.wrench_error);
        let missing =
            constants.acceleration_by_command.acceleration_by_wrench(machine, &motion.pose, missing);
        sent.0 += missing.0;
        errors.record_removed_acceleration(constants, &missing);
    }
    errors.record_sent(begin_ns, &sent, &transmission.leg_forces(&limited.command_n));
    Ok(())
}
