//! Many motions at once, one in each lane and in several threads, against one motion with its legs in lanes. `tests/vectors.rs` compares both with
//! forces of 80 digits.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use crate::near_singular::scenes::scenes;
use hexad::analysis::batch::{self, forces_of_rows};
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::forward_kinematics::{Outcome, refine};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::random::Random;
use hexad::model::regressor::regressor;
use hexad::model::rigid::{Motion, Pose, Twist};
use hexad::model::task::TaskState;
use hexad_support::{MACHINES, machine, motions, states};
use indicatif::ProgressBar;
use nalgebra::{Vector3, Vector6};

fn forces_of_all(model: &InverseDynamics, fidelity: Fidelity, motions: &[Motion]) -> Vec<Option<[f64; 6]>> {
    let mut forces = vec![None; motions.len()];
    model.forces_of_all(fidelity, motions, &mut forces);
    forces
}

/// Largest difference, as a share of the largest force.
fn difference(found: [f64; 6], expected: [f64; 6]) -> f64 {
    let largest = expected.into_iter().fold(0.0, |largest: f64, force| largest.max(force.abs()));
    found.into_iter().zip(expected).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs() / largest))
}

#[test]
fn every_fidelity_agrees_with_one_motion_alone() {
    let mut worst: f64 = 0.0;
    for name in MACHINES {
        let (model, motions) = (InverseDynamics::new(&machine(name)), motions(name));
        for fidelity in Fidelity::ALL {
            for (motion, forces) in motions.iter().zip(forces_of_all(&model, fidelity, &motions)) {
                let expected = model.forces_of(fidelity, motion).unwrap();
                let error = difference(forces.unwrap(), expected);
                assert!(error < 1e-14, "{name}, {}: {error:e}", fidelity.name());
                worst = worst.max(error);
            }
        }
    }
    println!("largest difference {worst:.1e}");
}

/// The same bits beside any neighbours and in any lane; what lies beyond the motions is left as it is.
#[test]
fn neighbours_do_not_matter() {
    let (model, motions) = (InverseDynamics::new(&machine("scattered")), motions("scattered"));
    let all = forces_of_all(&model, Fidelity::Exact, &motions);
    for (first, count) in [(0, 1), (3, 7), (1, 8), (5, 9), (2, 16), (0, 0)] {
        let part = &motions[first..first + count];
        let mut forces = vec![Some([7.0; 6]); count + 1];
        model.forces_of_all(Fidelity::Exact, part, &mut forces);
        assert_eq!(forces[..count], all[first..first + count]);
        assert_eq!(forces[count], Some([7.0; 6]));
    }
    let mut unreadable = motions[..8].to_vec();
    unreadable[2].pose.position.x = f64::NAN;
    let forces = forces_of_all(&model, Fidelity::Exact, &unreadable);
    assert!((0..8).all(|k| k == 2 || forces[k] == all[k]));
    assert!(forces[2].is_none_or(|forces| forces.iter().any(|force| force.is_nan())));
}

/// The same bits with any number of threads.
#[test]
fn threads_do_not_matter() {
    let (model, motions) = (InverseDynamics::new(&machine("scattered")), motions("scattered"));
    let many: Vec<_> = motions.iter().cycle().take(5001).copied().collect();
    let alone = forces_of_all(&model, Fidelity::Exact, &many);
    for threads in [0, 1, 2, 3, 16] {
        let (mut forces, bar) = (vec![None; many.len()], ProgressBar::hidden());
        batch::forces(&model, Fidelity::Exact, &many, &mut forces, threads, &bar);
        assert!(forces == alone && bar.position() == 5001, "{threads} threads");
    }
}

/// Rows of X, X' and X'' have the forces of their motions, on any vectors; NaN where there is none, and only there.
#[test]
fn rows_have_the_forces_of_their_motions() {
    let machine = machine("scattered");
    let model = batch::model(&machine);
    let mut states: Vec<_> = states("scattered").into_iter().cycle().take(3001).collect();
    (states[7].x[1], states[1500].xdd[5]) = (f64::NAN, f64::INFINITY);
    let rows = |of: fn(&TaskState) -> Vector6<f64>| states.iter().map(|s| of(s).into()).collect::<Vec<_>>();
    let (x, xd, xdd) = (rows(|state| state.x), rows(|state| state.xd), rows(|state| state.xdd));
    let mut forces = vec![[7.0; 6]; states.len()];
    forces_of_rows(&model, Fidelity::Exact, [&x, &xd, &xdd], &mut forces, 2);
    for (k, (state, forces)) in states.iter().zip(forces).enumerate() {
        if [7, 1500].contains(&k) {
            assert!(forces.iter().all(|force| force.is_nan()), "{k}: {forces:?}");
        } else {
            let expected = model.forces_of(Fidelity::Exact, &state.motion()).unwrap();
            assert!(difference(forces, expected) < 1e-14, "{k}: {forces:?} instead of {expected:?}");
        }
    }
}

/// Poses near their starts are those of Newton's method alone, from steps that rounding decides to those beyond the trusted region.
#[test]
fn poses_agree_with_one_pose_alone() {
    let (mut worst, mut solved, mut unsolved): (f64, _, _) = (0.0, 0, 0);
    for name in MACHINES {
        let machine = machine(name);
        let joints = &machine.joints;
        let mut random = Random::new(7);
        for size in [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1e-2, 3e-2, 0.1] {
            let there: Vec<_> = motions(name).iter().map(|motion| motion.pose).collect();
            let start = |pose: &Pose| {
                let mut step = |scale: f64| Vector3::from_fn(|_, _| scale * random.signed());
                pose.displaced(&Twist { angular: step(size), linear: step(size * joints.radius_m) })
            };
            let starts: Vec<_> = there.iter().map(start).collect();
            let lengths: Vec<_> = there.iter().map(|pose| leg_lengths(&machine, pose)).collect();
            let mut poses = vec![None; starts.len()];
            batch::poses(&machine, &starts, &lengths, &mut poses, 2);
            for ((start, lengths), found) in starts.iter().zip(&lengths).zip(poses) {
                let mut state = KinematicState::new(&machine, *start);
                let outcome = refine(&machine, &mut state, lengths).outcome;
                assert_eq!(found.is_some(), outcome == Outcome::Solved, "{name}, {size:e}: {outcome:?}");
                unsolved += usize::from(found.is_none());
                solved += usize::from(found.is_some());
                let error = found.map_or(0.0, |pose| joints.distance(&pose, state.pose()));
                let bound = 1e-15 * state.sensitivity().condition.max(10.0);
                assert!(error < bound, "{name}, {size:e}: {error:e} beyond {bound:e}");
                worst = worst.max(error / state.sensitivity().condition);
            }
        }
    }
    println!(
        "largest difference {worst:.1e} of the condition; {solved} solved, {unsolved} beyond the trusted region"
    );
    assert!(solved > 1000 && unsolved > 1000, "{solved} solved, {unsolved} not");
}

/// Regressors in threads are those of one motion after the other.
#[test]
fn regressors_agree_with_one_motion_alone() {
    let (machine, motions) = (machine("scattered"), motions("scattered"));
    let mut found = vec![None; motions.len()];
    batch::regressors(&machine, &motions, &mut found, 0);
    assert!(motions.iter().zip(found).all(|(motion, found)| found == regressor(&machine, motion)));
}

/// Where the blocks are nearly singular a motion is evaluated alone; elsewhere the difference is rounding times the condition.
#[test]
fn near_singular_poses_agree() {
    let (mut alone, mut in_lanes) = (0, 0);
    scenes(&mut |scene| {
        let expected = scene.model.forces_of(Fidelity::Exact, &scene.motion);
        let [forces] = forces_of_all(&scene.model, Fidelity::Exact, &[scene.motion])[..] else { panic!() };
        if forces == expected {
            alone += 1;
        } else {
            in_lanes += 1;
            let error = difference(forces.unwrap(), expected.unwrap());
            assert!(
                error < 1e-14 * scene.condition,
                "{}: {error:e}, condition {:e}",
                scene.family,
                scene.condition
            );
        }
    });
    assert!(alone > 1000 && in_lanes > 1000, "{alone} alone, {in_lanes} in lanes");
}
