//! Many motions at once, one in each lane, against one motion with its legs in lanes. `tests/vectors.rs` compares both with
//! forces of 80 digits.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use crate::common::{MACHINES, machine, motions};
use crate::near_singular::scenes::scenes;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::rigid::Motion;

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
