//! The program as it is shipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::python::output;

/// `hexad`, built with the profile `release` unless it is there already.
pub fn program() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let mut cargo = Command::new(env!("CARGO"));
    // With an example, which has the features of the tests: so it is the same build as that of tests with this profile.
    cargo.args(["build", "--release", "--quiet", "--bin", "hexad", "--example", "driver", "--target-dir"]);
    output(cargo.arg(target).current_dir(env!("CARGO_MANIFEST_DIR"))).unwrap();
    target.join("release/hexad")
}
