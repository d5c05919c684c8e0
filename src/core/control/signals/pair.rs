//! Pair of a quantity of the orientation and the same quantity of the position.

/// A quantity of the orientation, and the same quantity of the position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair<T> {
    /// Quantity of the orientation, in radians.
    pub angular: T,
    /// Quantity of the position, in metres.
    pub linear: T,
}

impl<T> Pair<T> {
    /// Applies a function to both quantities.
    #[inline(always)]
    pub fn map<U>(self, mut function: impl FnMut(T) -> U) -> Pair<U> {
        Pair { angular: function(self.angular), linear: function(self.linear) }
    }

    /// Pairs both quantities with the quantities of another pair.
    #[inline(always)]
    pub fn zip<U>(self, other: Pair<U>) -> Pair<(T, U)> {
        Pair { angular: (self.angular, other.angular), linear: (self.linear, other.linear) }
    }
}
