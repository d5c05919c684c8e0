//! Third-order approach of a vector to a moving target: the acceleration of the next instant.
//!
//! The approach is a cascade of two braking curves, on the vectors themselves and not per axis. The target of
//! the next instant is `p_t, v_t, a_t`. The present acceleration leads to the position P and the velocity Q:
//!
//! ```text
//! e   = p_t - P                       of the orientation log(R_t R^T): |e|' = e^ . (w_t - w) holds exactly
//! d(v)= tau1 v + v^2/2a + v a/2j      v >= a^2/j,   a = 0.95 A, j = J: the way in which v can be stopped
//!       tau1 v + v^1.5 / sqrt(j)      below;        phi = inverse of d
//! v_d = v_t + e^ phi(|e|)             velocity wanted
//! a_f = a_t + (phi/|e|)(v_t - Q) + (phi' - phi/|e|) e^ (e^ . (v_t - Q))       its derivative
//! x   = v_d - Q
//! a*  = a_f + 2 x / (tau2 (1 + sqrt(1 + 2 |x| / (0.7 J tau2^2))))            limited to A, its change to J h
//! ```
//!
//! d is the stopping distance from `a = 0`. The plain braking curve would overshoot where the velocity limit
//! hands over to it. Without limits `x' = -psi(x)` and `|e|' <= -phi + |x|`: the cascade is globally stable,
//! and its jerk is below 0.7 J.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use crate::control::constants::Constants;
use crate::control::signals::limits::{DerivativeLimits, Limit, LimitSet};
use crate::control::signals::pair::Pair;
use crate::model::inverse_geometry::leg_lengths_and_rates;
use crate::model::rigid::{Pose, Twist};

/// Share of the acceleration limit that the outer curve brakes with; the rest is for corrections.
const BRAKING_SHARE: f64 = 0.95;
/// Share of the velocity limit that a wanted velocity may reach: the inner curve ends there without exceeding
/// the limit.
const VELOCITY_SHARE: f64 = 0.999;
/// Share of the jerk limit that the inner curve uses.
const INNER_JERK_SHARE: f64 = 0.7;
/// Time constant of the outer curve, as a multiple of the build-up time `A / J`. It is at least the next
/// number of steps.
const OUTER_TIME_PER_RAMP: f64 = 0.4;
const MIN_OUTER_STEPS: f64 = 4.0;
/// Time constant of the inner curve, as a ratio of the outer one.
const INNER_TIME_RATIO: f64 = 0.5;
/// Steps of Newton's method on the braking curve, from above. Each leaves less than half of the error.
const NEWTON_STEPS: u32 = 4;
/// Least square root of a velocity: a step divides by it.
const SMALLEST_ROOT: f64 = 1e-150;

/// Target of one vector at the next instant.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct ApproachTarget {
    /// `e`: the target less the value that the present acceleration leads to.
    pub offset: Vector3<f64>,
    /// `v_t` and `a_t`, of the target itself.
    pub target_velocity: Vector3<f64>,
    pub target_acceleration: Vector3<f64>,
}

/// Velocity wanted at the next instant, and its derivative.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct WantedVelocity {
    pub velocity: Vector3<f64>,
    pub derivative: Vector3<f64>,
    /// Whether the velocity limit reduced it.
    pub is_limited: bool,
}

/// Limits of the approach of one vector, and the length of a step \[s\].
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Approach {
    limits: DerivativeLimits,
    /// Limits for closing the distance to the target, without the target's own motion.
    closing: DerivativeLimits,
    step_s: f64,
    outer_s: f64,
}

impl Approach {
    /// `closing_scale` is the share of the limits for closing the distance to the target.
    pub fn new(limits: DerivativeLimits, closing_scale: f64, step_s: f64) -> Self {
        let ramp_s = limits.acceleration / limits.jerk;
        let outer_s = (OUTER_TIME_PER_RAMP * ramp_s).max(MIN_OUTER_STEPS * step_s);
        Self { limits, closing: limits.scaled(closing_scale), step_s, outer_s }
    }

    /// Approach of a bound: its velocity follows from the distance alone.
    pub fn of_bound(limits: DerivativeLimits, closing_scale: f64, step_s: f64) -> Self {
        let mut approach = Self::new(limits, closing_scale, step_s);
        approach.closing.velocity = f64::INFINITY;
        approach
    }

    /// Wanted velocities of two vectors. `ahead`: the velocities that the present accelerations lead to.
    pub fn wanted(
        approaches: Pair<&Self>,
        targets: Pair<&ApproachTarget>,
        ahead: Pair<&Vector3<f64>>,
    ) -> Pair<WantedVelocity> {
        let distances = targets.map(|target| target.offset.norm());
        let roots =
            closing_roots([approaches.angular, approaches.linear], [distances.angular, distances.linear]);
        let roots = Pair { angular: roots[0], linear: roots[1] };
        let at = approaches.zip(targets).zip(ahead).zip(distances.zip(roots));
        at.map(|(((it, target), ahead), (distance, root))| it.wanted_at(target, ahead, distance, root))
    }

    fn wanted_at(
        &self,
        ApproachTarget { offset, target_velocity, target_acceleration }: &ApproachTarget,
        ahead: &Vector3<f64>,
        distance: f64,
        root: f64,
    ) -> WantedVelocity {
        let (closing, slope) = self.closing_velocity_of(distance, || root);
        let ratio = if closing > 0.0 { closing / distance } else { slope };
        let direction = if distance > 0.0 { offset / distance } else { Vector3::zeros() };
        let relative = target_velocity - ahead;
        let wanted = target_velocity + offset * ratio;
        let derivative =
            target_acceleration + relative * ratio + direction * ((slope - ratio) * direction.dot(&relative));
        let mut wanted = WantedVelocity { velocity: wanted, derivative, is_limited: false };
        self.limit_velocity(&mut wanted);
        wanted
    }

    /// Limits a wanted velocity.
    pub fn limit_velocity(&self, wanted: &mut WantedVelocity) {
        let (speed, limit) = (wanted.velocity.norm(), VELOCITY_SHARE * self.limits.velocity);
        if speed > limit {
            wanted.velocity *= limit / speed;
            let u = wanted.velocity / limit;
            // On the sphere of the limit the velocity can only turn.
            wanted.derivative = (wanted.derivative - u * wanted.derivative.dot(&u)) * (limit / speed);
            wanted.is_limited = true;
        }
    }

    /// phi' at distance zero \[1/s\].
    pub fn closing_slope_at_target(&self) -> f64 {
        1.0 / self.outer_s
    }

    /// Change of the velocity while the acceleration builds up to its limit and ends again, `a^2/j` \[m/s\].
    pub fn two_ramp_velocity(&self) -> f64 {
        self.closing.acceleration * self.closing.acceleration / self.closing.jerk
    }

    /// phi and phi' at a distance.
    pub fn closing_velocity_and_slope(&self, distance: f64) -> (f64, f64) {
        self.closing_velocity_of(distance, || closing_roots([self], [distance])[0])
    }

    /// phi and phi' at a distance. `root` is the square root of phi, needed below `a^2/j` only.
    fn closing_velocity_of(&self, distance: f64, root: impl FnOnce() -> f64) -> (f64, f64) {
        let DerivativeLimits { velocity: limit, acceleration, jerk } = self.closing;
        let a = BRAKING_SHARE * acceleration;
        let (v, slope) = if distance * jerk >= a * a * (self.outer_s + a / jerk) {
            let linear = self.outer_s + a / (2.0 * jerk);
            let v = 2.0 * distance / (linear + (linear * linear + 2.0 * distance / a).sqrt());
            (v, 1.0 / (linear + v / a))
        } else {
            let root = root();
            let v = (root * root).min(distance / self.outer_s);
            (v, 1.0 / (self.outer_s + 1.5 * root / jerk.sqrt()))
        };
        if v > limit { (limit, 0.0) } else { (v, slope) }
    }

    /// Accelerations of two vectors at the next instant for their wanted velocities, and the limits of
    /// acceleration and jerk that reduced them. With `in_proportion` the smaller of the two factors scales
    /// both, which keeps the direction.
    pub fn accelerations(
        approaches: Pair<&Self>,
        wanted: Pair<&WantedVelocity>,
        ahead: Pair<&Vector3<f64>>,
        present: Pair<&Vector3<f64>>,
        in_proportion: bool,
    ) -> (Pair<Vector3<f64>>, LimitSet) {
        let aim = approaches
            .zip(wanted)
            .zip(ahead)
            .map(|((it, wanted), ahead)| it.unlimited_acceleration(wanted, ahead));
        let largest = approaches.map(|approach| approach.limits.acceleration);
        let (aim, by_acceleration) = limited(aim, largest, in_proportion);
        let change = aim.zip(present).map(|(aim, present)| aim - present);
        let largest = approaches.map(|approach| approach.limits.jerk * approach.step_s);
        let (change, by_jerk) = limited(change, largest, in_proportion);
        let limits =
            LimitSet::default().with(Limit::Acceleration, by_acceleration).with(Limit::Jerk, by_jerk);
        (present.zip(change).map(|(present, change)| present + change), limits)
    }

    /// `a*` without limits.
    fn unlimited_acceleration(&self, wanted: &WantedVelocity, ahead: &Vector3<f64>) -> Vector3<f64> {
        let x = wanted.velocity - ahead;
        let time = INNER_TIME_RATIO * self.outer_s;
        let jerk = INNER_JERK_SHARE * self.limits.jerk;
        let per_velocity = 2.0 / (jerk * time * time);
        let gain = 2.0 / (time * (1.0 + (1.0 + x.norm() * per_velocity).sqrt()));
        wanted.derivative + x * gain
    }
}

/// Square roots of phi below `a^2/j` for several vectors, side by side. Each Newton step of a vector waits
/// for the previous one. A step is therefore a single division of short terms, and the steps of the other
/// vectors are computed meanwhile.
fn closing_roots<const N: usize>(approaches: [&Approach; N], distances: [f64; N]) -> [f64; N] {
    let by_root_jerk = approaches.map(|approach| 1.0 / approach.closing.jerk.sqrt());
    let outer_s = approaches.map(|approach| approach.outer_s);
    let mut roots = [0.0; N];
    for ((root, distance), outer_s) in roots.iter_mut().zip(&distances).zip(&outer_s) {
        *root = (distance / outer_s).sqrt().max(SMALLEST_ROOT);
    }
    for _ in 0..NEWTON_STEPS {
        let curves = distances.iter().zip(&outer_s).zip(&by_root_jerk);
        for (root, ((distance, outer_s), by_root_jerk)) in roots.iter_mut().zip(curves) {
            let ramp_s = *root * by_root_jerk;
            let square = *root * *root;
            *root = (square * (outer_s + 2.0 * ramp_s) + distance) / (*root * (2.0 * outer_s + 3.0 * ramp_s));
        }
    }
    roots
}

/// Share of a leg's largest rate that a wanted velocity may reach: the velocity ends there without exceeding
/// the limit.
const LEG_RATE_SHARE: f64 = 0.97;

/// Reduces the wanted velocities of rotation and translation by one factor, so that no leg moves too fast.
/// Returns whether they were reduced.
pub(in crate::control::reference) fn limit_leg_rates(
    constants: &Constants,
    pose: &Pose,
    turn: &mut WantedVelocity,
    shift: &mut WantedVelocity,
) -> bool {
    let machine = constants.machine();
    let limit = LEG_RATE_SHARE * machine.actuator.max_rate_m_s;
    if shift.velocity.norm() + constants.arm_m * turn.velocity.norm() <= limit {
        return false;
    }
    let twist = Twist { angular: turn.velocity, linear: shift.velocity };
    let (_, rates) = leg_lengths_and_rates(machine, pose, &twist);
    let fastest = rates.iter().fold(0.0_f64, |fastest, rate| fastest.max(rate.abs()));
    if fastest <= limit {
        return false;
    }
    let factor = limit / fastest;
    for wanted in [turn, shift] {
        wanted.velocity *= factor;
        wanted.derivative *= factor;
    }
    true
}

/// Shortens two vectors to at most `largest`, each by its own factor or both by the smaller one. Also returns
/// whether one was longer.
fn limited(
    vectors: Pair<Vector3<f64>>,
    largest: Pair<f64>,
    in_proportion: bool,
) -> (Pair<Vector3<f64>>, bool) {
    let factors = vectors.zip(largest).map(|(v, largest)| {
        let norm = v.norm();
        if norm > largest { largest / norm } else { 1.0 }
    });
    let least = factors.angular.min(factors.linear);
    let factors = if in_proportion { Pair { angular: least, linear: least } } else { factors };
    (vectors.zip(factors).map(|(v, factor)| v * factor), least < 1.0)
}
