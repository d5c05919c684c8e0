//! Walls: bounds that the wanted velocity approaches softly, so that a platform pressed against them slides.
//!
//! Each bound has a gap `g`: of a leg's length to an end of its stroke, or of a coordinate to the envelope.
//! The gradient of the leg or coordinate is G, so that `g' = -G V`. The wanted twist V and its derivative are
//! changed by the least amount such that
//!
//! ```text
//! G V  <= phi(g)
//! G V' = -phi'(g) G Q - G' Q        where this bound is active
//! ```
//!
//! phi is the lesser of the braking curve of the approach, on a share of the limits of acceleration and jerk, and
//! `2 g / T`: far from a bound it restricts nothing. Q is the present twist. T is the duration of the stop, which
//! brakes along V. If a platform slides past fast, a leg that approaches its end slowly moves on for half of T at its
//! rate. If rotation and translation cancel in a leg, the motion that stops later remains.
//!
//! The amount of a change is `sum (dV_i^2 / (|V_i| + w |V|))`, rotations times the radius of the joints. So each
//! coordinate is changed in proportion to what is wanted of it: a platform that is pressed against a bound becomes
//! slower along its own direction, and a coordinate that is to stand hardly moves to serve another.
//!
//! The bound on V' is blended in. It holds fully once the wall removes `a^2/j` from V, the change of velocity
//! while the acceleration builds up and ends again. Without blending, V' would jump whenever another wall becomes active,
//! and in a corner the walls would take turns.
//!
//! Both ends of a leg or of a coordinate are one wall. V is found by Hildreth's method (C. Hildreth, "A
//! quadratic programming procedure", 1957), in a few sweeps over all walls. The walls prove nothing: the
//! verified stop keeps the bounds. Without walls it would keep them with a motion at the limits of jerk.
//!
//! Walls are used under `on_violation = "limit"`, for setpoints that "stop" would reject: those beyond a limit, and
//! those that the reference could not keep up with. A setpoint that keeps the limits may go as near to a bound as it
//! can be stopped. On the way to a pose walls are used once the reference rests at a bound.

use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Vector3, Vector6};

use crate::control::constants::Constants;
use crate::control::parameters::Envelope;
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::tolerances::WALL_DISTANCE_PER_STROKE;
use crate::control::reference::proposal::approach::{Approach, WantedVelocity};
use crate::control::reference::proposal::walls::derivative_bound::DerivativeBound;
use crate::control::reference::stop::vector_stop::straight_extent;
use crate::control::signals::limits::{Limit, LimitSet, Limits};
use crate::control::signals::pair::Pair;
use crate::model::LEGS;
use crate::model::inverse_geometry::{LegMotion, leg_motion};
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::rigid::{Acceleration, Motion, Twist};
use crate::model::task::task_coordinates;

/// Share of the limits of acceleration and jerk with which a wall is approached. Several walls and the motion along them take the
/// rest.
const WALL_CLOSING_LIMITS_SHARE: f64 = 0.6;
/// `w`: weight of all of the wanted velocity in the amount that a coordinate may change.
const SHARED_WEIGHT: f64 = 0.02;
/// Speed below which nothing is wanted of any coordinate \[m/s\].
const SMALLEST_SPEED: f64 = 1e-9;
/// Sweeps over the walls: 8 sweeps bring two walls at 60 degrees to within 1e-3 (2026-11-29). With many
/// active walls there are fewer sweeps, because the next number of visits to walls bounds the longest cycle.
/// Six walls hold every direction; more contradict each other.
const SWEEPS: usize = 8;
const MAX_VISITS: usize = 24;
/// Period of the sweeps over all walls. The other sweeps cover only the active walls.
const SWEEPS_PER_FULL_SWEEP: usize = 3;
/// Visits to walls that take about as long as the examination of a knot, the unit of effort.
const WALL_VISITS_PER_EFFORT: usize = 24;
/// Time constant of the return from a negative gap, as a multiple of the approach's time constant.
const RETURN_RATIO: f64 = 4.0;

/// Lanes of a gradient in memory.
const LANES: usize = 8;
/// One wall for each leg and each coordinate.
const WALL_COUNT: usize = 12;

/// One end of a wall.
#[derive(Clone, Copy, Debug, Default)]
struct End {
    /// Largest closing rate \[m/s\].
    rate: f64,
    /// Derivative of this bound at the present rate, minus the curvature \[m/s^2\].
    derivative: f64,
}

impl End {
    /// Creates an end from the rate `closing` towards it and the `curvature` of the leg or coordinate.
    /// `per_way`: ratio of a rate to the stopping distance \[1/s\].
    fn new(approach: &Approach, gap: f64, closing: f64, curvature: f64, per_way: f64) -> Self {
        let (rate, slope) = if gap > 0.0 {
            let (rate, slope) = approach.closing_velocity_and_slope(gap);
            if gap * per_way < rate { (gap * per_way, per_way) } else { (rate, slope) }
        } else {
            let slope = approach.closing_slope_at_target() / RETURN_RATIO;
            (gap * slope, slope)
        };
        Self { rate, derivative: -slope * closing - curvature }
    }
}

/// Wall of a leg or a coordinate, with both ends. Rotations are multiplied by the radius of the joints.
#[derive(Clone, Copy, Debug, Default)]
struct Wall {
    /// Limit that the wall represents.
    limit: LimitSet,
    /// Gradient: six numbers, padded with zeros.
    gradient: [f64; LANES],
    /// Inverse square of the gradient's norm.
    inverse_square: f64,
    /// The end against the gradient, then the end along it.
    ends: [End; 2],
    /// Positive if the end along the gradient is active, negative if the other end is.
    multiplier: f64,
    /// Weight of the bound on the derivative, per multiplier. The weight is at most 1.
    blend_rate: f64,
}

impl Wall {
    /// Changes the coordinates: each is divided by its scale.
    #[inline(always)]
    fn scale_by<S: Simd>(&mut self, simd: S, scale: f64x8<S>) {
        let gradient = f64x8::load_array(simd, self.gradient) * scale;
        let square = dot(gradient, gradient).max(f64::MIN_POSITIVE);
        self.blend_rate *= square * self.inverse_square;
        (self.gradient, self.inverse_square) = (gradient.to_array(), 1.0 / square);
    }

    /// Takes from a velocity what is beyond the ends. Returns whether that changed.
    #[inline(always)]
    fn restrict<S: Simd>(&mut self, simd: S, velocity: &mut f64x8<S>) -> bool {
        let Self { ends: [against, along], inverse_square, multiplier, .. } = *self;
        let gradient = f64x8::load_array(simd, self.gradient);
        // Closing rate without this wall, and the part of it beyond the ends.
        let rate = dot(gradient, *velocity) * inverse_square + multiplier;
        let allowed = rate.min(along.rate * inverse_square).max(-against.rate * inverse_square);
        self.multiplier = rate - allowed;
        if self.multiplier == multiplier {
            return false;
        }
        *velocity -= gradient * f64x8::splat(simd, self.multiplier - multiplier);
        true
    }
}

/// Walls around one pose.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Walls {
    walls: [Wall; WALL_COUNT],
    count: usize,
    radius: f64,
    /// Visits to walls so far.
    visits: usize,
}

impl Walls {
    /// Walls around a motion. `led`: twist that the motion leads to a step later.
    pub fn new(
        constants: &Constants,
        bounds: &PoseBounds,
        motion: &Motion,
        led: &Twist,
        step_s: f64,
    ) -> Self {
        let (machine, limits) = (constants.machine(), &constants.parameters.limits);
        let radius = machine.joints.radius_m;
        let mut walls = Self { walls: [Wall::default(); WALL_COUNT], count: 0, radius, visits: 0 };
        let kept = WALL_DISTANCE_PER_STROKE * machine.actuator.stroke();
        let without_acceleration = Motion { twist: *led, acceleration: Acceleration::default(), ..*motion };
        let LegMotion { length_m, rate_m_s, accel_m_s2 } = leg_motion(machine, &without_acceleration);
        let wrenches: [[f64; 6]; LEGS] = leg_wrenches(machine, &motion.pose).into();
        let approach = Approach::of_bound(limits.position, WALL_CLOSING_LIMITS_SHARE, step_s);
        let halves_s = half_durations(limits, led);
        let half_s = halves_s.angular.max(halves_s.linear);
        let per_way = 1.0 / half_s;
        let ends = bounds.shortest_m.iter().zip(&bounds.longest_m);
        let legs = length_m.iter().zip(rate_m_s.iter().zip(&accel_m_s2)).zip(ends);
        for (column, ((length, (rate, curvature)), (shortest, longest))) in wrenches.into_iter().zip(legs) {
            let [mx, my, mz, nx, ny, nz] = column;
            let (moment, direction) = (Vector3::new(mx, my, mz), Vector3::new(nx, ny, nz));
            let gradient = stacked(&(moment / radius), &direction);
            let next = length + rate * step_s;
            // Deviation of the stopping distance from `rate T / 2`: the stop leads straight on, and either
            // rotation or translation ends sooner.
            let departure = 0.5 * curvature * half_s * half_s
                + moment.dot(&led.angular) * (halves_s.angular - half_s)
                + direction.dot(&led.linear) * (halves_s.linear - half_s);
            let gaps = [longest - next - departure.max(0.0), next - shortest + departure.min(0.0)];
            let [long, short] = gaps.map(|gap| gap - kept);
            let ends = [(short, -rate, -curvature), (long, *rate, *curvature)];
            let ends =
                ends.map(|(gap, closing, curvature)| End::new(&approach, gap, closing, curvature, per_way));
            walls.push(Limit::Stroke, &approach, gradient, ends);
        }
        if let Some(envelope) = &bounds.envelope {
            walls.push_envelope(constants, envelope, motion, led, step_s, kept);
        }
        walls
    }

    fn push_envelope(
        &mut self,
        constants: &Constants,
        Envelope { lowest, highest }: &Envelope,
        motion: &Motion,
        led: &Twist,
        step_s: f64,
        kept: f64,
    ) {
        let (machine, limits) = (constants.machine(), &constants.parameters.limits);
        let x = task_coordinates(&motion.pose, &machine.home);
        let radius = self.radius;
        // Rates of the Bryan angles:
        // alpha' = (e1 - s n) . w / c^2, beta' = e2 . w, gamma' = (n - s e1) . w / c^2.
        // n is the last column of the rotation; c e2 is normal to n and e1.
        let [_, beta, ..] = x;
        let (e1, n) = (Vector3::x(), motion.pose.rotation.column(2).into_owned());
        let (s, c) = (n.x, (n.y * n.y + n.z * n.z).sqrt().copysign(libm::cos(beta)));
        let e2 = Vector3::new(0.0, n.z, -n.y) / c;
        let zero = Vector3::zeros();
        let gradients = [
            stacked(&((e1 - n * s) / (c * c * radius)), &zero),
            stacked(&(e2 / radius), &zero),
            stacked(&((n - e1 * s) / (c * c * radius)), &zero),
            stacked(&zero, &Vector3::x()),
            stacked(&zero, &Vector3::y()),
            stacked(&zero, &Vector3::z()),
        ];
        let turning = Approach::of_bound(limits.orientation, WALL_CLOSING_LIMITS_SHARE, step_s);
        let shifting = Approach::of_bound(limits.position, WALL_CLOSING_LIMITS_SHARE, step_s);
        let velocity = stacked(&(led.angular * radius), &led.linear);
        let per_way = half_durations(limits, led).map(f64::recip);
        let ranges = lowest.iter().zip(highest);
        for (axis, ((x, gradient), (low, high))) in x.iter().zip(gradients).zip(ranges).enumerate() {
            let (approach, kept, per_way) = if axis < 3 {
                (&turning, kept / radius, per_way.angular)
            } else {
                (&shifting, kept, per_way.linear)
            };
            let kept = kept.min(0.05 * (high - low));
            let rate = gradient.dot(&velocity);
            let next = x + rate * step_s;
            let ends = [(next - low - kept, -rate), (high - next - kept, rate)];
            let ends = ends.map(|(gap, closing)| End::new(approach, gap, closing, 0.0, per_way));
            self.push(Limit::Envelope, approach, gradient, ends);
        }
    }

    fn push(&mut self, limit: Limit, approach: &Approach, gradient: Vector6<f64>, ends: [End; 2]) {
        if let Some(wall) = self.walls.get_mut(self.count) {
            let square = gradient.norm_squared();
            *wall = Wall {
                limit: LimitSet::default().with(limit, true),
                inverse_square: 1.0 / square.max(f64::MIN_POSITIVE),
                gradient: padded(&gradient),
                ends,
                blend_rate: square / approach.two_ramp_velocity(),
                ..Wall::default()
            };
            self.count += 1;
        }
    }

    /// Effort so far, in knots of an examination.
    pub fn effort(&self) -> u32 {
        (self.visits / WALL_VISITS_PER_EFFORT) as u32
    }

    /// Changes the wanted velocities of rotation and translation by the least amount such that no wall is
    /// approached too fast. Returns the limits that required a change.
    pub fn project(
        &mut self,
        level: Level,
        turn: &mut WantedVelocity,
        shift: &mut WantedVelocity,
    ) -> LimitSet {
        dispatch!(level, simd => self.project_in_lanes(simd, turn, shift))
    }

    #[inline(always)]
    fn project_in_lanes<S: Simd>(
        &mut self,
        simd: S,
        turn: &mut WantedVelocity,
        shift: &mut WantedVelocity,
    ) -> LimitSet {
        let load = |turn: &Vector3<f64>, shift: &Vector3<f64>| {
            f64x8::load_array(simd, padded(&stacked(&(turn * self.radius), shift)))
        };
        let wanted = load(&turn.velocity, &shift.velocity);
        // In coordinates in which the least change is the shortest.
        let per_speed = 1.0 / dot(wanted, wanted).sqrt().max(SMALLEST_SPEED);
        let amounts = wanted.max(-wanted) * f64x8::splat(simd, per_speed);
        let scale = (amounts + f64x8::splat(simd, SHARED_WEIGHT)).sqrt();
        let walls = self.walls.get_mut(..self.count).unwrap_or_default();
        for wall in walls.iter_mut() {
            wall.scale_by(simd, scale);
        }
        let mut velocity = wanted / scale;
        let mut sweeps = SWEEPS;
        let mut sweep = 0;
        while sweep < sweeps {
            let (mut is_changed, mut active) = (false, 0);
            let is_full = sweep % SWEEPS_PER_FULL_SWEEP == 0;
            for wall in walls.iter_mut() {
                if !is_full && wall.multiplier == 0.0 {
                    continue;
                }
                is_changed |= wall.restrict(simd, &mut velocity);
                active += usize::from(wall.multiplier != 0.0);
                self.visits += 1;
            }
            if is_full && !is_changed {
                break;
            }
            sweep += 1;
            sweeps = SWEEPS.min(MAX_VISITS / active.max(1));
        }
        let mut restricting = LimitSet::default();
        let mut active = heapless::Vec::<_, WALL_COUNT>::new();
        for wall in walls.iter().filter(|wall| wall.multiplier != 0.0) {
            restricting = restricting.union(wall.limit);
            active.push(DerivativeBound::new(wall)).ok();
        }
        if restricting.is_empty() {
            return restricting;
        }
        let mut derivative = load(&turn.derivative, &shift.derivative) / scale;
        for _ in 0..sweeps {
            for bound in &mut active {
                let gradient = f64x8::load_array(simd, *bound.gradient);
                let change = bound.change(dot(gradient, derivative));
                derivative -= gradient * f64x8::splat(simd, change);
            }
        }
        self.visits += sweeps * active.len();
        let store = |lanes: f64x8<S>, turn: &mut Vector3<f64>, shift: &mut Vector3<f64>| {
            let [mx, my, mz, x, y, z, ..] = lanes.to_array();
            (*turn, *shift) = (Vector3::new(mx, my, mz) / self.radius, Vector3::new(x, y, z));
        };
        store(velocity * scale, &mut turn.velocity, &mut shift.velocity);
        store(derivative * scale, &mut turn.derivative, &mut shift.derivative);
        restricting
    }
}

/// Sum of the products, in the same order on every processor.
#[inline(always)]
fn dot<S: Simd>(a: f64x8<S>, b: f64x8<S>) -> f64 {
    let (low, high) = (a * b).split();
    let [a, b, c, d] = (low + high).to_array();
    (a + b) + (c + d)
}

fn padded(v: &Vector6<f64>) -> [f64; LANES] {
    let [a, b, c, d, e, f] = (*v).into();
    [a, b, c, d, e, f, 0.0, 0.0]
}

/// Half of the durations of the stops of rotation and translation, from a twist with zero acceleration \[s\].
/// This is the ratio of stopping distance to velocity.
fn half_durations(limits: &Limits, twist: &Twist) -> Pair<f64> {
    let half = |velocity: &Vector3<f64>, limits| 0.5 * straight_extent(velocity.norm(), limits).duration_s;
    Pair { angular: half(&twist.angular, &limits.orientation), linear: half(&twist.linear, &limits.position) }
}

fn stacked(first: &Vector3<f64>, second: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(first.x, first.y, first.z, second.x, second.y, second.z)
}

mod derivative_bound;
#[cfg(test)]
mod tests;
