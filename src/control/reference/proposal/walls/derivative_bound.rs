//! Bound on the derivative of the wanted twist at a wall that is active.

use crate::control::reference::proposal::walls::{LANES, Wall};

/// Bound on V' at an active wall.
pub(in crate::control::reference::proposal::walls) struct DerivativeBound<'a> {
    pub gradient: &'a [f64; LANES],
    /// `G V'` at the bound.
    wanted: f64,
    /// The part of the bound that holds, over the square of the norm of the gradient; and the part that does not.
    weight_per_square: f64,
    rest: f64,
    multiplier: f64,
}

impl<'a> DerivativeBound<'a> {
    pub fn new(wall: &'a Wall) -> Self {
        let [against, along] = &wall.sides;
        let wanted = if wall.multiplier > 0.0 { along.derivative } else { -against.derivative };
        let weight = (wall.multiplier.abs() * wall.weight).min(1.0);
        let weight_per_square = weight * wall.inverse_square;
        Self { gradient: &wall.gradient, wanted, weight_per_square, rest: 1.0 - weight, multiplier: 0.0 }
    }

    /// Change of the multiplier for the present `G V'`.
    #[inline(always)]
    pub fn change(&mut self, present: f64) -> f64 {
        let change = (present - self.wanted) * self.weight_per_square - self.rest * self.multiplier;
        self.multiplier += change;
        change
    }
}
