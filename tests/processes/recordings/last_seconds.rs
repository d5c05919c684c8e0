//! The last seconds of a daemon, which it keeps in memory whether it records or not.

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use super::{read, replays_exactly};
use crate::support::children::Ended;
use crate::support::machine::Machine;
use crate::support::trio::Trio;

/// `hexad record` of a machine to a file of its folder.
fn record(machine: &Machine, name: &str, more: &[&str]) -> Ended {
    let output = machine.path(name).display().to_string();
    machine.hexad("record", &[&["--output", &*output], more].concat())
}

#[test]
#[apply(beside_others)]
fn the_last_seconds_are_recorded_on_request_without_a_folder() {
    let trio = Trio::in_motion("last-seconds");
    sleep(Duration::from_millis(1000));
    let folder = fs::read_dir(trio.machine.folder()).unwrap().count();
    for (name, last) in [("short.mcap", &["--last", "1"][..]), ("all.mcap", &[])] {
        let stdout = record(&trio.machine, name, last).succeeds();
        let file = trio.machine.path(name);
        let (_, cycles) = read(&file);
        assert_eq!(stdout, format!("{}: {} cycles\n", file.display(), cycles.len()));
        replays_exactly(&trio.machine, &file);
        assert!(cycles.windows(2).all(|two| two[0].cycle + 1 == two[1].cycle));
        // It begins with a memory, up to a second sooner.
        let whole = cycles.len() as u64 == cycles[cycles.len() - 1].cycle;
        assert!(
            if last.is_empty() { whole } else { (1000..=2001).contains(&cycles.len()) },
            "{}",
            cycles.len()
        );
    }
    // Both files, and what was said while they were written and replayed.
    assert!(fs::read_dir(trio.machine.folder()).unwrap().count() <= folder + 2 + 2 * 4);
    trio.finish();
}
