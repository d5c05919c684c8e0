//! Seeded random numbers, the same on every machine bit for bit: no function of a system library takes part.
//!
//! Steele, Lea and Flood (2014), "Fast splittable pseudorandom number generators": SplitMix64.

/// Sequence of random numbers.
///
/// ```
/// use hexad_core::model::random::Random;
/// let draw = |seed| Random::new(seed).uniform();
/// assert_eq!(draw(7), draw(7));
/// assert!(draw(7) != draw(8) && (0.0..1.0).contains(&draw(7)));
/// ```
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The sequence of this seed.
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Uniform in \[0, 1).
    pub fn uniform(&mut self) -> f64 {
        // The 53 bits that a double holds.
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in \[-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Mean 0, variance 1: the sum of twelve uniform numbers less six. As good as Gaussian to three
    /// deviations, and never beyond six.
    pub fn near_gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
