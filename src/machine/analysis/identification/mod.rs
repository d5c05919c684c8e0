//! Identification: masses, inertias, friction and force scales of a machine, from recorded motions.
//!
//! | step | file |
//! | --- | --- |
//! | motion and commands of a recording at the same instants, smoothed alike | [`mod@samples`] |
//! | equations, linear in parameters and force scales, and their QR decomposition | `equations` |
//! | parameters such that every value is a machine that can be built, and how far from its file it may be | `parameters` |
//! | most probable parameters, their deviations | `fit` |
//! | base parameters by the equations alone | `least_squares` |
//! | whether the residuals are noise, and what the model lacks otherwise | `examination`, `hypotheses` |
//!
//! Equations alone do not distinguish all parameters, see [`hexad_core::model::regressor`]: what they leave open stays as the file
//! has it. Without a known weight on the platform in one of the recordings no motion distinguishes the mean of the force
//! scales from all masses and friction: then the mean stays as it is.

use nalgebra::DVector;

use self::equations::{Equation, SAMPLES_PER_EQUATION, SCALE, equations};
use self::fit::{Fit, fit};
use self::least_squares::least_squares;
use self::parameters::{Bodies, FREE_PARAMETER_COUNT, Free, Parameters};
use crate::analysis::excitation_design::base_parameter_values;
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::machine::{Machine, Platform};
use hexad_core::model::regressor::DynamicParameters;
use hexad_core::motion::excitation::PERIOD_S;

mod equations;
mod examination;
mod fit;
mod hypotheses;
mod least_squares;
mod parameters;
pub mod samples;

pub use self::equations::Load;
pub use self::examination::{Examination, Finding};
pub use self::hypotheses::Cause;
pub use self::samples::{MotionSample, samples};

/// Samples of one recording, and what was on the platform.
#[derive(Clone, Debug)]
pub struct Run {
    /// Samples.
    pub samples: Vec<MotionSample>,
    /// Body on the platform.
    pub load: Load,
}

/// Identified machine.
#[derive(Clone, Debug)]
pub struct Identification {
    /// The machine, without the known weights and without the payload.
    pub machine: Machine,
    /// The payload; meaningless if no run had one.
    pub payload: Platform,
    /// Equations that were used.
    pub equations: usize,
    /// Number of combinations of parameters that the equations show better than they were known before, and of the others.
    pub shown: usize,
    /// See above.
    pub unknown: usize,
    /// RMS of what is left of the force of each leg \[N\].
    pub residual_n: [f64; LEGS],
    /// Correlation of successive residuals of each leg: 0 for white noise.
    pub correlation: [f64; LEGS],
    /// Base parameters by least squares of the equations alone, without prior: pairs of an index and a value. Indices count
    /// the parameters of the [regressor](hexad_core::model::regressor), then six force scales, six products of force scale and load friction, and the
    /// parameters of the payload. `None` without a known weight, or if the equations do not determine them.
    pub base_parameters: Option<Vec<(usize, f64)>>,
    /// Whether a known weight shows the mean of the force scales, or the machine is held.
    is_scale_known: bool,
    parameters: Parameters,
    fit: Fit,
}

/// A value and its standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimated {
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Value of the file, and the deviation that was expected of it.
    pub before: f64,
    /// See above.
    pub expected: f64,
}

/// Identifies a machine from runs; `None` if they do not have enough equations. With `holds_machine` only the payload is
/// identified.
pub fn identify(file: &Machine, runs: &[Run], holds_machine: bool) -> Option<Identification> {
    let mut parameters = Parameters::new(file);
    if holds_machine {
        parameters.hold_machine();
    }
    let all: Vec<Equation> = runs.iter().flat_map(|run| equations(file, &run.samples, &run.load)).collect();
    let has_known_weight = runs.iter().any(|run| matches!(run.load, Load::Known { .. }));
    let is_scale_known = holds_machine || has_known_weight;
    let fit = fit(&parameters, &all, file.actuator.max_force_n, is_scale_known)?;
    let Bodies { machine, payload } = parameters.bodies(&fit.free);
    let Fit { shown, unknown, residual_n, correlation, .. } = fit;
    Some(Identification {
        machine,
        payload,
        equations: all.len(),
        shown,
        unknown,
        residual_n,
        correlation,
        base_parameters: least_squares(file, &all).filter(|_| has_known_weight),
        is_scale_known,
        parameters,
        fit,
    })
}

/// How far a machine may be from its file before anything is recorded: standard deviations of its base parameters, see
/// [`base_parameter_values`].
pub fn expected_deviations(file: &Machine) -> DynamicParameters {
    let parameters = Parameters::new(file);
    let at = |free: &Free| base_parameter_values(&parameters.bodies(free).machine);
    let mut squares = DynamicParameters::zeros();
    for (index, deviation) in parameters.deviation.iter().enumerate() {
        let step = Free::from_fn(|row, _| if row == index { DIFFERENCE * deviation } else { 0.0 });
        let change = at(&(parameters.prior + step)) - at(&(parameters.prior - step));
        squares += (change / (2.0 * DIFFERENCE)).map(|change| change * change);
    }
    squares.map(f64::sqrt)
}

impl Identification {
    /// Tests whether the model explains the runs that were identified, and widens the deviations by what it lacks and by the deviation
    /// of the delay with which their samples were made. `None` if a pose is singular.
    pub fn examine(&mut self, runs: &[Run], delay_deviation_s: f64) -> Option<Examination> {
        let Self { machine, parameters, fit, is_scale_known, .. } = self;
        let runs: Vec<_> =
            runs.iter().map(|run| (run, equations(machine, &run.samples, &run.load))).collect();
        examination::examine((machine, parameters, fit), &runs, *is_scale_known, delay_deviation_s)
    }

    /// A quantity of machine and payload with its deviation.
    pub fn estimate(&self, quantity: impl Fn(&Machine, &Platform) -> f64) -> Estimated {
        let Self { parameters, fit: Fit { free, covariance, .. }, .. } = self;
        let at = |free: &Free| {
            let Bodies { machine, payload } = parameters.bodies(free);
            quantity(&machine, &payload)
        };
        let gradient = DVector::from_fn(FREE_PARAMETER_COUNT, |index, _| {
            let step = Free::from_fn(|row, _| {
                if row == index { DIFFERENCE * parameters.deviation.row(index).x } else { 0.0 }
            });
            (at(&(free + step)) - at(&(free - step))) / (2.0 * DIFFERENCE * parameters.deviation.row(index).x)
        });
        let scaled = gradient.component_mul(&DVector::from_iterator(
            FREE_PARAMETER_COUNT,
            parameters.deviation.iter().copied(),
        ));
        Estimated {
            value: at(free),
            deviation: gradient.dot(&(covariance * &gradient)).max(0.0).sqrt(),
            before: at(&parameters.prior),
            expected: scaled.norm(),
        }
    }
}

/// Step of differences, over the deviation of a parameter.
const DIFFERENCE: f64 = 1e-4;

impl Run {
    /// Time from the first to the last sample \[s\].
    pub fn duration_s(&self) -> f64 {
        self.samples.first().zip(self.samples.last()).map_or(0.0, |(first, last)| last.time_s - first.time_s)
    }

    /// Time of which a prediction is the mean \[s\].
    pub fn group_s(&self) -> f64 {
        let steps = self.samples.iter().zip(self.samples.iter().skip(1)).map(|(a, b)| b.time_s - a.time_s);
        SAMPLES_PER_EQUATION as f64 * steps.fold(f64::INFINITY, f64::min)
    }
}

/// Command of a leg in a run, mean of a group of samples, and what a machine does not explain of it.
#[derive(Clone, Copy, Debug)]
pub struct Prediction {
    /// Leg.
    pub leg: usize,
    /// First instant of the group, since the first release of the stretch \[s\].
    pub time_s: f64,
    /// Length \[m\] and rate \[m/s\] of the leg in the middle of the group.
    pub motion: [f64; 2],
    /// Recorded command \[N\].
    pub command_n: f64,
    /// Recorded command less the machine's \[N\].
    pub residual_n: f64,
}

/// Predictions of the commands of a run. A leg that nearly stands has none.
pub fn predictions(machine: &Machine, run: &Run) -> Vec<Prediction> {
    let parameters = Parameters::new(machine);
    let unknowns = parameters.unknowns(&parameters.prior);
    let prediction = |equation: Equation| {
        let command_n = equation.coefficients.row(SCALE + equation.leg).x;
        let residual_n = fit::residual(&equation, &unknowns);
        let middle = run
            .samples
            .get(equation.first + SAMPLES_PER_EQUATION / 2)
            .map(|sample| leg_motion(machine, &sample.motion));
        let of_leg = |values: [f64; LEGS]| values.get(equation.leg).copied().unwrap_or_default();
        let motion = middle.map_or([f64::NAN; 2], |legs| [of_leg(legs.length_m), of_leg(legs.rate_m_s)]);
        Prediction { leg: equation.leg, time_s: equation.time_s, motion, command_n, residual_n }
    };
    equations(machine, &run.samples, &run.load).into_iter().map(prediction).collect()
}

/// Largest distance of lengths and rates that are the same in the next period, as a ratio of stroke and largest rate, and of the
/// instants \[s\].
const SAME_RATIO: f64 = 2e-3;
const SAME_S: f64 = 5e-3;

/// Of the commands of each leg that a machine does not explain \[N\]: RMS of what is the same in each [period](PERIOD_S) of a
/// motion, and of what differs from one to the next, which no model can explain. `None` if no run has two periods.
pub fn repeated_and_changing_errors(machine: &Machine, runs: &[Run]) -> Option<[[f64; 2]; LEGS]> {
    let actuator = &machine.actuator;
    let largest = [actuator.max_length_m - actuator.min_length_m, actuator.max_rate_m_s];
    let mut sums = [[0.0; 3]; LEGS];
    for run in runs {
        let predictions = predictions(machine, run);
        for (leg, [count, same, different]) in sums.iter_mut().enumerate() {
            let of_leg: Vec<_> = predictions.iter().filter(|each| each.leg == leg).collect();
            for one in &of_leg {
                let later_s = one.time_s + PERIOD_S - SAME_S;
                let Some(other) = of_leg.get(of_leg.partition_point(|each| each.time_s < later_s)) else {
                    break;
                };
                let pairs = one.motion.iter().zip(other.motion).zip(largest);
                let is_same = other.time_s < later_s + 2.0 * SAME_S
                    && pairs.into_iter().all(|((a, b), most)| (a - b).abs() < SAME_RATIO * most);
                if is_same {
                    *count += 1.0;
                    *same += one.residual_n * other.residual_n;
                    *different += 0.5 * (one.residual_n - other.residual_n).powi(2);
                }
            }
        }
    }
    let has_period = sums.iter().all(|[count, ..]| *count > 0.0);
    has_period.then(|| {
        sums.map(|[count, same, different]| [same, different].map(|sum| (sum / count).max(0.0).sqrt()))
    })
}

/// RMS and largest part of the commands of each leg \[N\] in runs that a machine does not explain; NaN for a leg that nearly
/// stands.
pub fn prediction_errors(machine: &Machine, runs: &[Run]) -> [[f64; 2]; LEGS] {
    let mut errors = [(0.0, f64::NAN, 0_u32); LEGS];
    for Prediction { leg, residual_n, .. } in runs.iter().flat_map(|run| predictions(machine, run)) {
        if let Some((squares, largest, count)) = errors.get_mut(leg) {
            (*squares, *largest, *count) =
                (*squares + residual_n * residual_n, largest.max(residual_n.abs()), *count + 1);
        }
    }
    errors.map(|(squares, largest, count)| [(squares / f64::from(count)).sqrt(), largest])
}
