//! Rows without a solution: exit code 1, and a complete file that marks them.

use std::fs;

use nalgebra::{Rotation3, Vector3};

use super::{Ran, hexad, hexad_on_vectors, six_each, with_t};
use hexad::model::inverse_geometry::leg_lengths;
use hexad_support::{Legs, Table, data, machine, repository};

/// Forward kinematics of the first rows of a machine, some rows with other lengths.
fn with_lengths(name: &str, replaced: &[(usize, [f64; 6])], options: &[&str]) -> Ran {
    let reference = Table::read(&data(name, "csv"));
    let mut text = [with_t(&[]), six_each(&["length", "length_rate"])].concat().join(",") + "\n";
    for row in 0..10 {
        let other = replaced.iter().find(|(at, _)| *at == row).map(|(_, lengths)| *lengths);
        let lengths = other.unwrap_or_else(|| reference.legs(row, "length"));
        let numbers = [reference.number(row, "t")];
        let numbers = numbers.iter().chain(&lengths).copied().chain(reference.legs(row, "length_rate"));
        text += &(numbers.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(",") + "\n");
    }
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("lengths.csv");
    fs::write(&input, text).unwrap();
    hexad("forward-kinematics", &data(name, "toml"), &input, options)
}

#[test]
fn unreachable_lengths_are_marked_and_the_rest_is_solved() {
    // No platform of this size can have one leg that long beside others that short.
    let unreachable = [9.0, 0.9, 0.9, 0.9, 0.9, 0.9];
    let far_apart = [0.9, 1e6, 0.9, 0.9, 0.9, 0.9];
    let negative = [-1.0; 6];
    for start in ["previous", "home"] {
        let ran = with_lengths(
            "fried2008",
            &[(3, unreachable), (4, far_apart), (7, negative)],
            &["--start", start],
        );
        assert_eq!(ran.code, Some(1), "{}", ran.message);
        let words = "hexad: 3 of 10 rows have lengths outside of the stroke, the first at t = 0.003: length_1 = 9 m, must be ";
        assert!(ran.message.starts_with(words), "{}", ran.message);
        let error = "\nhexad: 3 of 10 rows did not converge (column converged), the first at t = 0.003\n";
        assert!(ran.message.ends_with(error), "{}", ran.message);
        let ours = ran.complete_table();
        let well = hexad_on_vectors("forward-kinematics", "fried2008", &["--start", start]).table();
        assert_eq!((ours.rows.len(), &ours.header), (10, &well.header));
        for row in 0..10 {
            let solved = ![3, 4, 7].contains(&row);
            assert_eq!(ours.number(row, "converged"), f64::from(u8::from(solved)), "row {row}");
            let error = (ours.coordinates(row, "") - well.coordinates(row, "")).amax();
            assert!(!solved || error < 1e-11, "row {row}: {error:e}");
        }
    }
}

#[test]
fn no_row_may_be_solvable() {
    let unreachable: Vec<_> = (0..10).map(|row| (row, [9.0, 0.9, 0.9, 0.9, 0.9, 0.9])).collect();
    let ran = with_lengths("fried2008", &unreachable, &[]);
    assert_eq!(ran.code, Some(1), "{}", ran.message);
    assert!(
        ran.message.starts_with("hexad: 10 of 10 rows have lengths outside of the stroke"),
        "{}",
        ran.message
    );
    assert_eq!(ran.complete_table().rows.len(), 10);
    // Within the stroke, but of no platform: one leg would pull all joints beyond the others.
    let machine = machine("fried2008");
    let (min, max) = (machine.actuator.min_length_m, machine.actuator.max_length_m);
    let ran = with_lengths("fried2008", &[(2, [max, min, max, min, max, min])], &[]);
    let message = "hexad: 1 of 10 rows did not converge (column converged), the first at t = 0.002\n";
    assert_eq!((ran.code, ran.message.as_str()), (Some(1), message));
}

/// From home each of these rows leads to another pose of the same lengths, up to 0.9 m away, at which nothing is singular.
#[test]
fn rows_with_other_poses_are_marked() {
    let (machine, lengths) =
        (repository().join("config/tsai2000.toml"), data("other_assembly_lengths", "csv"));
    for (options, code) in [(&["--start", "home"][..], 0), (&["--start", "home", "--strict"], 1)] {
        let ran = hexad("forward-kinematics", &machine, &lengths, options);
        assert_eq!(ran.code, Some(code), "{}", ran.message);
        let message = "hexad: 12 of 12 rows have the lengths of other poses, too (column other_poses), the first at t = 0.0\n";
        assert_eq!(ran.message, message);
        let ours = ran.complete_table();
        assert!(
            (0..12).all(|row| ours.number(row, "other_poses") >= 1.0 && ours.number(row, "converged") == 1.0)
        );
    }
}

/// Lengths that are none of the joints' distances in metres are told from what else they may be.
#[test]
fn what_else_lengths_outside_of_the_stroke_may_be_is_named() {
    let machine = machine("fried2008");
    let home = leg_lengths(&machine, &machine.home_pose());
    let of = |change: fn(f64, f64) -> f64| {
        let rows: Vec<_> =
            (0..10).map(|row| (row, home.map(|home| change(home, 1e-4 * row as f64)))).collect();
        with_lengths("fried2008", &rows, &[]).message
    };
    for (message, hint) in [
        (
            of(|home, change| 1e3 * (home + change)),
            "; in millimetres all rows fit: name the columns length_1_mm to length_6_mm\n",
        ),
        (of(|_, change| change), "; as changes from home all rows fit: add the lengths at home, ["),
        (of(|home, _| home + 10.0), ", between the joint centres\n"),
    ] {
        assert!(message.starts_with("hexad: 10 of 10 rows have lengths outside of the stroke"), "{message}");
        assert!(message.contains(hint), "{message}");
    }
}

/// All legs in one plane can carry nothing across it.
#[test]
fn singular_poses_have_no_forces() {
    let reference = Table::read(&data("motion_base", "csv"));
    let columns = reference.header[..19].join(",");
    let flat = format!("0.5{}", ",0".repeat(18));
    let sound = reference.rows[0][..19].join(",");
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("flat.csv");
    fs::write(&input, format!("{columns}\n{flat}\n{sound}\n")).unwrap();
    let ran = hexad("inverse-dynamics", &data("motion_base", "toml"), &input, &[]);
    assert_eq!(ran.code, Some(1), "{}", ran.message);
    let message = "hexad: 1 of 2 rows are at singular poses and have no forces, the first at t = 0.5\n";
    assert_eq!(ran.message, message);
    let ours = ran.complete_table();
    assert!(ours.legs(0, "force").iter().all(|force| force.is_nan()));
    assert!(ours.legs(0, "length").iter().all(|length| length.is_finite()));
    assert!(ours.legs(1, "force").iter().all(|force| force.is_finite()));
}

/// A leg along the first axis of its universal joint has forces and no joint rates.
#[test]
fn legs_along_their_universal_axis_have_no_joint_coordinates() {
    let machine = machine("motion_base");
    let legs = Legs::of(&machine);
    // Turned, as all legs would be in one plane otherwise.
    let alpha = 0.4;
    let arm = Rotation3::from_axis_angle(&Vector3::x_axis(), alpha) * legs.platform[0];
    let at = legs.base[0] - arm + legs.universal_axis[0] * 1.5;
    let columns = Table::read(&data("motion_base", "csv")).header[..19].join(",");
    let row = format!("0.5,{alpha},0,0,{:?},{:?},{:?}{}", at.x, at.y, at.z, ",0".repeat(12));
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("along.csv");
    fs::write(&input, format!("{columns}\n{row}\n")).unwrap();
    let ran = hexad("inverse-dynamics", &data("motion_base", "toml"), &input, &["--joint-space"]);
    let message = "hexad: 1 of 1 rows are at singular poses, or have a leg along its universal axis, the first at t = 0.5\n";
    assert_eq!((ran.code, &*ran.message), (Some(1), message));
    let ours = ran.complete_table();
    let [forces, bias, contact] =
        ["force", "joint_bias_beta", "contact_force_x"].map(|stem| ours.legs(0, stem));
    assert!(forces.iter().chain(&bias[1..]).chain(&contact[1..]).all(|value| value.is_finite()));
    assert!(bias[0].is_nan() && contact[0].is_nan());
}
