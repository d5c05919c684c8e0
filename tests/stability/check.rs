//! `hexad check` tells when the lengths of home belong to another pose nearby, and how near to unstable a loop is.

use std::fs;
use std::process::Command;

use super::common::data;

/// What `check` prints of the motion base with its home turned about the vertical.
fn checked(turn: f64) -> String {
    let text = fs::read_to_string(data("motion_base", "toml")).unwrap();
    // Near a singular pose only strong drives hold the platform.
    let text = text.replace("max_force_n = 20000.0", "max_force_n = 200000.0");
    let turned = text.replace("pose = [0.0, 0.0, 0.0,", &format!("pose = [0.0, 0.0, {turn},"));
    printed(
        &turned.replace("min_length_m = 1.1\nmax_length_m = 2.3", "min_length_m = 0.9\nmax_length_m = 4.0"),
    )
}

fn printed(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("checked.toml");
    fs::write(&file, text).unwrap();
    let ran =
        Command::new(env!("CARGO_BIN_EXE_hexad")).args(["check", "--config"]).arg(&file).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8(ran.stdout).unwrap()
}

/// Fichter: at a quarter turn about the vertical two of these poses meet, as far before it as behind.
#[test]
fn another_pose_nearby_is_told() {
    let line = |text: &str| text.lines().find(|line| line.starts_with("other poses")).unwrap().to_string();
    let near = checked(86_f64.to_radians());
    assert!(line(&near).ends_with("across a singular pose") && !line(&near).contains("NOT"), "{near}");
    assert!(line(&near).contains(", the nearest 8.0 deg and "), "{near}");
    assert!(
        near.contains("WARNING: at start-up the lengths alone may not distinguish it from home"),
        "{near}"
    );
    let far = checked(0.0);
    assert!(!far.contains("WARNING"), "{far}");
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
    let of_position = bold.lines().find(|line| line.starts_with("position ")).unwrap();
    assert!(
        of_position.contains("2.10 periods of delay") && of_position.contains("gain margin 1.47"),
        "{bold}"
    );
}
