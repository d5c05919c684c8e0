//! Motion envelope, as motion bases are specified: a box of task coordinates about home with required velocities and
//! accelerations, and sets of sample points of it.
//!
//! The box has 18 dimensions: X, X', X''. A point has a coordinate in \[0, 1\] for each: 0 is the lower end, 1 the upper
//! one. Two sets of points, the same on every computer:
//!
//! - [`MotionEnvelope::spread`]: evenly over the inside, by the additive recurrence `u_k = 1/2 + k a mod 1` with
//!   `a_j = phi^-j` and `phi^19 = phi + 1`, the generalised golden ratio of 18 dimensions (M. Roberts, "The
//!   unreasonable effectiveness of quasirandom sequences", 2018; of the family of Kronecker). It has no
//!   parameters, needs no table, any run of it is as even as any other; and of 32,768 points in 16 x 16 cells
//!   of any two dimensions none is left empty, where steps of square roots of primes leave some.
//! - [`MotionEnvelope::corner`]: of the 2^18 corners those where every corner of the pose (and home) meets rest
//!   and 32 patterns of extreme velocities and accelerations.
//!
//! Whether the machine can reach a point is not checked here.

use nalgebra::{SVector, Vector6};

use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;

/// Dimensions of an envelope: X, X', X''.
pub const DIMENSIONS: usize = 18;

/// Point of an envelope: a coordinate in \[0, 1\] for each dimension.
pub type EnvelopePoint = SVector<f64, DIMENSIONS>;

/// Root of `phi^19 = phi + 1`.
const GOLDEN_RATIO_18: f64 = 1.038_188_019_436_45;

/// Corners of the six ranges of the pose.
const POSE_CORNERS: u32 = 64;

/// Patterns of signs for the twelve velocities and accelerations.
const SIGN_PATTERNS: u32 = 32;

/// Number of corners of [`MotionEnvelope::corner`]: home and the corners of the pose, each at rest and with
/// every pattern.
pub const CORNER_COUNT: u32 = (1 + POSE_CORNERS) * (1 + SIGN_PATTERNS);

/// Twelve of the sixteen 5-bit masks with an odd number of bits. The sum of any two of them is even, hence
/// none of them: any three velocities and accelerations meet in all eight combinations of their signs, and
/// every pattern has its negative (a two-level design of resolution IV; Box and Hunter, 1961).
const SIGN_MASKS: [u32; 12] = [1, 2, 4, 8, 16, 7, 11, 13, 14, 19, 21, 22];

/// Bounds of an envelope, relative to home; angles \[rad\], positions \[m\], in the order of X.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeBounds {
    /// Lowest offset of X from home, at most 0.
    pub pose_min: [f64; 6],
    /// Highest offset of X from home, at least 0.
    pub pose_max: [f64; 6],
    /// Largest required magnitude of X', angle rates first.
    pub velocity: [f64; 6],
    /// Largest required magnitude of X''.
    pub acceleration: [f64; 6],
}

impl EnvelopeBounds {
    /// Largest rotation from home at the corners of the box \[rad\].
    pub fn largest_rotation(&self, machine: &Machine) -> f64 {
        let home = machine.home_pose();
        let rotation = |corner: usize| {
            let mut x = machine.home;
            let ranges = self.pose_min.iter().zip(&self.pose_max).enumerate().take(3);
            for (x, (k, (low, high))) in x.iter_mut().zip(ranges) {
                *x += if corner >> k & 1 == 0 { low } else { high };
            }
            home.displacement_to(&TaskState::at_rest(x).motion().pose).angular.norm()
        };
        (0..1 << 3).map(rotation).fold(0.0, f64::max)
    }
}

/// Motion envelope: a box of X, X', X'' about home.
///
/// ```
/// use hexad_machine::analysis::envelope::{EnvelopeBounds, MotionEnvelope};
/// let bounds = EnvelopeBounds { pose_min: [-0.1; 6], pose_max: [0.3; 6], velocity: [1.0; 6], acceleration: [5.0; 6] };
/// let envelope = MotionEnvelope::new(&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], bounds);
/// // Home at rest is one of its points, and the first corner.
/// let rest = envelope.at(&envelope.corner(0));
/// assert!((rest.x[5] - 1.0).abs() < 1e-15 && rest.xd.norm() == 0.0 && rest.xdd.norm() == 0.0);
/// assert!((envelope.at(&MotionEnvelope::spread(7)).x.amax() - 1.0) < 0.3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionEnvelope {
    home: Vector6<f64>,
    bounds: EnvelopeBounds,
}

impl MotionEnvelope {
    /// The envelope about a home pose.
    pub fn new(home: &[f64; 6], bounds: EnvelopeBounds) -> Self {
        Self { home: (*home).into(), bounds }
    }

    /// Its bounds.
    pub fn bounds(&self) -> &EnvelopeBounds {
        &self.bounds
    }

    /// The state at a point.
    pub fn at(&self, point: &EnvelopePoint) -> TaskState {
        let between = |low: Vector6<f64>, high: Vector6<f64>, first: usize| {
            let share: Vector6<f64> = point.fixed_rows::<6>(first).into();
            // In this form the middle of -a and a is exactly 0, and the ends are exact.
            low.component_mul(&share.map(|u| 1.0 - u)) + high.component_mul(&share)
        };
        let EnvelopeBounds { pose_min, pose_max, velocity, acceleration } = self.bounds;
        let (velocity, acceleration) = (Vector6::from(velocity), Vector6::from(acceleration));
        TaskState {
            x: self.home + between(pose_min.into(), pose_max.into(), 0),
            xd: between(-velocity, velocity, 6),
            xdd: between(-acceleration, acceleration, 12),
        }
    }

    /// The point at home, at rest.
    pub fn rest(&self) -> EnvelopePoint {
        let mut point = EnvelopePoint::repeat(0.5);
        let ranges = self.bounds.pose_min.iter().zip(&self.bounds.pose_max);
        for (share, (low, high)) in point.iter_mut().zip(ranges) {
            *share = if high > low { -low / (high - low) } else { 0.0 };
        }
        point
    }

    /// The k-th point of the infinite even spread.
    pub fn spread(k: u32) -> EnvelopePoint {
        let mut step = 1.0;
        EnvelopePoint::from_fn(|_, _| {
            step /= GOLDEN_RATIO_18;
            (0.5 + f64::from(k) * step).fract()
        })
    }

    /// The k-th of [`CORNER_COUNT`] corners; the first is home at rest. Beyond, they repeat.
    pub fn corner(&self, k: u32) -> EnvelopePoint {
        let (pose, pattern) = ((k / (1 + SIGN_PATTERNS)) % (1 + POSE_CORNERS), k % (1 + SIGN_PATTERNS));
        let mut point = self.rest();
        let (x, motion) = point.as_mut_slice().split_at_mut(6);
        if let Some(pose) = pose.checked_sub(1) {
            for (axis, share) in x.iter_mut().enumerate() {
                *share = f64::from((pose >> axis) & 1);
            }
        }
        if let Some(pattern) = pattern.checked_sub(1) {
            for (share, mask) in motion.iter_mut().zip(SIGN_MASKS) {
                *share = f64::from((pattern & mask).count_ones() & 1);
            }
        }
        point
    }
}
