//! Choices at random that can be had again.

pub struct Random(hexad::model::random::Random);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(hexad::model::random::Random::new(seed))
    }

    /// One of the numbers below a bound.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.0.bits() % bound
    }

    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u64) as usize]
    }
}
