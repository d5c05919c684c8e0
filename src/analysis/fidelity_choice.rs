//! What each fidelity of the ladder leaves out, in newtons, over a scene; and the cheapest fidelity that will do.
//!
//! The error of a fidelity is the difference of its six forces from the exact model's. Its size is judged
//! against the peak force of the scene. Of an envelope three things are looked at: an even spread over the
//! inside, the corners, and, because the worst of 18 dimensions is rarely among them, the point where a
//! climb from the worst of those ends, for each fidelity and leg.
//!
//! A share is the worst of three: largest error over peak of the even spread, of the corners, and of all
//! points together, the ends of the climbs among them. Corners raise both error and peak: who samples the
//! inside alone sees neither, and must find the choice good all the same.
//!
//! Points outside the actuators' stroke and singular poses are counted and passed over.

use super::envelope::{CORNER_COUNT, DIMENSIONS, EnvelopePoint, MotionEnvelope};
use super::fidelity_error::{ErrorStatistics, FIDELITY_COUNT, FidelitySample, largest};
use super::reachable_envelope::within_stroke;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::{Exact, Fidelity};
use crate::model::machine::LEGS;

/// Points of the even spread that are judged. With eight times as many the figures stay within a few per
/// cent, and with this many a daemon starts without a delay that anybody sees.
pub const SPREAD_POINTS: u32 = 1 << 15;

/// What is taken of a tolerance, for what no sample shows: on 200,000 other points of the inside, errors of
/// up to 1.13 times as large a share were seen where poses next to singular ones are in reach, and 1.02
/// elsewhere.
const TOLERANCE_MARGIN: f64 = 1.05;

/// Where most of an envelope is out of reach: points drawn at most.
const MAX_DRAWN_POINTS: u32 = 4 * SPREAD_POINTS;

/// The climb begins with steps as wide as the envelope and ends with this share of it.
const MIN_CLIMB_STEP: f64 = 1.0 / 64.0;

/// Sweeps over all dimensions with steps of one width, at most; they usually end after two.
const MAX_SWEEPS_PER_STEP: u32 = 4;

/// What a fidelity costs in accuracy over a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FidelityError {
    pub fidelity: Fidelity,
    /// Of the even spread, or of the rows \[N\].
    pub mean: f64,
    /// Of the same.
    pub rms: f64,
    /// Of all points \[N\].
    pub max: f64,
    /// The largest error as a share of the peak force, as the head of this file says.
    pub share: f64,
}

/// A scene, judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FidelityComparison {
    /// The even spread, or the rows.
    pub inside: ErrorStatistics,
    /// Everything.
    pub all: ErrorStatistics,
    /// In the order of [`Fidelity::ALL`].
    pub errors: [FidelityError; FIDELITY_COUNT],
}

impl FidelityComparison {
    /// Of an envelope. A bounded number of evaluations: at most some 200,000 points.
    pub fn of_envelope(model: &InverseDynamics, envelope: &MotionEnvelope) -> Self {
        let (mut inside, mut edge) = (ErrorStatistics::default(), ErrorStatistics::default());
        let mut worst = [[WorstPoint::default(); LEGS]; FIDELITY_COUNT];
        let look = |shares: &EnvelopePoint,
                    tally: &mut ErrorStatistics,
                    worst: &mut [[WorstPoint; LEGS]; FIDELITY_COUNT]| {
            let sample = FidelitySample::take(model, &envelope.at(shares));
            tally.add(&sample);
            if let Ok(sample) = sample {
                let errors = sample.errors.as_flattened();
                worst.as_flattened_mut().iter_mut().zip(errors).for_each(|(worst, e)| worst.note(*e, shares));
            }
        };
        for k in 0..MAX_DRAWN_POINTS {
            look(&MotionEnvelope::spread(k), &mut inside, &mut worst);
            if inside.judged >= u64::from(SPREAD_POINTS) {
                break;
            }
        }
        for k in 0..CORNER_COUNT {
            look(&envelope.corner(k), &mut edge, &mut worst);
        }
        let mut all = inside.and(&edge);
        let mut peak = all.peak;
        for (fidelity, (errors, worst)) in Fidelity::ALL.into_iter().zip(all.errors.iter_mut().zip(&worst)) {
            for (leg, start) in worst.iter().enumerate() {
                let top = climb(model, envelope, fidelity, leg, start);
                errors.max = errors.max.max(top.error);
                let forces = model.forces::<Exact>(&envelope.at(&top.shares).motion());
                peak = peak.max(forces.map_or(0.0, |forces| largest(&forces)));
            }
        }
        all.peak = peak;
        Self::new(&[inside, edge], all)
    }

    /// Of rows that were looked at one by one.
    pub fn of_rows(rows: ErrorStatistics) -> Self {
        Self::new(&[rows], rows)
    }

    /// The first part is what is called the inside.
    fn new(parts: &[ErrorStatistics], all: ErrorStatistics) -> Self {
        let inside = parts.first().copied().unwrap_or_default();
        let nothing = FidelityError { fidelity: Fidelity::Exact, mean: 0.0, rms: 0.0, max: 0.0, share: 0.0 };
        let mut errors = [nothing; FIDELITY_COUNT];
        for (number, (error, fidelity)) in errors.iter_mut().zip(Fidelity::ALL).enumerate() {
            let errors = |tally: &ErrorStatistics| tally.errors.get(number).copied().unwrap_or_default();
            let share = |tally: &ErrorStatistics| share(errors(tally).max, tally.peak);
            *error = FidelityError {
                fidelity,
                mean: inside.mean(&errors(&inside)),
                rms: inside.rms(&errors(&inside)),
                max: errors(&all).max,
                share: parts.iter().map(share).fold(share(&all), f64::max),
            };
        }
        Self { inside, all, errors }
    }

    /// The fidelities whose largest error is within a tolerance, given as a share of the peak force, less 5 %; the
    /// cheapest first, by the order of the ladder. That order is the same on every computer and in every
    /// run, as a measured time is not. The last one is the exact model.
    pub fn within(&self, tolerance: f64) -> impl Iterator<Item = &FidelityError> {
        self.errors.iter().filter(move |error| TOLERANCE_MARGIN * error.share <= tolerance)
    }

    /// The first of [`FidelityComparison::within`] that a control loop can run on.
    pub fn choice(&self, tolerance: f64) -> Fidelity {
        self.within(tolerance)
            .map(|error| error.fidelity)
            .find(|fidelity| fidelity.has_inertia())
            .unwrap_or(Fidelity::Exact)
    }
}

/// Where an error was largest.
#[derive(Clone, Copy, Debug)]
struct WorstPoint {
    error: f64,
    shares: EnvelopePoint,
}

impl Default for WorstPoint {
    fn default() -> Self {
        Self { error: 0.0, shares: EnvelopePoint::zeros() }
    }
}

impl WorstPoint {
    fn note(&mut self, error: f64, shares: &EnvelopePoint) {
        if error > self.error {
            *self = Self { error, shares: *shares };
        }
    }
}

/// The largest error of one fidelity and leg at the end of a climb along the axes of the envelope, with steps that are
/// halved where none leads up.
fn climb(
    model: &InverseDynamics,
    envelope: &MotionEnvelope,
    fidelity: Fidelity,
    leg: usize,
    start: &WorstPoint,
) -> WorstPoint {
    let error_at = |shares: &EnvelopePoint| -> Option<f64> {
        let state = envelope.at(shares);
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
    // Where nothing is wrong, as with the exact model, there is nothing to climb.
    while best.error > 0.0 && step >= MIN_CLIMB_STEP {
        for _ in 0..MAX_SWEEPS_PER_STEP {
            let before = best.error;
            for (axis, way) in (0..DIMENSIONS).flat_map(|axis| [(axis, step), (axis, -step)]) {
                let mut shares = best.shares;
                if let Some(share) = shares.get_mut(axis) {
                    *share = (*share + way).clamp(0.0, 1.0);
                }
                best.note(error_at(&shares).unwrap_or(0.0), &shares);
            }
            if best.error <= before {
                break;
            }
        }
        step *= 0.5;
    }
    best
}

/// Nothing of nothing is nothing: a scene at rest without gravity.
fn share(error: f64, peak: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / peak }
}
