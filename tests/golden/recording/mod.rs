//! How the streams were recorded: a controller and simulated hardware in closed loop, and a script of what happens.
//!
//! A recorded stream stays as it is when the controller changes, so that its hashes show the change. Streams are recorded
//! anew where none of them shows what a change is about: better a new one than another content under an old name.
//! `HEXAD_RECORD_STREAMS=NAME,NAME cargo test --test shipped -- --ignored record_streams`

use std::env;

use super::stream::Stream;
use hexad_support::edited::{deployed_table, set, table};
use hexad_support::{MACHINES, data};

mod faults;
mod loops;
mod recorder;
mod requests;
mod setpoints;

use recorder::Recorder;

/// A stream: name, machine, keys that differ from those of its file, and what happens.
type Script = (&'static str, &'static str, &'static str, fn(&mut Recorder));

/// Text of the configuration of a script: all of it, so that a machine file of another test may change.
fn configuration((name, machine, keys, _): &Script) -> String {
    let mut text =
        if MACHINES.contains(machine) { table(&data(machine, "toml")) } else { deployed_table(machine) };
    text.insert("name".into(), (*name).into());
    for (section, keys) in keys.parse::<toml::Table>().unwrap() {
        for (key, value) in keys.as_table().unwrap() {
            set(&mut text, &section, key, value.clone());
        }
    }
    text.to_string()
}

#[test]
#[ignore = "records streams anew, for a person"]
fn record_streams() {
    let names =
        env::var("HEXAD_RECORD_STREAMS").expect("HEXAD_RECORD_STREAMS: names of streams, with commas");
    let scripts = [faults::SCRIPTS, loops::SCRIPTS, requests::SCRIPTS, setpoints::SCRIPTS].concat();
    for name in names.split(',') {
        let script =
            scripts.iter().find(|script| script.0 == name).unwrap_or_else(|| panic!("no stream {name}"));
        let recorder = Recorder::record(&configuration(script), script.3);
        Stream::new(&recorder.config, recorder.inputs).write();
    }
}
