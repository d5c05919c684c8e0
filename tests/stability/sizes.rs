//! A platform of a centimetre and one of fifty metres, with C on it and a thousand radii away: the same relative
//! errors.

use super::*;

/// Radii of the platforms \[m\].
const RADII: [f64; 4] = [0.01, 0.5, 5.0, 50.0];

/// Largest ratio of errors among the sizes.
const ALIKE: f64 = 10.0;

/// The motion base with another radius, and its masses scaled so that lengths are all that changes; C moved by
/// `offset` radii along every axis of the platform.
fn sized(radius: f64, offset: f64) -> Machine {
    let mut sized = machine("motion_base");
    let scale = radius / sized.joints.radius_m;
    let moved = Vector3::repeat(offset * radius);
    let legs = Legs::of(&sized);
    for x in sized.home.iter_mut().skip(3) {
        *x = *x * scale + moved.x;
    }
    sized.joints = Legs {
        base: legs.base.map(|a| a * scale),
        platform: legs.platform.map(|b| b * scale - moved),
        universal_axis: legs.universal_axis,
    }
    .joints(&sized.home);
    sized.platform.center_of_mass_m = sized.platform.center_of_mass_m * scale - moved;
    sized.platform.inertia *= scale * scale;
    for link in [&mut sized.cylinder, &mut sized.rod] {
        link.center_of_mass_m *= scale;
        link.axial_inertia_kg_m2 *= scale * scale;
        link.transverse_inertia.constant_kg_m2 *= scale * scale;
    }
    sized
}

/// Largest error of the mean of the joints, in radii, and of the rotation, over poses near home.
fn pose_errors(radius: f64, offset: f64) -> Errors {
    let (machine, centered) = (&sized(radius, offset), sized(radius, 0.0));
    let mut errors = Errors::default();
    let r = machine.joints.radius_m;
    let center = Legs::of(machine).platform.iter().sum::<Vector3<f64>>() / 6.0;
    for number in 0..2000 {
        // In radians; shifts are three tenths of the radius.
        let mut there = rigid(pose(&centered, 0.2, number));
        there.position += there.rotation * Vector3::repeat(offset * radius);
        let lengths = leg_lengths(machine, &there);
        let mut kinematic_state = KinematicState::new(machine, nearby(&there, &center, r));
        assert_eq!(refine(machine, &mut kinematic_state, &lengths).outcome, Outcome::Solved, "{r}");
        let found = kinematic_state.pose();
        let at = |pose: &Pose| pose.position + pose.rotation * center;
        errors.add((at(found) - at(&there)).norm() / r + (found.rotation - there.rotation).norm());
    }
    errors
}

/// Half a per cent of the radius and 0.2 degrees away, turned about the mean of the joints.
fn nearby(there: &Pose, center: &Vector3<f64>, radius: f64) -> Pose {
    let arm = there.rotation * center;
    let turned =
        there.displaced(&Twist { angular: Vector3::new(2e-3, -2e-3, 2e-3), linear: Vector3::zeros() });
    Pose {
        rotation: turned.rotation,
        position: there.position + arm - turned.rotation * center + Vector3::new(3e-3, 3e-3, -2e-3) * radius,
    }
}

#[test]
fn pose_errors_do_not_depend_on_the_size() {
    let errors = RADII.map(|radius| pose_errors(radius, 0.0));
    let rms = errors.map(|errors| errors.rms());
    let (least, most) =
        (rms.iter().copied().fold(f64::NAN, f64::min), rms.iter().copied().fold(0.0, f64::max));
    assert!(most < ALIKE * least && most < 1e-14, "{rms:?}");
}

/// With C so far away coordinates have that many digits less, and the pose of the platform loses those only.
#[test]
fn a_distant_origin_costs_the_digits_of_its_distance() {
    let near = pose_errors(1.0, 0.0).rms();
    let far = pose_errors(1.0, 1000.0).rms();
    assert!(far / near < 1000.0 * ALIKE && far / near > 10.0, "{near:e} {far:e}");
}

/// Arms from a C a thousand radii away cancel: forces have those digits less.
#[test]
fn a_distant_origin_costs_forces_the_digits_of_its_distance() {
    let errors = |offset: f64| {
        let (machine, centered) = (sized(1.0, offset), sized(1.0, 0.0));
        let (moved, middle) = (InverseDynamics::new(&machine), InverseDynamics::new(&centered));
        let mut errors = Errors::default();
        for number in 0..2000 {
            let there = rigid(pose(&centered, 0.2, number));
            let (twist, acceleration) = moving();
            let centered = Motion { pose: there, twist, acceleration };
            let tool = Pose { rotation: Matrix3::identity(), position: Vector3::repeat(offset) };
            let motion = Frames { tool, ..Frames::default() }.tool_motion(&centered);
            let exact = middle.forces::<Exact>(&centered).unwrap();
            let largest = largest(&exact);
            for (exact, found) in exact.iter().zip(moved.forces::<Exact>(&motion).unwrap()) {
                errors.add((found - exact) / largest);
            }
        }
        errors.rms()
    };
    let [near, far] = [1.0, 1000.0].map(errors);
    assert!((10.0..1000.0 * ALIKE).contains(&(far / near)), "{near:e} {far:e}");
    assert!(far < 1e-11, "{far:e}");
}

fn moving() -> (Twist, Acceleration) {
    (
        Twist { angular: Vector3::new(0.3, -0.2, 0.4), linear: Vector3::new(0.3, 0.2, -0.3) },
        Acceleration { angular: Vector3::new(3.0, 2.0, -4.0), linear: Vector3::new(3.0, -2.0, 3.0) },
    )
}
