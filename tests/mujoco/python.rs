//! A Python of our own with MuJoCo in it, and the package `hexad`.
//!
//! Where it cannot be had, the tests are not run and say why.

use std::path::{Path, PathBuf};
use std::process::Command;

use hexad_support::libhexad::with_library;
use hexad_support::not_run::lacking;
use hexad_support::python::{self, output};

/// The engine. Pinned: what it makes of a model may change.
const MUJOCO: &str = "mujoco==4.0.0";

/// Runs a script of `tests/clients`; its standard error if it fails.
pub fn run(script: &str, arguments: &[&Path]) -> Result<(), String> {
    output(command(script).args(arguments)).map(drop)
}

/// What a few lines of Python among `tests/clients` print.
pub fn printed(lines: &str) -> String {
    let mut command = python();
    output(command.args(["-c", lines]).current_dir(clients())).unwrap()
}

/// A script of `tests/clients`.
pub fn command(script: &str) -> Command {
    let mut command = python();
    command.arg(clients().join(script));
    command
}

fn clients() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients")
}

fn python() -> Command {
    with_library(Command::new(environment().unwrap().join("bin/python")))
}

/// Whether there is no such Python here; the calling test is then not run.
pub fn is_lacking() -> bool {
    environment().inspect_err(|why| lacking(why)).is_err()
}

/// The virtual environment with it, or why there is none.
fn environment() -> Result<PathBuf, String> {
    python::environment(&[MUJOCO.to_owned()])
}
