//! Whether the Bryan angles of a rotation keep a margin from the ends of their ranges, without computing the
//! angles.
//!
//! The rotation matrix holds `sin(beta)`, and sine and cosine of alpha and gamma times `c = cos(beta)`. A
//! range has the width w. The angle is d above its low end and e below its high end, up to full turns:
//!
//! ```text
//! sin d >= margin and sin e >= margin                     =>  d, e >= margin     w < pi
//! the same, or where cos d <= 0 or cos e <= 0 instead     =>  d, e >= margin     pi <= w <= 5
//! ```
//!
//! This holds because `asin(margin) >= margin`. Full turns do not matter, because a range is cut off at 2.5
//! rad from the start of the motion. An end that was cut off needs no margin. The test takes a few products
//! for all ends together. Arc tangents would take 100 instructions each, at every knot of an examination.

use core::f64::consts::{FRAC_PI_2, PI};

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Matrix3;

use crate::control::parameters::Envelope;
use crate::control::reference::stop::vector_stop::Stop;

/// Largest margin, as a ratio of the width of a range.
pub(in crate::control::reference) const MARGIN_CAP_RATIO: f64 = 0.25;

/// Largest change of an angle along a motion \[rad\].
const MAX_CHANGE: f64 = 2.5;

/// Number of lanes: low ends of the three ranges and a zero, then high ends and a zero.
const LANES: usize = 8;

/// Ranges of the angles, with one end in each lane.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct AngleRanges {
    /// Sine and cosine of each end. Both have the opposite sign for a high end, because its distance has it.
    sine: [f64; LANES],
    cosine: [f64; LANES],
    /// Largest margin that is required from each end \[rad\].
    margin_cap_m: [f64; LANES],
    /// For a wide range, the sign of the distance, and the largest cosine of a distance that is always
    /// enough. For a narrow range, 0 and minus infinity.
    wide_sign: [f64; LANES],
    far_cosine: [f64; LANES],
    /// Sign of `cos(beta)`. It selects one of the two triples of angles that give the same rotation.
    cos_beta_sign: f64,
    /// Whether no range ends before it begins.
    is_nonempty: bool,
}

impl AngleRanges {
    /// Ranges of an envelope, for a motion that starts at X.
    pub fn new(Envelope { lowest, highest }: &Envelope, x: &[f64; 6]) -> Self {
        let [_, beta, ..] = *x;
        let zeros = [0.0; LANES];
        let mut ranges = Self {
            sine: zeros,
            cosine: zeros,
            margin_cap_m: zeros,
            wide_sign: zeros,
            far_cosine: [f64::NEG_INFINITY; LANES],
            cos_beta_sign: 1.0_f64.copysign(libm::cos(beta)),
            is_nonempty: true,
        };
        for (axis, (x, (low, high))) in x.iter().zip(lowest.iter().zip(highest)).take(3).enumerate() {
            let margin = (MARGIN_CAP_RATIO * (high - low)).min(1.0);
            let (reached_low, reached_high) = (low.max(x - MAX_CHANGE), high.min(x + MAX_CHANGE));
            let width = reached_high - reached_low;
            ranges.is_nonempty &= width >= 0.0;
            // An end that is too far to be reached needs no margin.
            let margins = [(low, reached_low), (high, reached_high)]
                .map(|(end, reached)| if *end == reached { margin } else { 0.0 });
            ranges.set_end(axis, reached_low, 1.0, margins[0], width >= PI);
            ranges.set_end(axis + LANES / 2, reached_high, -1.0, margins[1], width >= PI);
        }
        ranges
    }

    /// Ranges of an envelope, for a stop from X. `None` if they have room for every rotation of the stop.
    pub fn if_stop_may_leave(envelope: &Envelope, x: &[f64; 6], stop: &Stop) -> Option<Self> {
        let Envelope { lowest, highest } = envelope;
        let [_, beta, ..] = x;
        let turn = stop.peak_velocity * stop.duration_s;
        let need = turn / libm::cos((beta.abs() + turn).min(FRAC_PI_2));
        let mut ranges = x.iter().zip(lowest.iter().zip(highest)).take(3);
        let have_room = ranges.all(|(x, (low, high))| (x - low).min(high - x) >= need);
        (!have_room).then(|| Self::new(envelope, x))
    }

    fn set_end(&mut self, lane: usize, angle: f64, sign: f64, margin: f64, is_wide: bool) {
        let (sine, cosine) = libm::sincos(angle);
        let (wide, far) = if is_wide { (sign, 0.0) } else { (0.0, f64::NEG_INFINITY) };
        let lanes = [
            &mut self.sine,
            &mut self.cosine,
            &mut self.margin_cap_m,
            &mut self.wide_sign,
            &mut self.far_cosine,
        ];
        for (lanes, number) in lanes.into_iter().zip([sign * sine, sign * cosine, margin, wide, far]) {
            if let Some(slot) = lanes.get_mut(lane) {
                *slot = number;
            }
        }
    }

    /// Whether each angle of a rotation keeps a margin \[rad\] from the ends of its range. The margin is at
    /// most [`MARGIN_CAP_RATIO`] of the width.
    #[inline(always)]
    pub fn contain<S: Simd>(&self, simd: S, r: &Matrix3<f64>, margin_rad: f64) -> bool {
        let c = abs_cosine_of_beta(r);
        let both = |lanes: [f64; LANES / 2]| {
            let lanes = f64x4::load_array(simd, lanes);
            lanes.combine(lanes)
        };
        let load = |lanes: &[f64; LANES]| f64x8::load_array(simd, *lanes);
        // Sine and cosine of alpha and gamma are multiplied by c.
        let sine = both([-r.m23 * self.cos_beta_sign, r.m13, -r.m12 * self.cos_beta_sign, 0.0]);
        let cosine =
            both([r.m33 * self.cos_beta_sign, c * self.cos_beta_sign, r.m11 * self.cos_beta_sign, 0.0]);
        let (end_sine, end_cosine) = (load(&self.sine), load(&self.cosine));
        let distance_sine = sine * end_cosine - cosine * end_sine;
        let distance_cosine = (cosine * end_cosine + sine * end_sine) * load(&self.wide_sign);
        let margin = load(&self.margin_cap_m).min(f64x8::splat(simd, margin_rad)) * both([c, 1.0, c, 0.0]);
        let is_kept = distance_sine.simd_ge(margin) | distance_cosine.simd_le(load(&self.far_cosine));
        is_kept.all_true() & self.is_nonempty
    }
}

/// `|cos(beta)|`
#[inline(always)]
pub(in crate::control::reference) fn abs_cosine_of_beta(r: &Matrix3<f64>) -> f64 {
    (r.m11 * r.m11 + r.m12 * r.m12).sqrt()
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::control::tests::random_vectors::RandomVectors;
    use crate::model::machine::at_most_256_bits;
    use crate::model::task::{TaskState, task_coordinates};

    /// The ranges are around random angles, narrow and wide, on both sides of 90 degrees.
    #[test]
    fn a_rotation_is_inside_exactly_where_its_angles_are() {
        let mut samples = RandomVectors::new(1);
        let level = at_most_256_bits(Level::new());
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
            let margin = if k % 5 == 0 { 0.0 } else { 0.01 * samples.uniform() };
            let pose = TaskState::at_rest(x).motion().pose;
            let angles = task_coordinates(&pose, &home);
            // Distance by which the worst angle is inside, less the margin that its range requires.
            let room = |margin: f64| {
                let axes = angles.iter().zip(envelope.lowest.iter().zip(&envelope.highest)).take(3);
                axes.map(|(x, (low, high))| {
                    (x - low).min(high - x) - margin.min(MARGIN_CAP_RATIO * (high - low))
                })
                .fold(f64::INFINITY, f64::min)
            };
            let mut start = angles;
            // The start is on the same side of 90 degrees.
            for (x, size) in start.iter_mut().zip([0.5, 0.05, 0.5]) {
                *x += size * (2.0 * samples.uniform() - 1.0);
            }
            let ranges = AngleRanges::new(&envelope, &start);
            let is_contained = dispatch!(level, simd => ranges.contain(simd, &pose.rotation, margin));
            assert!(!is_contained || room(margin) > -1e-12, "{x:?} {envelope:?} {margin}");
            assert!(is_contained || room(margin * (1.0 + margin * margin)) < 1e-6, "{x:?} {margin}");
            if is_contained { inside += 1 } else { outside += 1 }
        }
        assert!(inside > 50_000 && outside > 50_000, "{inside} {outside}");
    }
}
