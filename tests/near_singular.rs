//! Near singular poses: the forces and the twist are as accurate as LU with partial pivoting makes them, to
//! a factor of two, whatever the condition; judged by a solution that is rounded once.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

pub mod reference;
pub mod scenes;

use std::collections::{BTreeMap, BTreeSet};

use scenes::{Scene, scenes};

use crate::*;

/// What the errors may be, over those of partial pivoting.
const WORST_RATIO: f64 = 2.0;
/// Of the largest of thousands of errors, a matter of chance.
const WORST_RATIO_OF_LARGEST: f64 = 2.5;

/// The guard of `model::balance`, to see that both sides of it are tested.
const LEAST_DA: f64 = 0.2;

/// Largest error of six numbers, as a share of the largest of them, of ours and of partial pivoting.
#[derive(Default)]
struct Both {
    ours: Errors,
    lu: Errors,
}

impl Both {
    fn add(&mut self, [ours, lu]: [Option<Vector6<f64>>; 2], exact: &Vector6<f64>) {
        let error = |found: Vector6<f64>| (found - exact).amax() / exact.amax();
        self.ours.add(error(ours.unwrap()));
        self.lu.add(error(lu.unwrap()));
    }

    fn assert_comparable(&self, what: &str) {
        let (max, rms) = (self.ours.max / self.lu.max, self.ours.rms() / self.lu.rms());
        println!("{what}: partial pivoting RMS {:.1e}, ratio max {max:.2}, RMS {rms:.2}", self.lu.rms());
        assert!(max < WORST_RATIO_OF_LARGEST && rms < WORST_RATIO, "{what}: ratio max {max}, RMS {rms}");
    }
}

/// Errors of forces and twist of many poses.
#[derive(Default)]
struct Compared {
    count: usize,
    by_blocks: usize,
    forces: Both,
    twist: Both,
}

impl Compared {
    fn add(&mut self, scene: &Scene) {
        let (machine, motion) = (scene.model.machine(), &scene.motion);
        let load = scene.model.load_of::<Exact>(motion);
        let n = load.leg_wrenches;
        let exact = reference::solve(&n, &load.wrench) + load.axial_forces_n;
        let ours = scene.model.forces::<Exact>(motion).map(Vector6::from);
        let lu = n.lu().solve(&load.wrench).map(|x| x + load.axial_forces_n);
        self.forces.add([ours, lu], &exact);

        // Angles count as lengths at the platform's radius.
        let r = machine.joints.radius_m;
        let scaled = |v: Vector6<f64>| v.component_mul(&Vector6::new(r, r, r, 1.0, 1.0, 1.0));
        let exact = scaled(reference::solve(&n.transpose(), &scene.rates));
        let ours = twist_from_rates(machine, &motion.pose, &scene.rates.into());
        let lu = n.transpose().lu().solve(&scene.rates);
        self.twist.add([ours.map(|twist| twist.vector()), lu].map(|v| v.map(scaled)), &exact);

        self.count += 1;
        self.by_blocks += usize::from(determinants(machine, &motion.pose).0.abs() > LEAST_DA);
    }

    fn assert_comparable(&self, what: &str) {
        self.forces.assert_comparable(&format!("{what} forces"));
        self.twist.assert_comparable(&format!("{what} twist"));
    }
}

/// dA, and dS / radius^3, the determinants that guard the blocks.
fn determinants(machine: &Machine, pose: &Pose) -> (f64, f64) {
    let n = leg_wrenches(machine, pose);
    let legs = machine.joints.triples.pack(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).0;
    let d_a = Matrix3::from_fn(|i, j| n[(i + 3, legs[j] as usize)]).determinant();
    (d_a, n.determinant() / d_a / machine.joints.radius_m.powi(3))
}

#[test]
fn no_worse_than_twice_partial_pivoting() {
    let mut decades: BTreeMap<i32, Compared> = BTreeMap::new();
    let mut families = BTreeSet::new();
    scenes(&mut |scene| {
        decades.entry(scene.condition.log10() as i32).or_default().add(scene);
        families.insert(scene.family);
    });
    assert_eq!(families.len(), 7, "{families:?}");
    assert_eq!(decades.keys().copied().collect::<Vec<_>>(), (0..13).collect::<Vec<_>>());
    for (decade, compared) in decades {
        assert!(compared.count > 1000, "{}", compared.count);
        assert!((0.1..0.99).contains(&(compared.by_blocks as f64 / compared.count as f64)));
        compared.assert_comparable(&format!("condition 1e{decade}, {} poses,", compared.count));
    }
}

/// The machines' own motions do not need the fallback, which costs time.
#[test]
fn the_blocks_serve_the_motions_of_every_machine() {
    for name in MACHINES {
        let machine = machine(name);
        for motion in motions(name) {
            let (d_a, d_s) = determinants(&machine, &motion.pose);
            assert!(d_a.abs() > LEAST_DA && d_s.abs() > 1.0, "{name}: {d_a} {d_s}");
        }
    }
}
