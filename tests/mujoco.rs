//! `hexad export` and the model against MuJoCo, an engine that nobody here wrote: the exported machine is what
//! the configuration says, and takes the forces that hexad computes.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod mujoco {
    use super::*;

    mod identification;
    mod in_the_loop;
    mod layouts;
    pub mod python;
    mod stage;
}

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hexad::model::LEGS;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::machine::{Link, Machine};
use hexad::model::random::Random;
use hexad::model::rigid::Motion;
use hexad::model::task::TaskState;
use mujoco::python;
use nalgebra::Vector3;

use hexad_support::{Errors, MACHINES, Table, data, largest, machine, motions};

/// The machines that come with hexad.
const DEPLOYED: [&str; 3] = ["fried2008", "motion_base", "tsai2000"];

/// A file of this test.
fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mujoco");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// What `hexad export` writes to standard output.
fn exported(name: &str, format: &str) -> String {
    export(name, &["--format".as_ref(), format.as_ref()])
}

fn export(name: &str, arguments: &[&OsStr]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    command.arg("export").arg("--config").arg(data(name, "toml")).args(arguments);
    let ended = command.output().unwrap();
    assert!(ended.status.success(), "{command:?}: {}", String::from_utf8_lossy(&ended.stderr));
    String::from_utf8(ended.stdout).unwrap()
}

#[test]
fn export_writes_the_same_to_a_file() {
    for format in ["mjcf", "urdf"] {
        let path = file(&format!("to_a_file.{format}"));
        let arguments = ["--format".as_ref(), format.as_ref(), "--output".as_ref(), path.as_os_str()];
        assert_eq!(export("tilted", &arguments), "", "nothing to standard output");
        assert_eq!(fs::read_to_string(&path).unwrap(), exported("tilted", format));
    }
}

/// Forces of MuJoCo for the motions of `tests/data/NAME.csv`, by a model of this text.
fn forces_by_mujoco(name: &str, label: &str, model: &str) -> Vec<[f64; LEGS]> {
    let [model_file, output] = ["xml", "csv"].map(|extension| file(&format!("{name}_{label}.{extension}")));
    fs::write(&model_file, model).unwrap();
    python::run("mujoco_inverse_dynamics.py", &[&model_file, &data(name, "csv"), &output]).unwrap();
    let table = Table::read(&output);
    (0..table.rows.len()).map(|row| table.legs(row, "force")).collect()
}

/// Differences to what hexad says of these motions of `machine`, as shares of the largest force of a motion.
fn differences(machine: &Machine, motions: &[Motion], found: &[[f64; LEGS]]) -> Errors {
    assert_eq!(motions.len(), found.len());
    let mut errors = Errors::default();
    for (motion, found) in motions.iter().zip(found) {
        let ours = inverse_dynamics::<Exact>(machine, motion).unwrap();
        for (a, b) in found.iter().zip(ours) {
            errors.add((a - b) / largest(&ours));
        }
    }
    errors
}

/// MuJoCo's Coulomb friction is a constraint and no force of a motion.
fn without_dry_friction(mut machine: Machine) -> Machine {
    machine.actuator.coulomb_friction_n = [0.0; 6];
    machine
}

#[test]
fn mujoco_computes_the_same_forces_from_the_mjcf() {
    if python::is_lacking() {
        return;
    }
    for name in MACHINES {
        let found = forces_by_mujoco(name, "mjcf", &exported(name, "mjcf"));
        let errors = differences(&without_dry_friction(machine(name)), &motions(name), &found);
        errors.assert_within(1e-11, &format!("{name} MJCF, forces"));
    }
}

/// URDF has no gravity (MuJoCo takes its own), no reflected mass, and inertias as at home.
#[test]
fn mujoco_computes_the_same_forces_from_the_urdf() {
    if python::is_lacking() {
        return;
    }
    for name in MACHINES {
        let mut machine = without_dry_friction(machine(name));
        let home = TaskState::at_rest(machine.home).motion().pose;
        let length = leg_lengths(&machine, &home)[0];
        for Link { transverse_inertia: inertia, .. } in [&mut machine.cylinder, &mut machine.rod] {
            inertia.constant_kg_m2 += inertia.quadratic_kg * (length - inertia.reference_length_m).powi(2);
            inertia.quadratic_kg = 0.0;
        }
        machine.gravity_m_s2 = Vector3::new(0.0, 0.0, -9.81);
        machine.actuator.reflected_mass_kg = 0.0;
        let found = forces_by_mujoco(name, "urdf", &exported(name, "urdf"));
        differences(&machine, &motions(name), &found).assert_within(1e-10, &format!("{name} URDF, forces"));
    }
}

/// The comparison sees every kind of number in the file: each of these makes a difference a thousand times
/// what is allowed above.
#[test]
fn mujoco_sees_what_is_wrong_in_a_model() {
    if python::is_lacking() {
        return;
    }
    let name = "motion_base";
    let right = exported(name, "mjcf");
    let wrong = [
        ("rod's inertia", "diaginertia=\"4.1 4.1 0.05\"", "diaginertia=\"4.1 4.1004 0.05\""),
        ("cylinder's spin", "diaginertia=\"16.0 16.0 0.9\"", "diaginertia=\"16.0 16.0 0.91\""),
        ("rod's centre", "<inertial pos=\"0 0 -0.75\"", "<inertial pos=\"0 0 -0.7501\""),
        ("platform's product of inertia", "12.0 -20.0 8.0\"", "12.0 -20.0 8.01\""),
        ("reflected mass", "armature=\"400.0\"", "armature=\"400.01\""),
        ("viscous friction", "damping=\"1500.0\"", "damping=\"1500.1\""),
        ("gravity", "gravity=\"0.0 0.0 -9.81\"", "gravity=\"0.0 0.0 -9.8101\""),
        ("joint on the platform", "pos=\"0.587785252292 -0", "pos=\"0.587786252292 -0"),
        ("joint on the base", "pos=\"1.989043790737 -0", "pos=\"1.989044790737 -0"),
    ];
    for (what, from, to) in wrong {
        assert!(right.contains(from), "{what}: {from:?} is not in the model");
        let label = format!("wrong_{}", what.replace([' ', '\''], "_"));
        let found = forces_by_mujoco(name, &label, &right.replace(from, to));
        let errors = differences(&machine(name), &motions(name), &found);
        println!("{what}: {:.1e}", errors.max);
        assert!(errors.max > 1e-8, "{what}: {errors:?}");
    }
}

/// Poses of a machine that is held.
const POSES: usize = 8;

/// Poses within the stroke, up to a tenth of a radian and of the platform's radius from home.
fn poses(machine: &Machine) -> Vec<[f64; 6]> {
    let mut random = Random::new(7);
    let stroke = machine.actuator.min_length_m..machine.actuator.max_length_m;
    let mut poses = Vec::new();
    while poses.len() < POSES {
        let mut x = machine.home;
        for (k, value) in x.iter_mut().enumerate() {
            let reach = if k < 3 { 0.1 } else { 0.1 * machine.joints.radius_m };
            *value += reach * (2.0 * random.uniform() - 1.0);
        }
        let lengths = leg_lengths(machine, &TaskState::at_rest(x).motion().pose);
        if lengths.iter().all(|length| stroke.contains(length)) {
            poses.push(x);
        }
    }
    poses
}

#[test]
fn mujoco_holds_the_machine_with_the_same_forces() {
    if python::is_lacking() {
        return;
    }
    for name in DEPLOYED {
        let machine = machine(name);
        let [model, input, output] =
            ["xml", "in.csv", "out.csv"].map(|end| file(&format!("{name}_held.{end}")));
        fs::write(&model, exported(name, "mjcf")).unwrap();
        let line = |x: &[f64; 6]| x.map(|value| value.to_string()).join(",") + "\n";
        let lines: String = poses(&machine).iter().map(line).collect();
        fs::write(&input, format!("alpha,beta,gamma,x,y,z\n{lines}")).unwrap();
        python::run("mujoco_statics.py", &[&model, &input, &output]).unwrap();

        let table = Table::read(&output);
        assert_eq!(table.rows.len(), POSES);
        let mut gaps = Errors::default();
        let mut settled = Vec::new();
        let mut found = Vec::new();
        for row in 0..table.rows.len() {
            gaps.add(table.number(row, "gap"));
            settled.push(TaskState::at_rest(table.coordinates(row, "").into()).motion());
            found.push(table.legs(row, "force"));
        }
        gaps.assert_within(2e-9, &format!("{name}, gaps of the loops [m]"));
        let errors = differences(&machine, &settled, &found);
        errors.assert_within(1e-6, &format!("{name}, forces at rest"));
    }
}
