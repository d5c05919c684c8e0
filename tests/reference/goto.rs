//! `hexad goto` before it moves: random pairs of poses, every limit, the time against the time-optimal profile, and that
//! only targets or ways outside of the workspace are refused.

use std::collections::BTreeMap;

use hexad::analysis::target_motion::{TargetRefusal, check_target, target_motion, workspace_bounds};
use hexad::config::Config;
use hexad::control::constants::Constants;
use hexad::control::signals::limits::Limit;
use hexad::model::random::Random;
use hexad::model::rigid::{Pose, Twist};
use hexad::model::task::TaskState;
use nalgebra::{Vector3, Vector6};
use rayon::prelude::*;

use super::arrival::{ARRIVED, optimal_s};
use super::observer::{Largest, examine};
use hexad_support::certificate::Certificate;
use hexad_support::rig::parameters;
use hexad_support::{MACHINES, data};

/// Ways from which on the time is compared with the time-optimal profile \[m\], \[rad\], and what the ratio may be.
const COMPARED_FROM: [f64; 2] = [0.02, 0.02];
const SLOWEST: (&str, f64) = ("slowest", 1.2);

/// Pairs of poses of each machine.
const PAIRS: u64 = 10;
const LONG_PAIRS: u64 = 2000;

/// Shares of the limits of autonomous motions, in turn.
const SPEEDS: [f64; 3] = [1.0, 0.5, 0.1];

/// Instants of the way, of position and of orientation, at which a refused way is examined.
const WAY_SAMPLES: u32 = 40;

/// Share of the quantity by which a way may be nearer than allowed to a bound without being refused for nothing: what a
/// proved stop needs beyond the bound.
const PROOF_ROOM: f64 = 0.1;

/// Outcome of the pairs of one machine.
#[derive(Debug, Default)]
struct Outcome {
    /// Of each kind; those "for nothing" are refused although the way keeps every bound by [`PROOF_ROOM`].
    counts: BTreeMap<&'static str, u64>,
    largest: Largest,
}

impl Outcome {
    fn add(&mut self, kind: &'static str, count: u64) {
        *self.counts.entry(kind).or_default() += count;
    }

    fn count(&self, kind: &str) -> u64 {
        self.counts.get(kind).copied().unwrap_or_default()
    }

    fn merge(mut self, other: Self) -> Self {
        other.counts.into_iter().for_each(|(kind, count)| self.add(kind, count));
        self.largest.merge(&other.largest);
        self
    }
}

/// A pose around home, in the workspace or not.
fn random_pose(random: &mut Random, constants: &Constants, scale: f64) -> Pose {
    let machine = constants.machine();
    let stroke = machine.actuator.stroke();
    let size = Vector6::new(0.4, 0.4, 0.6, 0.5 * stroke, 0.5 * stroke, 0.5 * stroke);
    let offset = size.map(|size| scale * size * (2.0 * random.uniform() - 1.0));
    TaskState::at_rest((Vector6::from(machine.home) + offset).into()).motion().pose
}

fn pose_inside(random: &mut Random, constants: &Constants) -> Pose {
    (0..10_000)
        .map(|k| random_pose(random, constants, 1.0 / (1.0 + 0.01 * f64::from(k))))
        .find(|pose| check_target(constants, pose).is_ok())
        .unwrap()
}

/// One pair: from a pose in the workspace to another, of which a fifth may be anywhere. The way uses the limits of autonomous
/// motions, or a share of them; a stop before a bound may use all.
#[expect(clippy::too_many_lines, reason = "a motion and all that is asserted about it")]
fn pair(constants: &Constants, seed: u64) -> Outcome {
    let mut random = Random::new(seed);
    let from = pose_inside(&mut random, constants);
    let to = if seed.is_multiple_of(5) {
        random_pose(&mut random, constants, 1.0)
    } else {
        pose_inside(&mut random, constants)
    };
    let mut outcome = Outcome::default();
    let speed = SPEEDS[seed as usize % SPEEDS.len()];
    let limits = &constants.parameters.limits;
    let limits = limits.scaled(speed * limits.autonomous_scale);
    let whole = from.displacement_to(&to);
    let period_ns = constants.parameters.period_ns;
    let mut arrived_s = [0.0; 2];
    let result = target_motion(constants, &from, &to, speed, |reference, before| {
        let end_ns = reference.time_ns();
        examine(constants, reference, before, [end_ns - period_ns, end_ns], &mut outcome.largest);
        let left = reference.motion().pose.displacement_to(&to);
        for (arrived_s, (left, whole)) in
            arrived_s.iter_mut().zip([(left.linear, whole.linear), (left.angular, whole.angular)])
        {
            if left.norm() > ARRIVED * whole.norm() {
                *arrived_s = end_ns as f64 * 1e-9;
            }
        }
        true
    });
    match result {
        Ok(motion) => {
            outcome.add("reached", 1);
            let ways = [(whole.linear.norm(), &limits.position), (whole.angular.norm(), &limits.orientation)];
            // Where the drives or the rates of the legs are the limit, the way takes longer.
            let is_leg_limited = [Limit::LegRate, Limit::Force]
                .iter()
                .any(|limit| motion.limited_shares[*limit as usize] > 0.0);
            let is_free = least_room(constants, &from, &to) > 0.0;
            outcome.add("limited by legs", u64::from(is_leg_limited));
            for ((way, limits), (from, arrived_s)) in
                ways.into_iter().zip(COMPARED_FROM.into_iter().zip(arrived_s))
            {
                if way >= from && is_free && !is_leg_limited {
                    outcome.add("compared", 1);
                    let ratio = arrived_s / optimal_s(way, limits);
                    outcome.largest.add(SLOWEST.0, ratio);
                    if ratio > SLOWEST.1 {
                        println!("seed {seed}: {ratio} times the fastest, {:?}", motion.limited_shares);
                    }
                }
            }
        }
        Err(TargetRefusal::Target(bound)) => {
            outcome.add("targets outside", 1);
            assert!(bound.get().margin < 0.0 && is_outside(constants, &to), "{bound}");
        }
        Err(TargetRefusal::Way { bound, share }) => {
            outcome.add("ways outside", 1);
            assert!(!is_outside(constants, &to) && (0.0..1.0).contains(&share), "{bound}");
            assert!(bound.get().margin < 0.0, "seed {seed}: refused after {share}: {bound}");
        }
        Err(TargetRefusal::Unproved { bound, share }) => {
            outcome.add("unproved", 1);
            println!("seed {seed}: no stop is proved after {share}: {bound}");
            outcome.add("for nothing", u64::from(least_room(constants, &from, &to) > PROOF_ROOM));
        }
        Err(refusal @ (TargetRefusal::TooLong(_) | TargetRefusal::Interrupted)) => {
            panic!("seed {seed}: {refusal}")
        }
    }
    outcome
}

fn is_outside(constants: &Constants, pose: &Pose) -> bool {
    workspace_bounds(constants, pose).iter().any(|bound| bound.margin < 0.0)
}

/// Least margin anywhere between the poses, whatever the order of position and orientation, as a share of the stroke, the
/// envelope or the bound.
fn least_room(constants: &Constants, from: &Pose, to: &Pose) -> f64 {
    let whole = from.displacement_to(to);
    let instants = || (0..=WAY_SAMPLES).map(|k| f64::from(k) / f64::from(WAY_SAMPLES));
    let stroke = constants.machine().actuator.stroke();
    let room_at = |turn: f64, shift: f64| {
        let displacement = Twist { angular: whole.angular * turn, linear: whole.linear * shift };
        let bounds = workspace_bounds(constants, &from.displaced(&displacement));
        let share = |bound: &hexad::analysis::target_motion::WorkspaceBound| {
            use hexad::analysis::target_motion::BoundedQuantity as Is;
            bound.margin
                / match bound.quantity {
                    Is::Length(_) | Is::Coordinate(_) => stroke,
                    Is::Condition | Is::UniversalSine | Is::HoldingForce(_) => bound.bound,
                    Is::Determinant => f64::MIN_POSITIVE,
                }
        };
        bounds.iter().map(share).fold(f64::INFINITY, f64::min)
    };
    instants()
        .flat_map(|turn| instants().map(move |shift| (turn, shift)))
        .map(|(a, b)| room_at(a, b))
        .fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_a_goto_keeps_every_limit_and_is_almost_as_fast_as_possible() {
    let machines = MACHINES.len() as u64;
    let certificate = Certificate::new("goto", machines * PAIRS, machines * LONG_PAIRS);
    let runs = certificate.total() / machines;
    for name in MACHINES {
        let config = Config::load(&data(name, "toml")).unwrap();
        let constants = Constants::new(&config.machine, parameters(&config));
        let pairs = (0..runs).into_par_iter().map(|seed| pair(&constants, seed));
        let outcome = pairs.reduce(Outcome::default, Outcome::merge);
        println!("{name}: {:?}\n  {:.4?}", outcome.counts, outcome.largest.0);
        for (quantity, bound) in super::limits::BOUNDS.into_iter().chain([SLOWEST]) {
            let value = outcome.largest.0.get(quantity).copied().unwrap_or(f64::NEG_INFINITY);
            assert!(value <= bound, "{name}: {quantity} {value:e} > {bound}");
        }
        assert_eq!(outcome.count("for nothing"), 0, "{name}");
        assert!(outcome.count("reached") > runs / 2, "{name}: {:?} of {runs}", outcome.counts);
        certificate.advance(runs);
    }
}

/// However short the way is, it takes time within the limits of jerk.
#[test]
fn a_step_of_a_micrometre_takes_time_and_no_step_takes_none() {
    let config = Config::load(&data("motion_base", "toml")).unwrap();
    let constants = Constants::new(&config.machine, parameters(&config));
    let home = *constants.home.pose();
    let limits = &config.deployment.limits.in_force();
    for length in [1e-6, 5e-6, 1e-5, 1e-4] {
        let step = Twist { angular: Vector3::zeros(), linear: Vector3::y() * length };
        let motion = target_motion(&constants, &home, &home.displaced(&step), 1.0, |_, _| true).unwrap();
        // Four phases of jerk, each a quarter of the time: d = 2 J (T / 4)^3.
        let jerk = limits.autonomous_scale * limits.position.jerk;
        let fastest = 4.0 * (length / (2.0 * jerk)).cbrt();
        println!("{length} m: {} s, the fastest possible {fastest} s", motion.duration_s);
        assert!((0.8..4.0).contains(&(motion.duration_s / fastest)), "{length}: {motion:?}");
        println!("  {:?}", motion.limited_shares);
    }
    for rounding in [0.0, 1e-15, 1e-12] {
        let step = Twist { angular: Vector3::z() * rounding, linear: Vector3::z() * rounding };
        let motion = target_motion(&constants, &home, &home.displaced(&step), 1.0, |_, _| true).unwrap();
        assert_eq!(motion.duration_s, 0.0, "{rounding}");
    }
}
