//! Sound machines whose legs are arranged so that methods which work on some of the legs first may fail:
//! parallel legs, legs in a plane.

use super::*;

/// Three legs straight up, two along x, one along y: any three of a kind lie in a plane at home, yet the six
/// determine everything. `order` says which leg gets which number.
fn orthogonal(order: [usize; LEGS]) -> Machine {
    let mut machine = machine("tilted");
    machine.home = [0.0; 6];
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let platform = [x * 0.4, y * 0.4 - x * 0.2, -y * 0.4 - x * 0.2, y * 0.3, -y * 0.3, x * 0.3];
    let along = [z, z, z, x, x, y];
    let base: [_; LEGS] = core::array::from_fn(|i| platform[i] - along[i]);
    // No leg along the first axis of its universal joint.
    let axes = along.map(|n| Vector3::new(n.y + n.z, n.z - n.x, n.x + n.y).normalize());
    let legs = Legs {
        base: order.map(|leg| base[leg]),
        platform: order.map(|leg| platform[leg]),
        universal_axis: order.map(|leg| axes[leg]),
    };
    machine.joints = legs.joints(&machine.home);
    machine
}

proptest! {
    #![proptest_config(cases(500))]

    #[test]
    fn parallel_legs_are_no_obstacle(
        order in Just([0, 1, 2, 3, 4, 5]).prop_shuffle(),
        at in [vector6(), vector6(), vector6()],
        share in prop_oneof![Just(0.0), (-12.0..0.0f64).prop_map(|power| 10f64.powf(power))],
    ) {
        let machine = orthogonal(order);
        let mut state = state_near_home(&machine, &at);
        state.x *= share;
        let motion = state.motion();
        let condition = condition(&machine, &motion.pose);
        prop_assert!(condition < 10.0, "{condition}");

        let load = InverseDynamics::new(&machine).load_of::<Exact>(&motion);
        let expected = leg_wrenches(&machine, &motion.pose).lu().solve(&load.wrench).unwrap() + load.axial_forces_n;
        let force = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
        prop_assert!(relative(&force, expected.as_slice()) < 1e-11, "{force:?} {expected}");

        let rates = leg_motion(&machine, &motion).rate_m_s;
        let twist = twist_from_rates(&machine, &motion.pose, &rates).unwrap().vector();
        prop_assert!((twist - motion.twist.vector()).amax() < 1e-11);

        let home = machine.home_pose();
        let mut found = Tracker::new(&machine, home);
        let (tracked, _) = found.find(&machine, &leg_lengths(&machine, &motion.pose));
        prop_assert_eq!(tracked, TrackingResult::Found);
        prop_assert!((found.pose().position - motion.pose.position).norm() < 1e-12);
        prop_assert!(angle_between(&found.pose().rotation, &motion.pose.rotation) < 1e-12);
        prop_assert_eq!(Vector6::from(leg_lengths(&machine, found.pose())).map(f64::is_finite), Vector6::repeat(true));
    }
}
