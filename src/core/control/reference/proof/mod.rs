//! Proof that a step, and the stop from its end, keep every limit over their whole length.
//!
//! | file | content |
//! | --- | --- |
//! | `verification` | a stop in free space, proved with one pose; entry to the proof |
//! | `examination` | a stop near a bound, knot by knot |
//! | `step` | step that leads to the stop |
//! | `knots` | instants at which a stop is examined |
//! | `cubic_departure` | how far a quantity may depart from a cubic between two knots |
//! | `angle_ranges`, `position_ranges` | whether a pose is within the envelope |
//! | `pose_bounds` | bounds of the leg lengths, and the envelope |
//! | `regularity` | a ball of poses proved regular, for the limit of the condition |
//! | `ball_group` | balls in SIMD lanes, and which of them cover a pose |
//! | `regular_balls` | the balls that were found last |
//! | `drive_forces` | whether the drives can give what a stop takes |
//! | `refusal` | why a step is refused |
//! | `tolerances` | allowances for rounding and between knots |
//! | `padding` | vectors of three numbers in four lanes |

pub(super) mod angle_ranges;
pub(super) mod ball_group;
pub(super) mod cubic_departure;
pub(super) mod drive_forces;
pub(super) mod examination;
pub(super) mod knots;
pub(super) mod padding;
pub(super) mod pose_bounds;
pub(super) mod position_ranges;
pub(super) mod refusal;
pub(super) mod regular_balls;
pub(super) mod regularity;
pub(super) mod step;
pub(super) mod tolerances;
pub(super) mod verification;
