//! Tests of the bounds on forces of the drives.

use crate::control::reference::tests::*;
use crate::model::active_forces::InverseDynamics;
use crate::model::force_changes::{ForceChangeBounds, LargestMotion};

/// Poses within a distance of a centre, with motions up to a largest one: no force departs from the centre's
/// by more than the bound, and some depart by a good part of it.
#[test]
fn no_force_changes_by_more_than_its_bound() {
    let mut samples = RandomVectors::new(2026_1126);
    for number in 0..20 {
        let mut machine = machine(&mut samples);
        machine.platform.center_of_mass_m = samples.vector(0.3);
        machine.actuator.reflected_mass_kg = 100.0 * samples.uniform();
        machine.actuator.viscous_friction_n_s_m = [100.0 * samples.uniform(); LEGS];
        let (dynamics, changes) = (InverseDynamics::new(&machine), ForceChangeBounds::new(&machine));
        let (stroke, mut nearest) = (machine.actuator.stroke(), 0.0_f64);
        for _ in 0..1000 {
            let around = Twist { angular: samples.vector(0.3), linear: samples.vector(0.2 * stroke) };
            let center = machine.home_pose().displaced(&around);
            let step = Twist { angular: samples.vector(0.1), linear: samples.vector(0.1 * stroke) };
            let (turn, shift) = (step.angular.norm(), step.linear.norm());
            let Conditioning { sensitivity, largest_row_norm, shortest_leg_m, universal_sine, .. } =
                Conditioning::new(&machine, &center);
            let moved = shift + changes.arm_m * turn;
            let turned_leg = moved / (shortest_leg_m * (shortest_leg_m - moved)).sqrt();
            let change = (6.0 * (turned_leg.powi(2) + (turn + turned_leg).powi(2))).sqrt();
            let inverse = sensitivity.condition / sensitivity.norm;
            if !(moved < shortest_leg_m && inverse * change < 0.9 && universal_sine > turned_leg + 0.1) {
                continue;
            }
            let twist = Twist { angular: samples.vector(1.0), linear: samples.vector(1.0) };
            let acceleration = Acceleration { angular: samples.vector(10.0), linear: samples.vector(5.0) };
            let largest = LargestMotion {
                angular_rad_s2: acceleration.angular.norm(),
                linear_m_s2: acceleration.linear.norm(),
                angular_velocity_rad_s: twist.angular.norm(),
                velocity_m_s: twist.linear.norm(),
            };
            let forces =
                |pose, twist| dynamics.forces::<Exact>(&Motion { pose, twist, acceleration }).unwrap();
            let at_center = forces(center, Twist::default());
            let norm = at_center.iter().map(|force| force * force).sum::<f64>().sqrt();
            let (rest, moving) =
                (changes.at_rest(turn, turned_leg), changes.moving(&largest, turn, turned_leg));
            let wrench = rest.wrench + moving.wrench + change * (norm + changes.axial_norm(&largest));
            // The reference never exceeds the rate of the legs.
            let friction = machine.actuator.largest_viscous_friction()
                * (largest.velocity_m_s + changes.arm_m * largest.angular_velocity_rad_s
                    - changes.max_rate_m_s)
                    .max(0.0);
            let bound = largest_row_norm / (1.0 - inverse * change) * wrench + rest.axial_n + moving.axial_n;
            for (there, here) in forces(center.displaced(&step), twist).iter().zip(at_center) {
                let ratio = (there - here).abs() / (bound + friction + 1e-9);
                assert!(ratio <= 1.0, "{number}: {ratio}");
                nearest = nearest.max(ratio);
            }
        }
        assert!(nearest > 0.2, "{number}: the bound is {} of the largest change", 1.0 / nearest);
    }
}
