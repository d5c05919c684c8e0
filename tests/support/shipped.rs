//! The program as it is shipped.

use std::path::PathBuf;
use std::process::Command;

use super::python::output;
use super::{programs, repository};

/// `hexad`, built with the profile `release` unless it is there already.
pub fn program() -> PathBuf {
    let target = programs().parent().unwrap().to_owned();
    let mut cargo = Command::new(env!("CARGO"));
    // With an example, which has the features of the tests: so it is the same build as that of tests with this profile.
    cargo.args(["build", "--release", "--quiet", "--bin", "hexad", "--example", "driver", "--target-dir"]);
    output(cargo.arg(&target).current_dir(repository())).unwrap();
    target.join("release/hexad")
}
