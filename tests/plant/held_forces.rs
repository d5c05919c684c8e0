//! Forces that are held while the legs turn: the bounds of the jerk against the accelerations of the plant.

use hexad::analysis::held_forces::HeldForces;

use super::*;

/// No motion changes the acceleration faster than the bounds, and some do so nearly.
#[test]
fn no_motion_changes_an_acceleration_faster_than_the_bounds_of_the_jerk() {
    let of = |velocity| DerivativeLimits { velocity, acceleration: 1.0, jerk: 1.0 };
    let limits = Limits { position: of(0.3), orientation: of(0.5), autonomous_scale: 1.0 };
    let mut random = Random::new(7);
    let mut displacement =
        |size: f64| Twist::from_vector(&Vector6::from_fn(|_, _| size * random.near_gaussian()));
    for name in MACHINES {
        let machine = machine(name);
        let plant = ForwardDynamics::new(&machine);
        let pose = machine.home_pose().displaced(&displacement(0.01 * machine.joints.radius_m));
        let rest = Motion { pose, twist: Twist::default(), acceleration: Acceleration::default() };
        let forces = inverse_dynamics::<Exact>(&machine, &rest).unwrap();
        let bounds = HeldForces::new(&machine).angular_and_linear_jerk_bounds(&pose, &limits).unwrap();
        let (mut most, dt) = ([0.0_f64; 2], 1e-5);
        for _ in 0..5_000 {
            let velocity = displacement(1.0);
            let rates = leg_wrenches(&machine, &pose).tr_mul(&velocity.vector());
            let slower = (limits.orientation.velocity / velocity.angular.norm())
                .min(limits.position.velocity / velocity.linear.norm())
                .min(machine.actuator.max_rate_m_s / rates.amax());
            let later = pose.displaced(&Twist::from_vector(&(velocity.vector() * (slower * dt))));
            let change = plant.acceleration(&later, &rest.twist, &forces).unwrap();
            most = [most[0].max(change.angular.norm() / dt), most[1].max(change.linear.norm() / dt)];
        }
        for (most, bound) in most.iter().zip(bounds) {
            assert!(*most <= 1.001 * bound && *most > 0.3 * bound, "{name}: {most} of {bound}");
        }
    }
}
