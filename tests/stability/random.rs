//! Random trials: how often each method finds the pose, and that ours is never deceived without notice.

use hexad::model::machine::Machine;
use rayon::prelude::*;

use super::common::stability::rivals::Update;
use super::common::stability::trials::{End, Method, ambiguous, pose, step, trial, within_reach};
use super::common::{MACHINES, machine};

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
            println!("{name} {method:?}: right, failed, wrong {found:.4?}");
            sum.iter_mut().zip(found).for_each(|(sum, share)| *sum += 0.1 * share);
            found
        };
        let [right, _, wrong] = sum(&mut ours, Method::Hexad);
        assert!(right > 0.93 && wrong < 2e-3, "{name}: {right} {wrong}");
        sum(&mut added, Method::Rival(Update::RotationAdded));
        sum(&mut angles, Method::Rival(Update::Angles));
    }
    println!("hexad {ours:.4?}, rotation added to angles {added:.4?}, Newton on angles {angles:.4?}");
    assert!(ours[0] > 0.985, "{ours:?}");
    // What the others are known for.
    assert!((0.7..0.9).contains(&added[0]) && added[2] > 0.01, "{added:?}");
    assert!((0.85..0.97).contains(&angles[0]) && angles[2] > 0.01, "{angles:?}");
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
