//! Random vectors for the tests of the reference generator.

use crate::control::tests::Vector3;
use crate::model::random::Random;

/// Sequence of random vectors.
pub(in crate::control) struct RandomVectors(Random);

impl RandomVectors {
    pub fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    /// In \[0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    pub fn below(&mut self, count: u32) -> u32 {
        (self.uniform() * f64::from(count)) as u32
    }

    /// Of any direction, at most as long as `largest`; every third as long, some zero or along an axis.
    pub fn vector(&mut self, largest: f64) -> Vector3<f64> {
        let mut direction = Vector3::from_fn(|_, _| 2.0 * self.uniform() - 1.0);
        match self.below(6) {
            0 => direction = Vector3::x() * direction.x.signum(),
            1 => direction.z = 0.0,
            _ => {}
        }
        let length = match self.below(6) {
            0 | 1 => 1.0,
            2 => 1e-6 * self.uniform(),
            3 => 0.0,
            _ => self.uniform(),
        };
        direction.normalize() * (largest * length)
    }
}
