//! A Python of our own with MuJoCo in it.
//!
//! Where it cannot be had, the tests fail and say why. Rust's test harness knows no "not run" that a test could
//! decide on, and a comparison that did not take place must not count as passed.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The engine. Pinned: what it makes of a model may change.
const PACKAGE: &str = "mujoco==4.0.0";

/// Runs a script of `tests/clients`; its standard error if it fails.
pub fn run(script: &str, arguments: &[&Path]) -> Result<(), String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients").join(script);
    let mut command = Command::new(environment().join("bin/python"));
    // No __pycache__ between the sources.
    command.arg("-B").arg(script).args(arguments);
    output(&mut command)
}

/// The virtual environment, set up by whoever comes first.
fn environment() -> &'static Path {
    static READY: OnceLock<PathBuf> = OnceLock::new();
    READY.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(PACKAGE.replace("==", "-"));
        // Another process may be at it.
        let lock = File::create(folder.with_extension("lock")).unwrap();
        lock.lock().unwrap();
        let complete = folder.join("complete");
        if !complete.exists() {
            if let Err(why) = set_up(&folder) {
                panic!(
                    "\n\nNOT RUN: no Python with {PACKAGE}.\n{why}\n\
                     Needed: python3 with the module venv (apt-get install python3-venv) and PyPI, once.\n\
                     Without: cargo test --release -- --skip mujoco\n\n"
                );
            }
            fs::write(complete, "").unwrap();
        }
        folder
    })
}

fn set_up(folder: &Path) -> Result<(), String> {
    output(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", PACKAGE];
    output(Command::new(folder.join("bin/python")).args(pip))
}

fn output(command: &mut Command) -> Result<(), String> {
    match command.output() {
        Ok(ended) if ended.status.success() => Ok(()),
        Ok(ended) => {
            Err(format!("{command:?}: {}\n{}", ended.status, String::from_utf8_lossy(&ended.stderr)))
        }
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}
