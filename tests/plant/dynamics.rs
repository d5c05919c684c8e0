//! Forward dynamics: its mass matrix is that of the bodies, and it inverts inverse dynamics.

use super::energy::energy;
use super::*;

/// `x^T M x / 2` is the kinetic energy of the bodies, so M is symmetric and positive definite. All 21 elements count: the energy of sums of unit
/// twists gives each of them.
#[test]
fn the_mass_matrix_belongs_to_the_kinetic_energy() {
    assert_each_within(1e-13, "mass matrix", &MACHINES, |machine, Motion { pose, twist, .. }| {
        let kinetic = |v: &Vector6<f64>| {
            energy(machine, &BodyState { pose: *pose, twist: Twist::from_vector(v) }).kinetic
        };
        let mass = ForwardDynamics::new(machine).mass_matrix(pose);
        let unit = |k| Vector6::ith(k, 1.0);
        let polarized =
            Matrix6::from_fn(|i, j| kinetic(&(unit(i) + unit(j))) - kinetic(&unit(i)) - kinetic(&unit(j)));
        let v = twist.vector();
        let whole = 0.5 * v.dot(&(mass * v)) / kinetic(&v) - 1.0;
        ((mass - polarized).amax() / mass.amax()).max(whole.abs())
    });
}

#[test]
fn forward_dynamics_inverts_inverse_dynamics() {
    assert_each_within(1e-12, "acceleration", &MACHINES, |machine, motion| {
        let force = inverse_dynamics::<Exact>(machine, motion).unwrap();
        let found = ForwardDynamics::new(machine).acceleration(&motion.pose, &motion.twist, &force);
        let wanted = motion.acceleration.vector();
        (found.unwrap().vector() - wanted).amax() / wanted.amax()
    });
}

/// The least mass an actuator feels: no direction of force accelerates its own legs more.
#[test]
fn the_smallest_leg_mass_is_a_bound() {
    for name in MACHINES {
        let mut machine = machine(name);
        machine.gravity_m_s2.fill(0.0);
        let dynamics = ForwardDynamics::new(&machine);
        for Motion { pose, .. } in motions(name) {
            let smallest = dynamics.smallest_effective_leg_mass_kg(&pose).unwrap();
            for k in 0..6 {
                let force: [f64; 6] = Vector6::ith(k, 1.0).into();
                let acceleration = dynamics.acceleration(&pose, &Twist::default(), &force).unwrap();
                let motion = Motion { pose, twist: Twist::default(), acceleration };
                let accel = leg_motion(&machine, &motion).accel_m_s2[k];
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
    assert_eq!(dynamics.smallest_effective_leg_mass_kg(&motion.pose), None);
}
