//! What must hold of the code that ships: one codegen unit, without debug assertions.
//!
//! `tests/all` builds and runs this with `--release`. A part of it: `cargo test --release --test shipped vectors`.

#![allow(clippy::unwrap_used, reason = "a failed assertion is how a test speaks")]

mod golden;
mod longest_cycle;
mod no_panic;
mod vectors;

use std::process::Command;

#[test]
fn the_version_names_commit_and_profile() {
    let output = Command::new(env!("CARGO_BIN_EXE_hexad")).arg("--version").output().unwrap();
    let version = String::from_utf8(output.stdout).unwrap();
    let (number, build) = version.trim().split_once(" (").unwrap();
    assert_eq!(number, format!("hexad {}", env!("CARGO_PKG_VERSION")));
    assert!(build.contains("commit") && build.ends_with("release)"), "{version}");
}
