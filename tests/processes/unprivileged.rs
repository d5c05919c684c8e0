//! Without any right that root has: the user nobody, no real-time priority, next to no locked memory.
//!
//! Needs root, to become nobody. iceoryx2 keeps files of one owner in `/tmp/iceoryx2` and `/dev/shm`, so
//! nobody gets both to himself, in a mount namespace.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;

use crate::support::children::{Ended, HANG, Hexad, hexad};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;
use crate::support::trio::start_plant;
use crate::support::turns;

/// `nobody` on every Linux.
const NOBODY: &str = "65534";

/// Empty places for iceoryx2, seen by this process and its children only.
const OWN_PLACES: &str = "mkdir -p /tmp/iceoryx2 && mount -t tmpfs -o mode=1777 tmpfs /tmp/iceoryx2 \
                          && mount -t tmpfs -o mode=1777 tmpfs /dev/shm && exec \"$@\"";

#[test]
fn nobody_is_told_what_is_lacking_and_served() {
    if let Some(reason) = cannot(&["unshare", "--mount", "sh", "-c", OWN_PLACES, "sh", "true"]) {
        println!("SKIPPED nobody_is_told_what_is_lacking_and_served: {reason}");
        return;
    }
    let _turn = turns::beside_others();
    let machine = Machine::patient("nobody");
    let ended = demo_as_nobody(&machine, &["unshare", "--mount", "sh", "-c", OWN_PLACES, "sh"]);
    let Ended { status, stdout, stderr } = ended;
    assert_eq!(status.code(), Some(0), "{stdout}\n{stderr}");
    for words in [
        "no FIFO priority 80: Operation not permitted",
        "give CAP_SYS_NICE or LimitRTPRIO=99",
        "no locked memory: ",
        "give CAP_IPC_LOCK or LimitMEMLOCK=infinity",
    ] {
        assert!(stderr.contains(words), "{words:?} must be in\n{stderr}");
    }
    assert!(stdout.contains("faults           0"), "{stdout}");
    assert!(stdout.contains("real-time thread 0 allocations"), "{stdout}");
}

#[test]
fn nobody_is_served_beside_root() {
    if let Some(reason) = cannot(&["true"]) {
        println!("SKIPPED nobody_is_served_beside_root: {reason}");
        return;
    }
    let _turn = turns::beside_others();
    let machine = Machine::patient("beside");
    let recorder = Recorder::start(&machine.name);
    let plant = start_plant(&machine);
    recorder.until("root's plant owns the shared memory", |recording| recording.measured.last().map(drop));
    let Ended { status, stdout, stderr } = demo_as_nobody(&machine, &[]);
    assert_eq!(status.code(), Some(0), "{stdout}\n{stderr}");
    assert!(stderr.contains("using /tmp/iceoryx2-65534"), "must say where its shared memory is: {stderr}");
    assert!(stdout.contains("faults           0"), "{stdout}");
    plant.stops_on("TERM", HANG);
}

/// Why this cannot be had here, if so. All of it needs root.
fn cannot(wrapper: &[&str]) -> Option<String> {
    let tried = as_nobody(wrapper, "true".into()).output();
    match tried {
        Ok(output) if output.status.success() => None,
        Ok(output) => Some(format!("{wrapper:?}: {}", String::from_utf8_lossy(&output.stderr).trim())),
        Err(error) => Some(format!("{wrapper:?}: {error}")),
    }
}

/// `wrapper... program` as nobody.
fn as_nobody(wrapper: &[&str], program: PathBuf) -> Command {
    let rights = ["prlimit", "--rtprio=0:0", "--memlock=65536:65536"];
    let user = ["setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "--inh-caps=-all"];
    let mut words = wrapper.iter().chain(&rights).chain(&user);
    let mut command = Command::new(words.next().expect("some words"));
    command.args(words).arg(program);
    command
}

fn demo_as_nobody(machine: &Machine, wrapper: &[&str]) -> Ended {
    // The folders on the way to the binary and to the machine file may be closed to others.
    let program = machine.path("hexad");
    fs::copy(hexad().get_program(), &program).expect("a copy of the binary");
    fs::set_permissions(machine.folder(), Permissions::from_mode(0o777)).expect("an open folder");
    let mut command = as_nobody(wrapper, program);
    command.args(["demo", "--seconds", "1", "--config"]).arg(&machine.file);
    command.arg("--charts").arg(machine.path("charts")).env("TMPDIR", machine.folder());
    command.env_remove("HEXAD_LOG");
    Hexad::spawn(machine, "demo", command).ends_within(HANG * 2)
}
