//! What happened, and how near to its bounds.

use hexad::control::controller::Output;
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::limits::Limits;
use hexad::control::signals::state::State;
use hexad::model::rigid::{Acceleration, Pose, Twist};
use hexad::model::task::TaskState;

use hexad_support::largest;

/// One cycle. Pose, twist and acceleration are the platform's own, at the end of it.
#[derive(Clone, Copy)]
pub struct Sample {
    pub time_ns: u64,
    pub output: Output,
    /// Without one the output is the default.
    pub has_daemon: bool,
    pub pose: Pose,
    pub twist: Twist,
    /// X, if somebody says one.
    pub setpoint: Option<TaskState>,
    /// `None` while the brakes have the platform.
    pub acceleration: Option<Acceleration>,
}

#[derive(Clone, Default)]
pub struct Recording {
    pub samples: Vec<Sample>,
}

/// Largest shares of their bounds while under control: of the forces, the platform's true motion, the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct Peaks {
    pub force: f64,
    pub force_rate: f64,
    pub acceleration: f64,
    pub jerk: f64,
    pub reference_acceleration: f64,
    pub reference_jerk: f64,
}

impl Recording {
    pub fn push(&mut self, sample: Sample) {
        self.samples.push(sample);
    }

    /// State and cause, wherever one of them changes.
    pub fn path(&self) -> Vec<(State, DiagnosticCode)> {
        let mut path: Vec<_> =
            self.samples.iter().map(|sample| (sample.output.state, sample.output.diagnostic.code)).collect();
        path.dedup();
        path
    }

    /// Forces, the platform's true motion and the reference, against their bounds.
    pub fn peaks(&self, parameters: &Parameters, max_force: f64) -> Peaks {
        let period_s = parameters.period_ns as f64 * 1e-9;
        let mut peaks = Peaks::default();
        let mut before: Option<&Sample> = None;
        for sample in &self.samples {
            let Some(now) = sample.acceleration.filter(|_| sample.output.state.has_control()) else {
                before = None;
                continue;
            };
            let wanted = |sample: &Sample| sample.output.reference.map(|reference| reference.acceleration);
            over(&mut peaks.force, largest(&sample.output.command_n) / max_force);
            over(&mut peaks.acceleration, acceleration_share(parameters, &now));
            if let Some(wanted) = wanted(sample) {
                over(&mut peaks.reference_acceleration, acceleration_share(parameters, &wanted));
            }
            if let Some(before) = before {
                let change = |(now, before): (&f64, &f64)| (now - before).abs();
                let step = sample
                    .output
                    .command_n
                    .iter()
                    .zip(&before.output.command_n)
                    .map(change)
                    .fold(0.0, f64::max);
                over(&mut peaks.force_rate, step / period_s / parameters.force_rate_n_s);
                let then = before.acceleration.unwrap_or_default();
                over(&mut peaks.jerk, jerk_share(parameters, &then, &now));
                if let Some((then, now)) = wanted(before).zip(wanted(sample)) {
                    over(&mut peaks.reference_jerk, jerk_share(parameters, &then, &now));
                }
            }
            before = Some(sample);
        }
        peaks
    }

    /// Seconds until the platform stands for good; `None` if it does not.
    pub fn time_to_rest(&self) -> Option<f64> {
        let moves = |sample: &Sample| sample.twist.vector().norm() > 1e-4;
        let begin = self.samples.first()?.time_ns;
        let seconds = |sample: &Sample| (sample.time_ns - begin) as f64 * 1e-9;
        match self.samples.iter().rposition(moves) {
            None => Some(0.0),
            Some(last) => Some(seconds(self.samples.get(last + 1)?)),
        }
    }
}

fn over(peak: &mut f64, share: f64) {
    *peak = peak.max(share);
}

/// The larger share of its limit, of position and orientation.
fn acceleration_share(parameters: &Parameters, now: &Acceleration) -> f64 {
    let Limits { position, orientation, .. } = &parameters.limits;
    (now.linear.norm() / position.acceleration).max(now.angular.norm() / orientation.acceleration)
}

/// The same of the mean jerk over a period.
fn jerk_share(parameters: &Parameters, then: &Acceleration, now: &Acceleration) -> f64 {
    let Limits { position, orientation, .. } = &parameters.limits;
    let linear = (now.linear - then.linear).norm() / position.jerk;
    let angular = (now.angular - then.angular).norm() / orientation.jerk;
    linear.max(angular) / (parameters.period_ns as f64 * 1e-9)
}
