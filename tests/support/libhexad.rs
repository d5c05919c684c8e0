//! libhexad, installed into a folder of the tests as a package would install it.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::python::output;
use super::{kept_files, programs, repository};

/// The prefix: `include`, `lib`, `lib/pkgconfig`.
pub fn prefix() -> &'static Path {
    static READY: OnceLock<PathBuf> = OnceLock::new();
    READY.get_or_init(|| {
        let folder = kept_files().join("libhexad");
        fs::create_dir_all(&folder).unwrap();
        // Another process may be at it.
        let lock = File::create(folder.join("lock")).unwrap();
        lock.lock().unwrap();
        let mut install = Command::new(repository().join("clients/c/install"));
        output(install.arg(folder.join("usr")).env("HEXAD_BUILT", built())).unwrap();
        folder.join("usr")
    })
}

/// Folder of libhexad and of the example of a driver in Rust, built with the profile of this test.
pub fn built() -> PathBuf {
    static READY: OnceLock<()> = OnceLock::new();
    READY.get_or_init(|| drop(output(cargo("build").args(["--lib", "--example", "driver"])).unwrap()));
    programs()
}

/// A command of Cargo for libhexad, with the profile of this test. Together with the library `hexad`, which so has the features with
/// which the tests were built, and is there already.
pub fn cargo(command: &str) -> Command {
    let programs = programs();
    let profile = programs.file_name().filter(|name| *name != "debug").unwrap_or("dev".as_ref());
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(repository()).args([command, "--quiet", "-p", "hexad", "-p", "hexad-c"]);
    cargo.arg("--profile").arg(profile);
    cargo.arg("--target-dir").arg(programs.parent().unwrap());
    cargo
}

/// Lets a command find the installed library and header, and the package of Python.
pub fn with_library(mut command: Command) -> Command {
    let library = prefix().join("lib");
    command.env("PKG_CONFIG_PATH", library.join("pkgconfig")).env("LD_LIBRARY_PATH", &library);
    let package: OsString = repository().join("clients/python/src").into();
    // No __pycache__ between the sources.
    command.env("PYTHONPATH", package).env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// What `hexad messages` prints.
pub fn declared(language: &str) -> String {
    let mut command = Command::new(programs().join("hexad"));
    output(command.args(["messages", "--language", language])).unwrap()
}
