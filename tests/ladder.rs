//! Each fidelity of the ladder leaves out what it says: the difference to the exact model is that, computed
//! without the fidelity, by the regressor form (which shares no code with the ladder) or from the vectors.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::{
    Exact, Fidelity, Gravity, LumpedLegs, MasslessLegs, ModelTerms, NoVelocity, RigidLegs,
};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::machine::{Link, Machine, Platform, TransverseInertia};
use hexad::model::regressor::{
    DynamicParameters, Regressor, dynamic_parameters, regressor, rod_mass_null_direction,
};
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::model::task::TaskState;
use hexad_support::{Errors, Legs, MACHINES, Table, data, machine, motions};
use nalgebra::{Matrix3, Vector3, Vector6};

/// Of the largest force of the row: rounding, times the condition.
const ROUNDING: f64 = 1e-12;

/// One motion of one machine.
struct Row<'a> {
    model: &'a InverseDynamics,
    motion: Motion,
}

impl Row<'_> {
    fn machine(&self) -> &Machine {
        self.model.machine()
    }

    fn forces<M: ModelTerms>(&self) -> Vector6<f64> {
        self.model.forces::<M>(&self.motion).unwrap().into()
    }

    fn regressor(&self) -> Regressor {
        regressor(self.machine(), &self.motion).unwrap()
    }

    fn regressor_at_rest(&self) -> Regressor {
        regressor(self.machine(), &Motion { twist: Twist::default(), ..self.motion }).unwrap()
    }

    /// The share of some parameters in the forces.
    fn share(&self, y: &Regressor, parameters: impl Fn(usize) -> bool) -> Vector6<f64> {
        let all = dynamic_parameters(self.machine());
        y * DynamicParameters::from_fn(|k, _| if parameters(k) { all[k] } else { 0.0 })
    }
}

/// Exact minus fidelity is what `left_out` says, on every row of the vectors of every machine; `nothing_at`
/// names machines where that is nothing.
fn check<M: ModelTerms>(fidelity: &str, nothing_at: &[&str], left_out: impl Fn(&Row) -> Vector6<f64>) {
    for name in MACHINES {
        let model = InverseDynamics::new(&machine(name));
        let (mut errors, mut sizes) = (Errors::default(), Errors::default());
        for motion in motions(name) {
            let row = Row { model: &model, motion };
            let exact = row.forces::<Exact>();
            let difference = exact - row.forces::<M>();
            errors.add((difference - left_out(&row)).amax() / exact.amax());
            sizes.add(difference.amax() / exact.amax());
        }
        println!("{name} {fidelity} leaves out RMS {:.1e}, max {:.1e}", sizes.rms(), sizes.max);
        errors.assert_within(ROUNDING, &format!("{name} {fidelity}"));
        assert_eq!(sizes.max < 1e3 * ROUNDING, nothing_at.contains(&name), "{name} {fidelity}: {sizes:?}");
    }
}

/// The legs' parameters in the regressor.
fn of_legs(index: usize) -> bool {
    (10..19).contains(&index)
}

/// The axial inertias.
fn of_spin(index: usize) -> bool {
    index == 12 || index == 17
}

#[test]
fn gravity_leaves_out_all_but_weight() {
    check::<Gravity>("gravity", &[], |row| {
        let held = Motion { twist: Twist::default(), acceleration: Acceleration::default(), ..row.motion };
        let weight = regressor(row.machine(), &held).unwrap() * dynamic_parameters(row.machine());
        row.regressor() * dynamic_parameters(row.machine()) - weight
    });
}

#[test]
fn massless_legs_leave_out_the_legs() {
    check::<MasslessLegs>("massless-legs", &[], |row| row.share(&row.regressor(), of_legs));
}

#[test]
fn lumped_legs_leave_out_all_but_points_in_the_platform() {
    check::<LumpedLegs>("lumped-legs", &[], |row| {
        let y = row.regressor();
        let points = y * rod_mass_null_direction(row.machine()) - y.column(14);
        row.share(&y, of_legs) + points * lumped_mass(row.machine())
    });
}

#[test]
fn no_velocity_leaves_out_what_grows_with_it_but_friction_and_the_spin() {
    check::<NoVelocity>("no-velocity", &[], |row| {
        let (y, at_rest) = (row.regressor(), row.regressor_at_rest());
        let friction = row.share(&y, |k| k >= 20);
        (y - at_rest) * dynamic_parameters(row.machine()) - friction + row.share(&at_rest, of_spin)
    });
}

#[test]
fn rigid_legs_leave_out_the_spin() {
    check::<RigidLegs>("rigid-legs", &SPINLESS, |row| row.share(&row.regressor(), of_spin));
}

/// Machines whose legs have no axial inertia.
const SPINLESS: [&str; 1] = ["tsai2000"];

/// The same against numbers with 80 digits that know of no regressor.
#[test]
fn rigid_legs_are_those_of_the_vectors() {
    for name in MACHINES {
        let table = Table::read(&data(name, "csv"));
        let model = InverseDynamics::new(&machine(name));
        let mut errors = Errors::default();
        for (index, motion) in motions(name).into_iter().enumerate() {
            let row = Row { model: &model, motion };
            let [exact, rigid] =
                ["force", "force_no_spin"].map(|stem| Vector6::from(table.legs(index, stem)));
            let difference = row.forces::<Exact>() - row.forces::<RigidLegs>();
            errors.add((difference - (exact - rigid)).amax() / exact.amax());
        }
        errors.assert_within(ROUNDING, &format!("{name} spin"));
    }
}

/// What hangs on B: with the rest of the leg's mass at A, the mass and the centre of mass of a leg of the
/// mean length at home.
fn lumped_mass(machine: &Machine) -> f64 {
    let Machine { cylinder, rod, .. } = machine;
    let home = TaskState::at_rest(machine.home).motion().pose;
    let length = leg_lengths(machine, &home).iter().sum::<f64>() / 6.0;
    (cylinder.mass_kg * cylinder.center_of_mass_m + rod.mass_kg * (length - rod.center_of_mass_m)) / length
}

fn nothing() -> Link {
    let transverse_inertia =
        TransverseInertia { constant_kg_m2: 0.0, quadratic_kg: 0.0, reference_length_m: 0.0 };
    Link { mass_kg: 0.0, center_of_mass_m: 0.0, axial_inertia_kg_m2: 0.0, transverse_inertia }
}

/// A body and points of this mass at the `B_i`, by Steiner's theorem.
fn with_points(machine: &Machine, mass: f64) -> Platform {
    let points = Legs::of(machine).platform.map(|b| (mass, b, Matrix3::zeros()));
    let Platform { mass_kg, center_of_mass_m, inertia } = machine.platform;
    let parts: Vec<_> = [(mass_kg, center_of_mass_m, inertia)].into_iter().chain(points).collect();
    let mass_kg: f64 = parts.iter().map(|part| part.0).sum();
    let center_of_mass_m: Vector3<f64> =
        parts.iter().map(|(mass, at, _)| at * *mass).sum::<Vector3<f64>>() / mass_kg;
    let about_center = |(mass, at, own): &(f64, Vector3<f64>, Matrix3<f64>)| {
        let r: Vector3<f64> = at - center_of_mass_m;
        own + (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * *mass
    };
    Platform { mass_kg, center_of_mass_m, inertia: parts.iter().map(about_center).sum() }
}

/// The simple fidelities are the exact model of another machine.
#[test]
fn rungs_without_links_are_exact_for_a_machine_without_them() {
    for name in MACHINES {
        let machine = machine(name);
        let bare = Machine { cylinder: nothing(), rod: nothing(), ..machine.clone() };
        let lumped = Machine { platform: with_points(&machine, lumped_mass(&machine)), ..bare.clone() };
        let [machine, bare, lumped] = [machine, bare, lumped].map(|machine| InverseDynamics::new(&machine));
        let mut errors = Errors::default();
        for motion in motions(name) {
            for (fidelity, other) in [(Fidelity::MasslessLegs, &bare), (Fidelity::LumpedLegs, &lumped)] {
                let fidelity = Vector6::from(machine.forces_of(fidelity, &motion).unwrap());
                let other = Vector6::from(other.forces::<Exact>(&motion).unwrap());
                errors.add((fidelity - other).amax() / other.amax());
            }
        }
        errors.assert_within(ROUNDING, &format!("{name} without links"));
    }
}

/// Errors of all fidelities over the vectors, with the velocities and accelerations of a motion that runs
/// `faster` times as fast; shares of the peak force.
fn errors_of_rungs(name: &str, faster: f64) -> [Errors; 6] {
    let model = InverseDynamics::new(&machine(name));
    let mut all = [Errors::default(); 6];
    let faster = motions(name).into_iter().map(|motion| Motion {
        twist: Twist::from_vector(&(motion.twist.vector() * faster)),
        acceleration: Acceleration::from_vector(&(motion.acceleration.vector() * faster * faster)),
        ..motion
    });
    let motions: Vec<_> = faster.collect();
    let exact: Vec<_> =
        motions.iter().map(|motion| Vector6::from(model.forces::<Exact>(motion).unwrap())).collect();
    let peak = exact.iter().map(Vector6::amax).fold(0.0, f64::max);
    for (errors, fidelity) in all.iter_mut().zip(Fidelity::ALL) {
        for (motion, exact) in motions.iter().zip(&exact) {
            errors.add((Vector6::from(model.forces_of(fidelity, motion).unwrap()) - exact).amax() / peak);
        }
    }
    all
}

/// On fast scenes every step up the ladder pays.
#[test]
fn on_fast_scenes_the_rungs_are_ordered() {
    for name in MACHINES {
        let [gravity, massless, lumped, no_velocity, rigid, exact] =
            errors_of_rungs(name, 3.0).map(|e| e.rms());
        println!("{name}: {gravity:.1e} {massless:.1e} {lumped:.1e} {no_velocity:.1e} {rigid:.1e}");
        assert!(gravity > massless.max(no_velocity), "{name}");
        assert!(massless > lumped, "{name}");
        assert!(no_velocity > rigid, "{name}");
        assert!(lumped > rigid, "{name}");
        assert!(rigid > 0.0 || SPINLESS.contains(&name), "{name}");
        assert_eq!(exact, 0.0);
    }
}
