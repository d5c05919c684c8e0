//! Control loops of a deployment, and the stability margin of each.

use core::f64::consts::TAU;
use core::fmt;

use super::deployment::{Control, Deployment, DeploymentLimits, Drive, Realtime, STABLE_MASS_RATIOS};
use crate::analysis::sampled_loop::{MAX_DELAY_PERIODS, SampledLoop, edge};
use hexad_core::control::law::estimator::SENT_ACCELERATIONS;

/// Control loop with the longest delay that the daemon may have.
#[derive(Clone, Copy, Debug)]
pub struct ControlLoop {
    /// Name in messages: `position`, `orientation` or `legs`.
    pub name: &'static str,
    /// Natural frequency of the error dynamics \[Hz\].
    pub bandwidth_hz: f64,
    /// Cycles per second \[Hz\].
    pub rate_hz: f64,
    /// The loop in dimensionless form, with its longest delay in periods. Its margins decide stability.
    pub sampled: SampledLoop,
}

/// The loops of position and orientation, or the loop of the stiffest mode of the legs.
pub fn loops(deployment: &Deployment) -> Vec<ControlLoop> {
    loops_of(&deployment.realtime, &deployment.control, &deployment.drive, &deployment.limits)
}

fn loops_of(
    realtime: &Realtime,
    control: &Control,
    drive: &Drive,
    limits: &DeploymentLimits,
) -> Vec<ControlLoop> {
    // Modes on legs compute the forces at the desired pose.
    let held_pole_t = if control.mode.acts_on_legs() { 0.0 } else { limits.held_pole_per_s };
    let [position, orientation] = [
        (control.position_bandwidth_hz, control.position_damping_ratio),
        (control.orientation_bandwidth_hz, control.orientation_damping_ratio),
    ];
    let each = if control.mode.acts_on_legs() {
        vec![("legs", position, control.leg_masses.stiffest_mode_gain_ratio)]
    } else {
        vec![("position", position, 1.0), ("orientation", orientation, 1.0)]
    };
    let with = |(name, (bandwidth_hz, damping_ratio), gain): (_, (f64, f64), f64)| ControlLoop {
        name,
        bandwidth_hz,
        rate_hz: realtime.rate_hz,
        sampled: SampledLoop {
            estimator_ratio: control.estimator_bandwidth_hz / bandwidth_hz,
            compensates_disturbance: control.compensate_disturbances,
            held_pole_t: held_pole_t * realtime.period_s(),
            ..realtime.sampled_loop(bandwidth_hz, damping_ratio, drive.total_delay_s())
        }
        .with_feedback_gain(gain),
    };
    each.into_iter().map(with).collect()
}

/// Masses of the platform, as ratios of the modelled mass, for which the loop must be stable at the longest age of its
/// measurements. The range is narrower than [`STABLE_MASS_RATIOS`]: so slow a driver and so wrong a model are both rare.
const MASSES_AT_LONGEST_AGE: [f64; 2] = [0.9, 1.1];

/// Largest constant age of the measurements with which all loops are stable and the estimator still has the
/// accelerations sent since \[s\]. At least the age that the measurements have in any case.
pub fn longest_stable_age_s(deployment: &Deployment) -> f64 {
    let recorded = SENT_ACCELERATIONS as f64 - 1.0;
    let recorded_s = recorded * deployment.realtime.period_s() - deployment.drive.total_delay_s();
    let Deployment { realtime, control, drive, limits, .. } = deployment;
    stable_age_s(realtime, control, drive, limits).min(recorded_s)
}

/// Largest constant age of the measurements with which all loops are stable \[s\].
fn stable_age_s(realtime: &Realtime, control: &Control, drive: &Drive, limits: &DeploymentLimits) -> f64 {
    let sampled =
        loops_of(realtime, control, drive, limits).into_iter().map(|it| it.sampled).filter(is_finite);
    let delays = sampled.map(|sampled| {
        sampled.longest_known_delay_periods(&MASSES_AT_LONGEST_AGE).max(sampled.delay_periods)
    });
    delays.fold(f64::INFINITY, f64::min) * realtime.period_s() - drive.total_delay_s()
}

/// The age \[s\], or the largest age with which all loops are stable if that is less. A loop with a rejected value is
/// left out.
pub(super) fn bounded_age_s(
    age_s: f64,
    realtime: &Realtime,
    control: &Control,
    drive: &Drive,
    limits: &DeploymentLimits,
) -> f64 {
    let delay = (age_s + drive.total_delay_s()) * realtime.rate_hz;
    let is_stable = |ControlLoop { sampled, .. }: ControlLoop| {
        !is_finite(&sampled) || sampled.is_stable_with_known_delay(delay, &MASSES_AT_LONGEST_AGE)
    };
    let are_stable =
        !delay.is_finite() || loops_of(realtime, control, drive, limits).into_iter().all(is_stable);
    if are_stable { age_s } else { age_s.min(stable_age_s(realtime, control, drive, limits)) }
}

/// Whether the values from which the loop follows were all accepted.
fn is_finite(sampled: &SampledLoop) -> bool {
    let SampledLoop { wn_t, damping_ratio, estimator_ratio, delay_periods, held_pole_t, .. } = *sampled;
    let values = [wn_t, damping_ratio, estimator_ratio, delay_periods, held_pole_t];
    values.iter().all(|value| value.is_finite())
}

/// `timeouts.measured_ms` beyond the age with which the loops are stable: its value and that age \[ms\].
pub fn unstable_timeout_ms(deployment: &Deployment) -> Option<(f64, f64)> {
    let Deployment { realtime, control, drive, limits, timeouts, .. } = deployment;
    let age_s = bounded_age_s(timeouts.measured_s, realtime, control, drive, limits);
    (timeouts.measured_s > age_s).then_some((1e3 * timeouts.measured_s, 1e3 * age_s))
}

impl ControlLoop {
    /// Largest bandwidth with which the loop is stable \[Hz\].
    pub fn largest_stable_hz(&self) -> f64 {
        self.sampled.largest_wn_t() * self.rate_hz / TAU
    }

    /// Error if the loop is unstable because of the pole of the platform under constant forces.
    pub fn beyond_held_pole(&self) -> Option<String> {
        let Self { name, rate_hz, sampled, .. } = self;
        let with = |held_pole_t| SampledLoop { held_pole_t, ..*sampled }.is_stable();
        if with(sampled.held_pole_t) || !with(0.0) {
            return None;
        }
        let stable = edge(0.0, sampled.held_pole_t, with) * rate_hz;
        Some(format!(
            "too large for the {name} loop: within it the platform leaves a pose whose forces are held with up to {:.1}/s, and \
             with {:.2} periods of delay the loop is stable to {stable:.1}/s; lower it, or raise realtime.rate_hz",
            sampled.held_pole_t * rate_hz,
            sampled.delay_periods,
        ))
    }

    /// Warning if a plausible mass would make the loop unstable.
    pub fn warning(&self) -> Option<String> {
        let Self { name, sampled, .. } = self;
        let delay = sampled.delay_periods;
        if !sampled.is_stable() {
            return Some(format!(
                "{name} loop: with {delay:.2} periods of delay it is not stable: lower the bandwidths or the damping ratios"
            ));
        }
        let (lightest, heaviest) = (1.0 / sampled.gain_margin(), 1.0 / sampled.least_gain());
        let [light, heavy] = STABLE_MASS_RATIOS;
        (lightest > light || heaviest < heavy).then(|| {
            format!(
                "{name} loop: with {delay:.2} periods of delay it is stable with {lightest:.2} to {heaviest:.2} of the modelled \
                 mass only; {light} to {heavy} is advisable: lower the bandwidths, or shorten the delay"
            )
        })
    }
}

/// Displays the loop, its margin with its delay, and the delay at which it becomes unstable.
impl fmt::Display for ControlLoop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, bandwidth_hz, rate_hz, sampled } = self;
        let (limit, margin, longest) =
            (sampled.largest_wn_t(), sampled.gain_margin(), sampled.longest_delay());
        let beyond = if longest < 0.99 * MAX_DELAY_PERIODS as f64 { "" } else { "more than " };
        write!(
            f,
            "{name:<12} bandwidth {bandwidth_hz:>6.2} Hz at {rate_hz:.0} Hz: wn T = {:.3}, with {:.2} periods of delay \
             stable to {limit:.3} ({:.2} Hz), gain margin {margin:.2}; stable to {beyond}{longest:.1} periods",
            sampled.wn_t,
            sampled.delay_periods,
            limit * rate_hz / TAU,
        )
    }
}
