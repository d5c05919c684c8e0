//! Frames: round trips, derivatives, and what stays where it is while a tool turns.

use super::*;

/// Poses and twists of each round trip.
const CASES: u32 = 100_000;

/// A machine of a metre. Errors are in shares of the lengths that are added up.
const SIZE_M: f64 = 1.0;

fn pose(random: &mut Random) -> Pose {
    let (angles, place) = (vector(random) * 3.1, vector(random) * SIZE_M);
    TaskState::at_rest([angles.x, angles.y, angles.z, place.x, place.y, place.z]).motion().pose
}

fn frames(random: &mut Random) -> Frames {
    Frames { work: pose(random), tool: pose(random) }
}

fn motion(random: &mut Random) -> Motion {
    Motion {
        pose: pose(random),
        twist: Twist { angular: vector(random) * 2.0, linear: vector(random) },
        acceleration: Acceleration { angular: vector(random) * 5.0, linear: vector(random) * 5.0 },
    }
}

/// Largest differences of two motions: of R, C, twist and acceleration, as shares of what is added up in each.
fn differences(a: &Motion, b: &Motion, frames: &Frames) -> [f64; 4] {
    let arm = frames.tool.position.norm();
    let size = a.pose.position.norm() + arm + frames.work.position.norm();
    let turning = a.twist.angular.norm();
    let speed = a.twist.linear.norm() + turning * (1.0 + arm);
    let acceleration =
        a.acceleration.linear.norm() + a.acceleration.angular.norm() * (1.0 + arm) + turning * turning * arm;
    [
        (a.pose.rotation - b.pose.rotation).amax(),
        (a.pose.position - b.pose.position).amax() / size,
        (a.twist.vector() - b.twist.vector()).amax() / speed,
        (a.acceleration.vector() - b.acceleration.vector()).amax() / acceleration,
    ]
}

#[test]
fn there_and_back_is_exact_to_rounding() {
    let mut random = Random::new(42);
    let mut worst = [0.0_f64; 4];
    for _ in 0..CASES {
        let (frames, motion) = (frames(&mut random), motion(&mut random));
        let back = frames.platform_motion(&frames.tool_motion(&motion));
        let there = frames.tool_motion(&frames.platform_motion(&motion));
        for found in [back, there].map(|other| differences(&motion, &other, &frames)) {
            worst = core::array::from_fn(|k| worst[k].max(found[k]));
        }
    }
    assert!(worst.iter().all(|worst| *worst < 1e-15), "{worst:?}");
}

#[test]
fn without_frames_every_bit_stays() {
    let mut random = Random::new(1);
    for _ in 0..1000 {
        let motion = motion(&mut random);
        assert_eq!(Frames::default().tool_motion(&motion), motion);
        assert_eq!(Frames::default().platform_motion(&motion), motion);
    }
}

/// The tool's twist and acceleration are the derivatives of its pose while the platform moves.
#[test]
fn derivatives_of_the_tool_belong_to_its_pose() {
    let (mut random, h) = (Random::new(2), 1e-4);
    for _ in 0..1000 {
        let frames = frames(&mut random);
        let mut six = || Vector6::from_fn(|_, _| random.signed());
        let state = TaskState { x: six(), xd: six(), xdd: six() };
        let at = |t: f64| frames.tool_motion(&state.after(t).motion());
        let (before, now, after) = (at(-h), at(0.0), at(h));
        let twist = before.pose.displacement_to(&after.pose).vector() / (2.0 * h);
        assert!((twist - now.twist.vector()).amax() < 1e-6, "{twist} {}", now.twist.vector());
        let acceleration = (after.twist.vector() - before.twist.vector()) / (2.0 * h);
        assert!((acceleration - now.acceleration.vector()).amax() < 1e-6, "{acceleration}");
    }
}

/// A tool that only turns keeps its origin, whatever the platform does for it.
#[test]
fn a_tool_turns_about_its_origin() {
    let mut random = Random::new(3);
    for _ in 0..1000 {
        let (frames, mut tool) = (frames(&mut random), motion(&mut random));
        (tool.twist.linear, tool.acceleration.linear) = Default::default();
        let place = |platform: &Pose| platform.position + platform.rotation * frames.tool.position;
        let platform = frames.platform_motion(&tool);
        let rest = place(&platform.pose);
        let wanted = frames.work.position + frames.work.rotation * tool.pose.position;
        assert!((rest - wanted).amax() < 4e-15 * SIZE_M);
        // The velocity of the tool's origin as a point of the platform.
        let Twist { angular, linear } = platform.twist;
        assert!((linear + angular.cross(&(rest - platform.pose.position))).amax() < 1e-14);
    }
}
