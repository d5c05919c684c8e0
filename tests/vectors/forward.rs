//! `hexad forward-kinematics`: poses and twists from the lengths and rates of the same vectors.

use core::f64::consts::TAU;
use std::fs;

use nalgebra::Vector3;

use super::{hexad, hexad_on_vectors, six_each, with_t};
use hexad_support::{Errors, MACHINES, Table, angle_between, angular_velocity, data, largest, rotation};

/// Metres and radians.
const POSE_BOUND: f64 = 1e-11;

/// Of the largest component of the row's twist.
const TWIST_BOUND: f64 = 1e-10;

/// Newton needs four or five iterations a step; from one row to the next it may take forty trusted steps.
const MOST_ITERATIONS: f64 = 150.0;

const POSE: [&str; 9] = ["alpha", "beta", "gamma", "x", "y", "z", "iterations", "converged", "other_poses"];
const TWIST: [&str; 6] = ["omega_x", "omega_y", "omega_z", "x_rate", "y_rate", "z_rate"];

fn check_poses(ours: &Table, reference: &Table, what: &str) {
    let [mut position, mut orientation, mut angles, mut iterations] = [Errors::default(); 4];
    assert_eq!(ours.rows.len(), reference.rows.len());
    for row in 0..reference.rows.len() {
        assert_eq!(ours.number(row, "t"), reference.number(row, "t"));
        assert_eq!(ours.number(row, "converged"), 1.0, "{what}, row {row}");
        iterations.add(ours.number(row, "iterations"));
        let (x, wanted) = (ours.coordinates(row, ""), reference.coordinates(row, ""));
        (x - wanted).rows(3, 3).iter().for_each(|error| position.add(*error));
        orientation
            .add(angle_between(&rotation(wanted[0], wanted[1], wanted[2]), &rotation(x[0], x[1], x[2])));
        if wanted[1].cos() > 0.1 {
            (x - wanted).rows(0, 3).iter().for_each(|error| angles.add(error - (error / TAU).round() * TAU));
        }
    }
    position.assert_within(POSE_BOUND, &format!("{what} position"));
    orientation.assert_within(POSE_BOUND, &format!("{what} orientation"));
    angles.assert_within(POSE_BOUND, &format!("{what} angles"));
    println!("{what} iterations: mean {:.1}, max {}", iterations.mean(), iterations.max);
    assert!(iterations.max <= MOST_ITERATIONS);
}

fn check_twists(ours: &Table, reference: &Table, what: &str) {
    let mut errors = Errors::default();
    for row in 0..reference.rows.len() {
        let (x, rates) = (reference.coordinates(row, ""), reference.coordinates(row, "_rate"));
        let omega = angular_velocity(x[0], x[1], &Vector3::new(rates[0], rates[1], rates[2]));
        let wanted = [omega.x, omega.y, omega.z, rates[3], rates[4], rates[5]];
        let scale = largest(&wanted);
        TWIST.iter().zip(wanted).for_each(|(name, b)| errors.add((ours.number(row, name) - b) / scale));
    }
    errors.assert_within(TWIST_BOUND, &format!("{what} twist"));
}

#[test]
fn poses_and_twists_agree_from_either_start() {
    for name in MACHINES {
        let reference = Table::read(&data(name, "csv"));
        for start in ["previous", "home"] {
            let ours = hexad_on_vectors("forward-kinematics", name, &["--start", start]).table();
            assert_eq!(ours.header, with_t(&[&POSE[..], &TWIST].concat()));
            let what = format!("{name} from {start}");
            check_poses(&ours, &reference, &what);
            check_twists(&ours, &reference, &what);
        }
    }
}

#[test]
fn the_row_before_is_the_default_start() {
    let [by_default, previous, home] = [&[][..], &["--start", "previous"], &["--start", "home"]]
        .map(|options| hexad_on_vectors("forward-kinematics", "fried2008", options).table().rows);
    assert_eq!(by_default, previous);
    assert_ne!(by_default, home, "other iterations");
    assert_eq!(previous[0], home[0], "the first row starts at home either way");
}

/// Without rates there are no rate columns, and nothing else changes.
#[test]
fn rates_are_optional() {
    let reference = Table::read(&data("ceiling", "csv"));
    let columns = [with_t(&[]), six_each(&["length"])].concat();
    let mut text = columns.join(",") + "\n";
    for row in 0..reference.rows.len() {
        let numbers: Vec<_> =
            columns.iter().map(|name| format!("{:?}", reference.number(row, name))).collect();
        text += &(numbers.join(",") + "\n");
    }
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("lengths.csv");
    fs::write(&input, text).unwrap();
    let ours = hexad("forward-kinematics", &data("ceiling", "toml"), &input, &[]).table();
    assert_eq!(ours.header, with_t(&POSE));
    let with_rates = hexad_on_vectors("forward-kinematics", "ceiling", &[]).table();
    for (without, with) in ours.rows.iter().zip(&with_rates.rows) {
        assert_eq!(without[..], with[..without.len()]);
    }
    check_poses(&ours, &reference, "ceiling without rates");
}
