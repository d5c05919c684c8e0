//! Worst forces and payloads, found again by the ordinary inverse dynamics over many directions.

use super::*;
use hexad::analysis::drive_capability::DriveCapability;
use hexad::control::constants::MAX_HOLDING_SHARE;

const DIRECTIONS: u32 = 10_000;
const POSES: u32 = 4;

/// Faster than the smoothing of the Coulomb force, too slow for any other force of velocity.
const CREEPING: f64 = 1e-3;

/// The largest force over many directions of both accelerations and of a creeping motion.
fn by_force(machine: &Machine, pose: Pose, effort: AccelerationDemand) -> f64 {
    let model = InverseDynamics::new(machine);
    let forces = (0..DIRECTIONS).map(|k| {
        let [angular, linear] = directions(k);
        let [turning, moving] = directions(k + DIRECTIONS);
        let twist =
            Twist { angular: turning * CREEPING / machine.joints.radius_m, linear: moving * CREEPING };
        let acceleration =
            Acceleration { angular: angular * effort.angular_rad_s2, linear: linear * effort.linear_m_s2 };
        largest(&model.forces::<Exact>(&Motion { pose, twist, acceleration }).unwrap())
    });
    forces.fold(0.0, f64::max)
}

/// With friction by direction alone.
fn dry(name: &str) -> Machine {
    let mut machine = machine(name);
    machine.actuator.viscous_friction_n_s_m = [0.0; 6];
    machine.actuator.coulomb_friction_n = [0.01 * machine.actuator.max_force_n; 6];
    machine
}

/// An acceleration that asks for about a third of the actuators' force.
fn effort(machine: &Machine) -> AccelerationDemand {
    let linear_m_s2 = machine.actuator.max_force_n / machine.platform.mass_kg;
    AccelerationDemand { linear_m_s2, angular_rad_s2: linear_m_s2 / machine.joints.radius_m }
}

#[test]
fn no_direction_asks_for_more_and_some_for_nearly_as_much() {
    for name in MACHINES {
        let machine = dry(name);
        let effort = effort(&machine);
        let workspace = PoseEvaluator::new(&machine, effort);
        for k in 0..POSES {
            let pose = TaskState::at_rest(beside_home(&machine, k, 0.1)).motion().pose;
            let share = by_force(&machine, pose, effort) / workspace.quality(&pose).worst_force_n;
            assert!((0.95..1.0 + 1e-5).contains(&share), "{name}, pose {k}: {share}");
        }
    }
}

/// What `check`, `goto` and the reference allow at rest, and all of the force in motion.
#[test]
fn a_machine_with_its_payload_is_at_the_limit_in_motion_or_at_rest() {
    let mut held_back = 0;
    for (name, demand) in MACHINES.into_iter().flat_map(|name| [(name, 0.0), (name, 0.5), (name, 5.0)]) {
        let mut machine = dry(name);
        let pose = TaskState::at_rest(beside_home(&machine, 1, 0.1)).motion().pose;
        let demand = AccelerationDemand { linear_m_s2: demand, angular_rad_s2: demand };
        let quality = |machine: &Machine| PoseEvaluator::new(machine, demand).quality(&pose);
        let held =
            |machine: &Machine| DriveCapability::new(machine, &pose).unwrap().largest_holding_force().1;
        // Whatever the machine: it can carry something.
        machine.actuator.max_force_n = 2.0 * quality(&machine).worst_force_n;
        let payload = quality(&machine).payload_kg;
        assert!(payload > 0.0 && payload.is_finite(), "{name}: {payload}");
        let limit = machine.actuator.max_force_n;
        // At the centre of mass it adds neither a moment of inertia nor an arm.
        machine.platform.mass_kg += payload;
        let shares = [quality(&machine).worst_force_n / limit, held(&machine) / (MAX_HOLDING_SHARE * limit)];
        assert!((shares[0].max(shares[1]) - 1.0).abs() < 1e-9, "{name}: {shares:?} with {payload} kg");
        held_back += u32::from(shares[1] > shares[0]);
        assert!(by_force(&machine, pose, demand) <= (1.0 + 1e-5) * limit, "{name}");
        assert!(quality(&machine).payload_kg < 1e-6 * payload, "{name}");
        machine.platform.mass_kg += 0.01 * payload;
        assert!(quality(&machine).payload_kg == 0.0, "{name}");
    }
    assert!((5..60).contains(&held_back), "{held_back}");
}

#[test]
fn what_weighs_nothing_has_no_limit_and_what_is_too_much_carries_nothing() {
    let mut machine = machine("fried2008");
    let home = machine.home_pose();
    let hard = AccelerationDemand { linear_m_s2: 1e4, angular_rad_s2: 0.0 };
    let quality = PoseEvaluator::new(&machine, hard).quality(&home);
    assert!(quality.payload_kg == 0.0 && quality.worst_force_n > machine.actuator.max_force_n, "{quality:?}");
    machine.gravity_m_s2 = Vector3::zeros();
    let still = AccelerationDemand { linear_m_s2: 0.0, angular_rad_s2: 0.0 };
    let quality = PoseEvaluator::new(&machine, still).quality(&home);
    assert_eq!((quality.worst_force_n, quality.payload_kg), (0.0, f64::INFINITY));
}

/// Beside a home that is not singular, on its side; across, on the other.
#[test]
fn reach_ends_with_the_stroke_and_at_singular_poses() {
    let machine = machine("motion_base");
    let workspace =
        PoseEvaluator::new(&machine, AccelerationDemand { linear_m_s2: 1.0, angular_rad_s2: 1.0 });
    let at = |z: f64| {
        let [alpha, beta, gamma, x, y, _] = machine.home;
        workspace.quality(&TaskState::at_rest([alpha, beta, gamma, x, y, z]).motion().pose)
    };
    let [.., z] = machine.home;
    let home = at(z);
    let lengths = leg_lengths(&machine, &machine.home_pose());
    let margin = machine.actuator.max_length_m - largest(&lengths);
    assert!((home.stroke_margin_m - margin).abs() < 1e-12, "{home:?}");
    assert!(home.within_reach() && home.determinant > 0.0);
    assert!(!at(2.5).within_reach() && at(2.5).stroke_margin_m < 0.0);
    // Flat on the base all legs lie in one plane; below, the mirror image has the same lengths.
    assert!(at(0.0).condition > 1e12 && !(at(0.0).worst_force_n < 1e12), "{:?}", at(0.0));
    let below = at(-z);
    assert!(below.stroke_margin_m > 0.0 && below.determinant < 0.0 && !below.within_reach(), "{below:?}");
}
