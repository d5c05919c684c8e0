//! A quantity of the orientation beside the same one of the position.

/// A quantity of the orientation and the same of the position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair<T> {
    /// Of the orientation: radians.
    pub angular: T,
    /// Of the position: metres.
    pub linear: T,
}

impl<T> Pair<T> {
    /// The same function of both.
    #[inline(always)]
    pub fn map<U>(self, mut function: impl FnMut(T) -> U) -> Pair<U> {
        Pair { angular: function(self.angular), linear: function(self.linear) }
    }

    /// Both, each beside that of another pair.
    #[inline(always)]
    pub fn zip<U>(self, other: Pair<U>) -> Pair<(T, U)> {
        Pair { angular: (self.angular, other.angular), linear: (self.linear, other.linear) }
    }
}
