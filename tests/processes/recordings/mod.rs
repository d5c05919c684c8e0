//! `hexad run --record` and `--faults`, and what becomes of their files.

use std::fs;
use std::path::{Path, PathBuf};

use hexad::messages::CycleMessage;
use hexad::recording::Item;
use hexad::recording::reader::{Recording, Summary};

use crate::support::children::{Ended, Hexad, run};
use crate::support::machine::Machine;

mod busy_host;
mod crashes;
mod full_disk;
mod last_seconds;
mod python;
mod reloads;
mod replays;
mod tables;

/// Arguments of a daemon that records.
fn arguments(machine: &Machine) -> Vec<PathBuf> {
    let [record, faults, report] = ["record", "faults", "report.json"].map(|name| machine.path(name));
    ["--record".into(), record, "--faults".into(), faults, "--report".into(), report].into()
}

/// A daemon that records every cycle and every fault. Returns when it runs.
fn start_recording(machine: &Machine) -> Hexad {
    let mut daemon = Hexad::start(machine, "run", &arguments(machine));
    daemon.says_or_has_ended("running");
    daemon
}

/// The recordings in a folder of a machine, the oldest first.
fn files(machine: &Machine, folder: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(machine.path(folder)) else { return vec![] };
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// What a recording says about itself, and its cycles.
fn read(path: &Path) -> (Summary, Vec<CycleMessage>) {
    let mut cycles = vec![];
    let recording = Recording::open(path).unwrap();
    let summary = recording.each(|item| {
        if let Item::Cycle(cycle) = item {
            cycles.push(*cycle);
        }
    });
    (summary.unwrap(), cycles)
}

/// `hexad` with a command about a file.
fn about(machine: &Machine, command: &str, file: &Path, more: &[&str]) -> Ended {
    let file = file.display().to_string();
    run(machine, &[&[command, &file], more].concat())
}

/// All cycles of a recording must be repeated to the bit.
fn replays_exactly(machine: &Machine, file: &Path) {
    let Ended { status, stdout, stderr } = about(machine, "replay", file, &[]);
    let (summary, cycles) = read(file);
    assert_eq!((status.code(), summary.unfinished), (Some(0), None), "{stdout}{stderr}");
    let words = format!("\n{} cycles repeated: every output is the same to the bit\n", cycles.len());
    let is_recorded_here = !stdout.contains("the instruction set is another one here");
    assert!(stdout.contains(&words) && is_recorded_here, "{words} must be in {stdout}");
}
