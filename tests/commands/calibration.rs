//! `hexad calibrate`: tables as people have them, what is written, and what is refused.

use hexad::analysis::calibration::model::Geometry;
use hexad::config::Config;
use hexad::model::random::Random;
use hexad::model::rigid::{Pose, exp};
use hexad::model::task::{pose_of, task_coordinates};
use nalgebra::{Matrix3x6, Vector3, Vector6};
use serde_json::Value;

use super::{Folder, has, numbers};
use hexad_support::browser::Browser;

const OFFSET_M: [f64; 6] = [4e-4, -3e-4, 5e-4, 0.0, -6e-4, 2e-4];
const TRACKER: [f64; 6] = [0.4, -0.3, 2.0, 3.0, -1.0, 0.5];
const PROBE: [f64; 6] = [-0.2, 0.5, 0.1, 0.02, 0.05, 0.1];

/// Joints half a millimetre off the drawing.
fn truth(folder: &Folder) -> Geometry {
    let (nominal, mut random) = (Geometry::of(&folder.config().machine), Random::new(3));
    let mut moved =
        |joints: Matrix3x6<f64>| joints + Matrix3x6::from_fn(|_, _| 5e-4 * random.near_gaussian());
    let [base, platform] = [nominal.base, nominal.platform].map(&mut moved);
    Geometry { base, platform, offset: Vector6::from(OFFSET_M) }
}

/// Planned poses.
fn planned(folder: &Folder) -> Vec<Pose> {
    folder.execute("calibrate @M --plan 20 --output @/T.csv").unwrap();
    numbers(&folder.read("T.csv")).iter().map(|row| pose_of(row.as_slice().try_into().unwrap())).collect()
}

fn joined(a: &Pose, b: &Pose) -> Pose {
    Pose { rotation: a.rotation * b.rotation, position: a.rotation * b.position + a.position }
}

/// Lengths [mm] and poses of the probe [mm, rad], as a table of columns with these names.
fn table(folder: &Folder, poses: &[Pose], lengths: [usize; 6]) -> String {
    let (truth, mut random) = (truth(folder), Random::new(8));
    let names: Vec<_> = lengths.iter().map(|leg| format!("length_{leg}_mm")).collect();
    let mut text = format!("row,{},x_mm,y_mm,z_mm,alpha,beta,gamma\n", names.join(","));
    for (k, pose) in poses.iter().enumerate() {
        let seen = joined(&joined(&pose_of(&TRACKER), pose), &pose_of(&PROBE));
        let mut noise = |size: f64| Vector3::from_fn(|_, _| size * random.near_gaussian());
        let seen =
            Pose { rotation: exp(&noise(2e-5)) * seen.rotation, position: seen.position + noise(2e-5) };
        let [alpha, beta, gamma, x, y, z] = task_coordinates(&seen, &[0.0; 6]);
        let lengths = truth.lengths(pose).0;
        let millimetres = lengths.iter().copied().chain([x, y, z]).map(|length| 1e3 * length);
        let numbers = millimetres.chain([alpha, beta, gamma]);
        let numbers: Vec<_> = numbers.map(|number| format!("{number:.7}")).collect();
        text += &format!("{k},{}\n", numbers.join(","));
    }
    text
}

#[test]
fn a_table_becomes_a_machine_file_in_which_only_joints_are_new() {
    let folder = Folder::new("");
    let poses = planned(&folder);
    folder.write("poses.csv", table(&folder, &poses, [1, 2, 3, 4, 5, 6]));
    let said = folder.says("calibrate @M @/poses.csv --output @/new.toml");
    has(
        &said,
        &[
            &format!("{} with six lengths and a probe", poses.len()),
            "30 of 30 of joints",
            "finds the same minimum",
            "suspected rows: none",
        ],
    );
    has(
        &said,
        &[
            "leg[6].platform_m",
            "add it to the position that each drive takes at its home switch",
            "new.toml: written",
        ],
    );
    let (old, new) = (folder.read("machine.toml"), folder.read("new.toml"));
    let changed = old.lines().zip(new.lines()).filter(|(old, new)| old != new);
    assert_eq!(old.lines().count(), new.lines().count());
    for (old, new) in changed {
        let key = old.split('=').next().unwrap();
        assert!(["base_m", "platform_m"].contains(&key.trim()) && new.starts_with(key), "{old} {new}");
        assert!(new.contains("# was [") && new.contains("], +- ["), "{new}");
    }
    // The lengths between the joints at home do not depend on the frames, the joints' distances from each other neither.
    let (found, truth) =
        (Geometry::of(&Config::load(&folder.path("new.toml")).unwrap().machine), truth(&folder));
    for (found, truth) in [(found.base, truth.base), (found.platform, truth.platform)] {
        for (a, b) in [(0, 1), (1, 3), (2, 5)] {
            let distance = |joints: &Matrix3x6<f64>| (joints.column(a) - joints.column(b)).norm();
            assert!((distance(&found) - distance(&truth)).abs() < 1.5e-4);
        }
    }
    let json: Value = serde_json::from_str(&folder.says("calibrate @M @/poses.csv --json")).unwrap();
    let [before, after, row] =
        ["before", "after", "rows_left_out"].map(|key| json[key]["position_rms_m"].as_f64().unwrap());
    assert!(after < 0.1 * before && (1e-5..1e-4).contains(&row), "{before} {after} {row}");
    let offset = json["legs"][4]["offset_m"].as_f64().unwrap();
    assert!(
        (offset - OFFSET_M[4]).abs() < 4.0 * json["legs"][4]["offset_deviation_m"].as_f64().unwrap(),
        "{offset}"
    );
    folder.refuses("calibrate @M @/poses.csv --output @/new.toml", &["new.toml exists already"]);
}

/// A file of the tracker beside the file of lengths, with quaternions; then reflectors, one hidden in every fourth row.
#[test]
fn the_tracker_has_a_file_of_its_own() {
    let folder = Folder::new("");
    let poses = planned(&folder);
    folder.write("lengths.csv", table(&folder, &poses, [1, 2, 3, 4, 5, 6]).replace("alpha", "other"));
    let places = [[0.4, 0.1, 0.2], [-0.3, 0.4, 0.1], [-0.2, -0.4, 0.3], [0.1, 0.1, -0.2]].map(Vector3::from);
    let mut points = "point_1_x [mm],point_1_y,point_1_z".to_owned();
    (2..=4).for_each(|k| ["x", "y", "z"].iter().for_each(|axis| points += &format!(",point_{k}_{axis}")));
    for (k, pose) in poses.iter().enumerate() {
        let at = joined(&pose_of(&TRACKER), pose);
        let cells: Vec<_> = places
            .iter()
            .enumerate()
            .flat_map(|(point, place)| {
                let seen = at.rotation * place + at.position;
                let scale = if point == 0 { [1e3, 1.0, 1.0] } else { [1.0; 3] };
                let is_hidden = (k + point) % 4 == 0 && point > 0;
                [0, 1, 2].map(|axis| {
                    if is_hidden { String::new() } else { format!("{:.6}", scale[axis] * seen[axis]) }
                })
            })
            .collect();
        points += &format!("\n{}", cells.join(","));
    }
    folder.write("points.csv", points + "\n");
    let said = folder.says("calibrate @M @/lengths.csv --tracker @/points.csv --page @/page.html");
    has(&said, &[&format!("{} with six lengths and reflectors", poses.len()), "page with charts: "]);
    has(&folder.read("page.html"), &["Position over the workspace, calibrated: "]);
}

#[test]
fn what_is_no_calibration_is_refused_with_the_reason() {
    let folder = Folder::new("");
    let poses = planned(&folder);
    let good = table(&folder, &poses, [1, 2, 3, 4, 5, 6]);
    let refused = |text: String, code: u8, words: &[&str]| {
        folder.write("poses.csv", text);
        let (found, message) = folder.execute("calibrate @M @/poses.csv").unwrap_err();
        assert_eq!(found, code, "{message}");
        has(&message, words);
    };
    let lines: Vec<_> = good.lines().collect();
    refused(
        good.replace("x_mm,y_mm,z_mm,alpha,beta,gamma", "a,b,c,d,e,f"),
        2,
        &["lengths alone. Whatever the joints are", "measure each pose with a tracker"],
    );
    refused(good.replace("gamma", "yaw"), 2, &["missing columns gamma"]);
    refused(table(&folder, &poses, [1, 2, 5, 4, 3, 6]), 1, &["lengths of legs 3 and 5 are exchanged"]);
    refused(
        good.replace("x_mm,y_mm,z_mm", "x,y,z"),
        1,
        &["positions of the tracker in millimetres as metres; name the columns x_mm"],
    );
    refused(lines[..6].join("\n") + "\n", 1, &["5 rows: must be 7 at least"]);
    folder.write("poses.csv", &good);
    folder.write("short.csv", lines[..9].join("\n") + "\n");
    folder.refuses(
        "calibrate @M @/poses.csv --tracker @/short.csv",
        &[&format!("short.csv: 8 rows, must be {} as in ", poses.len())],
    );
    folder.refuses("calibrate @M", &["<POSES>"]);
    folder.refuses("calibrate @M --plan 20", &["--output"]);
    let points = good.replace(
        "x_mm,y_mm,z_mm,alpha,beta,gamma",
        "point_1_x,point_1_y,point_1_z,point_2_x,point_2_y,point_2_z",
    );
    refused(points, 2, &["2 reflectors (point_1_x ...), must be 3 at least"]);
}

#[test]
fn offsets_alone_follow_from_a_pose_in_the_base_frame() {
    let folder = Folder::new("");
    let nominal = Geometry { offset: Vector6::from(OFFSET_M), ..Geometry::of(&folder.config().machine) };
    let x = [0.01, -0.02, 0.03, 1.12, 0.01, -0.02];
    let numbers: Vec<_> = nominal.lengths(&pose_of(&x)).0.iter().chain(&x).map(f64::to_string).collect();
    folder.write(
        "pose.csv",
        format!(
            "length_1,length_2,length_3,length_4,length_5,length_6,alpha,beta,gamma,x,y,z\n{}\n",
            numbers.join(",")
        ),
    );
    let said = folder.says("calibrate @M @/pose.csv --offsets-only");
    has(&said, &["1      +0.4000         unknown", "5      -0.6000", "home switch"]);
    let json: Value =
        serde_json::from_str(&folder.says("calibrate @M @/pose.csv --offsets-only --json")).unwrap();
    assert!((json["offset_m"][2].as_f64().unwrap() - OFFSET_M[2]).abs() < 1e-12, "{json}");
}

#[test]
#[ignore = "second tier: needs Chromium"]
fn the_page_shows_rows_maps_and_joints() {
    let folder = Folder::new("");
    let poses = planned(&folder);
    folder.write("poses.csv", table(&folder, &poses, [1, 2, 3, 4, 5, 6]));
    folder.says("calibrate @M @/poses.csv --page @/page.html");
    let Some(browser) = Browser::find() else { return };
    let script = "document.body.dataset.result = JSON.stringify([\"#rows circle\", \"#maps rect\", \"#joints line\", \"#facts dd.bad\"]\
                  .map((of) => document.querySelectorAll(of).length));";
    let found = browser.run(&folder.path("page.html"), script);
    let counts: Vec<u64> = found.as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).collect();
    assert_eq!((counts[0], counts[2], counts[3]), (2 * 6 * poses.len() as u64, 6 * 6, 0), "{counts:?}");
    assert!(counts[1] > 500, "{counts:?}");
}
