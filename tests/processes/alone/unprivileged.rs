//! Without any right that root has: the user nobody, no real-time priority, next to no locked memory.

use std::path::Path;

use crate::support::children::{Ended, HANG, Hexad};
use crate::support::machine::Machine;
use crate::support::nobody::{AS_NOBODY, NO_LIMITS_RAISED, OWN_PLACES, cannot, wrapped};
use crate::support::recorder::Recorder;
use crate::support::trio::start_plant;

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn nobody_is_told_what_is_lacking_and_served() {
    let nobody = [OWN_PLACES, NO_LIMITS_RAISED, AS_NOBODY];
    if cannot(&nobody) {
        return;
    }
    let Ended { status, stdout, stderr } = demo(&machine("nobody"), &nobody);
    assert_eq!(status.code(), Some(0), "{stdout}\n{stderr}");
    for words in ["no FIFO priority 80: ", "no locked memory: ", "no bound on idle states: "] {
        assert!(stderr.contains(words), "{words:?} must be in\n{stderr}");
    }
    assert!(stdout.contains("faults           0"), "{stdout}");
    assert!(stdout.contains("real-time thread 0 allocations"), "{stdout}");
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn nobody_is_served_beside_root() {
    let nobody = [NO_LIMITS_RAISED, AS_NOBODY];
    if cannot(&nobody) {
        return;
    }
    let machine = machine("beside");
    let recorder = Recorder::start(&machine.name);
    let plant = start_plant(&machine);
    recorder.until("root's plant owns the shared memory", |recording| recording.measured.last().map(drop));
    let Ended { status, stdout, stderr } = demo(&machine, &nobody);
    assert_eq!(status.code(), Some(0), "{stdout}\n{stderr}");
    assert!(Path::new("/tmp/hexad-65534/prefix").exists(), "it has shared memory of its own");
    assert!(stdout.contains("faults           0"), "{stdout}");
    let page = machine.path("charts").join("report.html");
    assert!(stdout.ends_with(&format!("report           {}\n", page.display())), "{stdout}");
    assert!(!machine.path("charts").join("forces.svg").exists(), "pictures are written on request alone");
    plant.stops();
}

/// With timeouts that also a busy machine does not reach: nobody has priority here.
fn machine(test: &str) -> Machine {
    let timeouts = "[timeouts]\nsetpoint_ms = 200.0\nmeasured_ms = 900.0\nallow_unstable_age = true\n\
                    [plant]\nforce_timeout_ms = 900.0\n";
    Machine::with(test, timeouts)
}

fn demo(machine: &Machine, wrappers: &[&[&str]]) -> Ended {
    let mut command = wrapped(machine, wrappers);
    command.args(["demo", "--seconds", "1", "--config"]).arg(&machine.file);
    command.arg("--charts").arg(machine.path("charts"));
    Hexad::spawn(machine, "demo", command).ends_within(HANG * 2)
}
