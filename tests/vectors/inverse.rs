//! `hexad inverse-dynamics`: forces, lengths and their derivatives.

use hexad::model::joint_space::{LegDynamics, joint_space};

use super::{hexad_on_vectors, six_each, with_t};
use hexad_support::{Errors, MACHINES, Table, data, largest, machine, motions};

/// Of the largest force of the row.
const FORCE_BOUND: f64 = 1e-12;

/// Of each length; of the largest rate and of the largest acceleration of the row.
const KINEMATICS_BOUND: f64 = 1e-13;

/// Compares six columns with the reference, relative to the largest of the row.
fn compare(ours: &Table, reference: &Table, stems: [&str; 2], bound: f64, what: &str) {
    let mut errors = Errors::default();
    for row in 0..reference.rows.len() {
        let [ours, reference] = [ours.legs(row, stems[0]), reference.legs(row, stems[1])];
        let scale = largest(&reference);
        ours.iter().zip(reference).for_each(|(a, b)| errors.add((a - b) / scale));
    }
    errors.assert_within(bound, &format!("{what} {}", stems[0]));
}

fn check(name: &str, options: &[&str], forces: &str) {
    let reference = Table::read(&data(name, "csv"));
    let ran = hexad_on_vectors("inverse-dynamics", name, options);
    let ours = ran.table();
    assert_eq!(ran.message, "", "nothing to complain about");
    let columns = six_each(&["force", "length", "length_rate", "length_accel", "drive_command"]);
    assert_eq!(ours.header, [with_t(&[]), columns].concat());
    assert_eq!(ours.rows.len(), reference.rows.len());
    for (a, b) in ours.rows.iter().zip(&reference.rows) {
        assert_eq!(a[0], b[0], "t is passed through");
    }
    let what = format!("{name} {}", options.join(" "));
    compare(&ours, &reference, ["force", forces], FORCE_BOUND, &what);
    // The machines of the vectors lose nothing between drive and leg.
    compare(&ours, &reference, ["drive_command", forces], FORCE_BOUND, &what);
    for stem in ["length_rate", "length_accel"] {
        compare(&ours, &reference, [stem, stem], KINEMATICS_BOUND, &what);
    }
    let mut errors = Errors::default();
    for row in 0..reference.rows.len() {
        let (ours, reference) = (ours.legs(row, "length"), reference.legs(row, "length"));
        ours.iter().zip(reference).for_each(|(a, b)| errors.add(a / b - 1.0));
    }
    errors.assert_within(KINEMATICS_BOUND, &format!("{what} length"));
}

#[test]
fn forces_agree_with_80_digits() {
    for name in MACHINES {
        check(name, &["--model", "exact"], "force");
    }
}

#[test]
fn forces_without_spin_agree_with_80_digits() {
    for name in MACHINES {
        check(name, &["--model", "rigid-legs"], "force_no_spin");
    }
}

#[test]
fn the_exact_model_is_the_default() {
    let [by_default, exact, rigid] = [&[][..], &["--model", "exact"], &["--model", "rigid-legs"]]
        .map(|options| hexad_on_vectors("inverse-dynamics", "motion_base", options).table().rows);
    assert_eq!(by_default, exact);
    assert_ne!(by_default, rigid, "the legs of this machine do spin");
}

/// The columns that were there stay as they are; the others are what `tests/paper` compares with the dense matrices.
#[test]
fn joint_space_adds_each_leg_as_a_serial_robot() {
    let [plain, ours] = [&[][..], &["--joint-space"]]
        .map(|options| hexad_on_vectors("inverse-dynamics", "scattered", options).table());
    let of_joints =
        |what: &str, joints: &[&str]| joints.iter().map(|joint| format!("{what}_{joint}")).collect();
    let stems: [Vec<String>; 4] = [
        of_joints("joint_mass", &["beta", "gamma", "length"]),
        of_joints("joint_bias", &["beta", "gamma", "length"]),
        of_joints("joint_accel", &["beta", "gamma"]),
        of_joints("contact_force", &["x", "y", "z"]),
    ];
    let stems = stems.concat();
    let columns = six_each(&stems.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(ours.header, [plain.header.clone(), columns].concat());
    let machine = machine("scattered");
    for (index, motion) in motions("scattered").iter().enumerate() {
        let width = plain.header.len();
        assert_eq!(ours.rows[index][..width], plain.rows[index]);
        let legs = joint_space(&machine, motion, &plain.legs(index, "force"));
        let expected = legs.map(|LegDynamics { mass: m, bias: b, accel: a, contact_force_n: f }| {
            [m.x, m.y, m.z, b.x, b.y, b.z, a.x, a.y, f.x, f.y, f.z]
        });
        for (k, stem) in stems.iter().enumerate() {
            assert_eq!(ours.legs(index, stem), expected.map(|leg| leg[k]), "row {index}, {stem}");
        }
    }
}

/// The order of the columns does not matter, nor do other columns, blanks and the platform's line ends.
#[test]
fn columns_are_found_by_name() {
    let reference = Table::read(&data("tilted", "csv"));
    let mut text = String::new();
    for row in [&reference.header].into_iter().chain(&reference.rows) {
        let reversed: Vec<_> = row.iter().rev().map(String::as_str).collect();
        text += &(reversed.join(" ,  ") + "\r\n");
    }
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("reversed.csv");
    std::fs::write(&input, text).unwrap();
    let ours = super::hexad("inverse-dynamics", &data("tilted", "toml"), &input, &[]).table();
    assert_eq!(ours.rows, hexad_on_vectors("inverse-dynamics", "tilted", &[]).table().rows);
}
