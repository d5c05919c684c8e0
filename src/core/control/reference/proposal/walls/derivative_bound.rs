//! Bound on the derivative of the wanted twist at an active wall.

use crate::control::reference::proposal::walls::{LANES, Wall};

/// Bound on V' at an active wall.
pub(in crate::control::reference::proposal::walls) struct DerivativeBound<'a> {
    pub gradient: &'a [f64; LANES],
    /// `G V'` at the bound.
    wanted: f64,
    /// Weight of the bound over the square of the gradient's norm, and 1 minus the weight.
    blend_per_square: f64,
    unblended: f64,
    multiplier: f64,
}

impl<'a> DerivativeBound<'a> {
    pub fn new(wall: &'a Wall) -> Self {
        let [against, along] = &wall.ends;
        let wanted = if wall.multiplier > 0.0 { along.derivative } else { -against.derivative };
        let blend = (wall.multiplier.abs() * wall.blend_rate).min(1.0);
        let blend_per_square = blend * wall.inverse_square;
        Self { gradient: &wall.gradient, wanted, blend_per_square, unblended: 1.0 - blend, multiplier: 0.0 }
    }

    /// Change of the multiplier for the present `G V'`.
    #[inline(always)]
    pub fn change(&mut self, present: f64) -> f64 {
        let change = (present - self.wanted) * self.blend_per_square - self.unblended * self.multiplier;
        self.multiplier += change;
        change
    }
}
