//! Forces under gravity in any direction of a cone, against directions tried one by one and against a hand computation.

use hexad::analysis::clearance::{Clearance, WorkspaceLimit};
use hexad::analysis::gravity_cone::GravityCone;
use hexad::analysis::region_shape::{PoseCell, RegionShape};
use hexad::control::constants::MAX_HOLDING_SHARE;
use hexad::model::drive_loads::DriveLoads;

use super::*;

const DIRECTIONS: u32 = 2_000;
const CONES_RAD: [f64; 4] = [0.0, 0.3, 1.05, 2.5];

/// Gravity on the edge of a cone, all around.
fn on_edge(gravity: &Vector3<f64>, half_angle: f64) -> impl Iterator<Item = Vector3<f64>> {
    let side = gravity.cross(&Vector3::ith(gravity.iamin(), 1.0)).normalize();
    let tipped = exp(&(side * half_angle)) * gravity;
    let axis = gravity.normalize();
    (0..720).map(move |k| exp(&(axis * (TAU * f64::from(k) / 720.0))) * tipped)
}

/// Largest force of each leg at rest over directions within a cone, by ordinary inverse dynamics.
fn by_direction(machine: &Machine, pose: Pose, half_angle: f64) -> [f64; LEGS] {
    let gravity = machine.gravity_m_s2;
    let inside = (0..DIRECTIONS).map(|k| directions(k)[0] * gravity.norm());
    let inside = inside.filter(|tried| tried.angle(&gravity) <= half_angle);
    let rest = Motion { pose, twist: Twist::default(), acceleration: Acceleration::default() };
    let mut largest = [0.0_f64; LEGS];
    for gravity_m_s2 in inside.chain(on_edge(&gravity, half_angle)) {
        let forces = inverse_dynamics::<Exact>(&Machine { gravity_m_s2, ..machine.clone() }, &rest).unwrap();
        largest.iter_mut().zip(forces).for_each(|(largest, force)| *largest = largest.max(force.abs()));
    }
    largest
}

#[test]
fn no_direction_of_a_cone_asks_for_more_and_one_for_as_much() {
    let mut inside = 0;
    for name in MACHINES {
        let machine = machine(name);
        let dynamics = InverseDynamics::new(&machine);
        for (k, half_angle) in (0..).zip(CONES_RAD) {
            let cone = GravityCone::new(machine.gravity_m_s2, half_angle);
            let pose = TaskState::at_rest(beside_home(&machine, k, 0.1)).motion().pose;
            let rest = Motion { pose, twist: Twist::default(), acceleration: Acceleration::default() };
            let (most, found) =
                (cone.holding(&dynamics, &pose).unwrap(), by_direction(&machine, pose, half_angle));
            for (leg, row) in DriveLoads::holding_rows(&dynamics, &pose).unwrap().iter().enumerate() {
                let share = found[leg] / most[leg];
                assert!((0.99..1.0 + 1e-9).contains(&share), "{name}, {half_angle}, leg {leg}: {share}");
                let gravity = cone.worst(row);
                let angle = gravity.angle(&machine.gravity_m_s2);
                let longer = gravity.norm() / machine.gravity_m_s2.norm() - 1.0;
                assert!(angle <= half_angle + 1e-7 && longer.abs() < 1e-12, "{name}: {angle} {longer}");
                inside += u32::from(angle < 0.99 * half_angle);
                let force = dynamics.forces_under::<Exact>(&rest, &gravity).unwrap()[leg];
                assert!((force.abs() / most[leg] - 1.0).abs() < 1e-9, "{name}: {force} {most:?}");
            }
        }
    }
    assert!(inside > 20, "{inside}");
}

/// A platform of 100 kg at home, with its centre of mass in C, on legs without mass: `N Gamma = [0; -m g]`. Leg 1 takes `-m n . g` with n
/// from the inverse of N, and gravity on the edge of the cone next to n takes most of it.
#[test]
fn a_platform_on_light_legs_is_as_by_hand() {
    let mut machine = machine("motion_base");
    (machine.platform.mass_kg, machine.platform.center_of_mass_m) = (100.0, Vector3::zeros());
    (machine.cylinder.mass_kg, machine.rod.mass_kg) = (0.0, 0.0);
    let inverse = leg_wrenches(&machine, &machine.home_pose()).try_inverse().unwrap();
    let n: Vector3<f64> = inverse.fixed_view::<1, 3>(0, 3).transpose();
    let (down, half_angle) = (n.angle(&-machine.gravity_m_s2), 0.5);
    let away = down.min(PI - down);
    assert!(away > half_angle, "{away}");
    let expected = 100.0 * 9.81 * n.norm() * (away - half_angle).cos();
    let cone = GravityCone::new(machine.gravity_m_s2, half_angle);
    let [found, ..] = cone.holding(&InverseDynamics::new(&machine), &machine.home_pose()).unwrap();
    assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
    machine.actuator.coulomb_friction_n = [0.0; LEGS];
    let worst = cone.worst_holding(&machine, [machine.home]).unwrap();
    assert!(worst.force_n >= found && worst.leg <= LEGS && worst.pose == machine.home, "{worst:?}");
}

/// With its payload a leg is at the limit in one direction, in motion or at rest.
#[test]
fn a_payload_is_one_that_every_direction_permits() {
    for (name, demand) in MACHINES.into_iter().flat_map(|name| [(name, 0.0), (name, 2.0)]) {
        let mut machine = machine(name);
        let pose = TaskState::at_rest(beside_home(&machine, 1, 0.1)).motion().pose;
        let demand = AccelerationDemand { linear_m_s2: demand, angular_rad_s2: demand };
        let quality = |machine: &Machine, half_angle: f64| {
            PoseEvaluator::new(machine, demand).in_cone(half_angle).quality(&pose)
        };
        machine.actuator.max_force_n = 2.0 * quality(&machine, 1.0).worst_force_n;
        let [upright, tipped] = [0.0, 1.0].map(|half_angle| quality(&machine, half_angle).payload_kg);
        assert!(tipped > 0.0 && tipped < upright, "{name}: {upright} {tipped}");
        machine.platform.mass_kg += tipped;
        let limit = machine.actuator.max_force_n;
        let cone = GravityCone::new(machine.gravity_m_s2, 1.0);
        let holding = cone.holding(&InverseDynamics::new(&machine), &pose).unwrap();
        let held = holding.iter().zip(machine.actuator.coulomb_friction_n);
        let held = held.map(|(force, friction)| force + friction).fold(0.0, f64::max);
        let shares = [quality(&machine, 1.0).worst_force_n / limit, held / (MAX_HOLDING_SHARE * limit)];
        assert!((shares[0].max(shares[1]) - 1.0).abs() < 1e-9, "{name}: {shares:?} with {tipped} kg");
    }
}

/// Cells that are proved held have no pose and no direction of gravity that needs more, and some are not proved for the cone alone.
#[test]
fn a_cell_is_held_under_every_direction() {
    let (mut proved, mut lost) = (0, 0);
    let mut machine = machine("motion_base");
    let cone = GravityCone::new(machine.gravity_m_s2, 0.8);
    let at_home = cone.worst_holding(&machine, [machine.home]).unwrap();
    machine.actuator.max_force_n = 1.7 * at_home.force_n / MAX_HOLDING_SHARE;
    let bound = MAX_HOLDING_SHARE * machine.actuator.weakest_available_force_n();
    let [upright, tipped] = [0.0, 0.8].map(|half_angle| Clearance::new(&machine, 1e3).in_cone(half_angle));
    let shape = RegionShape::Box { low: [-1.0; 6], high: [1.0; 6] };
    for k in 0..60 {
        let (middle, size) = (numbers(k), numbers(k + 1000));
        let cell = PoseCell {
            middle: core::array::from_fn(|axis| 0.5 * middle[axis]),
            half: core::array::from_fn(|axis| 0.01 * size[axis].abs()),
        };
        if !tipped.is_regular(&shape, &cell) {
            lost += u32::from(upright.is_regular(&shape, &cell));
            continue;
        }
        proved += 1;
        let poses = (0..64_u32).map(|j| {
            let sign = |axis: usize| if j >> axis & 1 == 0 { -1.0 } else { 1.0 };
            core::array::from_fn(|axis| machine.home[axis] + cell.middle[axis] + cell.half[axis] * sign(axis))
        });
        let worst = cone.worst_holding(&machine, poses).unwrap();
        assert!(worst.force_n <= bound, "cell {k}: {worst:?} beyond {bound}");
        let pose = TaskState::at_rest(worst.pose).motion().pose;
        assert!(!matches!(tipped.violation_at(&pose), Some(WorkspaceLimit::HoldingForce(_))), "cell {k}");
    }
    assert!(proved > 5 && lost > 5, "{proved} {lost}");
}

fn check(text: &str, more: &[&str]) -> (Option<i32>, serde_json::Value, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("M.toml");
    fs::write(&file, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    let ended = command.arg("check").arg(&file).arg("--json").args(more).output().unwrap();
    let report = serde_json::from_slice(&ended.stdout).unwrap_or_default();
    (ended.status.code(), report, String::from_utf8(ended.stderr).unwrap())
}

#[test]
fn check_examines_the_cone_and_names_leg_direction_and_pose() {
    let (text, half_angle) = (fs::read_to_string(data("motion_base", "toml")).unwrap(), 40_f64.to_radians());
    let machine = machine("motion_base");
    let expected = GravityCone::new(machine.gravity_m_s2, half_angle);
    let expected = expected.worst_holding(&machine, [machine.home]).unwrap();
    let examine = |text: &str, half_angle: Option<f64>| {
        Config::parse(text, "M.toml").unwrap().examine_in_cone(half_angle)
    };
    // Drives that hold the platform upright and not tipped.
    let force = format!("max_force_n = {}", (expected.force_n / MAX_HOLDING_SHARE).floor() - 1.0);
    let weak = text.replace("max_force_n = 20000.0", &force);
    let upright = examine(&weak, None);
    assert!(upright.errors.is_empty() && upright.gravity_cone.is_none(), "{upright:?}");
    let (code, report, errors) = check(&weak, &["--gravity-cone", "40deg"]);
    assert_eq!((code, &report["is_valid"]), (Some(2), &false.into()));
    assert!(errors.contains("N at home with gravity up to 40.0 deg from gravity_m_s2, 90 %"), "{errors}");
    let cone = &report["gravity_cone"];
    assert_eq!(
        (&cone["at_home"]["force_n"], &cone["hardest"]),
        (&expected.force_n.into(), &serde_json::Value::Null)
    );
    assert_eq!(cone["at_home"]["leg"], expected.leg);
    // The same in an envelope: a pose of it, and a direction.
    let numbers = |number: f64| format!("[0.0, 0.0, 0.0, {number}, {number}, {number}]");
    let envelope = |size: f64| {
        let (low, high, rate) = (numbers(-size), numbers(size), [0.1; 6]);
        format!(
            "[envelope]\npose_min = {low}\npose_max = {high}\nvelocity = {rate:?}\nacceleration = {rate:?}\n"
        )
    };
    let found = examine(&format!("{text}\n{}", envelope(0.1)), Some(half_angle));
    let hardest = found.gravity_cone.unwrap().hardest.unwrap();
    assert!(found.errors.is_empty() && hardest.force_n > expected.force_n, "{hardest:?}");
    // Held at home in every direction, and not in the envelope.
    let force = format!("max_force_n = {}", (expected.force_n / MAX_HOLDING_SHARE).ceil() + 1.0);
    let weak = text.replace("max_force_n = 20000.0", &force);
    let found = examine(&format!("{weak}\n{}", envelope(0.1)), Some(half_angle));
    let bound = &found.errors.first().unwrap().bound;
    assert!(bound.contains("N within [envelope] at x") && bound.contains("up to 40.0 deg from"), "{bound}");
    let (code, _, errors) = check(&text, &["--gravity-cone", "40"]);
    assert!(code == Some(2) && errors.contains("has no unit: say 40deg or 40rad"), "{errors}");
}
