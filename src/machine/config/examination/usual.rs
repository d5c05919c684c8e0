//! Examination of values by ratios that are alike for machines of every size: a wrong unit shows in them.
//!
//! The bounds come from known machines, from a piezo stage of 0.1 mm to a motion base of 20 kN, with room beyond. What
//! they cannot know: docs/operator.md.

use core::ops::RangeInclusive;

use super::Examiner;
use crate::analysis::drive_capability::DriveCapability;
use crate::config::machine::rounded;
use hexad_core::model::LEGS;
use hexad_core::model::machine::Link;
use nalgebra::Vector3;

/// A ratio of a value of the file.
struct Ratio {
    key: &'static str,
    /// Number, and of what it is this multiple.
    ratio: f64,
    of: &'static str,
    usual: RangeInclusive<f64>,
}

fn ratio(key: &'static str, ratio: f64, of: &'static str, usual: RangeInclusive<f64>) -> Ratio {
    Ratio { key, ratio, of, usual }
}

pub(super) fn examine(examiner: &mut Examiner) {
    let gravity = examiner.config.machine.gravity_m_s2.norm();
    if gravity != 0.0 && !(9.7..=9.9).contains(&gravity) {
        let bound = "on the Earth it is 9.76 to 9.84 m/s^2, in space 0; check its unit, or the site";
        examiner.warn("gravity_m_s2", format!("{} long", rounded(gravity)), bound);
    }
    let ratios = [body_ratios, drive_ratios, limit_ratios, sensor_ratios, pair_ratios];
    for Ratio { key, ratio, of, usual } in ratios.into_iter().flat_map(|of| of(examiner)).collect::<Vec<_>>()
    {
        // Zero: without it. Infinite: without a bound.
        if ratio == 0.0 || !ratio.is_finite() || usual.contains(&ratio) || !examiner.is_stated(key) {
            continue;
        }
        let bound = format!("usual is {} to {}; check the units", usual.start(), usual.end());
        examiner.warn(key, format!("{} times {of}", rounded(ratio)), bound);
    }
}

/// Masses, centres of mass and radii of gyration against sizes.
fn body_ratios(examiner: &Examiner) -> Vec<Ratio> {
    let machine = &examiner.config.machine;
    let (platform, cylinder, rod) = (&machine.platform, &machine.cylinder, &machine.rod);
    let (radius, shortest) = (machine.joints.radius_m, machine.actuator.min_length_m);
    let gyration = (0.5 * platform.inertia.trace() / platform.mass_kg).sqrt();
    let transverse = |link: &Link| {
        let inertia = &link.transverse_inertia;
        inertia.constant_kg_m2 + inertia.quadratic_kg * (shortest - inertia.reference_length_m).powi(2)
    };
    let of_link = |link: &Link| {
        [
            link.center_of_mass_m / shortest,
            (link.axial_inertia_kg_m2 / link.mass_kg).sqrt() / shortest,
            (transverse(link) / link.mass_kg).sqrt() / shortest,
        ]
    };
    let [cylinder_center, cylinder_axial, cylinder_transverse] = of_link(cylinder);
    let [rod_center, rod_axial, rod_transverse] = of_link(rod);
    let base = &machine.joints.triples.unpack_vectors(&machine.joints.base);
    let middle = base.iter().sum::<Vector3<f64>>() / LEGS as f64;
    let base_radius = base.iter().map(|joint| (joint - middle).norm()).sum::<f64>() / LEGS as f64;
    const LENGTH: &str = "actuator.min_length_m";
    const GYRATION: &str = "actuator.min_length_m (radius of gyration by inertia and mass)";
    vec![
        ratio(
            "platform.mass_kg",
            platform.mass_kg / (cylinder.mass_kg + rod.mass_kg),
            "the mass of a leg",
            0.5..=300.0,
        ),
        ratio(
            "platform.center_of_mass_m",
            platform.center_of_mass_m.norm() / radius,
            "the radius of the joints",
            0.0..=3.0,
        ),
        ratio(
            "platform.inertia_kg_m2",
            gyration / radius,
            "the radius of the joints (radius of gyration by inertia and mass)",
            0.25..=2.5,
        ),
        ratio("leg", base_radius / radius, "platform_m (radii of the joints by base_m)", 0.3..=8.0),
        ratio("cylinder.mass_kg", cylinder.mass_kg / rod.mass_kg, "rod.mass_kg", 0.2..=8.0),
        ratio("cylinder.center_of_mass_m", cylinder_center, LENGTH, 0.1..=1.2),
        ratio("cylinder.axial_inertia_kg_m2", cylinder_axial, GYRATION, 0.01..=0.25),
        ratio("cylinder.transverse_inertia_kg_m2", cylinder_transverse, GYRATION, 0.05..=0.7),
        ratio("rod.center_of_mass_m", rod_center, LENGTH, 0.1..=1.2),
        ratio("rod.axial_inertia_kg_m2", rod_axial, GYRATION, 0.01..=0.25),
        ratio("rod.transverse_inertia_kg_m2", rod_transverse, GYRATION, 0.025..=0.7),
    ]
}

/// Lengths, forces and frictions of the drives.
fn drive_ratios(examiner: &Examiner) -> Vec<Ratio> {
    let machine = &examiner.config.machine;
    let actuator = &machine.actuator;
    let largest = |of_legs: &[f64; LEGS]| of_legs.iter().copied().fold(0.0, f64::max);
    let drives = DriveCapability::new(machine, &machine.home_pose());
    let held = drives.map_or(0.0, |drives| drives.largest_holding_force().1);
    let (force, stroke) = (actuator.max_force_n, actuator.max_length_m - actuator.min_length_m);
    const FORCE: &str = "actuator.max_force_n";
    vec![
        ratio(
            "actuator.max_length_m",
            actuator.max_length_m / actuator.min_length_m,
            "actuator.min_length_m",
            1.0..=6.0,
        ),
        ratio(
            "actuator.max_rate_m_s",
            stroke / actuator.max_rate_m_s,
            "a second for the whole stroke",
            0.005..=150.0,
        ),
        ratio(FORCE, force / held, "the largest force that holds the platform at home", 1.0..=120.0),
        ratio(
            "actuator.reflected_mass_kg",
            actuator.reflected_mass_kg * LEGS as f64 / machine.platform.mass_kg,
            "the platform's mass on a leg",
            0.1..=150.0,
        ),
        ratio(
            "actuator.viscous_friction_n_s_m",
            largest(&actuator.viscous_friction_n_s_m) * actuator.max_rate_m_s / force,
            "actuator.max_force_n at max_rate_m_s",
            0.003..=0.6,
        ),
        ratio(
            "actuator.coulomb_friction_n",
            largest(&actuator.coulomb_friction_n) / force,
            FORCE,
            0.001..=0.4,
        ),
        ratio("actuator.friction_uncertainty_n", actuator.friction_uncertainty_n / force, FORCE, 0.001..=0.4),
    ]
}

/// Limits against what they limit.
fn limit_ratios(examiner: &Examiner) -> Vec<Ratio> {
    let machine = &examiner.config.machine;
    let (limits, control) = (&examiner.config.deployment.limits, &examiner.config.deployment.control);
    let (linear, actuator) = (&limits.reference.position, &machine.actuator);
    let stroke = actuator.max_length_m - actuator.min_length_m;
    let payload = limits.payload_change_kg.unwrap_or_default() / machine.platform.mass_kg;
    let [step, change] =
        [limits.disturbance_step_m_s2.unwrap_or_default(), control.disturbance_m_s2_per_sqrt_s]
            .map(|disturbance| disturbance / linear.acceleration);
    const ACCELERATION: &str = "limits.acceleration_m_s2";
    vec![
        ratio(
            "limits.velocity_m_s",
            stroke / linear.velocity,
            "a second for the whole stroke",
            0.005..=150.0,
        ),
        ratio("limits.payload_change_kg", payload, "platform.mass_kg", 0.005..=3.0),
        ratio("limits.disturbance_step_m_s2", step, ACCELERATION, 0.03..=10.0),
        ratio("control.disturbance_m_s2_per_sqrt_s", change, ACCELERATION, 0.03..=10.0),
        ratio(
            "limits.force_rate_n_s",
            limits.force_rate_n_s / actuator.max_force_n,
            "actuator.max_force_n in a second",
            3.0..=900.0,
        ),
        ratio("limits.stroke_margin_m", limits.stroke_margin_m / stroke, "the stroke", 3e-4..=0.2),
    ]
}

/// Noise and steps of the sensors.
fn sensor_ratios(examiner: &Examiner) -> Vec<Ratio> {
    let (actuator, noise) = (&examiner.config.machine.actuator, &examiner.config.deployment.noise);
    let stroke = actuator.max_length_m - actuator.min_length_m;
    let per_step = if noise.length_step_m > 0.0 { noise.length_m / noise.length_step_m } else { 0.0 };
    let rate = noise.rate_m_s.unwrap_or_default() / actuator.max_rate_m_s;
    let tolerance = noise.pose_tolerance_m / noise.length_m;
    const NOISE: &str = "measured.length_noise_m";
    vec![
        ratio(NOISE, noise.length_m / stroke, "the stroke", 0.0..=1e-3),
        ratio(NOISE, per_step, "measured.length_step_m", 0.1..=30.0),
        ratio("measured.length_step_m", noise.length_step_m / stroke, "the stroke", 0.0..=3e-3),
        ratio("measured.pose_tolerance_m", tolerance, NOISE, 20.0..=15_000.0),
        ratio("measured.rate_noise_m_s", rate, "actuator.max_rate_m_s", 0.0..=0.1),
    ]
}

/// Two keys of which either may be wrong: lengths against angles at the radius of the joints, tolerances against each other. Named as
/// the stated one of both.
fn pair_ratios(examiner: &Examiner) -> Vec<Ratio> {
    let deployment = &examiner.config.deployment;
    let (control, limits) = (&deployment.control, &deployment.limits.reference);
    let (linear, angular, window) = (&limits.position, &limits.orientation, &deployment.in_position);
    let at_radius = |linear: f64, angular: f64| linear / angular / examiner.config.machine.joints.radius_m;
    let velocity = at_radius(linear.velocity, angular.velocity);
    let acceleration = at_radius(linear.acceleration, angular.acceleration);
    let tolerance = at_radius(window.tolerance_m, window.tolerance_rad);
    let engage = [
        control.engage_position_m / control.following_position_m,
        control.engage_orientation_rad / control.following_orientation_rad,
    ];
    let following = [
        control.following_velocity_m_s / linear.velocity,
        control.following_velocity_rad_s / angular.velocity,
    ];
    let jerk = [linear, angular].map(|bound| bound.jerk / bound.acceleration);
    const ANGLES: &str = "the value of the rotation, at the radius of the joints";
    const IN_A_SECOND: &str = "the acceleration in a second";
    let rows = [
        (["limits.velocity_m_s", "limits.velocity_rad_s"], velocity, ANGLES, 0.08..=12.0),
        (["limits.acceleration_m_s2", "limits.acceleration_rad_s2"], acceleration, ANGLES, 0.05..=20.0),
        (["limits.jerk_m_s3", "limits.acceleration_m_s2"], jerk[0], IN_A_SECOND, 3.0..=2000.0),
        (["limits.jerk_rad_s3", "limits.acceleration_rad_s2"], jerk[1], IN_A_SECOND, 3.0..=2000.0),
        (["control.engage_position_m", "control.following_position_m"], engage[0], FOLLOWING, 0.005..=1.0),
        (
            ["control.engage_orientation_rad", "control.following_orientation_rad"],
            engage[1],
            FOLLOWING,
            0.005..=1.0,
        ),
        (
            ["control.following_velocity_m_s", "limits.velocity_m_s"],
            following[0],
            "limits.velocity_m_s",
            0.02..=4.0,
        ),
        (
            ["control.following_velocity_rad_s", "limits.velocity_rad_s"],
            following[1],
            "limits.velocity_rad_s",
            0.02..=4.0,
        ),
        (["in_position.tolerance_m", "in_position.tolerance_rad"], tolerance, ANGLES, 0.03..=30.0),
    ];
    const FOLLOWING: &str = "the same of control.following";
    let named = |[first, second]: [&'static str; 2]| if examiner.is_stated(first) { first } else { second };
    rows.into_iter().map(|(keys, number, of, usual)| ratio(named(keys), number, of, usual)).collect()
}
