//! Random vectors for the tests of the reference generator.

use nalgebra::Vector3;

/// Sequence of random numbers: SplitMix64.
pub(super) struct RandomVectors(u64);

impl RandomVectors {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// In \[0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
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
