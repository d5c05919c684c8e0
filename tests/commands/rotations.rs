//! Orientations in every order of rotation and as quaternions: the conversions against `scipy.spatial.transform`, and tables of
//! the commands against the same motion in X.

use std::process::Command;

use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::rise;
use hexad::motion::rotation_order::{RotationOrder, quaternion_of, rotation_of};
use hexad::text::csv_table::{length_columns, pose_columns, trajectory_columns};
use nalgebra::{Matrix3, Vector6};
use serde_json::Value;

use super::{Folder, largest_difference, table};
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};

/// Package, with the version that was tried.
const SCIPY: &str = "scipy==1.15.3";

/// Random rotations: for each order angles, rotation, quaternion, and the angles of the rotation with the second within 90 deg.
const REFERENCE: &str = r#"
import json
import numpy as np
from scipy.spatial.transform import Rotation
random = np.random.default_rng(1)
found = {}
for order in ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx"):
    places = ["xyz".index(axis) for axis in order]
    rows = []
    for _ in range(2000):
        angles = random.uniform(-np.pi, np.pi, 3)
        rotation = Rotation.from_euler(order.upper(), angles[places])
        back = np.empty(3)
        back[places] = rotation.as_euler(order.upper())
        x, y, z, w = rotation.as_quat()
        rows.append([*angles, *rotation.as_matrix().flatten(), w, x, y, z, *back])
    found[order] = rows
print(json.dumps(found))
"#;

#[test]
#[ignore = "second tier: needs PyPI"]
fn rotations_are_those_of_scipy() {
    let python = match environment(&[SCIPY.into()]) {
        Ok(folder) => folder.join("bin/python"),
        Err(why) => return lacking(&why),
    };
    let printed = output(Command::new(python).args(["-c", REFERENCE])).unwrap();
    let found: Value = serde_json::from_str(&printed).unwrap();
    let (mut worst, mut worst_angle) = (0.0_f64, 0.0_f64);
    for order in RotationOrder::ALL {
        let rows: Vec<Vec<f64>> = serde_json::from_value(found[order.name()].clone()).unwrap();
        assert_eq!(rows.len(), 2000);
        for row in rows {
            let expected = Matrix3::from_row_slice(&row[3..12]);
            let pose = order.motion(&TaskState::at_rest([row[0], row[1], row[2], 0.0, 0.0, 0.0])).pose;
            worst = worst.max((pose.rotation - expected).amax());
            let quaternion = [row[12], row[13], row[14], row[15]];
            worst = worst.max((rotation_of(quaternion) - expected).amax());
            let back = quaternion_of(&pose.rotation, &quaternion);
            worst = quaternion.iter().zip(back).map(|(a, b)| (a - b).abs()).fold(worst, f64::max);
            let near = [row[16], row[17], row[18], 0.0, 0.0, 0.0];
            let back = order.coordinates(&pose, &near);
            // Errors of the first and the third angle grow with 1 / cos of the second.
            let middle = order.name().as_bytes()[1] - b'x';
            let cosine = near[usize::from(middle)].cos();
            worst_angle =
                near.iter().zip(back).map(|(a, b)| cosine * (a - b).abs()).fold(worst_angle, f64::max);
        }
    }
    println!("rotations of scipy: largest difference {worst:.1e}, of angles {worst_angle:.1e}");
    assert!(worst > 0.0 && worst < 2e-15 && worst_angle < 1e-14, "{worst:e} {worst_angle:e}");
}

/// A motion of all six coordinates from rest to rest.
fn state(t: f64) -> TaskState {
    let profile = rise(t, 2.0);
    let way = Vector6::new(0.3, -0.25, 0.35, 0.02, -0.03, 0.04);
    let home = Vector6::new(0.0, 0.0, 0.0, 1.1, 0.0, 0.0);
    TaskState {
        x: home + way * profile.value_share,
        xd: way * profile.rate_per_s,
        xdd: way * profile.accel_per_s2,
    }
}

/// Number of a row, and its time.
fn times() -> impl Iterator<Item = (usize, f64)> {
    (0..=40).map(|k| (k, 0.05 * k as f64))
}

/// A table with a row for each time: the time, then these numbers.
fn timed(columns: &str, row: impl Fn(usize, f64) -> Vec<f64>) -> String {
    table(columns, times().map(|(k, t)| [vec![t], row(k, t)].concat()))
}

/// Poses of a motion alone.
fn poses(at: impl Fn(f64) -> TaskState) -> String {
    timed(&pose_columns().join(","), |_, t| at(t).x.as_slice().to_vec())
}

/// Poses that forward kinematics find for the lengths in a table of inverse dynamics.
fn found(folder: &Folder, rotation: &str, forces: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let lengths = timed(&length_columns().join(","), |k, _| forces[k][7..13].to_vec());
    let rows = folder.computes(&format!("forward-kinematics --rotation {rotation}"), &lengths);
    let width = if rotation == "quaternion" { 7 } else { 6 };
    rows.iter().map(|row| row[1..=width].to_vec()).collect()
}

/// A table in any order gives the same forces as the same motion in X, with derivatives of the table and with
/// computed ones; forward kinematics return the numbers of the table.
#[test]
fn tables_of_every_order_are_the_same_motion() {
    let folder = Folder::new("");
    let forces =
        |order: &str, input: &str| folder.computes(&format!("inverse-dynamics --rotation {order}"), input);
    for order in RotationOrder::ALL {
        let (name, near) = (order.name(), |t: f64| state(t).x.into());
        let in_x = |t: f64| TaskState::of_motion(&order.motion(&state(t)), &near(t)).unwrap();
        let motion = |at: &dyn Fn(f64) -> TaskState| {
            let numbers = |TaskState { x, xd, xdd }| [x, xd, xdd].iter().flatten().copied().collect();
            timed(&trajectory_columns().join(","), |_, t| numbers(at(t)))
        };
        let by_rates = largest_difference(&forces(name, &motion(&state)), &forces("xyz", &motion(&in_x)));
        let by_poses = forces(name, &poses(state));
        let back = largest_difference(
            &found(&folder, name, &by_poses),
            &times().map(|(_, t)| state(t).x.as_slice().to_vec()).collect::<Vec<_>>(),
        );
        let by_poses = largest_difference(&by_poses, &forces("xyz", &poses(in_x)));
        println!(
            "{name}: forces differ by {by_rates:.1e}, without rates by {by_poses:.1e}; angles by {back:.1e}"
        );
        assert!(by_rates < 1e-12 && by_poses < 1e-9 && back < 1e-11, "{name}");
    }
    // The order is not without effect.
    let [a, b] = ["xyz", "zyx"].map(|name| forces(name, &poses(state)));
    assert!(largest_difference(&a, &b) > 1e-3);
}

#[test]
fn a_table_of_quaternions_is_the_same_motion() {
    let folder = Folder::new("");
    let numbers = |t: f64, sign: f64| -> Vec<f64> {
        let state = state(t);
        let quaternion = quaternion_of(&state.motion().pose.rotation, &[1.0, 0.0, 0.0, 0.0]);
        quaternion.iter().map(|q| sign * q).chain(state.x.iter().skip(3).copied()).collect()
    };
    let expected = folder.computes("inverse-dynamics", &poses(state));
    // Of both signs in turn, which are the same rotation.
    let alternating = timed("t,qw,qx,qy,qz,x,y,z", |k, t| numbers(t, if k % 2 == 0 { 1.0 } else { -1.0 }));
    let forces = folder.computes("inverse-dynamics --rotation quaternion", &alternating);
    assert!(largest_difference(&forces, &expected) < 1e-9);
    let stated: Vec<_> = times().map(|(_, t)| numbers(t, 1.0)).collect();
    assert!(largest_difference(&found(&folder, "quaternion", &expected), &stated) < 1e-11);
}
