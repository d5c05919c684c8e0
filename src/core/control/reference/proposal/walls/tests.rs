//! Tests of each wall against finite differences of lengths and coordinates, and of the restricted velocities
//! against the conditions of an optimum.

use nalgebra::Matrix3;

use fearless_simd::Level;

use crate::control::reference::proposal::walls::*;
use crate::control::reference::stop::pose_stop::{PoseStop, StopKind, advanced};
use crate::control::setpoint::target::at_rest;
use crate::control::signals::limits::DerivativeLimits;
use crate::control::tests::random_vectors::RandomVectors;
use crate::control::tests::{machine, parameters, pose};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::rigid::Pose;

const STEP_S: f64 = 1e-3;

/// One end of a wall, with the gradient towards that end.
#[derive(Clone, Copy)]
struct WallEnd {
    limit: LimitSet,
    gradient: Vector6<f64>,
    end: End,
    /// Positive if the end is active.
    multiplier: f64,
}

/// Both ends of each wall; the end along the gradient comes first.
fn ends(walls: &Walls) -> Vec<WallEnd> {
    let of = |wall: &Wall, sign: f64, end: End| WallEnd {
        limit: wall.limit,
        gradient: Vector6::from_row_slice(&wall.gradient[..6]) * sign,
        end,
        multiplier: (wall.multiplier * sign).max(0.0),
    };
    let kept = walls.walls.iter().take(walls.count);
    kept.flat_map(|wall| [of(wall, 1.0, wall.ends[1]), of(wall, -1.0, wall.ends[0])]).collect()
}

struct Scene {
    constants: Constants,
    bounds: PoseBounds,
    motion: Motion,
}

impl Scene {
    fn new(samples: &mut RandomVectors) -> Self {
        let machine = machine(samples);
        let mut parameters = parameters(&machine);
        parameters.envelope = Some(Envelope {
            lowest: [-0.3, -0.3, -0.3, -0.2, -0.2, 1.3],
            highest: [0.3, 0.3, 0.3, 0.2, 0.2, 1.7],
        });
        let constants = Constants::new(&machine, parameters);
        let twist = Twist { angular: samples.vector(0.8), linear: samples.vector(0.8) };
        let motion = Motion { twist, ..at_rest(&pose(samples, &constants)) };
        Self { bounds: PoseBounds::configured(&constants), constants, motion }
    }

    fn walls(&self) -> Walls {
        Walls::new(&self.constants, &self.bounds, &self.motion, &self.motion.twist, STEP_S)
    }

    /// Lengths and coordinates of a pose.
    fn quantities(&self, pose: &Pose) -> [f64; 12] {
        let machine = self.constants.machine();
        let (lengths, x) = (leg_lengths(machine, pose), task_coordinates(pose, &machine.home));
        core::array::from_fn(|k| if k < LEGS { lengths[k] } else { x[k - LEGS] })
    }
}

/// The approach of a wall: 0.6 of the limits.
fn approach(constants: &Constants, is_angle: bool) -> Approach {
    let limits = &constants.parameters.limits;
    Approach::of_bound(if is_angle { limits.orientation } else { limits.position }, 0.6, STEP_S)
}

#[test]
#[expect(clippy::too_many_lines, reason = "one quantity after the other, from first principles")]
fn each_wall_has_the_gradient_the_gap_and_the_curvature_of_its_quantity() {
    let mut samples = RandomVectors::new(71);
    let mut outside = 0;
    for _ in 0..300 {
        let scene = Scene::new(&mut samples);
        let Scene { constants, bounds, motion } = &scene;
        let walls = scene.walls();
        assert_eq!(walls.count, 12);
        let radius = constants.machine().joints.radius_m;
        let moved = |twist: &Twist, t: f64| {
            let turned = Twist { angular: twist.angular * t, linear: twist.linear * t };
            scene.quantities(&motion.pose.displaced(&turned))
        };
        let now = scene.quantities(&motion.pose);
        let next = moved(&motion.twist, STEP_S);
        let (limits, twist) = (&constants.parameters.limits, &motion.twist);
        let stop_of = |speed: f64, limits: &DerivativeLimits| {
            let DerivativeLimits { acceleration, jerk, .. } = limits;
            let is_long = speed >= acceleration * acceleration / jerk;
            if is_long { speed / acceleration + acceleration / jerk } else { 2.0 * (speed / jerk).sqrt() }
        };
        let turn_s = stop_of(twist.angular.norm(), &limits.orientation);
        let shift_s = stop_of(twist.linear.norm(), &limits.position);
        let envelope = bounds.envelope.unwrap();
        let stroke = constants.machine().actuator.stroke();
        for (k, wall) in ends(&walls).into_iter().enumerate() {
            let (quantity, sign) = (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
            let is_angle = (6..9).contains(&quantity);
            // The gradient, along every axis.
            for axis in 0..6 {
                let unit = Twist::from_vector(&Vector6::ith(axis, 1.0));
                let t = 1e-5;
                let rate = (moved(&unit, t)[quantity] - moved(&unit, -t)[quantity]) / (2.0 * t);
                let scaled = wall.gradient[axis] * if axis < 3 { radius } else { 1.0 };
                assert!((scaled - sign * rate).abs() < 1e-6, "{k} {axis}: {scaled}, not {rate}");
            }
            let stop_s = match quantity {
                ..6 => turn_s.max(shift_s),
                6..9 => turn_s,
                _ => shift_s,
            };
            // Stopping distance minus the distance in half of the stop's duration at the present rate.
            let rest = |whole: Twist, s: f64| 0.5 * wall.gradient.dot(&whole.vector()) * (s - stop_s);
            let asynchronous = rest(Twist { angular: twist.angular * radius, ..Twist::default() }, turn_s)
                + rest(Twist { linear: twist.linear, ..Twist::default() }, shift_s);
            let t = 1e-4;
            let curvature = if quantity < LEGS {
                let [after, before] = [t, -t].map(|t| moved(&motion.twist, t)[quantity]);
                sign * (after - 2.0 * now[quantity] + before) / (t * t)
            } else {
                0.0
            };
            let departure = curvature * stop_s * stop_s / 8.0 + asynchronous;
            let departure = if quantity < LEGS { departure.max(0.0) } else { 0.0 };
            let bound = match (quantity, k % 2) {
                (leg @ 0..6, 0) => bounds.longest_m[leg],
                (leg @ 0..6, _) => -bounds.shortest_m[leg],
                (other, 0) => envelope.highest[other - LEGS],
                (other, _) => -envelope.lowest[other - LEGS],
            };
            let kept = 5e-3 * stroke / if is_angle { radius } else { 1.0 };
            let gap = bound - sign * next[quantity] - departure - kept;
            let approach = approach(constants, is_angle);
            let (rate, slope) = if gap > 0.0 {
                let straight = 2.0 / stop_s;
                let (rate, slope) = approach.closing_velocity_and_slope(gap);
                if straight * gap < rate { (straight * gap, straight) } else { (rate, slope) }
            } else {
                outside += 1;
                (gap * approach.closing_slope_at_target() / 4.0, approach.closing_slope_at_target() / 4.0)
            };
            // Equal to second order in the step.
            assert!((wall.end.rate - rate).abs() < 2e-4, "{k}: {} not {rate}, gap {gap}", wall.end.rate);
            let velocity = stacked(&(twist.angular * radius), &twist.linear);
            let derivative = -slope * wall.gradient.dot(&velocity) - curvature;
            assert!((wall.end.derivative - derivative).abs() < 2e-2, "{k}: {:?} not {derivative}", wall.end);
        }
    }
    assert!(outside > 100, "{outside}");
}

/// A platform that approaches no wall too fast can stop before it. The stop that brakes at once shows it, in
/// fine steps.
#[test]
fn a_platform_that_approaches_no_wall_too_fast_can_stop() {
    let mut samples = RandomVectors::new(74);
    let (mut nearest, mut worst) = (0, f64::INFINITY);
    for _ in 0..2000 {
        let mut scene = Scene::new(&mut samples);
        let lengths = leg_lengths(scene.constants.machine(), &scene.motion.pose);
        scene.bounds.shortest_m = lengths.map(|length| length - (0.01 + 0.09 * samples.uniform()));
        scene.bounds.longest_m = lengths.map(|length| length + (0.01 + 0.09 * samples.uniform()));
        scene.bounds.envelope = None;
        let whole = scene.motion.twist;
        let scale = |scene: &mut Scene, factor: f64| {
            scene.motion.twist = Twist { angular: whole.angular * factor, linear: whole.linear * factor };
        };
        let is_slow = |scene: &Scene| {
            let velocity = stacked(
                &(scene.motion.twist.angular * scene.constants.machine().joints.radius_m),
                &scene.motion.twist.linear,
            );
            ends(&scene.walls()).iter().all(|end| end.gradient.dot(&velocity) <= end.end.rate)
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            scale(&mut scene, middle);
            if is_slow(&scene) { low = middle } else { high = middle }
        }
        scale(&mut scene, low);
        if low == 0.0 || high == 1.0 || !is_slow(&scene) {
            continue;
        }
        nearest += 1;
        let Scene { constants, bounds, motion } = &scene;
        let stop = PoseStop::new(StopKind::BrakeAtOnce, motion, &constants.parameters.limits);
        let (mut pose, mut state, dt) =
            (motion.pose, stop.state_at(Level::new(), 0.0), stop.duration() / 100.0);
        for k in 1..=100 {
            let next = stop.state_at(Level::new(), f64::from(k) * dt);
            pose = advanced(&pose, &state, &next, dt);
            state = next;
            let lengths = leg_lengths(constants.machine(), &pose);
            let ends = bounds.shortest_m.iter().zip(&bounds.longest_m);
            for (length, (shortest, longest)) in lengths.iter().zip(ends) {
                let room = (length - shortest).min(longest - length);
                worst = worst.min(room / constants.machine().actuator.stroke());
            }
        }
    }
    assert!(nearest > 1000 && worst > 0.95 * WALL_DISTANCE_PER_STROKE, "{nearest}: {worst}");
}

/// Conditions of the nearest velocity: no wall is approached too fast, and the change over its amount is a sum of the
/// active gradients with positive multiples.
#[test]
fn the_restricted_velocity_is_the_nearest_that_approaches_no_wall_too_fast() {
    let mut samples = RandomVectors::new(72);
    let (mut several, mut free, mut partly, mut most_work) = (0, 0, 0, 0);
    for _ in 0..500 {
        let scene = Scene::new(&mut samples);
        let mut walls = scene.walls();
        let mut wanted = |size| WantedVelocity {
            velocity: samples.vector(size),
            derivative: samples.vector(5.0),
            is_limited: false,
        };
        let [turn, shift] = [wanted(1.2), wanted(1.2)];
        let (mut new_turn, mut new_shift) = (turn, shift);
        let limits = walls.project(scene.constants.machine().level, &mut new_turn, &mut new_shift);
        let of = |first: &Vector3<f64>, second: &Vector3<f64>| stacked(&(first * walls.radius), second);
        let [before, after] = [(&turn, &shift), (&new_turn, &new_shift)]
            .map(|(turn, shift)| of(&turn.velocity, &shift.velocity));
        // The gradients as they were before they were scaled.
        let pairs = ends(&walls).into_iter().zip(ends(&scene.walls()));
        let ends: Vec<_> = pairs.map(|(end, WallEnd { gradient, .. })| WallEnd { gradient, ..end }).collect();
        let active: Vec<&WallEnd> = ends.iter().filter(|end| end.multiplier > 0.0).collect();
        for (k, wall) in ends.iter().enumerate() {
            // Far beyond one end the return is no faster than the other end may be approached.
            let excess = wall.gradient.dot(&after) - wall.end.rate.max(-ends[k ^ 1].end.rate);
            if active.len() <= 1 {
                assert!(excess < 1e-9, "{excess}");
            }
        }
        let speed = before.norm().max(SMALLEST_SPEED);
        let amounts = before.map(|wanted| wanted.abs() / speed + SHARED_WEIGHT);
        let change: Vector6<f64> = active.iter().map(|wall| wall.gradient * wall.multiplier).sum();
        assert!((before - change.component_mul(&amounts) - after).norm() < 1e-9);
        // The effort is bounded, and zero if no wall is active.
        most_work = most_work.max(walls.effort());
        assert!(walls.effort() <= 4 && (!active.is_empty() || walls.effort() == 0), "{}", walls.effort());
        let expected = active.iter().fold(LimitSet::default(), |set, wall| set.union(wall.limit));
        assert_eq!(limits, expected);
        let derivative = of(&new_turn.derivative, &new_shift.derivative);
        match active.as_slice() {
            [] => {
                assert_eq!((new_turn.derivative, new_shift.derivative), (turn.derivative, shift.derivative));
                free += 1;
            }
            [wall] => {
                let rate = wall.gradient.dot(&after);
                assert!(rate >= wall.end.rate - 1e-9 && (rate <= 0.0 || rate <= wall.end.rate + 1e-9));
                // The weight of the bound on the derivative grows with the velocity that is taken away, and
                // is 1 from 0.6 a^2/j on.
                let is_angle = ends[12..18].iter().any(|end| core::ptr::eq(end, *wall));
                let limits = &scene.constants.parameters.limits;
                let limits = if is_angle { limits.orientation } else { limits.position };
                let taken = wall.gradient.dot(&(before - after));
                let weight = taken * limits.jerk / (0.6 * limits.acceleration * limits.acceleration);
                partly += u32::from(weight < 1.0);
                let weight = weight.min(1.0);
                let before = wall.gradient.dot(&of(&turn.derivative, &shift.derivative));
                let expected = weight * wall.end.derivative + (1.0 - weight) * before;
                assert!((wall.gradient.dot(&derivative) - expected).abs() < 1e-6, "{weight}");
            }
            _ => several += 1,
        }
    }
    assert!(several > 50 && free > 10 && partly > 3 && most_work == 3, "{several} {free} {partly}");
}

/// Two walls at 60 degrees, like the faces of a wedge: 8 sweeps leave 1e-3 of the excess.
#[test]
fn two_walls_at_60_degrees_converge() {
    let mut samples = RandomVectors::new(73);
    let scene = Scene::new(&mut samples);
    let mut walls = scene.walls();
    walls.count = 0;
    let directions =
        [Vector3::x(), Matrix3::new(0.5, 0.0, 0.0, 0.75_f64.sqrt(), 0.0, 0.0, 0.0, 0.0, 1.0) * Vector3::x()];
    for direction in directions {
        let gradient = stacked(&Vector3::zeros(), &direction);
        let free = End { rate: f64::INFINITY, derivative: 0.0 };
        let approach = approach(&scene.constants, false);
        walls.push(Limit::Stroke, &approach, gradient, [free, End::default()]);
    }
    let still =
        WantedVelocity { velocity: Vector3::zeros(), derivative: Vector3::zeros(), is_limited: false };
    let along = directions[0] + directions[1];
    let (mut turn, mut shift) = (still, WantedVelocity { velocity: along, derivative: along * 3.0, ..still });
    walls.project(scene.constants.machine().level, &mut turn, &mut shift);
    for direction in directions {
        assert!(direction.dot(&shift.velocity).abs() < 1e-3, "{}", shift.velocity);
        assert!(direction.dot(&shift.derivative).abs() < 2e-3, "{}", shift.derivative);
    }
    assert_eq!(turn.velocity, Vector3::zeros());
}
