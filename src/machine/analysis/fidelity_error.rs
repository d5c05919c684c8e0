//! Force errors of every fidelity against the exact model, motion by motion.
//!
//! The error of leg i is `|Gamma_i(fidelity) - Gamma_i(exact)|` \[N\]. Motions outside the stroke and at singular poses are
//! counted and not evaluated.

use super::reachable_envelope::within_stroke;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::task::TaskState;

/// Number of fidelities.
pub const FIDELITY_COUNT: usize = Fidelity::ALL.len();

/// Force errors of all fidelities at one motion.
#[derive(Clone, Copy, Debug)]
pub struct FidelitySample {
    /// Largest exact force \[N\].
    pub peak_n: f64,
    /// Error of each fidelity and leg \[N\], in the order of [`Fidelity::ALL`].
    pub errors_n: [[f64; LEGS]; FIDELITY_COUNT],
}

/// Reason why a motion has no sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotEvaluated {
    /// A leg is outside of its stroke.
    OutsideStroke,
    /// The pose is singular.
    Singular,
}

impl FidelitySample {
    /// Evaluates every fidelity at a motion.
    pub fn take(model: &InverseDynamics, state: &TaskState) -> Result<Self, NotEvaluated> {
        if !within_stroke(model.machine(), state) {
            return Err(NotEvaluated::OutsideStroke);
        }
        let motion = state.motion();
        let of = |fidelity| model.forces_of(fidelity, &motion).filter(|f| f.iter().all(|f| f.is_finite()));
        let exact = of(Fidelity::Exact).ok_or(NotEvaluated::Singular)?;
        let mut errors_n = [[0.0; LEGS]; FIDELITY_COUNT];
        for (errors, fidelity) in errors_n.iter_mut().zip(Fidelity::ALL) {
            let forces = of(fidelity).ok_or(NotEvaluated::Singular)?;
            for (error, (force, exact)) in errors.iter_mut().zip(forces.iter().zip(&exact)) {
                *error = (force - exact).abs();
            }
        }
        Ok(Self { peak_n: largest(&exact), errors_n })
    }
}

/// Sums of the errors of one fidelity, over samples and legs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorSums {
    sum: f64,
    squares: f64,
    /// Largest \[N\].
    pub max_n: f64,
}

/// Error statistics of all fidelities over many motions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorStatistics {
    /// Motions with a sample.
    pub evaluated: u64,
    /// Motions outside of the actuators' stroke.
    pub outside: u64,
    /// Motions at a singular pose.
    pub singular: u64,
    /// Largest exact force \[N\].
    pub peak_n: f64,
    /// In the order of [`Fidelity::ALL`].
    pub errors: [ErrorSums; FIDELITY_COUNT],
}

impl ErrorStatistics {
    /// Adds one motion.
    pub fn add(&mut self, sample: &Result<FidelitySample, NotEvaluated>) {
        let sample = match sample {
            Ok(sample) => sample,
            Err(NotEvaluated::OutsideStroke) => return self.outside += 1,
            Err(NotEvaluated::Singular) => return self.singular += 1,
        };
        self.evaluated += 1;
        self.peak_n = self.peak_n.max(sample.peak_n);
        for (sums, errors) in self.errors.iter_mut().zip(&sample.errors_n) {
            sums.sum += errors.iter().sum::<f64>();
            sums.squares += errors.iter().map(|error| error * error).sum::<f64>();
            sums.max_n = sums.max_n.max(largest(errors));
        }
    }

    /// Mean of a fidelity's errors \[N\]; like `errors_n`, NaN without a sample.
    pub fn mean(&self, errors: &ErrorSums) -> f64 {
        errors.sum / self.values()
    }

    /// Root mean square of a fidelity's errors \[N\].
    pub fn rms(&self, errors: &ErrorSums) -> f64 {
        (errors.squares / self.values()).sqrt()
    }

    fn values(&self) -> f64 {
        (self.evaluated * LEGS as u64) as f64
    }

    /// The statistics of both sets of motions together.
    pub(crate) fn and(mut self, other: &Self) -> Self {
        self.evaluated += other.evaluated;
        self.outside += other.outside;
        self.singular += other.singular;
        self.peak_n = self.peak_n.max(other.peak_n);
        for (a, b) in self.errors.iter_mut().zip(&other.errors) {
            *a =
                ErrorSums { sum: a.sum + b.sum, squares: a.squares + b.squares, max_n: a.max_n.max(b.max_n) };
        }
        self
    }
}

/// The largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))
}
