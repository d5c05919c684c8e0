//! A Python of our own with MuJoCo and iceoryx2 in it.
//!
//! Where it cannot be had, the tests are not run and say why.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::common::not_run::lacking;
use super::common::python::{self, output};

/// The engine. Pinned: what it makes of a model may change.
const MUJOCO: &str = "mujoco==4.0.0";

/// What speaks with the daemon, of the daemon's own version.
fn iceoryx2() -> String {
    let (_, after) = include_str!("../../Cargo.toml").split_once("iceoryx2 = { version = \"=").unwrap();
    format!("iceoryx2=={}", after.split_once('"').unwrap().0)
}

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
    let mut command = Command::new(environment().unwrap().join("bin/python"));
    // No __pycache__ between the sources.
    command.arg("-B").env("PYTHONPATH", declarations());
    command
}

/// A folder with `hexad_messages.py`, as a user of the clients generates it.
fn declarations() -> &'static Path {
    static READY: OnceLock<PathBuf> = OnceLock::new();
    READY.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("declarations");
        fs::create_dir_all(&folder).unwrap();
        // Whole at once: another process may import it at this moment.
        let part = folder.join(format!("{}.part", std::process::id()));
        fs::write(&part, declared("python")).unwrap();
        fs::rename(&part, folder.join("hexad_messages.py")).unwrap();
        folder
    })
}

/// What `hexad messages` prints.
pub fn declared(language: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    output(command.args(["messages", "--language", language])).unwrap()
}

/// Whether there is no such Python here; the calling test is then not run.
pub fn is_lacking() -> bool {
    environment().inspect_err(|why| lacking(why)).is_err()
}

/// The virtual environment with both, or why there is none.
fn environment() -> Result<PathBuf, String> {
    python::environment(&[MUJOCO.to_owned(), iceoryx2()])
}
