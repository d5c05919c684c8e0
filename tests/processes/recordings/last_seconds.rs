//! The last seconds of a daemon, which it keeps in memory whether it records or not.

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use serde_json::json;

use super::{read, replays_exactly};
use crate::support::children::{Ended, HANG, run};
use crate::support::machine::Machine;
use crate::support::socket::Client;
use crate::support::trio::{Trio, start_daemon};
use crate::support::turns;

/// `hexad record` of a machine to a file of its folder.
fn record(machine: &Machine, name: &str, more: &[&str]) -> Ended {
    let [config, output] = [machine.file.clone(), machine.path(name)].map(|path| path.display().to_string());
    run(machine, &[&["record", "--config", &config, "--output", &output], more].concat())
}

#[test]
fn the_last_seconds_are_recorded_on_request_without_a_folder() {
    let _turn = turns::beside_others();
    let trio = Trio::in_motion("last-seconds");
    sleep(Duration::from_millis(2500));
    let folder = fs::read_dir(trio.machine.folder()).unwrap().count();
    for (name, last) in [("short.mcap", &["--last", "1"][..]), ("all.mcap", &[])] {
        let Ended { status, stdout, stderr } = record(&trio.machine, name, last);
        assert_eq!(status.code(), Some(0), "{stderr}");
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

#[test]
fn a_request_without_a_file_and_one_without_a_daemon_are_refused() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("no-seconds");
    let Ended { status, stderr, .. } = record(&machine, "none.mcap", &[]);
    assert_eq!(status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("no daemon runs for no-seconds-"), "{stderr}");
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let mut client = Client::connect(&daemon);
    client.send(&format!("{}\n", json!({"version": 1, "request": "record"})));
    let answer = client.answer();
    assert_eq!(answer["result"], "invalid");
    assert!(answer["text"].as_str().unwrap().starts_with("record needs an open file"), "{answer}");
    daemon.stops_on("TERM", HANG);
    let left = fs::read_dir(machine.folder()).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().contains("none.mcap")));
}
