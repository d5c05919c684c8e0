//! Force error of each fidelity over an envelope or a trajectory, and the cheapest fidelity within a tolerance.
//!
//! The error of a fidelity is the difference of its six forces from the exact model's, relative to the peak force of the
//! same motions. An envelope is evaluated at an even spread over the inside, at its corners, and, because the worst point
//! of 18 dimensions is rarely among them, at the end of a coordinate ascent from the worst of those, for each fidelity and
//! leg.
//!
//! A share is the largest of three: largest error over peak of the even spread, of the corners, and of all points with
//! the ends of the ascents. Corners raise both error and peak: the choice must hold for the inside alone as well.
//!
//! The result is sampled, not proved; `TOLERANCE_MARGIN` covers errors between samples. Points outside of the actuators'
//! stroke and singular poses are counted and passed over.

use super::envelope::{CORNER_COUNT, DIMENSIONS, EnvelopePoint, MotionEnvelope};
use super::fidelity_error::{ErrorStatistics, FIDELITY_COUNT, FidelitySample, largest};
use super::reachable_envelope::within_stroke;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::{Exact, Fidelity};

/// Points of the even spread that are evaluated. Eight times as many change the figures by a few per cent; this many
/// take a fraction of a second when the daemon starts.
pub const SPREAD_POINTS: u32 = 1 << 15;

/// Factor on a share before it is compared with a tolerance, for errors between the samples: 200,000 other points of
/// the inside had up to 1.13 times as large a share where poses next to singular ones are in reach, and 1.02 elsewhere.
const TOLERANCE_MARGIN: f64 = 1.05;

/// Most points drawn, where most of an envelope is out of reach.
const MAX_DRAWN_POINTS: u32 = 4 * SPREAD_POINTS;

/// Last step of an ascent as a share of the envelope; the first is as wide as the envelope.
const MIN_ASCENT_STEP: f64 = 1.0 / 64.0;

/// Most sweeps over all dimensions with steps of one width; two are usual.
const MAX_SWEEPS_PER_STEP: u32 = 4;

/// Force error of one fidelity over an envelope or a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FidelityForceErrors {
    /// The fidelity.
    pub fidelity: Fidelity,
    /// Mean over the even spread, or over the rows \[N\].
    pub mean_n: f64,
    /// Root mean square over the same \[N\].
    pub rms_n: f64,
    /// Largest over all points \[N\].
    pub max_n: f64,
    /// The largest error as a share of the peak force, as the head of this file says.
    pub share: f64,
}

/// Comparison of all fidelities with the exact model, over an envelope or a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FidelityComparison {
    /// Statistics of the even spread, or of the rows.
    pub inside: ErrorStatistics,
    /// Statistics of all points.
    pub all: ErrorStatistics,
    /// In the order of [`Fidelity::ALL`].
    pub errors: [FidelityForceErrors; FIDELITY_COUNT],
}

impl FidelityComparison {
    /// Comparison over an envelope, at 200,000 points at most.
    pub fn of_envelope(model: &InverseDynamics, envelope: &MotionEnvelope) -> Self {
        let (mut inside, mut edge) = (ErrorStatistics::default(), ErrorStatistics::default());
        let mut worst = [[WorstPoint::default(); LEGS]; FIDELITY_COUNT];
        let evaluate = |point: &EnvelopePoint,
                        statistics: &mut ErrorStatistics,
                        worst: &mut [[WorstPoint; LEGS]; FIDELITY_COUNT]| {
            let sample = FidelitySample::take(model, &envelope.at(point));
            statistics.add(&sample);
            if let Ok(sample) = sample {
                let errors = sample.errors_n.as_flattened();
                worst
                    .as_flattened_mut()
                    .iter_mut()
                    .zip(errors)
                    .for_each(|(worst, e)| worst.update(*e, point));
            }
        };
        for k in 0..MAX_DRAWN_POINTS {
            evaluate(&MotionEnvelope::spread(k), &mut inside, &mut worst);
            if inside.evaluated >= u64::from(SPREAD_POINTS) {
                break;
            }
        }
        for k in 0..CORNER_COUNT {
            evaluate(&envelope.corner(k), &mut edge, &mut worst);
        }
        let mut all = inside.and(&edge);
        let mut peak = all.peak_n;
        for (fidelity, (errors, worst)) in Fidelity::ALL.into_iter().zip(all.errors.iter_mut().zip(&worst)) {
            for (leg, start) in worst.iter().enumerate() {
                let top = ascend(model, envelope, fidelity, leg, start);
                errors.max_n = errors.max_n.max(top.error);
                let forces = model.forces::<Exact>(&envelope.at(&top.point).motion());
                peak = peak.max(forces.map_or(0.0, |forces| largest(&forces)));
            }
        }
        all.peak_n = peak;
        Self::new(&[inside, edge], all)
    }

    /// Comparison over the rows of a trajectory.
    pub fn of_rows(rows: ErrorStatistics) -> Self {
        Self::new(&[rows], rows)
    }

    /// The first part is the inside.
    fn new(parts: &[ErrorStatistics], all: ErrorStatistics) -> Self {
        let inside = parts.first().copied().unwrap_or_default();
        let nothing = FidelityForceErrors {
            fidelity: Fidelity::Exact,
            mean_n: 0.0,
            rms_n: 0.0,
            max_n: 0.0,
            share: 0.0,
        };
        let mut errors = [nothing; FIDELITY_COUNT];
        for (number, (error, fidelity)) in errors.iter_mut().zip(Fidelity::ALL).enumerate() {
            let errors =
                |statistics: &ErrorStatistics| statistics.errors.get(number).copied().unwrap_or_default();
            let share = |statistics: &ErrorStatistics| share(errors(statistics).max_n, statistics.peak_n);
            *error = FidelityForceErrors {
                fidelity,
                mean_n: inside.mean(&errors(&inside)),
                rms_n: inside.rms(&errors(&inside)),
                max_n: errors(&all).max_n,
                share: parts.iter().map(share).fold(share(&all), f64::max),
            };
        }
        Self { inside, all, errors }
    }

    /// The fidelities whose largest error is within a tolerance, given as a share of the peak force, less 5 %; in the
    /// order of [`Fidelity::ALL`], which is the same on every computer, as measured times are not. The last one is the
    /// exact model.
    pub fn within(&self, tolerance: f64) -> impl Iterator<Item = &FidelityForceErrors> {
        self.errors.iter().filter(move |error| TOLERANCE_MARGIN * error.share <= tolerance)
    }

    /// The cheapest of [`FidelityComparison::within`] that a control law can use.
    pub fn choice(&self, tolerance: f64) -> Fidelity {
        self.within(tolerance)
            .map(|error| error.fidelity)
            .find(|fidelity| fidelity.has_inertia())
            .unwrap_or(Fidelity::Exact)
    }
}

/// Point with the largest error of one fidelity and leg.
#[derive(Clone, Copy, Debug)]
struct WorstPoint {
    error: f64,
    point: EnvelopePoint,
}

impl Default for WorstPoint {
    fn default() -> Self {
        Self { error: 0.0, point: EnvelopePoint::zeros() }
    }
}

impl WorstPoint {
    fn update(&mut self, error: f64, point: &EnvelopePoint) {
        if error > self.error {
            *self = Self { error, point: *point };
        }
    }
}

/// Coordinate ascent of the error of one fidelity and leg along the axes of the envelope, with steps that are halved where
/// none increases it.
fn ascend(
    model: &InverseDynamics,
    envelope: &MotionEnvelope,
    fidelity: Fidelity,
    leg: usize,
    start: &WorstPoint,
) -> WorstPoint {
    let error_at = |point: &EnvelopePoint| -> Option<f64> {
        let state = envelope.at(point);
        if !within_stroke(model.machine(), &state) {
            return None;
        }
        let motion = state.motion();
        let (exact, force) =
            (model.forces_of(Fidelity::Exact, &motion)?, model.forces_of(fidelity, &motion)?);
        Some((force.get(leg)? - exact.get(leg)?).abs()).filter(|error| error.is_finite())
    };
    let mut best = *start;
    let mut step = 1.0;
    // The exact model has no error.
    while best.error > 0.0 && step >= MIN_ASCENT_STEP {
        for _ in 0..MAX_SWEEPS_PER_STEP {
            let before = best.error;
            for (axis, signed_step) in (0..DIMENSIONS).flat_map(|axis| [(axis, step), (axis, -step)]) {
                let mut point = best.point;
                if let Some(share) = point.get_mut(axis) {
                    *share = (*share + signed_step).clamp(0.0, 1.0);
                }
                best.update(error_at(&point).unwrap_or(0.0), &point);
            }
            if best.error <= before {
                break;
            }
        }
        step *= 0.5;
    }
    best
}

/// Error over peak force; no error of no force is 0, as at rest without gravity.
fn share(error: f64, peak: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / peak }
}
