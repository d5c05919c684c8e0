//! Stop of a vector: from any velocity and acceleration to rest, in closed form, within acceleration and jerk
//! limits.
//!
//! Position and orientation are each a triple integrator in base axes, `v' = a`, `a' = j`, so that the same
//! stop serves both. There are two kinds of stop. The end pose is not given; it follows from the stop.
//!
//! **Release first**, in free space: `a` decreases to zero in its own direction within `|a| / J`, so that `v`
//! changes straight to `v1 = v + a |a| / 2J`. Then `v1` decreases to zero in its own direction. Usually only
//! the extent of this stop is needed:
//!
//! ```text
//! duration = |a|/J + d(v1)                        d = v/A + A/J, length v^2/2A + v A/2J      v >= A^2/J
//! length  <= max(|v|, |v1|) |a|/J + length(v1)    d = 2 sqrt(v/J), length v sqrt(v/J)        below
//! ```
//!
//! **Brake at once**, near a wall, where releasing the brake first would waste room. With `u = v/|v|` and
//! `a = a_p u + c e`, `c >= 0`, the part across, along e, ends with zero velocity and zero acceleration:
//!
//! ```text
//! across:  -Jc for (1 + sqrt 1/2) c/Jc, then +Jc for sqrt(1/2) c/Jc,  Jc = 0.8 J c/A;    speed <= c^2/2Jc
//! along:   meanwhile brakes with A1 = sqrt(A^2 - c^2/2), Jp = sqrt(J^2 - Jc^2), jerk into braking at most
//!          j1 = min(Jp, (a_p + A1) Jc / ((1 - sqrt(1/2)) c));  afterwards with A and J
//! ```
//!
//! The acceleration keeps `|a| <= A`. The path `(a_p, a_c)` starts in the disk of radius A. j1 lets it reach
//! `-A1` only when `a_c <= c/sqrt 2`, which is in the disk, too. The path between is a straight line, and
//! disks are convex. Later both parts stay below these corners. The jerk keeps `|j|^2 = Jp^2 + Jc^2 = J^2`.
//! If `v = 0`, `u` is along `a`, so that `c = 0`.

use core::f64::consts::FRAC_1_SQRT_2;

use fearless_simd::{Simd, f64x4, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::control::reference::proof::padding::{Padded, padded};
use crate::control::signals::limits::DerivativeLimits;

/// Jerk across as a ratio of `J c/A`. A larger ratio ends the part across sooner and leaves less jerk along.
const ACROSS_JERK_RATIO: f64 = 0.8;

/// Velocity or acceleration that counts as zero, as a ratio of its limit.
const NEGLIGIBLE_RATIO: f64 = 1e-9;

/// Most pieces of a stop: five while there is a part across, three afterwards, and one at rest.
const MAX_PIECES: usize = 9;

/// Largest velocity, duration and length of a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::control::reference) struct StopExtent {
    pub peak_velocity: f64,
    /// Duration \[s\].
    pub duration_s: f64,
    /// Bound on the distance from the start.
    pub distance_bound: f64,
}

/// Extent of the release-first stop.
pub(in crate::control::reference) fn release_first_extent(
    v: &Vector3<f64>,
    a: &Vector3<f64>,
    limits: &DerivativeLimits,
) -> StopExtent {
    let release = a.norm() / limits.jerk;
    let released = (v + a * (0.5 * release)).norm();
    let peak_velocity = v.norm().max(released);
    let straight = straight_extent(released, limits);
    StopExtent {
        peak_velocity,
        duration_s: release + straight.duration_s,
        distance_bound: peak_velocity * release + straight.distance_bound,
    }
}

/// Extent of the stop from a speed with zero acceleration.
pub(in crate::control::reference) fn straight_extent(
    v: f64,
    DerivativeLimits { acceleration, jerk, .. }: &DerivativeLimits,
) -> StopExtent {
    let ramp = acceleration / jerk;
    let (duration_s, distance_bound) = if v >= acceleration * ramp {
        (v / acceleration + ramp, 0.5 * v * (v / acceleration + ramp))
    } else {
        let ramp = (v / jerk).sqrt();
        (2.0 * ramp, v * ramp)
    };
    StopExtent { peak_velocity: v, duration_s, distance_bound }
}

/// Direction u of the stop that brakes at once: along the velocity, or the acceleration if there is none.
pub(in crate::control::reference) fn braking_direction(
    v: &Vector3<f64>,
    a: &Vector3<f64>,
    limits: &DerivativeLimits,
) -> Vector3<f64> {
    let (speed, magnitude) = (v.norm(), a.norm());
    if speed > NEGLIGIBLE_RATIO * limits.velocity {
        v / speed
    } else if magnitude > 0.0 {
        a / magnitude
    } else {
        Vector3::zeros()
    }
}

/// Displacement, velocity and acceleration at one instant of a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::control::reference) struct VectorStopState {
    pub displacement: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub acceleration: Vector3<f64>,
}

/// Piece of a stop with constant jerk, and the state in which it begins.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Piece {
    displacement: Padded,
    velocity: Padded,
    acceleration: Padded,
    jerk: Padded,
}

impl Piece {
    fn new(begin: &VectorStopState, jerk: &Vector3<f64>) -> Self {
        Self {
            displacement: padded(&begin.displacement),
            velocity: padded(&begin.velocity),
            acceleration: padded(&begin.acceleration),
            jerk: padded(jerk),
        }
    }

    /// State `dt` seconds after the start of the piece.
    #[inline(always)]
    fn after<S: Simd>(&self, simd: S, dt: f64) -> VectorStopState {
        let (load, splat) = (|lanes| f64x4::load_array(simd, lanes), |number| f64x4::splat(simd, number));
        let vector = |lanes: f64x4<S>| {
            let [x, y, z, _] = lanes.to_array();
            Vector3::new(x, y, z)
        };
        let (velocity, acceleration, jerk) = (load(self.velocity), load(self.acceleration), load(self.jerk));
        let mean_velocity = velocity + (acceleration * splat(0.5) + jerk * splat(dt / 6.0)) * splat(dt);
        VectorStopState {
            displacement: vector(load(self.displacement) + mean_velocity * splat(dt)),
            velocity: vector(velocity + (acceleration + jerk * splat(0.5 * dt)) * splat(dt)),
            acceleration: vector(acceleration + jerk * splat(dt)),
        }
    }
}

/// A stop as pieces of constant jerk.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct Stop {
    pieces: [Piece; MAX_PIECES],
    count: usize,
    /// Start of each piece \[s\]; infinite if there is none.
    begins: [f64; MAX_PIECES],
    /// Bound on the velocity.
    pub peak_velocity: f64,
    /// Duration \[s\].
    pub duration_s: f64,
}

impl Stop {
    /// Plans the release-first stop, in place because a stop is large.
    #[inline(always)]
    pub fn release_first<S: Simd>(
        &mut self,
        simd: S,
        v: &Vector3<f64>,
        a: &Vector3<f64>,
        limits: &DerivativeLimits,
    ) {
        let DerivativeLimits { acceleration: limit, jerk, .. } = *limits;
        let mut pieces = Pieces::new(simd, self, v, a);
        let magnitude = a.norm();
        if magnitude > 0.0 {
            pieces.push(magnitude / jerk, -a * (jerk / magnitude));
        }
        let v1 = pieces.end.velocity;
        let speed = v1.norm();
        let u = if speed > 0.0 { v1 / speed } else { Vector3::zeros() };
        for (dt, jerk) in brake(speed, 0.0, jerk, limit, |_| jerk) {
            pieces.push(dt, u * jerk);
        }
        pieces.finish_with_rest(v.norm().max(speed));
    }

    /// Plans the stop that brakes at once, in place.
    #[inline(always)]
    pub fn brake_at_once<S: Simd>(
        &mut self,
        simd: S,
        v: &Vector3<f64>,
        a: &Vector3<f64>,
        limits: &DerivativeLimits,
    ) {
        let DerivativeLimits { acceleration: limit, jerk, .. } = *limits;
        let u = braking_direction(v, a, limits);
        let rest = a - u * a.dot(&u);
        let c = rest.norm();
        let mut pieces = Pieces::new(simd, self, v, a);
        let (mut across_speed, mut peak) = (0.0, 0.0);
        if c > NEGLIGIBLE_RATIO * limit {
            let across_jerk = ACROSS_JERK_RATIO * jerk * c / limit;
            let across = [
                ((1.0 + FRAC_1_SQRT_2) * c / across_jerk, -across_jerk),
                (FRAC_1_SQRT_2 * c / across_jerk, across_jerk),
            ];
            across_speed = 0.5 * c * c / across_jerk;
            let limit_along = (limit * limit - 0.5 * c * c).sqrt();
            let jerk_along = (jerk * jerk - across_jerk * across_jerk).sqrt();
            let steepness = across_jerk / ((1.0 - FRAC_1_SQRT_2) * c);
            let (speed, along) = (v.dot(&u), a.dot(&u));
            let plan = brake(speed, along, jerk_along, limit_along, |a| {
                jerk_along.min((a + limit_along).max(0.0) * steepness)
            });
            peak = peak_speed(speed, along, &plan);
            pieces.push_both(&u, &plan, &(rest / c), &across);
        }
        let (speed, along) = (pieces.end.velocity.dot(&u), pieces.end.acceleration.dot(&u));
        let plan = brake(speed, along, jerk, limit, |_| jerk);
        peak = peak_speed(speed, along, &plan).max(peak);
        for (dt, jerk) in plan {
            pieces.push(dt, u * jerk);
        }
        pieces.finish_with_rest((peak * peak + across_speed * across_speed).sqrt());
    }

    /// State `t_s` seconds after the start; at rest from the end on.
    #[inline(always)]
    pub fn at<S: Simd>(&self, simd: S, t_s: f64) -> VectorStopState {
        // Compares all starts without a branch: successive calls are mostly for knots in different pieces.
        let begun = self.begins.iter().map(|begin| usize::from(*begin <= t_s)).sum::<usize>();
        let index = begun.saturating_sub(1);
        match (self.pieces.get(index), self.begins.get(index)) {
            (Some(piece), Some(begin)) => piece.after(simd, t_s - begin),
            _ => VectorStopState::default(),
        }
    }
}

/// Builder of the pieces of a stop, with the state at their end.
struct Pieces<'a, S: Simd> {
    simd: S,
    stop: &'a mut Stop,
    end: VectorStopState,
}

impl<'a, S: Simd> Pieces<'a, S> {
    #[inline(always)]
    fn new(simd: S, stop: &'a mut Stop, v: &Vector3<f64>, a: &Vector3<f64>) -> Self {
        let end = VectorStopState { velocity: *v, acceleration: *a, ..VectorStopState::default() };
        (stop.count, stop.begins, stop.duration_s) = (0, [f64::INFINITY; MAX_PIECES], 0.0);
        Self { simd, stop, end }
    }

    /// Appends a piece.
    #[inline(always)]
    fn push(&mut self, dt: f64, jerk: Vector3<f64>) {
        if !(dt > 0.0) {
            return;
        }
        let Self { simd, stop: Stop { pieces, count, begins, duration_s, .. }, end } = self;
        if let (Some(piece), Some(begin)) = (pieces.get_mut(*count), begins.get_mut(*count)) {
            (*piece, *begin) = (Piece::new(end, &jerk), *duration_s);
            *count += 1;
            *duration_s += dt;
            *end = piece.after(*simd, dt);
        }
    }

    /// Appends the pieces of a plan along `u` combined with a plan across, along `e`, until the plan across
    /// ends.
    #[inline(always)]
    fn push_both(&mut self, u: &Vector3<f64>, along: &Plan, e: &Vector3<f64>, across: &[(f64, f64); 2]) {
        let [(first, _), (second, _)] = *across;
        let end = first + second;
        let mut t = 0.0;
        // Each pass ends at one of five instants.
        for _ in 0..5 {
            let ((left, jerk), (left_across, jerk_across)) = (present(along, t), present(across, t));
            let dt = left.min(left_across).min(end - t);
            self.push(dt, u * jerk + e * jerk_across);
            t += dt;
        }
    }

    /// Appends the rest at the end of the stop, and stores the peak velocity.
    #[inline(always)]
    fn finish_with_rest(self, peak_velocity: f64) {
        let rest = VectorStopState { displacement: self.end.displacement, ..VectorStopState::default() };
        let Stop { pieces, count, begins, duration_s, .. } = self.stop;
        if let (Some(piece), Some(begin)) = (pieces.get_mut(*count), begins.get_mut(*count)) {
            (*piece, *begin) = (Piece::new(&rest, &Vector3::zeros()), *duration_s);
            *count += 1;
        }
        self.stop.peak_velocity = peak_velocity;
    }
}

/// Durations and jerks of one component: ramp into braking, hold, release.
type Plan = [(f64, f64); 3];

/// Time left in the present section of a plan, and its jerk; infinite and zero after the end.
fn present(plan: &[(f64, f64)], t: f64) -> (f64, f64) {
    let mut end = 0.0;
    for (dt, jerk) in plan {
        end += dt;
        if t < end {
            return (end - t, *jerk);
        }
    }
    (f64::INFINITY, 0.0)
}

/// Stop of one component from (v, a) with the release jerk `jerk` and the acceleration `limit`. `ramp_jerk`
/// gives the jerk of the ramp into braking for an acceleration, positive in the direction in which the
/// component would move on if released.
fn brake(v: f64, a: f64, jerk: f64, limit: f64, ramp_jerk: impl Fn(f64) -> f64) -> Plan {
    // If released now, the component would move on in the direction of `sign`.
    let sign = if v + a * a.abs() / (2.0 * jerk) >= 0.0 { 1.0 } else { -1.0 };
    let (v, a) = (sign * v, sign * a);
    let ramp_jerk = ramp_jerk(a);
    if !(ramp_jerk > 0.0) {
        // Braking at the limit already.
        let hold = (v - limit * limit / (2.0 * jerk)) / limit;
        return [(0.0, 0.0), (hold.max(0.0), 0.0), (limit / jerk, sign * jerk)];
    }
    let peak = ((2.0 * v * ramp_jerk + a * a) / (1.0 + ramp_jerk / jerk)).max(0.0).sqrt();
    let hold = (v + (a - limit) * (a + limit) / (2.0 * ramp_jerk) - limit * limit / (2.0 * jerk)) / limit;
    let (peak, hold) = if peak > limit { (limit, hold.max(0.0)) } else { (peak, 0.0) };
    [((a + peak).max(0.0) / ramp_jerk, -sign * ramp_jerk), (hold, 0.0), (peak / jerk, sign * jerk)]
}

/// Largest speed of a component during its plan: at the start, or where the acceleration changes its sign.
fn peak_speed(v: f64, a: f64, [(_, jerk), ..]: &Plan) -> f64 {
    let turned = if a * jerk < 0.0 { v - 0.5 * a * a / jerk } else { v };
    v.abs().max(turned.abs())
}

#[cfg(test)]
mod tests;
