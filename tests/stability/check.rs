//! `hexad check` tells when the lengths of home belong to another pose nearby, and how near to unstable a loop is.

use hexad::analysis::assembly_modes::{OtherMode, other_modes};
use hexad::commands::check::CheckReport;
use hexad::text::csv_table::{NumberTable, length_columns, six};
use hexad::text::numbers::AXES;

use super::*;

/// What `check` prints.
fn printed(text: &str) -> String {
    let config = Config::parse(text, "checked.toml").unwrap();
    CheckReport::new(&config, &config.examine()).to_string()
}

/// The motion base with its home turned about the vertical. Near a singular pose only strong drives hold the platform.
fn checked(turn: f64) -> String {
    let text = fs::read_to_string(data("motion_base", "toml")).unwrap();
    let text = text.replace("max_force_n = 20000.0", "max_force_n = 200000.0");
    let text = text.replace("pose = [0.0, 0.0, 0.0,", &format!("pose = [0.0, 0.0, {turn},"));
    printed(&text.replace("min_length_m = 1.1\nmax_length_m = 2.3", "min_length_m = 0.9\nmax_length_m = 4.0"))
}

/// Fichter: at a quarter turn about the vertical two of these poses meet, as far before it as behind.
#[test]
fn another_pose_nearby_is_told() {
    let line = |text: &str| text.lines().find(|line| line.starts_with("other poses")).unwrap().to_string();
    let near = checked(86_f64.to_radians());
    assert!(line(&near).ends_with("across a singular pose") && !line(&near).contains("NOT"), "{near}");
    assert!(line(&near).contains(", the nearest 8.0 deg and "), "{near}");
    assert!(near.contains("WARNING: at start-up the lengths alone may not distinguish it "), "{near}");
    let far = checked(0.0);
    assert!(!far.contains("WARNING"), "{far}");
    assert!(far.contains("\nother permitted poses             at home none (proved); in the "), "{far}");
}

/// Lengths of a platform at rest that forward kinematics from home takes for another pose, both well conditioned and in the
/// stroke: it is among those that the daemon names before control begins.
#[test]
fn the_true_pose_is_named_where_the_lengths_lead_to_another() {
    let machine = machine("tsai2000");
    let rows = |name, columns: &[String]| {
        NumberTable::read(&data(name, "csv"), None, columns, &[]).unwrap().rows().to_vec()
    };
    let lengths = rows("other_assembly_lengths", &length_columns());
    let poses = rows("other_assembly_poses", &AXES.map(String::from));
    for (lengths, x) in lengths.iter().zip(poses) {
        let mut tracker = Tracker::new(&machine, machine.home_pose());
        assert_eq!(tracker.find(&machine, &six(lengths, 1)).0, TrackingResult::Found);
        let truth = TaskState::at_rest(six(&x, 0)).motion().pose;
        let distance = machine.joints.distance(tracker.pose(), &truth);
        let others = other_modes(&machine, tracker.kinematic_state());
        let is_truth = |other: &&OtherMode| (other.distance - distance).abs() < 1e-6;
        assert!(
            others.iter().find(is_truth).is_some_and(OtherMode::is_confusable),
            "{distance} from {x:?}: {others:?}"
        );
    }
}

/// Two periods and a lead of delay: near the largest bandwidth the estimator is slower, so that 0.7 of the mass is still stable.
#[test]
fn near_the_limit_of_the_loop_the_estimator_is_slower() {
    let of = |bandwidth: &str| {
        let text = fs::read_to_string(data("motion_base", "toml")).unwrap();
        let keys = ["position", "orientation"].map(|part| format!("{part}_bandwidth_hz = {bandwidth}\n"));
        printed(&format!("{text}\n[control]\n{}", keys.concat()))
    };
    let (usual, bold) = (of("10"), of("53"));
    assert!(usual.contains("estimator 10.50 Hz") && !usual.contains("WARNING"), "{usual}");
    assert!(bold.contains("estimator 28.49 Hz") && !bold.contains("advisable"), "{bold}");
    let position = bold.lines().find(|line| line.starts_with("position ")).unwrap();
    assert!(position.contains("2.10 periods of delay") && position.contains("margin 1.47"), "{bold}");
}
