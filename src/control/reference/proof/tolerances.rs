//! Tolerances of the proof: what must be equal or ordered stands side by side.

/// Part of the stroke by which a length may exceed its bound between two knots. Departures are bounded for the worst direction:
/// without this room a platform at the bound could not leave it.
pub(in crate::control::reference) const BETWEEN_KNOTS_RATIO: f64 = 2.5e-5;
/// Part of the stroke beyond a pose outside the nominal bounds in which control may begin: above the noise of lengths.
pub(in crate::control::reference) const START_RATIO: f64 = BETWEEN_KNOTS_RATIO;
/// Distance of relaxed bounds from the end stops, as a part of the stroke: one room between knots, and one for the following error.
/// A platform nearer to an end stop may return; one that moves towards it may not begin.
pub(in crate::control::reference) const END_STOP_RATIO: f64 = BETWEEN_KNOTS_RATIO + START_RATIO;
/// Part of the stroke that walls keep from a bound, so that the examination finds room between knots.
pub(in crate::control::reference) const WALL_RATIO: f64 = 5e-3;
/// Relative allowance for rounding of a velocity; absolute, in \[rad\] or \[m\], for a range whose ends are equal.
pub(in crate::control::reference) const ROUNDING: f64 = 1e-9;
/// Allowance for the rounding of an angle \[rad\].
pub(in crate::control::reference) const ANGLE_ROUNDING: f64 = 1e-15;

const _: () = assert!(WALL_RATIO > 100.0 * BETWEEN_KNOTS_RATIO && ANGLE_ROUNDING < ROUNDING);
