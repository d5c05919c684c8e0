//! The commands of `docs/calibration.md`, as a user types them, with a platform whose joints differ from its file.

use std::fs;

use hexad::analysis::calibration::model::Geometry;
use hexad::analysis::calibration::start::fitted;
use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::forward_kinematics::{Tracker, TrackingResult};
use hexad::model::machine::Machine as Model;
use hexad::model::random::Random;
use hexad::model::rigid::{Pose, exp};
use hexad::model::task::{pose_of, task_coordinates};
use nalgebra::{Vector3, Vector6};
use serde_json::Value;

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::does;
use crate::support::trio::{start_daemon, start_plant};

const GUIDE: &str = include_str!("../../docs/calibration.md");
/// Fewer than the guide's 60, to save time.
const POSES: &str = "--plan 16";
const BUILT: &str = "[plant.build]\njoint_error_m = 1e-3\n[plant.sensor]\nlength_noise_m = 2e-6\n\
                     [measured]\nlength_noise_m = 2e-6\n";
const TRACKER: [f64; 6] = [0.4, -0.3, 2.0, 3.0, -1.0, 0.5];
const PROBE: [f64; 6] = [-0.2, 0.5, 0.1, 0.02, 0.05, 0.1];

/// Types a line that the guide shows.
fn type_line(machine: &Machine, line: &str) -> String {
    assert!(GUIDE.lines().any(|shown| shown.trim() == line), "the guide must show: {line}");
    let mut command = hexad();
    let words = line.replace("--plan 60", POSES).replace("--config F", "--config machine.toml");
    command.current_dir(machine.folder()).args(words.split(' ').skip(1));
    Hexad::spawn(machine, "guide", command).ends_within(6 * HANG).succeeds()
}

fn joined(a: &Pose, b: &Pose) -> Pose {
    Pose { rotation: a.rotation * b.rotation, position: a.rotation * b.position + a.position }
}

/// Pose of a machine with these lengths.
fn pose_with(machine: &Model, lengths: Vector6<f64>) -> Pose {
    let mut tracker = Tracker::new(machine, machine.home_pose());
    assert_eq!(tracker.find(machine, &lengths.into()).0, TrackingResult::Found);
    *tracker.pose()
}

/// Lengths of the rows that `hexad goto --table` has written.
fn visited(machine: &Machine, name: &str) -> Vec<Vector6<f64>> {
    let text = fs::read_to_string(machine.path(name)).unwrap();
    let row = |line: &str| {
        Vector6::from_iterator(line.split(',').skip(14).map_while(|number| number.parse().ok()).take(6))
    };
    text.lines().skip(1).map(row).collect()
}

/// The platform's joints, with base and platform where they lie best on the drawing.
fn truth_on_drawing(truth: &Model, drawn: &Model) -> Geometry {
    let (mut found, drawn) = (Geometry::of(truth), Geometry::of(drawn));
    for (found, drawn) in [(&mut found.base, drawn.base), (&mut found.platform, drawn.platform)] {
        let pairs: Vec<_> =
            (0..LEGS).map(|leg| (found.column(leg).into(), drawn.column(leg).into())).collect();
        let onto = fitted(&pairs).unwrap();
        found.column_iter_mut().for_each(|mut joint| {
            let moved = onto.rotation * &joint + onto.position;
            joint.copy_from(&moved);
        });
    }
    found
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_platform_with_other_joints_is_calibrated_as_the_guide_says() {
    let machine = Machine::with("calibrate", &format!("{PATIENT}{BUILT}"));
    let config = Config::load(&machine.file).unwrap();
    let imperfections = &config.deployment.plant.imperfections;
    let truth = imperfections.build.built(&config.machine, &mut Random::new(imperfections.seed));
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    daemon.says("standby: no setpoint");
    type_line(&machine, "hexad calibrate --config F --plan 60 --output TARGETS.csv");
    type_line(&machine, "hexad goto --config F --table TARGETS.csv --output VISITED.csv --engage");

    let mut random = Random::new(5);
    let mut text = "x,y,z,qw,qx,qy,qz\n".to_owned();
    for lengths in visited(&machine, "VISITED.csv") {
        let seen = joined(&joined(&pose_of(&TRACKER), &pose_with(&truth, lengths)), &pose_of(&PROBE));
        let mut noise = || Vector3::from_fn(|_, _| 2e-5 * random.near_gaussian());
        let (place, rotation) = (seen.position + noise(), exp(&noise()) * seen.rotation);
        let [w, i, j, k] = hexad::motion::rotation_order::quaternion_of(&rotation, &[1.0, 0.0, 0.0, 0.0]);
        text += &format!("{:?},{:?},{:?},{w:?},{i:?},{j:?},{k:?}\n", place.x, place.y, place.z);
    }
    fs::write(machine.path("TRACKER.csv"), text).unwrap();
    let line = "hexad calibrate --config F VISITED.csv --tracker TRACKER.csv --rotation quaternion --output NEW.toml --page NEW.html";
    let said = type_line(&machine, line);
    assert!(said.contains("NEW.toml: written") && said.contains("finds the same minimum"), "{said}");
    type_line(&machine, "hexad check --config NEW.toml");
    let json = "hexad calibrate --config F VISITED.csv --tracker TRACKER.csv --rotation quaternion --json";
    let json: Value = serde_json::from_str(&type_line(&machine, json)).unwrap();
    let expected = json["after"]["position_worst_m"].as_f64().unwrap();
    let before = json["before"]["position_worst_m"].as_f64().unwrap();

    // The new file in force, then poses that the calibration has not used.
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops();
    let new = fs::read_to_string(machine.path("NEW.toml")).unwrap();
    let old = fs::read_to_string(&machine.file).unwrap();
    fs::write(&machine.file, &new).unwrap();
    let (calibrated, mut random) = (Config::load(&machine.file).unwrap().machine, Random::new(6));
    let daemon = start_daemon(&machine);
    daemon.says("standby: no setpoint");
    let mut unused = "alpha,beta,gamma,x,y,z\n".to_owned();
    for _ in 0..50 {
        let mut x = calibrated.home;
        x.iter_mut().enumerate().for_each(|(k, x)| *x += if k < 3 { 0.12 } else { 0.08 } * random.signed());
        unused += &(x.map(|x| x.to_string()).join(",") + "\n");
    }
    fs::write(machine.path("UNUSED.csv"), unused).unwrap();
    let table = ["--table", "UNUSED.csv", "--output", "REACHED.csv", "--average", "0.1", "--engage"];
    let mut command = hexad();
    command.current_dir(machine.folder()).args(["goto", "--config", "machine.toml"]).args(table);
    Hexad::spawn(&machine, "unused", command).ends_within(12 * HANG).succeeds();
    let on_drawing = truth_on_drawing(&truth, &config.machine).applied_to(&config.machine);
    let error = |lengths| {
        (pose_with(&calibrated, lengths).position - pose_with(&on_drawing, lengths).position).norm()
    };
    let reached = visited(&machine, "REACHED.csv");
    let worst = reached.iter().map(|lengths| error(*lengths)).fold(0.0, f64::max);
    println!("{before:.1e} m, expected {expected:.1e} m, of {} poses {worst:.1e} m", reached.len());
    assert!(
        reached.len() == 50 && worst < expected && expected < 0.2 * before,
        "{worst} {expected} {before}"
    );

    // After a new homing: the lengths are off, the pose is known.
    let lengths = reached[0].map(|length| length - 1e-4);
    let x = task_coordinates(&pose_with(&calibrated, reached[0]), &calibrated.home);
    let row: Vec<_> = lengths.iter().chain(&x).map(f64::to_string).collect();
    let header = "length_1,length_2,length_3,length_4,length_5,length_6,alpha,beta,gamma,x,y,z";
    fs::write(machine.path("REFERENCE.csv"), format!("{header}\n{}\n", row.join(","))).unwrap();
    let said = type_line(&machine, "hexad calibrate --config NEW.toml REFERENCE.csv --offsets-only");
    assert_eq!(said.matches("+0.1000").count(), 6, "{said}");
    assert_ne!(old, new);
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops();
    plant.stops();
}
