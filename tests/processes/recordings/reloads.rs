//! A recording over a reload: each side has its configuration and is repeated with it.

use std::fs;

use hexad::config::Config;
use hexad::control::signals::state::State;

use super::{about, files, read, replays_exactly, start_recording};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::{ask, clear, does, engage};
use crate::support::peer;
use crate::support::trio::start_plant;

const OLD: &str = "position_bandwidth_hz = 10.0";
const NEW: &str = "position_bandwidth_hz = 7.0";

#[test]
#[apply(beside_others)]
fn both_sides_of_a_reload_are_repeated_with_their_own_gains() {
    let machine = Machine::with("reloads", &format!("{PATIENT}\n[control]\n{OLD}\n"));
    let (plant, _peer) = (start_plant(&machine), peer::start(&machine));
    let daemon = start_recording(&machine);
    engage(&machine);
    // A fault whose window is not complete when the next configuration begins.
    does(&machine, "estop", &[], &["fault"]);
    let old = fs::read_to_string(&machine.file).unwrap();
    let new = old.replace(OLD, NEW);
    fs::write(&machine.file, &new).unwrap();
    let stdout = ask(&machine, "reload", &[]).succeeds();
    let (_, cycle) = stdout.split_once(", from cycle ").expect("the first cycle");
    let first: u64 = cycle.split(' ').next().unwrap().parse().unwrap();
    clear(&machine);
    engage(&machine);
    does(&machine, "stop", &[], &["standby"]);
    daemon.stops();
    plant.stops();

    let recorded = files(&machine, "record");
    let [before, after] = recorded.as_slice() else { panic!("two recordings: {recorded:?}") };
    let faults = files(&machine, "faults");
    assert_eq!(faults.len(), 1, "{faults:?}");
    faults.iter().chain(&recorded).for_each(|file| replays_exactly(&machine, file));
    for (file, text) in [(&faults[0], &old), (before, &old), (after, &new)] {
        let (summary, cycles) = read(file);
        assert_eq!(summary.info.configuration, *text, "{}", file.display());
        assert!(Config::parse(&summary.info.configuration, "a recording").is_ok());
        let numbers = [cycles.first(), cycles.last()].map(|cycle| cycle.unwrap().cycle);
        let is_before = text == &old;
        assert_eq!(is_before, numbers[0] < first, "{numbers:?}");
        assert_eq!(is_before, numbers[1] < first, "{numbers:?}");
        assert!(cycles.iter().any(|cycle| cycle.state == State::Active as u32));
    }
    // The gains are in force: with the old ones the cycles would be others.
    fs::write(&machine.file, &old).unwrap();
    let config = machine.file.display().to_string();
    let stdout = about(&machine, "replay", after, &["--config", &config]).stdout;
    assert!(stdout.contains(" cycles differ\n"), "{stdout}");
}
