//! Tolerances of the proof. They are in one file because some must be equal or ordered.

/// Distance by which a length may exceed its bound between two knots, as a part of the stroke. Departures are
/// bounded for the worst direction. Without this allowance a platform at the bound could not leave it.
pub(in crate::control::reference) const BETWEEN_KNOTS_PER_STROKE: f64 = 2.5e-5;
/// Distance of relaxed bounds beyond a pose that is outside the nominal bounds when control begins, as a part
/// of the stroke. It is above the noise of lengths.
pub(in crate::control::reference) const START_EXCESS_PER_STROKE: f64 = BETWEEN_KNOTS_PER_STROKE;
/// Force at rest by which its bound may be exceeded between two knots, as a part of the bound in motion. Without
/// this allowance a platform at the bound could only leave it in the directions in which the force decreases most.
pub(in crate::control::reference) const FORCE_BETWEEN_KNOTS_RATIO: f64 = 0.01;
/// Room of the relaxed bound of the force at rest beyond the force at a pose, as a part of the largest force: the
/// way back is proved within it.
pub(in crate::control::reference) const START_FORCE_RATIO: f64 = 0.01;
/// Distance of relaxed bounds from the end stops, as a part of the stroke: the allowance between knots, and
/// as much for the following error. A platform nearer to an end stop may return. Control may not begin while
/// the platform moves towards it.
pub(in crate::control::reference) const END_STOP_DISTANCE_PER_STROKE: f64 =
    BETWEEN_KNOTS_PER_STROKE + START_EXCESS_PER_STROKE;
/// Distance that walls keep from a bound, as a part of the stroke: it gives the examination room between
/// knots.
pub(in crate::control::reference) const WALL_DISTANCE_PER_STROKE: f64 = 5e-3;
/// Allowance for the rounding of a velocity, as a part of its limit.
pub(in crate::control::reference) const VELOCITY_ROUNDING_RATIO: f64 = 1e-9;
/// Allowance for rounding at each end of the envelope \[rad\] or \[m\]; a range whose ends are equal needs it.
pub(in crate::control::reference) const RANGE_ROUNDING: f64 = 1e-9;
/// Allowance for the rounding of an angle \[rad\].
pub(in crate::control::reference) const ANGLE_ROUNDING_RAD: f64 = 1e-15;

const _: () = assert!(
    WALL_DISTANCE_PER_STROKE > 100.0 * BETWEEN_KNOTS_PER_STROKE && ANGLE_ROUNDING_RAD < RANGE_ROUNDING
);
