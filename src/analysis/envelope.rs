//! An envelope: what a platform is asked to do, as motion bases are specified. A box of task coordinates
//! about home with limits of velocity and acceleration, and points of it to look at.
//!
//! The box has 18 dimensions: X, X', X''. Its points are named by shares: 0 is the lower end of a dimension,
//! 1 the upper one. Three sets of points, each the same on every computer:
//!
//! - [`MotionEnvelope::spread`]: evenly over the inside, by the additive recurrence `u_k = 1/2 + k a mod 1` with
//!   `a_j = phi^-j` and `phi^19 = phi + 1`, the generalised golden ratio of 18 dimensions (M. Roberts, "The
//!   unreasonable effectiveness of quasirandom sequences", 2018; of the family of Kronecker). It has no
//!   parameters, needs no table, any run of it is as even as any other; and of 32,768 points in 16 x 16 cells
//!   of any two dimensions none is left empty, where steps of square roots of primes leave some.
//! - [`MotionEnvelope::corner`]: of the 2^18 corners those where every corner of the pose (and home) meets rest
//!   and 32 patterns of extreme velocities and accelerations.
//! - [`MotionEnvelope::at`]: any point, for those who search.
//!
//! What this file does not do: ask whether the machine can reach a point.

use nalgebra::{SVector, Vector6};

use crate::model::task::TaskState;

/// X, X', X''.
pub const DIMENSIONS: usize = 18;

/// A point of the envelope; each number in \[0, 1\].
pub type EnvelopePoint = SVector<f64, DIMENSIONS>;

/// Root of `phi^19 = phi + 1`.
const GOLDEN_RATIO_18: f64 = 1.038_188_019_436_45;

/// Corners of the six ranges of the pose.
const POSE_CORNERS: u32 = 64;

/// Patterns of signs for the twelve velocities and accelerations.
const SIGN_PATTERNS: u32 = 32;

/// How many corners [`MotionEnvelope::corner`] knows: home and the corners of the pose, each at rest and with
/// every pattern.
pub const CORNER_COUNT: u32 = (1 + POSE_CORNERS) * (1 + SIGN_PATTERNS);

/// Twelve of the sixteen 5-bit masks with an odd number of bits. The sum of any two of them is even, hence
/// none of them: any three velocities and accelerations meet in all eight combinations of their signs, and
/// every pattern has its negative (a two-level design of resolution IV; Box and Hunter, 1961).
const SIGN_MASKS: [u32; 12] = [1, 2, 4, 8, 16, 7, 11, 13, 14, 19, 21, 22];

/// Ranges of a motion, relative to home; angles \[rad\], positions \[m\], in the order of X.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeBounds {
    /// Lowest offset of X from home, at most 0.
    pub pose_min: [f64; 6],
    /// Highest offset of X from home, at least 0.
    pub pose_max: [f64; 6],
    /// Largest magnitude of X', angle rates first.
    pub velocity: [f64; 6],
    /// Largest magnitude of X''.
    pub acceleration: [f64; 6],
}

/// The box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionEnvelope {
    home: Vector6<f64>,
    limits: EnvelopeBounds,
}

impl MotionEnvelope {
    /// The box about a home pose.
    pub fn new(home: &[f64; 6], limits: EnvelopeBounds) -> Self {
        Self { home: (*home).into(), limits }
    }

    /// What it was made of.
    pub fn limits(&self) -> &EnvelopeBounds {
        &self.limits
    }

    /// A point by its shares.
    pub fn at(&self, shares: &EnvelopePoint) -> TaskState {
        let between = |low: Vector6<f64>, high: Vector6<f64>, first: usize| {
            let share: Vector6<f64> = shares.fixed_rows::<6>(first).into();
            // In this form the middle of -a and a is exactly 0, and the ends are exact.
            low.component_mul(&share.map(|u| 1.0 - u)) + high.component_mul(&share)
        };
        let EnvelopeBounds { pose_min, pose_max, velocity, acceleration } = self.limits;
        let (velocity, acceleration) = (Vector6::from(velocity), Vector6::from(acceleration));
        TaskState {
            x: self.home + between(pose_min.into(), pose_max.into(), 0),
            xd: between(-velocity, velocity, 6),
            xdd: between(-acceleration, acceleration, 12),
        }
    }

    /// EnvelopePoint of the point at home, at rest.
    pub fn rest(&self) -> EnvelopePoint {
        let mut shares = EnvelopePoint::repeat(0.5);
        let ranges = self.limits.pose_min.iter().zip(&self.limits.pose_max);
        for (share, (low, high)) in shares.iter_mut().zip(ranges) {
            *share = if high > low { -low / (high - low) } else { 0.0 };
        }
        shares
    }

    /// The k-th point of the even spread, without end.
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
        let mut shares = self.rest();
        let (x, motion) = shares.as_mut_slice().split_at_mut(6);
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
        shares
    }
}
