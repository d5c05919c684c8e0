//! Random trials: how often each method finds the pose, and that ours is never deceived without notice.

use std::collections::BTreeSet;

use hexad::analysis::assembly_modes::{other_permitted_modes, permitted_modes};
use hexad::model::forward_kinematics::{Tracker, TrackingResult};
use hexad::model::sensitivity::Sensitivity;
use hexad::motion::rotation_order::rotation_of;
use hexad_support::certificate::Certificate;
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};
use hexad_support::stability::rivals::Update;
use rayon::prelude::*;
use serde_json::json;

use super::*;

/// Trials per machine; `cargo bench --bench stability` makes a million.
const TRIALS: u64 = 10_000;

/// The spread of the poses \[rad\].
const ANGLE: f64 = core::f64::consts::FRAC_PI_3;

/// Random poses that the platform gets to from home without a singular one.
fn reachable(machine: &Machine) -> Vec<[f64; 6]> {
    let poses = (0..TRIALS).into_par_iter().map(|number| pose(machine, ANGLE, number));
    poses.filter(|x| within_reach(machine, *x)).collect()
}

fn ends(machine: &Machine, method: Method, poses: &[[f64; 6]]) -> [f64; 3] {
    let ends: Vec<_> = poses.par_iter().map(|x| trial(machine, method, *x)).collect();
    let share = |end: End| ends.iter().filter(|found| **found == end).count() as f64 / ends.len() as f64;
    [End::Right, End::Failed, End::Wrong].map(share)
}

/// From home to poses up to 60 degrees away on every axis.
#[test]
fn poses_far_from_home_are_found_where_others_fail() {
    let (mut ours, mut added, mut angles) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for name in MACHINES {
        let machine = machine(name);
        let poses = reachable(&machine);
        let sum = |sum: &mut [f64; 3], method| {
            let found = ends(&machine, method, &poses);
            sum.iter_mut().zip(found).for_each(|(sum, share)| *sum += 0.1 * share);
            found
        };
        let [right, _, wrong] = sum(&mut ours, Method::Hexad);
        assert!(right > 0.93 && wrong < 2e-3, "{name}: {right} {wrong}");
        sum(&mut added, Method::Rival(Update::RotationAdded));
        sum(&mut angles, Method::Rival(Update::Angles));
    }
    assert!(ours[0] > 0.985, "{ours:?}");
    // What the others are known for.
    assert!((0.7..0.9).contains(&added[0]) && added[2] > 0.01, "{added:?}");
    assert!((0.85..0.97).contains(&angles[0]) && angles[2] > 0.01, "{angles:?}");
}

/// In the stroke, on the side of home and turned from it by no more than the joints permit, and conditioned well enough.
fn is_permitted(machine: &Machine, pose: Pose, most_condition: f64) -> bool {
    let [state, home] = [pose, machine.home_pose()].map(|pose| KinematicState::new(machine, pose));
    let turn = home.pose().displacement_to(state.pose()).angular.norm();
    let is_in_stroke = state.lengths(machine).iter().all(|length| machine.actuator.margin(*length) >= 0.0);
    let Sensitivity { condition, determinant, .. } = *state.sensitivity();
    let is_on_side = determinant * home.sensitivity().determinant > 0.0;
    turn < machine.max_rotation_rad && is_in_stroke && condition < most_condition && is_on_side
}

/// The first of 100,000 random poses that are in the stroke, as far from home as the joints permit, and well conditioned. `spread` is
/// their largest turn about each axis \[rad\] and their largest shift in strokes, at most in radii.
fn permitted(machine: &Machine, most: usize, spread: [f64; 2]) -> Vec<[f64; 6]> {
    let radius = machine.joints.radius_m;
    // Short strokes permit little of the rest.
    let share = (machine.actuator.stroke() / radius).min(1.0);
    let drawn = (0..100_000_u64).map(|number| {
        let mut random = Random::new(number.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 56);
        let sizes = [spread[0] * share; 3].into_iter().chain([spread[1] * share * radius; 3]);
        let away: Vec<_> = sizes.map(|size| size * random.signed()).collect();
        std::array::from_fn(|i| machine.home[i] + away[i])
    });
    drawn.filter(|x| is_permitted(machine, rigid(*x), 100.0)).take(most).collect()
}

const NEAR: [f64; 2] = [0.1, 0.2];
const WIDE: [f64; 2] = [0.5, 1.5];

fn is_missing(machine: &Machine, x: &[f64; 6]) -> bool {
    let truth = rigid(*x);
    let found = permitted_modes(machine, &leg_lengths(machine, &truth));
    found.poses.iter().all(|it| machine.joints.distance(it.pose(), &truth) > 1e-6)
}

/// How a daemon starts with the lengths of a pose: with it, after a question, not, or with another.
fn start(machine: &Machine, x: &[f64; 6]) -> [usize; 4] {
    let (truth, mut tracker) = (rigid(*x), Tracker::new(machine, machine.home_pose()));
    if tracker.find(machine, &leg_lengths(machine, &truth)).0 != TrackingResult::Found {
        return [0, 0, 1, 0];
    }
    let is_alone = other_permitted_modes(machine, tracker.kinematic_state()).poses.is_empty();
    let is_true = machine.joints.distance(tracker.pose(), &truth) < 1e-6;
    [is_alone && is_true, !is_alone, false, is_alone && !is_true].map(usize::from)
}

/// No start takes another pose than the true one. Which have started, asked, and been refused.
fn starts(name: &str, machine: &Machine, most: usize, spread: [f64; 2]) -> [usize; 3] {
    let poses = permitted(machine, most, spread);
    let add = |sum: [usize; 4], one: [usize; 4]| std::array::from_fn(|k| sum[k] + one[k]);
    let [right, asked, refused, wrong] = poses.par_iter().map(|x| start(machine, x)).reduce(|| [0; 4], add);
    println!(
        "{name}: of {} poses {right} start, {asked} ask, {refused} are refused, {wrong} wrong",
        poses.len()
    );
    assert_eq!(wrong, 0, "{name}: {:?}", poses.iter().find(|x| start(machine, x)[3] > 0));
    assert!(right + asked > 20, "{name}: {right} {asked}");
    [right, asked, refused]
}

/// With the joints moved, and a stroke around the lengths at home.
fn scattered(number: usize) -> Machine {
    let mut machine = machine(MACHINES[number % MACHINES.len()]);
    let (mut random, mut legs) = (Random::new(number as u64), Legs::of(&machine));
    let size = 0.3 * machine.joints.radius_m;
    for joint in legs.base.iter_mut().chain(&mut legs.platform) {
        *joint += Vector3::from_fn(|_, _| size * random.signed());
    }
    machine.joints = legs.joints(&machine.home);
    let lengths = leg_lengths(&machine, &machine.home_pose());
    machine.actuator.min_length_m = 0.7 * lengths.iter().copied().fold(f64::INFINITY, f64::min);
    machine.actuator.max_length_m = 1.4 * lengths.iter().copied().fold(0.0, f64::max);
    machine
}

#[test]
fn no_start_takes_another_pose_than_the_true_one() {
    for name in MACHINES {
        starts(name, &machine(name), 60, WIDE);
    }
    for name in ["fried2008", "reference", "motion_base"] {
        let machine = deployed(name).machine;
        let [_, asked, refused] = starts(name, &machine, 60, NEAR);
        assert_eq!([asked, refused], [0; 2], "{name}: near home nothing is asked");
        let is_proved =
            |x: &[f64; 6]| permitted_modes(&machine, &leg_lengths(&machine, &rigid(*x))).is_proved_complete;
        assert!(permitted(&machine, 60, NEAR).iter().all(is_proved), "{name}");
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn no_start_takes_another_pose_than_the_true_one_in_a_long_search() {
    let most = if Certificate::is_long() { 10_000 } else { 500 };
    for name in MACHINES {
        for max_rotation in [30.0, 50.0] {
            let machine = Machine { max_rotation_rad: f64::to_radians(max_rotation), ..machine(name) };
            starts(&format!("{name}, {max_rotation} deg"), &machine, most, WIDE);
        }
    }
    for number in 0..25 {
        starts(&format!("random {number}"), &scattered(number), most, WIDE);
    }
}

/// Joints in planes that are parallel at home, where rounding must not decide the height; a pose rotated by 29.7 degrees, near to a fold.
#[test]
fn poses_of_the_long_search_are_among_those_of_their_lengths() {
    assert!(!is_missing(
        &machine("ceiling"),
        &[-0.021369, 0.042331, -0.223771, -0.449728, 0.467678, -0.76144]
    ));
    let x = [0.171213, -0.168746, -0.446119, -1.144312, 0.266192, 0.400991];
    let usual = machine("tsai2000");
    assert!(!is_missing(&usual, &x));
    // One turned by 30.2 degrees is excluded, unless the joints permit it.
    let x = [0.3366, -0.2894, -0.2411, -2.3233, -0.3909, 0.0827];
    assert!(is_missing(&usual, &x) && !is_missing(&Machine { max_rotation_rad: 0.6, ..usual }, &x));
}

#[test]
#[ignore = "second tier: takes long"]
fn the_true_pose_is_among_those_of_its_lengths_in_a_long_search() {
    let most = if Certificate::is_long() { usize::MAX } else { 1000 };
    let named = MACHINES.map(|name| (name.into(), machine(name)));
    for (name, machine) in named.into_iter().chain((0..25).map(|k| (format!("random {k}"), scattered(k)))) {
        let poses = permitted(&machine, most, WIDE);
        let missing: Vec<_> = poses.par_iter().filter(|x| is_missing(&machine, x)).collect();
        println!("{name}: {} poses, {} missing", poses.len(), missing.len());
        assert!(missing.is_empty(), "{name}: {} of {}: {:?}", missing.len(), poses.len(), missing[0]);
    }
}

/// Those that numpy finds from starts and with equations of its own.
#[test]
#[ignore = "second tier: needs PyPI"]
fn every_permitted_pose_that_numpy_finds_is_found() {
    let packages = ["numpy==2.3.5", "scipy==1.16.3"].map(String::from);
    let Ok(python) = environment(&packages).inspect_err(|why| lacking(why)) else { return };
    let (folder, script) = (TempDir::new().unwrap(), data("../stability/permitted_poses", "py"));
    let file = folder.path().join("case.json");
    let wide = |machine| Machine { max_rotation_rad: f64::to_radians(50.0), ..machine };
    let [fried, random] = [machine("fried2008"), scattered(9)].map(wide);
    for machine in [fried, random, machine("motion_base"), machine("tsai2000"), scattered(0)] {
        let (Legs { base, platform, .. }, home) = (Legs::of(&machine), machine.home_pose());
        let poses = permitted(&machine, 200, WIDE);
        let lengths: Vec<_> = poses.into_iter().map(|x| leg_lengths(&machine, &rigid(x))).collect();
        let arms = platform.map(|arm| home.rotation * arm);
        let case = json!([base, arms, home.position, machine.max_rotation_rad, lengths]);
        fs::write(&file, case.to_string()).unwrap();
        let theirs = output(Command::new(python.join("bin/python")).arg(&script).arg(&file)).unwrap();
        let ours: Vec<_> = lengths.iter().map(|lengths| permitted_modes(&machine, lengths).poses).collect();
        let (mut common, count) = (BTreeSet::new(), ours.iter().flatten().count());
        for [row, w, i, j, k, x, y, z] in serde_json::from_str::<Vec<[f64; 8]>>(&theirs).unwrap() {
            let rotation = rotation_of([w, i, j, k]) * home.rotation;
            let (row, pose) = (row as usize, Pose { rotation, position: Vector3::new(x, y, z) });
            let own = ours[row].iter().position(|own| machine.joints.distance(own.pose(), &pose) < 1e-6);
            assert!(own.is_some() || !is_permitted(&machine, pose, 1e4), "{:?}: {pose:?}", lengths[row]);
            common.extend(own.map(|own| (row, own)));
        }
        println!("{} rows, {count} poses, {} also of numpy", lengths.len(), common.len());
        assert!(lengths.len() == 200 && common.len() * 50 >= count * 49);
    }
}

/// A wrong pose at start-up is one of several with these lengths, and a search finds that there are several.
#[test]
fn wrong_poses_at_start_up_do_not_go_unnoticed() {
    let mut wrong = 0;
    for name in MACHINES {
        let machine = machine(name);
        for x in reachable(&machine) {
            if trial(&machine, Method::Hexad, x) == End::Wrong {
                wrong += 1;
                assert!(ambiguous(&machine, x), "{name}: {x:?}");
            }
        }
    }
    assert!(wrong > 0, "the trials do not come to such poses");
}

/// One measurement after the other, the true pose anywhere: followed or refused, never taken for another.
#[test]
fn a_step_is_followed_or_refused() {
    for name in MACHINES {
        let machine = machine(name);
        let poses = reachable(&machine);
        let ends: Vec<_> = poses.par_iter().enumerate().map(|(k, x)| step(&machine, *x, k as u64)).collect();
        let count = |end: End| ends.iter().filter(|found| **found == end).count();
        assert_eq!(count(End::Wrong), 0, "{name}");
        assert!(count(End::Right) * 10 > ends.len() && count(End::Failed) * 10 > ends.len(), "{name}");
    }
}
