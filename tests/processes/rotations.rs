//! Orientations in every order of rotation and as quaternions: the conversions against `scipy.spatial.transform`, and tables of
//! the commands against the same motion in X.

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::rise;
use hexad::motion::rotation_order::{RotationOrder, quaternion_of, rotation_of};
use nalgebra::{Matrix3, Vector6};
use serde_json::Value;

use crate::common::not_run::lacking;
use crate::common::python::{environment, output};
use crate::support::children::{Ended, run};
use crate::support::machine::Machine;

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
    TaskState { x: home + way * profile.value, xd: way * profile.rate, xdd: way * profile.accel }
}

/// A table with these columns, a row for each time.
fn table(columns: &str, row: impl Fn(f64) -> Vec<f64>) -> String {
    let mut text = format!("{columns}\n");
    for t in (0..=40).map(|k| 0.05 * f64::from(k)) {
        let numbers: Vec<String> = row(t).iter().map(|number| format!("{number:?}")).collect();
        writeln!(text, "{t:?},{}", numbers.join(",")).unwrap();
    }
    text
}

/// Numbers of the rows that a command writes for a table.
fn written(machine: &Machine, command: &str, input: &str, rotation: &str) -> Vec<Vec<f64>> {
    let files = ["rotation-input.csv", "rotation-output.csv"].map(|name| machine.path(name));
    fs::write(&files[0], input).unwrap();
    let [input, output] = files.each_ref().map(|file| file.display().to_string());
    let config = machine.file.display().to_string();
    let Ended { status, stderr, .. } = run(
        machine,
        &[command, "--config", &config, "--input", &input, "--output", &output, "--rotation", rotation],
    );
    assert_eq!(status.code(), Some(0), "{rotation}: {stderr}");
    let text = fs::read_to_string(&files[1]).unwrap();
    let row = |line: &str| line.split(',').map(|number| number.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

fn largest_difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.len() == b.len()));
    let relative = |(a, b): (&f64, &f64)| (a - b).abs() / (1.0 + b.abs());
    a.iter().flatten().zip(b.iter().flatten()).map(relative).fold(0.0, f64::max)
}

const POSES: &str = "t,alpha,beta,gamma,x,y,z";

fn motions() -> String {
    let of =
        |end: &str| ["alpha", "beta", "gamma", "x", "y", "z"].map(|axis| format!("{axis}{end}")).join(",");
    format!("{POSES},{},{}", of("_rate"), of("_accel"))
}

/// A table in any order gives the same forces as the same motion in X, with derivatives of the table and with
/// computed ones; forward kinematics return the numbers of the table.
#[test]
fn tables_of_every_order_are_the_same_motion() {
    let machine = Machine::patient("rotations");
    for order in RotationOrder::ALL {
        let in_x = |t: f64| TaskState::of_motion(&order.motion(&state(t)), &state(t).x.into()).unwrap();
        let of =
            |state: &TaskState| [state.x, state.xd, state.xdd].iter().flatten().copied().collect::<Vec<_>>();
        let name = order.name();
        let forces = written(&machine, "inverse-dynamics", &table(&motions(), |t| of(&state(t))), name);
        let expected = written(&machine, "inverse-dynamics", &table(&motions(), |t| of(&in_x(t))), "xyz");
        let by_rates = largest_difference(&forces, &expected);
        let poses = |at: &dyn Fn(f64) -> TaskState| table(POSES, |t| at(t).x.as_slice().to_vec());
        let forces = written(&machine, "inverse-dynamics", &poses(&state), name);
        let expected = written(&machine, "inverse-dynamics", &poses(&in_x), "xyz");
        let by_poses = largest_difference(&forces, &expected);
        let lengths = table("t,length_1,length_2,length_3,length_4,length_5,length_6", |t| {
            forces[(t / 0.05).round() as usize][7..13].to_vec()
        });
        let found = written(&machine, "forward-kinematics", &lengths, name);
        let found: Vec<_> = found.iter().map(|row| row[1..7].to_vec()).collect();
        let stated: Vec<_> = (0..=40).map(|k| state(0.05 * f64::from(k)).x.as_slice().to_vec()).collect();
        let back = largest_difference(&found, &stated);
        println!(
            "{name}: forces differ by {by_rates:.1e}, without rates by {by_poses:.1e}; angles by {back:.1e}"
        );
        assert!(
            by_rates < 1e-12 && by_poses < 1e-9 && back < 1e-11,
            "{name}: {by_rates:e} {by_poses:e} {back:e}"
        );
    }
    // The order is not without effect.
    let [a, b] = ["xyz", "zyx"].map(|name| {
        written(&machine, "inverse-dynamics", &table(POSES, |t| state(t).x.as_slice().to_vec()), name)
    });
    assert!(largest_difference(&a, &b) > 1e-3);
}

#[test]
fn a_table_of_quaternions_is_the_same_motion() {
    let machine = Machine::patient("quaternions");
    let numbers = |t: f64, sign: f64| -> Vec<f64> {
        let state = state(t);
        let quaternion = quaternion_of(&state.motion().pose.rotation, &[1.0, 0.0, 0.0, 0.0]);
        quaternion.iter().map(|q| sign * q).chain(state.x.iter().skip(3).copied()).collect()
    };
    let columns = "t,qw,qx,qy,qz,x,y,z";
    let xyz = table(POSES, |t| state(t).x.as_slice().to_vec());
    let expected = written(&machine, "inverse-dynamics", &xyz, "xyz");
    // Of both signs in turn, which are the same rotation.
    let alternating =
        table(columns, |t| numbers(t, if (t / 0.05).round() % 2.0 == 0.0 { 1.0 } else { -1.0 }));
    let forces = written(&machine, "inverse-dynamics", &alternating, "quaternion");
    assert!(largest_difference(&forces, &expected) < 1e-9);
    let lengths = table("t,length_1,length_2,length_3,length_4,length_5,length_6", |t| {
        expected[(t / 0.05).round() as usize][7..13].to_vec()
    });
    let found = written(&machine, "forward-kinematics", &lengths, "quaternion");
    let found: Vec<_> = found.iter().map(|row| row[1..8].to_vec()).collect();
    let stated: Vec<_> = (0..=40).map(|k| numbers(0.05 * f64::from(k), 1.0)).collect();
    assert!(largest_difference(&found, &stated) < 1e-11);
}

#[test]
fn orientations_that_have_no_meaning_are_refused() {
    let machine = Machine::patient("no-rotations");
    let config = machine.file.display().to_string();
    let quaternion = "t,qw,qx,qy,qz,x,y,z";
    let motions = motions();
    let rates = motions.split_once("x,y,z").unwrap().1;
    let zeros = ",0".repeat(12);
    for (text, rotation, words) in [
        (
            format!("{quaternion}\n0,1,0,0,0,1.1,0,0\n1,1,1,0,0,1.1,0,0\n"),
            "quaternion",
            "line 3: norm of qw, qx, qy, qz = 1.414: must be 1",
        ),
        (
            format!("{quaternion}{rates}\n0,1,0,0,0,1.1,0,0{zeros}\n"),
            "quaternion",
            "line 2: rates and accelerations beside a quaternion: leave them out",
        ),
        (format!("{quaternion}\n0,1,0,0,0,1.1,0,0\n"), "xyz", "missing columns alpha, beta, gamma"),
        (
            format!("{quaternion}\n0,1,0,0,0,1.1,0,0\n"),
            "xyz",
            "--rotation names another order or quaternions",
        ),
        // alpha = 90 deg first, then gamma: in X, beta is 90 deg.
        (
            format!("{motions}\n0,1.5707963267948966,0,1.5707963267948966,1.1,0,0{zeros}\n"),
            "zxy",
            "alpha and gamma of X have no rates at beta = +-90 deg",
        ),
        (String::new(), "zxz", "[possible values: xyz, xzy, yxz, yzx, zxy, zyx, quaternion]"),
    ] {
        let file = machine.path("refused.csv");
        fs::write(&file, text).unwrap();
        let file = file.display().to_string();
        let ended =
            run(&machine, &["move", "--config", &config, "--trajectory", &file, "--rotation", rotation]);
        assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    }
    let ended = run(&machine, &["move", "--config", &config, "--motion", "circle", "--rotation", "zyx"]);
    assert_eq!(ended.status.code(), Some(2));
    assert!(ended.stderr.contains("cannot be used with"), "{}", ended.stderr);
}
