//! A Python with packages of its own, set up once from PyPI.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use super::kept_files;

/// The environments that this process has found, or why there is none.
static FOUND: Mutex<BTreeMap<String, Result<PathBuf, String>>> = Mutex::new(BTreeMap::new());

/// The virtual environment with these packages, set up by whoever comes first, or why there is none.
pub fn environment(packages: &[String]) -> Result<PathBuf, String> {
    named_environment(&packages.join("-").replace("==", "-"), packages)
}

/// The same with the name of the environment, and arguments for pip.
pub fn named_environment(name: &str, arguments: &[String]) -> Result<PathBuf, String> {
    let mut found = FOUND.lock().unwrap();
    found.entry(name.into()).or_insert_with(|| locked_environment(name, arguments)).clone()
}

fn locked_environment(name: &str, packages: &[String]) -> Result<PathBuf, String> {
    let folder = kept_files().join(name);
    // Another process may be at it. (Versions have dots: no `with_extension` here.)
    let beside = |end: &str| PathBuf::from(format!("{}.{end}", folder.display()));
    let lock = File::create(beside("lock")).unwrap();
    lock.lock().unwrap();
    let complete = folder.join("complete");
    if !complete.exists() {
        set_up(&folder, packages).map_err(|why| {
            format!("a Python with {packages:?}; apt-get install python3-venv, and PyPI, once\n{why}")
        })?;
        fs::write(complete, "").unwrap();
    }
    Ok(folder)
}

fn set_up(folder: &Path, packages: &[String]) -> Result<(), String> {
    output(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    output(Command::new(folder.join("bin/python")).args(pip).args(packages)).map(drop)
}

/// What a command prints; its standard error if it fails.
pub fn output(command: &mut Command) -> Result<String, String> {
    match command.output() {
        Ok(ended) if ended.status.success() => Ok(String::from_utf8_lossy(&ended.stdout).into()),
        Ok(ended) => {
            Err(format!("{command:?}: {}\n{}", ended.status, String::from_utf8_lossy(&ended.stderr)))
        }
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}
