//! The fidelities of the ladder against the exact model, motion by motion.

use super::reachable_envelope::within_stroke;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::machine::LEGS;
use crate::model::task::TaskState;

/// Rungs of the ladder.
pub const FIDELITY_COUNT: usize = Fidelity::ALL.len();

/// Forces of all fidelities at one point against the exact ones.
#[derive(Clone, Copy, Debug)]
pub struct FidelitySample {
    /// Largest exact force \[N\].
    pub peak: f64,
    /// Error of each fidelity and leg \[N\], in the order of [`Fidelity::ALL`].
    pub errors: [[f64; LEGS]; FIDELITY_COUNT],
}

/// Why a point has no sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotEvaluated {
    OutsideStroke,
    Singular,
}

impl FidelitySample {
    /// Evaluates every fidelity.
    pub fn take(model: &InverseDynamics, state: &TaskState) -> Result<Self, NotEvaluated> {
        if !within_stroke(model.machine(), state) {
            return Err(NotEvaluated::OutsideStroke);
        }
        let motion = state.motion();
        let of = |fidelity| model.forces_of(fidelity, &motion).filter(|f| f.iter().all(|f| f.is_finite()));
        let exact = of(Fidelity::Exact).ok_or(NotEvaluated::Singular)?;
        let mut errors = [[0.0; LEGS]; FIDELITY_COUNT];
        for (errors, fidelity) in errors.iter_mut().zip(Fidelity::ALL) {
            let forces = of(fidelity).ok_or(NotEvaluated::Singular)?;
            for (error, (force, exact)) in errors.iter_mut().zip(forces.iter().zip(&exact)) {
                *error = (force - exact).abs();
            }
        }
        Ok(Self { peak: largest(&exact), errors })
    }
}

/// Statistics of the errors of one fidelity, over samples and legs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    sum: f64,
    squares: f64,
    /// Largest \[N\].
    pub max: f64,
}

/// What has been seen of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorStatistics {
    /// Points with a sample.
    pub judged: u64,
    /// Points outside the actuators' stroke.
    pub outside: u64,
    /// Poses without a solution.
    pub singular: u64,
    /// Largest exact force \[N\].
    pub peak: f64,
    /// In the order of [`Fidelity::ALL`].
    pub errors: [Errors; FIDELITY_COUNT],
}

impl ErrorStatistics {
    /// Takes note of one point.
    pub fn add(&mut self, sample: &Result<FidelitySample, NotEvaluated>) {
        let sample = match sample {
            Ok(sample) => sample,
            Err(NotEvaluated::OutsideStroke) => return self.outside += 1,
            Err(NotEvaluated::Singular) => return self.singular += 1,
        };
        self.judged += 1;
        self.peak = self.peak.max(sample.peak);
        for (tally, errors) in self.errors.iter_mut().zip(&sample.errors) {
            tally.sum += errors.iter().sum::<f64>();
            tally.squares += errors.iter().map(|error| error * error).sum::<f64>();
            tally.max = tally.max.max(largest(errors));
        }
    }

    /// Mean of a fidelity's errors \[N\]; like `errors`, NaN if nothing was judged.
    pub fn mean(&self, errors: &Errors) -> f64 {
        errors.sum / self.values()
    }

    /// Root mean square of a fidelity's errors \[N\].
    pub fn rms(&self, errors: &Errors) -> f64 {
        (errors.squares / self.values()).sqrt()
    }

    fn values(&self) -> f64 {
        (self.judged * LEGS as u64) as f64
    }

    /// Both together.
    pub(crate) fn and(mut self, other: &Self) -> Self {
        self.judged += other.judged;
        self.outside += other.outside;
        self.singular += other.singular;
        self.peak = self.peak.max(other.peak);
        for (a, b) in self.errors.iter_mut().zip(&other.errors) {
            *a = Errors { sum: a.sum + b.sum, squares: a.squares + b.squares, max: a.max.max(b.max) };
        }
        self
    }
}

/// The largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))
}
