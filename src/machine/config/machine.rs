//! The sections that describe the machine, and the checks that follow from mechanics.
//!
//! `name` and `gravity_m_s2` at the top, `[platform]`, `[cylinder]`, `[rod]`, `[actuator]`, `[home]` and
//! six `[[leg]]`. What follows from the geometry as a whole is checked in [`super::geometry`].

use fearless_simd::Level;
use nalgebra::{Matrix3, Vector3};

use super::bound::Bound;
use super::geometry;
use super::reader::SectionReader;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::machine::{Actuator, Joints, Link, Machine, Platform, TransverseInertia};
use hexad_core::model::task::TaskState;

/// Largest gravity \[m/s^2\]: ten times the Earth's is a wrong unit, not a site.
const MAX_GRAVITY_M_S2: f64 = 100.0;

/// Key of the friction that the file does not state, and its default as shares of forces.
const FRICTION_UNCERTAINTY: &str = "friction_uncertainty_n";
const USUAL_FRICTION_PER_MAX_FORCE: f64 = 0.03;
const USUAL_FRICTION_PER_HOLDING: f64 = 0.2;

/// Least length of a leg as a share of its largest. Forces and accelerations of a leg that turns are as 1 / length: below a
/// thousandth no motion is proved (2026-11-29: three machines).
const LEAST_LENGTH_RATIO: f64 = 0.01;

/// Largest load friction: of a lead screw that hardly turns under load.
const MAX_LOAD_FRICTION: f64 = 0.8;
/// A drive that gives less than half or more than twice of what it is told has a wrong unit.
const FORCE_SCALE_BOUND: Bound = Bound::Within(0.5, 2.0);

/// Rotation from home that usual universal and spherical joints permit; more than a right angle none does.
const USUAL_ROTATION_DEG: f64 = 30.0;
const ROTATION_BOUND_DEG: Bound = Bound::Within(1.0, 90.0);

/// Relative tolerance of the triangle inequalities: a flat plate and a thin disc meet them with equality,
/// and the digits of a file round them to either side.
const INERTIA_TOLERANCE: f64 = 1e-9;

/// Section `[[leg]]`, its reader still open for the checks that need all six.
pub(super) struct LegSection<'t> {
    pub reader: SectionReader<'t>,
    pub base_m: Vector3<f64>,
    pub platform_m: Vector3<f64>,
    /// Unit length.
    pub universal_axis: Vector3<f64>,
}

/// Reads and checks the machine. Rejected values are NaN.
pub(super) fn read(root: &mut SectionReader, level: Level) -> Machine {
    let gravity_m_s2 = Vector3::from(root.vector("gravity_m_s2"));
    if gravity_m_s2.norm() > MAX_GRAVITY_M_S2 {
        root.reject("gravity_m_s2", format!("must be at most {MAX_GRAVITY_M_S2} long"));
    }
    let platform = platform(root.section("platform"));
    let section = root.section("actuator");
    let is_friction_stated = section.has(FRICTION_UNCERTAINTY);
    let actuator = actuator(section);
    let cylinder = link(root.section("cylinder"), &actuator);
    let rod = link(root.section("rod"), &actuator);
    let mut home = root.section("home");
    let home_pose = home.vector("pose");
    let max_rotation_rad =
        home.number_or("max_rotation_deg", USUAL_ROTATION_DEG, ROTATION_BOUND_DEG).to_radians();
    let legs: Vec<LegSection> = root.rows("leg", LEGS).into_iter().map(leg).collect();
    let of_leg = |member: fn(&LegSection) -> Vector3<f64>| -> [Vector3<f64>; LEGS] {
        core::array::from_fn(|i| legs.get(i).map_or(Vector3::repeat(f64::NAN), member))
    };
    let joints = Joints::new(
        &of_leg(|leg| leg.base_m),
        &of_leg(|leg| leg.platform_m),
        &of_leg(|leg| leg.universal_axis),
        &TaskState::at_rest(home_pose).motion().pose,
    );
    let mut machine = Machine {
        gravity_m_s2,
        platform,
        joints,
        cylinder,
        rod,
        actuator,
        home: home_pose,
        max_rotation_rad,
        level,
    };
    if !is_friction_stated {
        machine.actuator.friction_uncertainty_n = usual_friction_uncertainty(&machine);
    }
    geometry::check(&machine, &legs, &home);
    machine
}

fn platform(mut section: SectionReader) -> Platform {
    let mass_kg = section.number("mass_kg", Bound::Positive);
    let center_of_mass_m = Vector3::from(section.vector("center_of_mass_m"));
    let mut tensor = section.section("inertia_kg_m2");
    let [xx, yy, zz] = ["xx", "yy", "zz"].map(|key| tensor.number(key, Bound::Positive));
    let [xy, xz, yz] = ["xy", "xz", "yz"].map(|key| tensor.number_or(key, 0.0, Bound::Finite));
    let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    if inertia.iter().all(|x| x.is_finite()) {
        check_inertia(&section, &inertia);
    }
    Platform { mass_kg, center_of_mass_m, inertia }
}

/// Checks an inertia tensor: a body of positive masses has `0 < I1 <= I2 <= I3 <= I1 + I2`.
fn check_inertia(section: &SectionReader, inertia: &Matrix3<f64>) {
    let mut principal: [f64; 3] = inertia.symmetric_eigenvalues().into();
    principal.sort_by(f64::total_cmp);
    let [least, middle, greatest] = principal;
    let tolerance = INERTIA_TOLERANCE * greatest.abs();
    let shown = format!("principal moments {:?}", principal.map(rounded));
    if least <= tolerance {
        section.reject_as("inertia_kg_m2", shown, "must all be greater than 0");
    } else if greatest > least + middle + tolerance {
        section.reject_as("inertia_kg_m2", shown, "the greatest must be at most the sum of the others");
    }
}

/// Friction that a file without `actuator.friction_uncertainty_n` may lack \[N\]: a share of the largest force, at most
/// a share of the largest force that holds the platform at home.
fn usual_friction_uncertainty(machine: &Machine) -> f64 {
    let at_home = TaskState::at_rest(machine.home).motion();
    let held = InverseDynamics::new(machine).forces_of(Fidelity::Gravity, &at_home).unwrap_or_default();
    let largest = held.into_iter().map(f64::abs).fold(0.0, f64::max);
    (USUAL_FRICTION_PER_MAX_FORCE * machine.actuator.weakest_available_force_n())
        .min(USUAL_FRICTION_PER_HOLDING * largest)
}

fn actuator(mut section: SectionReader) -> Actuator {
    let actuator = Actuator {
        min_length_m: section.number("min_length_m", Bound::Positive),
        max_length_m: section.number("max_length_m", Bound::Positive),
        max_rate_m_s: section.number("max_rate_m_s", Bound::Positive),
        max_force_n: section.number("max_force_n", Bound::Positive),
        reflected_mass_kg: section.number_or("reflected_mass_kg", 0.0, Bound::NotNegative),
        viscous_friction_n_s_m: section.per_leg_or("viscous_friction_n_s_m", 0.0, Bound::NotNegative),
        coulomb_friction_n: section.per_leg_or("coulomb_friction_n", 0.0, Bound::NotNegative),
        load_friction_share: section.per_leg_or("load_friction", 0.0, Bound::Within(0.0, MAX_LOAD_FRICTION)),
        force_scale: section.per_leg_or("force_scale", 1.0, FORCE_SCALE_BOUND),
        friction_uncertainty_n: section.number_or(FRICTION_UNCERTAINTY, 0.0, Bound::NotNegative),
        coulomb_smoothing_m_s: Actuator::COULOMB_SMOOTHING_M_S,
    };
    if actuator.max_length_m <= actuator.min_length_m {
        let bound = format!("must be greater than {} (actuator.min_length_m)", actuator.min_length_m);
        section.reject("max_length_m", bound);
    }
    let least = LEAST_LENGTH_RATIO * actuator.max_length_m;
    if actuator.min_length_m < least {
        let bound = format!(
            "must be at least {} (a hundredth of actuator.max_length_m): give the length at the end stop; every stop is proved for legs as \
             short as this, and for shorter ones none is",
            rounded(least)
        );
        section.reject("min_length_m", bound);
    }
    actuator
}

fn link(mut section: SectionReader, actuator: &Actuator) -> Link {
    let link = Link {
        mass_kg: section.number("mass_kg", Bound::Positive),
        center_of_mass_m: section.number("center_of_mass_m", Bound::NotNegative),
        axial_inertia_kg_m2: section.number("axial_inertia_kg_m2", Bound::NotNegative),
        transverse_inertia: transverse_inertia(&mut section),
    };
    // A body of revolution has no less than half its axial inertia about every other axis.
    let least = least_over_stroke(&link.transverse_inertia, actuator);
    let bound = 0.5 * link.axial_inertia_kg_m2;
    if least < bound - INERTIA_TOLERANCE * bound {
        section.reject_as(
            "transverse_inertia_kg_m2",
            format!("{} at its least over the stroke", rounded(least)),
            format!("must be at least {} (half of axial_inertia_kg_m2)", rounded(bound)),
        );
    }
    link
}

fn transverse_inertia(section: &mut SectionReader) -> TransverseInertia {
    const KEY: &str = "transverse_inertia_kg_m2";
    if !section.is_table(KEY) {
        let constant_kg_m2 = section.number(KEY, Bound::NotNegative);
        return TransverseInertia { constant_kg_m2, quadratic_kg: 0.0, reference_length_m: 0.0 };
    }
    let mut table = section.section(KEY);
    TransverseInertia {
        constant_kg_m2: table.number("constant_kg_m2", Bound::Finite),
        quadratic_kg: table.number("quadratic_kg", Bound::Finite),
        reference_length_m: table.number("reference_length_m", Bound::Finite),
    }
}

/// Least transverse inertia of a link over the stroke; NaN if a value that it depends on was rejected.
fn least_over_stroke(inertia: &TransverseInertia, actuator: &Actuator) -> f64 {
    let TransverseInertia { constant_kg_m2, quadratic_kg, reference_length_m } = *inertia;
    let (shortest, longest) = (actuator.min_length_m, actuator.max_length_m);
    if quadratic_kg == 0.0 {
        return constant_kg_m2;
    }
    if !(shortest..longest).contains(&shortest) {
        return f64::NAN;
    }
    // A parabola is least at an end or at its vertex.
    let vertex = reference_length_m.clamp(shortest, longest);
    let [a, b, c] =
        [shortest, vertex, longest].map(|l| constant_kg_m2 + quadratic_kg * (l - reference_length_m).powi(2));
    if a.is_finite() { a.min(b).min(c) } else { f64::NAN }
}

fn leg(mut reader: SectionReader) -> LegSection {
    let base_m = Vector3::from(reader.vector("base_m"));
    let platform_m = Vector3::from(reader.vector("platform_m"));
    let axis = Vector3::from(reader.vector_or("universal_axis", [0.0, 1.0, 0.0]));
    // Scaled before it is squared, which would leave no digits of a short one.
    let universal_axis = axis.unscale(axis.amax()).normalize();
    if axis.amax() == 0.0 {
        reader.reject("universal_axis", "must not be zero: it is a direction");
    }
    LegSection { reader, base_m, platform_m, universal_axis }
}

/// A number rounded to six significant digits, enough for an error text.
pub(super) fn rounded(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}
