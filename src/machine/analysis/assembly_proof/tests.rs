//! Each step of the proof alone, at random poses: none excludes a pose that has the lengths.

use super::*;
use crate::config::Config;
use hexad_core::model::random::Random;

/// Machines, and poses within 30 degrees and a third of the radius of home; `check` has a random vector of norm 1 or less.
fn poses(count: usize, mut check: impl FnMut(&Machine, &Pose, &mut dyn FnMut() -> Vector3<f64>)) {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let machine = Config::load(format!("../../config/{name}.toml").as_ref()).unwrap().machine;
        let mut random = Random::new(count as u64);
        let mut vector = || Vector3::from_fn(|_, _| random.signed()).cap_magnitude(1.0);
        for _ in 0..count {
            let way = Twist { angular: vector() * 0.5, linear: vector() * (0.3 * machine.joints.radius_m) };
            check(&machine, &machine.home_pose().displaced(&way), &mut vector);
        }
    }
}

/// A little more than a bound, for rounding.
fn bounds(bound: f64, value: f64) -> bool {
    value.abs() <= bound * (1.0 + 1e-9) + 1e-12
}

#[test]
fn regions_and_what_they_become_contain_the_pose() {
    poses(3000, |machine, truth, vector| {
        let legs = Legs::new(machine, &leg_lengths(machine, truth));
        let center = truth.position + truth.rotation * legs.mean;
        // On the edge of the ball.
        let w = vector().normalize() * (0.26 * vector().x.abs().powi(4));
        let regions = legs.regions(exp(&-w) * truth.rotation, w.norm());
        let holds = |region: &Region| bounds(region.tau, (center - region.center).norm());
        let region = regions.into_iter().flatten().find(holds).expect("a region with the pose");
        if let Some((middle, half)) = legs.newton(&region) {
            let t = center - region.center;
            let error = Vector6::new(w.x, w.y, w.z, t.x, t.y, t.z) - middle;
            assert!(error.iter().zip(&half).all(|(error, half)| bounds(*half, *error)), "{error} {half}");
        }
    });
}

#[test]
fn no_region_of_two_poses_has_at_most_one() {
    let mut pairs = 0;
    poses(50, |machine, truth, _| {
        let lengths = leg_lengths(machine, truth);
        let (legs, modes) =
            (Legs::new(machine, &lengths), all_modes(machine, &lengths, &truth.rotation, 1.5));
        for (k, one) in modes.poses.iter().enumerate() {
            for other in modes.poses.iter().skip(k + 1) {
                let half = log(&(other.pose().rotation * one.pose().rotation.transpose())) * 0.5;
                let centers = [one, other].map(|it| it.pose().position + it.pose().rotation * legs.mean);
                let region = Region {
                    rotation: exp(&half) * one.pose().rotation,
                    center: (centers[0] + centers[1]) * 0.5,
                    rho: half.norm(),
                    tau: (centers[1] - centers[0]).norm() * 0.5,
                };
                assert!(!legs.has_at_most_one(&region), "{one:?} {other:?}");
                pairs += 1;
            }
        }
    });
    assert!(pairs > 150, "{pairs}");
}

#[test]
fn a_cell_and_its_eighths_contain_its_orientations() {
    poses(1000, |_, _, vector| {
        let cell = Cell { turn: vector() * 2.0, half: 0.15 };
        let turn = cell.turn + vector().map(|x| x.signum() * 0.15);
        let contains = |cell: &Cell| bounds(cell.radius(), log(&(exp(&turn) * exp(&-cell.turn))).norm());
        assert!(contains(&cell) && cell.eighths().any(|eighth| contains(&eighth)), "{turn}");
    });
}
