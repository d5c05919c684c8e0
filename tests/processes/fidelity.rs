//! `control.fidelity`: the daemon says which model it runs on and why, and runs on it.

use crate::support::children::{HANG, Hexad, run};
use crate::support::machine::{Machine, PATIENT};
use crate::support::recorder::Recorder;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::{operator, turns};

/// What the daemon says about it with these keys in `[control]`.
fn said(keys: &str) -> String {
    let machine = Machine::with("fidelity", &format!("[control]\n{keys}\n"));
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let ended = daemon.stops_on("TERM", HANG);
    ended.stderr.lines().filter(|line| line.contains("fidelity: ")).collect()
}

#[test]
fn the_daemon_chooses_and_says_why() {
    let line = said("fidelity = \"auto\"");
    for words in [
        "leaving out spin of the legs costs 0.00",
        "of the peak force, the largest found; tolerance 0.1 %; velocity terms and spin would cost 0.66",
        "extent of the legs would cost",
        "fidelity=\"rigid-legs\"",
    ] {
        assert!(line.contains(words), "{words:?} must be in {line}");
    }
    let line = said("fidelity = \"auto\"\nfidelity_tolerance = 1e-9");
    assert!(line.contains("nothing may be left out at a tolerance of 0.0000001 %"), "{line}");
    // Gravity would be within this tolerance.
    let line = said("fidelity = \"auto\"\nfidelity_tolerance = 1");
    assert!(line.contains("fidelity=\"massless-legs\""), "{line}");
    assert!(said("fidelity = \"no-velocity\"").contains("fidelity=\"no-velocity\""));
    assert_eq!(said("fidelity = \"exact\""), "");
}

/// Without the mass of the legs the platform hangs lower by their weight over Kp, some millimetres.
#[test]
fn the_daemon_runs_on_the_rung_it_was_told() {
    let _turn = turns::beside_others();
    let sections = format!("[control]\nfidelity = \"massless-legs\"\n{PATIENT}");
    let machine = Machine::with("fidelity", &sections);
    let recorder = Recorder::start(&machine.name);
    let _plant = start_plant(&machine);
    let _daemon = start_daemon(&machine);
    let _setpoints = Hexad::start(&machine, "move", &["--motion", "settle", "--seconds", "100"]);
    operator::engage(&machine);
    recorder.until("the platform hangs lower", |recording| {
        let (force, measured) = (recording.forces.last()?, recording.measured.last()?);
        (force.valid == 1 && (1.090..1.097).contains(&measured.x[3])).then_some(())
    });
}

#[test]
fn a_rung_without_inertia_is_refused() {
    let machine = Machine::with("gravity", "[control]\nfidelity = \"gravity\"\n");
    let file = machine.file.display().to_string();
    let ended = run(&machine, &["run", "--config", &file]);
    assert_eq!(ended.status.code(), Some(2), "{}", ended.stderr);
    let words = "control.fidelity = \"gravity\": must be one of \"exact\", \"rigid-legs\", \"no-velocity\", \
                 \"lumped-legs\", \"massless-legs\", \"auto\"";
    assert!(ended.stderr.contains(words), "{}", ended.stderr);
}
