//! Whether the Bryan angles of a rotation keep a distance from the ends of their ranges, without the angles.
//!
//! The matrix holds sine and cosine of each angle times `c = cos(beta)`. With the angles d and e from both ends of a range of
//! the width w, up to full turns:
//!
//! ```text
//! sin d >= slack and sin e >= slack                       =>  d, e >= slack      w < pi
//! the same, or where cos d <= 0 or cos e <= 0 instead     =>  d, e >= slack      pi <= w <= 5
//! ```
//!
//! as `asin(slack) >= slack`. A range ends at most 2.5 rad from where a motion begins, without slack there, so that full turns do
//! not matter. That is 24 products for three angles, where each arc tangent takes 100 instructions: an examination asks at every knot.

use core::f64::consts::PI;

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Matrix3;

use crate::control::parameters::Envelope;

/// Part of the width of a range that a slack may use.
pub(super) const MAX_SLACK_RATIO: f64 = 0.25;

/// Largest change of an angle along a motion \[rad\].
const MAX_CHANGE: f64 = 2.5;

/// One end of a range.
#[derive(Clone, Copy, Debug, Default)]
struct End {
    sine: f64,
    cosine: f64,
    /// Most slack that is kept from it \[rad\].
    slack: f64,
}

impl End {
    /// At an angle; one that is too far to be reached needs no slack.
    fn new(angle: f64, is_reached: bool, slack: f64) -> Self {
        let (sine, cosine) = libm::sincos(angle);
        Self { sine, cosine, slack: if is_reached { slack } else { 0.0 } }
    }

    /// Whether an angle keeps a distance from this end, given sine and cosine of the distance times `c >= 0`.
    #[inline(always)]
    fn is_kept(&self, (sine, cosine): (f64, f64), c: f64, slack: f64, is_wide: bool) -> bool {
        (sine >= slack.min(self.slack) * c) | (is_wide & (cosine <= 0.0))
    }
}

/// Range of an angle.
#[derive(Clone, Copy, Debug, Default)]
struct Range {
    low: End,
    high: End,
    width: f64,
}

impl Range {
    /// `x` is where the motion begins.
    fn new(low: f64, high: f64, x: f64) -> Self {
        let slack = (MAX_SLACK_RATIO * (high - low)).min(1.0);
        let (lowest, highest) = (x - MAX_CHANGE, x + MAX_CHANGE);
        Self {
            low: End::new(low.max(lowest), low > lowest, slack),
            high: End::new(high.min(highest), high < highest, slack),
            width: high.min(highest) - low.max(lowest),
        }
    }

    /// For sine and cosine of an angle, both times `c >= 0`.
    #[inline(always)]
    fn contains(&self, sine: f64, cosine: f64, c: f64, slack: f64) -> bool {
        let Self { low, high, width } = self;
        let from_low = (sine * low.cosine - cosine * low.sine, cosine * low.cosine + sine * low.sine);
        let from_high = (cosine * high.sine - sine * high.cosine, cosine * high.cosine + sine * high.sine);
        let is_wide = *width >= PI;
        low.is_kept(from_low, c, slack, is_wide)
            & high.is_kept(from_high, c, slack, is_wide)
            & (*width >= 0.0)
    }
}

/// Ranges of alpha, beta and gamma.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AngleRanges {
    ranges: [Range; 3],
    /// Sign of `cos(beta)`: of the two triples of angles that give the same rotation.
    sign: f64,
}

impl AngleRanges {
    /// Those of an envelope, for a motion from X.
    pub fn new(Envelope { lowest, highest }: &Envelope, [alpha, beta, gamma, ..]: &[f64; 6]) -> Self {
        let ([a0, b0, g0, ..], [a1, b1, g1, ..]) = (*lowest, *highest);
        let ranges = [Range::new(a0, a1, *alpha), Range::new(b0, b1, *beta), Range::new(g0, g1, *gamma)];
        Self { ranges, sign: 1.0_f64.copysign(libm::cos(*beta)) }
    }

    /// Whether each angle of a rotation has a distance from the ends of its range \[rad\], or a part of it that is narrower.
    #[inline(always)]
    pub fn contain(&self, r: &Matrix3<f64>, slack: f64) -> bool {
        let Self { ranges: [alpha, beta, gamma], sign } = self;
        let c = cosine_of_beta(r);
        alpha.contains(-r.m23 * sign, r.m33 * sign, c, slack)
            & beta.contains(r.m13, c * sign, 1.0, slack)
            & gamma.contains(-r.m12 * sign, r.m11 * sign, c, slack)
    }
}

/// `|cos(beta)|`
#[inline(always)]
pub(super) fn cosine_of_beta(r: &Matrix3<f64>) -> f64 {
    (r.m11 * r.m11 + r.m12 * r.m12).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::samples::Samples;
    use super::*;
    use crate::model::task::{TaskState, task_coordinates};

    /// Ranges around random angles, narrow and wide, on both sides of 90 degrees.
    #[test]
    fn a_rotation_is_inside_exactly_where_its_angles_are() {
        let mut samples = Samples::new(1);
        let (mut inside, mut outside) = (0, 0);
        for k in 0..200_000 {
            let home_beta = if k % 2 == 0 { 0.0 } else { PI };
            let home = [0.0, home_beta, 0.0, 0.0, 0.0, 0.0];
            let mut angle = |center: f64, size: f64| center + size * (2.0 * samples.uniform() - 1.0);
            let x = [angle(0.0, 1.5), angle(home_beta, 1.5), angle(0.0, 1.5), 0.0, 0.0, 0.0];
            let mut envelope = Envelope { lowest: [0.0; 6], highest: [0.0; 6] };
            for (axis, (low, high)) in
                envelope.lowest.iter_mut().zip(&mut envelope.highest).take(3).enumerate()
            {
                let widest = [1e-3, 0.3, 3.5][k / 2 % 3];
                (*low, *high) = (x[axis] - widest * samples.uniform(), x[axis] + widest * samples.uniform());
                if samples.uniform() < 0.2 {
                    (*low, *high) = (*high, *high + widest * samples.uniform());
                }
            }
            let slack = if k % 5 == 0 { 0.0 } else { 0.01 * samples.uniform() };
            let pose = TaskState::at_rest(x).motion().pose;
            let angles = task_coordinates(&pose, &home);
            // By which the worst angle is inside, beyond the slack that a range allows.
            let room = |slack: f64| {
                let axes = angles.iter().zip(envelope.lowest.iter().zip(&envelope.highest)).take(3);
                axes.map(|(x, (low, high))| {
                    (x - low).min(high - x) - slack.min(MAX_SLACK_RATIO * (high - low))
                })
                .fold(f64::INFINITY, f64::min)
            };
            let mut start = angles;
            // On the same side of 90 degrees.
            for (x, size) in start.iter_mut().zip([0.5, 0.05, 0.5]) {
                *x += size * (2.0 * samples.uniform() - 1.0);
            }
            let is_contained = AngleRanges::new(&envelope, &start).contain(&pose.rotation, slack);
            assert!(!is_contained || room(slack) > -1e-12, "{x:?} {envelope:?} {slack}");
            assert!(is_contained || room(slack * (1.0 + slack * slack)) < 1e-6, "{x:?} {envelope:?} {slack}");
            if is_contained { inside += 1 } else { outside += 1 }
        }
        assert!(inside > 50_000 && outside > 50_000, "{inside} {outside}");
    }
}
