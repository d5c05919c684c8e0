//! Poses with the same lengths that numpy finds, from starts and with equations of its own.

use hexad::analysis::assembly_modes::permitted_modes;
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};
use hexad_support::repository;
use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::json;

use super::random::{WIDE, permitted, scattered};
use super::*;

#[test]
#[ignore = "second tier: needs PyPI"]
fn every_permitted_pose_that_numpy_finds_is_found() {
    let python = match environment(&["numpy==2.3.5", "scipy==1.16.3"].map(String::from)) {
        Ok(python) => python,
        Err(why) => return lacking(&why),
    };
    let wide = |machine| Machine { max_rotation: f64::to_radians(50.0), ..machine };
    let machines = [
        ("fried2008, 50 deg", wide(machine("fried2008"))),
        ("motion_base", machine("motion_base")),
        ("tsai2000", machine("tsai2000")),
        ("random 0", scattered(0)),
        ("random 9, 50 deg", wide(scattered(9))),
    ];
    let cases = machines.each_ref().map(|(_, machine)| {
        let [base, platform] =
            [&machine.joints.base, &machine.joints.platform].map(|it| machine.joints.triples.unpack_vectors(it));
        let poses = permitted(machine, 200, WIDE);
        let lengths: Vec<_> = poses.iter().map(|x| leg_lengths(machine, &rigid(*x))).collect();
        let Pose { rotation, position } = machine.home_pose();
        let q = UnitQuaternion::from_matrix(&rotation);
        let home = [q.w, q.i, q.j, q.k, position.x, position.y, position.z];
        let max_rotation = machine.max_rotation;
        json!({"base": base, "platform": platform, "home": home, "max_rotation": max_rotation, "lengths": lengths})
    });
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("cases.json");
    fs::write(&file, json!(cases).to_string()).unwrap();
    let script = repository().join("tests/stability/permitted_poses.py");
    let found = output(Command::new(python.join("bin/python")).arg(script).arg(file)).unwrap();
    let found: Vec<[f64; 9]> = serde_json::from_str(&found).unwrap();
    for (index, ((name, machine), case)) in machines.iter().zip(&cases).enumerate() {
        let lengths: Vec<[f64; 6]> = serde_json::from_value(case["lengths"].clone()).unwrap();
        let (mut theirs, mut ours, mut missing) = (0, 0, vec![]);
        for (row, lengths) in lengths.iter().enumerate() {
            let modes = permitted_modes(machine, lengths);
            ours += modes.poses.len();
            for &[_, _, w, i, j, k, x, y, z] in
                found.iter().filter(|it| it[..2] == [index as f64, row as f64])
            {
                let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
                let pose =
                    Pose { rotation: rotation.to_rotation_matrix().into(), position: Vector3::new(x, y, z) };
                theirs += 1;
                if modes.poses.iter().all(|mode| machine.joints.distance(mode.pose(), &pose) > 1e-6) {
                    missing.push((lengths, pose));
                }
            }
        }
        println!("{name}: {} rows, {ours} poses of hexad, {theirs} of numpy", lengths.len());
        assert!(missing.is_empty(), "{name}: {missing:?}");
        assert!(theirs * 50 >= ours * 49 && lengths.len() == 200, "{name}: numpy finds {theirs} of {ours}");
    }
}
