//! Control loops of a deployment, and the stability margin of each.

use core::f64::consts::TAU;
use core::fmt;

use super::deployment::{Deployment, STABLE_MASSES};
use crate::analysis::sampled_loop::{MAX_DELAY_PERIODS, SampledLoop};
use crate::control::estimator::SENT_ACCELERATIONS;

/// Control loop with the longest delay that the daemon may have.
#[derive(Clone, Copy, Debug)]
pub struct ControlLoop {
    /// Name for people: `position`, `orientation` or `legs`.
    pub name: &'static str,
    /// Natural frequency of the error dynamics \[Hz\].
    pub bandwidth_hz: f64,
    /// Cycles per second \[Hz\].
    pub rate_hz: f64,
    /// The loop without units, with its longest delay in periods; its margins decide stability.
    pub sampled: SampledLoop,
}

/// The loops of position and orientation, or that of the stiffest mode of the legs.
pub fn loops(deployment: &Deployment) -> Vec<ControlLoop> {
    let control = &deployment.control;
    let [position, orientation] = [
        (control.position_bandwidth_hz, control.position_damping_ratio),
        (control.orientation_bandwidth_hz, control.orientation_damping_ratio),
    ];
    let each = if control.mode.acts_on_legs() {
        vec![("legs", position, control.leg_masses.stiffest)]
    } else {
        vec![("position", position, 1.0), ("orientation", orientation, 1.0)]
    };
    let with = |(name, (bandwidth_hz, damping_ratio), gain): (_, (f64, f64), f64)| ControlLoop {
        name,
        bandwidth_hz,
        rate_hz: deployment.realtime.rate_hz,
        sampled: SampledLoop {
            estimator_ratio: control.estimator_bandwidth_hz / bandwidth_hz,
            compensates_disturbance: control.compensate_disturbances,
            ..deployment.realtime.sampled_loop(bandwidth_hz, damping_ratio, deployment.drive.total_delay_s())
        }
        .with_feedback_gain(gain),
    };
    each.into_iter().map(with).collect()
}

/// Masses of the platform over that of the model with which the loop must stand the age of its measurements. Less than
/// [`STABLE_MASSES`]: a driver so slow is rare, and so is a model so wrong.
const MASSES_AT_LONGEST_AGE: [f64; 2] = [0.9, 1.1];

/// Largest constant age of the measurements with which all loops are stable, and the estimator knows what was sent since \[s\].
/// No less than the age that the measurements have in any case.
pub fn longest_age_s(deployment: &Deployment) -> f64 {
    let recorded = SENT_ACCELERATIONS as f64 - 1.0;
    let recorded_s = recorded * deployment.realtime.period_s() - deployment.drive.total_delay_s();
    stable_age_s(deployment).min(recorded_s)
}

fn stable_age_s(deployment: &Deployment) -> f64 {
    let delays = loops(deployment).into_iter().map(|ControlLoop { sampled, .. }| {
        sampled.longest_known_delay(&MASSES_AT_LONGEST_AGE).max(sampled.delay)
    });
    delays.fold(f64::INFINITY, f64::min) * deployment.realtime.period_s() - deployment.drive.total_delay_s()
}

/// Warning if control without measurements may last longer than the loop stands measurements of that age.
pub fn timeout_warning(deployment: &Deployment) -> Option<String> {
    let [timeout_ms, age_ms] = [deployment.timeouts.measured_s, stable_age_s(deployment)].map(|s| 1e3 * s);
    (timeout_ms > age_ms).then(|| {
        format!(
            "timeouts.measured_ms = {timeout_ms} is more than {age_ms:.1} ms, the largest age of measurements with which the \
             loop is stable: older ones are refused when they arrive, and without any the platform is not controlled for so long"
        )
    })
}

impl ControlLoop {
    /// Warning where a mass that is plausible would make the loop unstable.
    pub fn warning(&self) -> Option<String> {
        let Self { name, sampled, .. } = self;
        let delay = sampled.delay;
        if !sampled.is_stable() {
            return Some(format!(
                "{name} loop: with {delay:.2} periods of delay it is not stable: lower the bandwidths or the damping ratios"
            ));
        }
        let (lightest, heaviest) = (1.0 / sampled.gain_margin(), 1.0 / sampled.least_gain());
        let [light, heavy] = STABLE_MASSES;
        (lightest > light || heaviest < heavy).then(|| {
            format!(
                "{name} loop: with {delay:.2} periods of delay it is stable with {lightest:.2} to {heaviest:.2} of the modelled \
                 mass only; {light} to {heavy} is advisable: lower the bandwidths, or shorten the delay"
            )
        })
    }
}

/// The loop, its margin with its delay, and the delay at which it would be unstable.
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
            sampled.delay,
            limit * rate_hz / TAU,
        )
    }
}
