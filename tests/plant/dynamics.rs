//! Forward dynamics: its mass matrix is that of the bodies, and it inverts inverse dynamics.

use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::plant::forward_dynamics::ForwardDynamics;
use hexad::plant::integrator::BodyState;
use nalgebra::{Matrix6, Vector6};

use super::common::{Errors, MACHINES, machine, motions};
use super::energy::energy;

#[test]
fn the_mass_matrix_is_symmetric_and_positive_definite() {
    for name in MACHINES {
        let machine = machine(name);
        let dynamics = ForwardDynamics::new(&machine);
        for motion in motions(name) {
            let mass = dynamics.mass_matrix(&motion.pose);
            assert!((mass - mass.transpose()).amax() < 1e-14 * mass.amax(), "{name}: {mass}");
            let smallest = mass.symmetric_eigenvalues().min();
            assert!(smallest > 0.0, "{name}: {smallest}");
        }
    }
}

/// `x^T M x / 2` is the kinetic energy of the bodies. All 21 elements count: the energy of sums of unit
/// twists gives each of them.
#[test]
fn the_mass_matrix_belongs_to_the_kinetic_energy() {
    for name in MACHINES {
        let machine = machine(name);
        let dynamics = ForwardDynamics::new(&machine);
        let mut errors = Errors::default();
        for Motion { pose, twist, .. } in motions(name) {
            let kinetic = |v: &Vector6<f64>| {
                energy(&machine, &BodyState { pose, twist: Twist::from_vector(v) }).kinetic
            };
            let mass = dynamics.mass_matrix(&pose);
            let unit = |k| Vector6::ith(k, 1.0);
            let polarized = Matrix6::from_fn(|i, j| {
                kinetic(&(unit(i) + unit(j))) - kinetic(&unit(i)) - kinetic(&unit(j))
            });
            errors.add((mass - polarized).amax() / mass.amax());
            let v = twist.vector();
            errors.add(0.5 * v.dot(&(mass * v)) / kinetic(&v) - 1.0);
        }
        errors.assert_within(1e-13, &format!("{name} mass matrix"));
    }
}

#[test]
fn forward_dynamics_inverts_inverse_dynamics() {
    for name in MACHINES {
        let machine = machine(name);
        let dynamics = ForwardDynamics::new(&machine);
        let mut errors = Errors::default();
        for motion in motions(name) {
            let force = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
            let found = dynamics.acceleration(&motion.pose, &motion.twist, &force).unwrap();
            let wanted = motion.acceleration.vector();
            errors.add((found.vector() - wanted).amax() / wanted.amax());
        }
        errors.assert_within(1e-12, &format!("{name} acceleration"));
    }
}

/// The least mass an actuator feels: no direction of force accelerates its own legs more.
#[test]
fn the_smallest_leg_mass_is_a_bound() {
    for name in MACHINES {
        let mut machine = machine(name);
        machine.gravity.fill(0.0);
        let dynamics = ForwardDynamics::new(&machine);
        for Motion { pose, .. } in motions(name) {
            let smallest = dynamics.smallest_leg_mass(&pose).unwrap();
            for k in 0..6 {
                let force: [f64; 6] = Vector6::ith(k, 1.0).into();
                let acceleration = dynamics.acceleration(&pose, &Twist::default(), &force).unwrap();
                let motion = Motion { pose, twist: Twist::default(), acceleration };
                let accel = hexad::model::inverse_geometry::leg_motion(&machine, &motion).accel[k];
                assert!(accel > 0.0 && accel <= (1.0 + 1e-9) / smallest, "{name}: {accel} {smallest}");
            }
        }
    }
}

/// Where the dynamics are not defined there is no acceleration, and no panic.
#[test]
fn no_pose_no_acceleration() {
    let machine = machine("fried2008");
    let dynamics = ForwardDynamics::new(&machine);
    let mut motion = motions("fried2008")[0];
    motion.pose.position.fill(f64::NAN);
    assert_eq!(dynamics.acceleration(&motion.pose, &motion.twist, &[0.0; 6]), None::<Acceleration>);
    assert_eq!(dynamics.smallest_leg_mass(&motion.pose), None);
}
