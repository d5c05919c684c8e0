//! Poses where the drives are weak: the reference stays where they can hold the platform, takes no more than they can give,
//! and leaves every pose that it reaches. Forces are those of the inverse dynamics at the reference's own motion.

use hexad::analysis::target_motion::{TargetRefusal, check_target, target_motion};
use hexad::config::Config;
use hexad::control::constants::{Constants, MAX_HOLDING_SHARE};
use hexad::control::reference::ReferenceGenerator;
use hexad::control::setpoint::target::Target;
use hexad::control::signals::limits::Limit;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Exact;
use hexad::model::random::Random;
use hexad::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad::model::task::pose_of;
use nalgebra::Vector3;
use rayon::prelude::*;

use hexad_support::certificate::Certificate;
use hexad_support::edited::with_force;
use hexad_support::rig::parameters;

const SHIPPED: [&str; 4] = ["motion_base", "fried2008", "tsai2000", "reference"];

/// Forces of the drives at home as shares of the largest force, for machines from barely sufficient to generous.
const HOLDING_AT_HOME: [f64; 4] = [0.6, 0.4, 0.2, 0.05];

/// The constants of a shipped machine, whose drives need this share of their force at home if one is given.
fn constants(name: &str, holding: Option<f64>) -> Constants {
    let mut config = Config::load(format!("config/{name}.toml").as_ref()).unwrap();
    if let Some(holding) = holding {
        let at_home = held(&InverseDynamics::new(&config.machine), &config.machine.home_pose());
        config.machine.actuator.max_force_n = at_home / holding;
    }
    let mut parameters = parameters(&config);
    parameters.limits.autonomous_scale = 1.0;
    Constants::new(&config.machine, parameters)
}

/// The largest force at rest, as a share of the drives' largest force.
fn held(dynamics: &InverseDynamics, pose: &Pose) -> f64 {
    share(dynamics, &Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() })
        * dynamics.machine().actuator.max_force_n
}

fn share(dynamics: &InverseDynamics, motion: &Motion) -> f64 {
    let forces = dynamics
        .forces::<Exact>(motion)
        .map_or(f64::INFINITY, |forces| forces.into_iter().map(f64::abs).fold(0.0, f64::max));
    forces / dynamics.machine().actuator.max_force_n
}

fn begun(constants: &Constants, pose: &Pose) -> ReferenceGenerator {
    let mut reference = ReferenceGenerator::new(constants);
    let start = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
    assert_eq!(reference.verify_start(constants, &start), Ok(()), "{pose:?}");
    reference.begin_placed_motion(0);
    reference
}

/// Moves towards a pose for so many cycles. Returns the largest share of the force, and whether the pose was reached.
fn go(
    reference: &mut ReferenceGenerator,
    constants: &Constants,
    to: &Pose,
    speed: f64,
    cycles: u32,
) -> (f64, bool) {
    let mut largest = 0.0_f64;
    for _ in 0..cycles {
        let end_ns = reference.time_ns() + constants.parameters.period_ns;
        reference.advance(constants, end_ns, Some(&Target::Pose { pose: to, speed_share: speed }));
        largest = largest.max(share(&constants.dynamics, reference.motion()));
        let left = reference.motion().pose.displacement_to(to);
        if left.linear.norm() < 1e-6
            && left.angular.norm() < 1e-6
            && reference.motion().twist.vector().norm() < 1e-6
        {
            return (largest, true);
        }
    }
    (largest, false)
}

/// Random targets anywhere, reached or not, then home: no force beyond the drives', and home is always reached.
#[test]
fn certificate_no_pose_is_reached_that_the_drives_cannot_leave() {
    let runs = SHIPPED.len() * HOLDING_AT_HOME.len();
    let certificate = Certificate::new("weak poses", runs as u64 * 4, runs as u64 * 400);
    let searched: Vec<_> = (0..certificate.total())
        .into_par_iter()
        .map(|run| {
            let (name, holding) = (SHIPPED[run as usize % 4], HOLDING_AT_HOME[run as usize / 4 % 4]);
            let constants = constants(name, Some(holding));
            let mut random = Random::new(run);
            let home = *constants.home.pose();
            let mut reference = begun(&constants, &home);
            let stroke = constants.machine().actuator.stroke();
            let (mut largest, mut passed) = (0.0_f64, vec![home]);
            for _ in 0..8 {
                let mut vector = |size: f64| Vector3::from_fn(|_, _| random.signed()) * size;
                let away = Twist { angular: vector(0.8), linear: vector(1.2 * stroke) };
                let speed = [1.0, 0.3][usize::from(random.uniform() < 0.3)];
                let (force, _) = go(&mut reference, &constants, &home.displaced(&away), speed, 700);
                largest = largest.max(force);
                passed.push(reference.motion().pose);
            }
            // The straight way home may be barred: back over the poses that were passed, from each of them home if that is
            // possible.
            let is_home = passed.iter().rev().any(|pose| {
                go(&mut reference, &constants, pose, 1.0, 3000);
                let (force, is_home) = go(&mut reference, &constants, &home, 1.0, 10_000);
                largest = largest.max(force);
                is_home
            });
            assert!(is_home, "{name}, {holding} at home, run {run}: {:?}", reference.motion());
            certificate.advance(1);
            largest
        })
        .collect();
    let largest = searched.into_iter().fold(0.0, f64::max);
    println!("largest share of the force {largest:.4}");
    // Of what the drives can give a stop may take this share, and the reference none beyond it.
    assert!(largest <= 0.95 && largest > 0.9, "{largest}");
}

/// A motion to a target among weak poses, for which the drives give less and less acceleration, ends there and not beyond; only a
/// way that exceeds a bound is refused.
#[test]
fn certificate_a_goto_ends_at_its_target_among_weak_poses() {
    // Of a motion base whose drives hold it with half of their force.
    let seen = [
        [0.1245, -0.29928, 0.00202, -0.0532, -0.24927, 1.10295],
        [-0.06236, 0.16901, -0.10644, 0.10561, 0.00589, 0.91771],
        [-0.00648, 0.18857, 0.03877, 0.25359, 0.15894, 0.89085],
    ];
    let constants_of = |config: Config| Constants::new(&config.machine, parameters(&config));
    let weak = constants_of(with_force("motion_base", 7600.0));
    for x in seen {
        assert!(beyond(&weak, &pose_of(&x)).is_ok_and(|beyond| beyond < 1e-3), "{x:?}");
    }
    let certificate = Certificate::new("weak targets", 12 * 20, 12 * 850);
    let outcomes = (0..certificate.total()).into_par_iter().map(|run| {
        let (name, share) = (SHIPPED[run as usize % 4], [1.5, 2.0, 3.0][run as usize / 4 % 3]);
        let at_home = constants(name, None);
        let home = *at_home.home.pose();
        let constants = constants_of(with_force(name, share * held(&at_home.dynamics, &home)));
        let mut random = Random::new(run);
        let mut vector = |size: f64| Vector3::from_fn(|_, _| random.signed()) * size;
        let stroke = constants.machine().actuator.stroke();
        let to = home.displaced(&Twist { angular: vector(0.3), linear: vector(0.4 * stroke) });
        certificate.advance(1);
        match beyond(&constants, &to) {
            Ok(beyond) => {
                // It comes back where the strength falls faster than a stop takes.
                assert!(beyond < 0.05 * stroke, "{name}, {share}, run {run}: {beyond} m beyond");
                [1, 0, 0, u32::from(beyond > 2e-3 * stroke)]
            }
            Err(TargetRefusal::Target(_)) => [0, 1, 0, 0],
            Err(TargetRefusal::Way { .. }) => [0, 0, 1, 0],
            Err(refusal) => panic!("{name}, {share}, run {run}: {refusal}"),
        }
    });
    let sum = |a: [u32; 4], b: [u32; 4]| core::array::from_fn(|k| a[k] + b[k]);
    let [reached, outside, ways, beyond] = outcomes.reduce(|| [0; 4], sum);
    println!("{reached} reached, {beyond} of them from beyond; {outside} targets and {ways} ways outside");
    assert!(reached > outside / 4 && beyond <= reached / 100, "{reached}, {beyond}");
}

/// How much farther from its target a motion from home goes after it was nearer \[m\].
fn beyond(constants: &Constants, to: &Pose) -> Result<f64, TargetRefusal> {
    let (mut nearest, mut beyond) = (f64::INFINITY, 0.0_f64);
    target_motion(constants, constants.home.pose(), to, 1.0, |reference, _| {
        let left = reference.motion().pose.displacement_to(to).linear.norm();
        nearest = nearest.min(left);
        beyond = beyond.max(left - nearest);
        true
    })?;
    Ok(beyond)
}

/// A way from home of a machine: one of 24 directions, every third without rotation. Distances are in arms.
fn way(constants: &Constants, way: u64) -> impl Fn(f64) -> Pose {
    let home = *constants.home.pose();
    let mut random = Random::new(way);
    let direction = Vector3::from_fn(|_, _| random.signed()).normalize() * constants.arm_m;
    let turn = Vector3::from_fn(|_, _| random.signed()) * f64::from(way as u32 % 3) * 0.2;
    move |distance| home.displaced(&Twist { angular: turn * distance, linear: direction * distance })
}

/// In 24 directions the reference of each shipped machine reaches nearly every pose that it may stand at.
#[test]
#[ignore = "second tier: takes long"]
fn slow_motions_reach_nearly_all_poses_that_the_drives_can_hold() {
    for name in SHIPPED {
        let constants = constants(name, None);
        let ways: Vec<_> = (0..24_u64)
            .into_par_iter()
            .map(|k| {
                let at = way(&constants, k);
                let is_usable = |distance: &f64| check_target(&constants, &at(*distance)).is_ok();
                let possible = (1..2000).map(|k| f64::from(k) * 1e-3).take_while(is_usable).last().unwrap();
                let mut reference = begun(&constants, &at(0.0));
                // In parts, because rotation and translation of a motion to one target end at different times.
                for part in 1..=20 {
                    go(&mut reference, &constants, &at(possible * f64::from(part) / 20.0), 0.1, 10_000);
                }
                let left = reference.motion().pose.displacement_to(&at(possible)).linear.norm();
                1.0 - left / (possible * constants.arm_m)
            })
            .collect();
        let least = ways.iter().copied().fold(1.0, f64::min);
        println!("{name}: {least:.3}");
        assert!(least > 0.97, "{name}: {ways:.3?}");
    }
}

/// A bound that is hit on a slow way to a target: the reference stands there. With the jerk of the way it came back
/// from its stop at twice its speed, again and again.
#[test]
fn a_slow_motion_does_not_bounce_off_a_bound() {
    let constants = constants("fried2008", None);
    let at = way(&constants, 20);
    let mut reference = begun(&constants, &at(0.0));
    let mut fastest = 0.0_f64;
    for _ in 0..20 {
        go(&mut reference, &constants, &at(1.431), 0.1, 1000);
        fastest = fastest.max(reference.motion().twist.linear.norm());
    }
    assert!(reference.active_limits().contains(Limit::Stroke), "{:?}", reference.active_limits());
    assert!(fastest < 0.1001 && reference.motion().twist.linear.norm() < 1e-3, "{fastest}");
}

/// A platform that begins beyond the bound may leave, and gets no farther.
#[test]
fn a_start_where_the_drives_are_weak_is_left_towards_poses_that_need_less_force() {
    let constants = constants("motion_base", None);
    let home = *constants.home.pose();
    let below = |z: f64| Pose { position: home.position + Vector3::z() * z, ..home };
    let holding = |pose: &Pose| held(&constants.dynamics, pose) / constants.machine().actuator.max_force_n;
    let start = below(-1.04);
    assert!((0.92..0.97).contains(&holding(&start)) && holding(&start) > MAX_HOLDING_SHARE);
    let mut reference = begun(&constants, &start);
    go(&mut reference, &constants, &below(-1.2), 1.0, 2000);
    let reached = holding(&reference.motion().pose);
    assert!(reached < holding(&start) + 0.01, "{reached}");
    let (force, is_home) = go(&mut reference, &constants, &home, 1.0, 20_000);
    assert!(is_home && force < 1.0, "{force}, {:?}", reference.motion());
    go(&mut reference, &constants, &start, 1.0, 20_000);
    assert!(holding(&reference.motion().pose) <= MAX_HOLDING_SHARE);
}
