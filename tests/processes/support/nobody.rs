//! Processes without root's rights. Taking them away needs root.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;

use super::children::hexad;
use super::machine::Machine;
use hexad_support::not_run::lacking;

/// `nobody` on every Linux.
const NOBODY: &str = "65534";

/// Empty places for shared memory, and for its book-keeping of a user without a runtime folder. They are seen by this
/// process and its children only.
pub const OWN_PLACES: &[&str] = &[
    "unshare",
    "--mount",
    "sh",
    "-c",
    "mount -t tmpfs -o mode=1777 tmpfs /dev/shm && if [ -d /run/hexad-root ]; then \
     mount -t tmpfs -o mode=0700 tmpfs /run/hexad-root; fi && exec \"$@\"",
    "sh",
];

/// No real-time priority, next to no locked memory.
pub const NO_LIMITS_RAISED: &[&str] = &["prlimit", "--rtprio=0:0", "--memlock=65536:65536"];

/// What follows runs as nobody.
pub const AS_NOBODY: &[&str] = &["setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups"];

/// The command `hexad`, behind these wrappers one after the other.
pub fn wrapped(machine: &Machine, wrappers: &[&[&str]]) -> Command {
    let mut command = behind(wrappers, program_for_others(machine));
    command.env("TMPDIR", machine.folder()).env_remove("HEXAD_LOG");
    command
}

/// A copy of the program in the machine's folder, which is open to all: the folders on the way to the build's may be closed to others.
pub fn program_for_others(machine: &Machine) -> PathBuf {
    let program = machine.path("hexad");
    // By a process of its own: a child that another test starts would inherit the file open for writing, and until its own program
    // runs, "Text file busy" would be the answer to whoever starts this one.
    let copied = Command::new("cp").arg(hexad().get_program()).arg(&program).status().expect("cp");
    assert!(copied.success(), "a copy of the binary");
    fs::set_permissions(machine.folder(), Permissions::from_mode(0o777)).expect("an open folder");
    program
}

/// Whether these wrappers do not work here; the calling test is then not run.
pub fn cannot(wrappers: &[&[&str]]) -> bool {
    let reason = match behind(wrappers, "true".into()).output() {
        Ok(output) if output.status.success() => return false,
        Ok(output) => String::from_utf8_lossy(&output.stderr).trim().to_owned(),
        Err(error) => error.to_string(),
    };
    lacking(&format!("what it takes for {wrappers:?}: {reason}"));
    true
}

fn behind(wrappers: &[&[&str]], program: PathBuf) -> Command {
    let mut words = wrappers.iter().copied().flatten();
    let mut command = Command::new(words.next().expect("some words"));
    command.args(words).arg(program);
    command
}
