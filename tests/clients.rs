//! libhexad and the package of Python, as programs in C, C++ and Python use them after an installation.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod clients {
    mod batch;
    mod declarations;
    mod drivers;
    mod frames;
    mod library;
    mod requests;
    mod verdicts;
    mod wheel;
}

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, Command};

use hexad::commands::demo::children::PARENT_VARIABLE;

use hexad_support::process::Process;
use hexad_support::repository;

/// A file of this test.
fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("clients");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// A daemon of the machine of the paper under another name, with more sections in its file. It runs.
fn start_daemon(name: &str, sections: &str) -> Process {
    let machine = file(&format!("{name}.toml"));
    let text = fs::read_to_string(repository().join("config/fried2008.toml")).unwrap();
    let named = text.replace("name = \"fried2008\"", &format!("name = \"{name}\""));
    fs::write(&machine, format!("{named}\n{sections}")).unwrap();
    let mut daemon = Command::new(env!("CARGO_BIN_EXE_hexad"));
    daemon.args(["run".as_ref(), "--config".as_ref(), machine.as_os_str()]).env_remove("HEXAD_LOG");
    daemon.env(PARENT_VARIABLE, process::id().to_string());
    let daemon = Process::start(daemon, file(&format!("{name}-daemon.txt")));
    daemon.says("running");
    daemon
}
