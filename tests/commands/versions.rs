//! A recording of another version: a replay repeats it or names both versions and the first difference.

use std::thread;

use hexad::config::Config;
use hexad::daemon::replay::recorded_controller;
use hexad::daemon::version::VERSION;
use hexad::messages::CycleMessage;
use hexad::realtime::setup::denormals;
use hexad::recording::file::RecordingFile;
use hexad::recording::reader::Recording;
use hexad::recording::{Item, RunInfo};

use super::{Folder, has};
use hexad_support::data;

/// What this version computes, as another one would have recorded it.
#[test]
fn a_replay_of_another_version_names_both_versions_and_the_first_difference() {
    let (folder, mut cycles) = (Folder::new(""), vec![]);
    let recording = Recording::open(&data("hexad-2026-11-25", "mcap")).unwrap();
    let summary = recording
        .each(|item| cycles.extend(if let Item::Cycle(cycle) = item { Some(*cycle) } else { None }))
        .unwrap();
    let config = Config::parse(&summary.info.configuration, "the recording").unwrap();
    let other = RunInfo { version: "0.0.9".into(), commit: "0123456789ab".into(), ..summary.info };
    let mut controller = recorded_controller(&other, &config);
    // A replay flushes denormal numbers in its thread.
    let compute = || {
        denormals::flush();
        for cycle in &mut cycles {
            let input = cycle.input().unwrap();
            *cycle = CycleMessage::new(&input, &controller.step(&input)).with_number_and_timing_of(cycle);
        }
    };
    thread::scope(|scope| scope.spawn(compute).join().unwrap());
    let replayed = |cycles: &[CycleMessage]| {
        let mut file = RecordingFile::create(&folder.path("other.mcap"), &other, None).unwrap();
        cycles.iter().for_each(|cycle| file.write_cycle(cycle).unwrap());
        file.finish().unwrap();
        folder.run("replay @/other.mcap")
    };
    let (code, text, errors) = replayed(&cycles);
    assert_eq!(code, Some(0), "{text}{errors}");
    let other_here = format!("the version is another one here: hexad {VERSION}\n");
    has(&text, &["hexad 0.0.9 (commit 0123456789ab), ", &other_here, "every output is the same to the bit"]);

    let (middle, number) = (cycles.len() / 2, cycles[cycles.len() / 2].cycle);
    cycles[middle].force_n[2] += 1e-9;
    cycles[middle + 1].position_m[0] += 1.0;
    let (code, text, errors) = replayed(&cycles);
    assert_eq!(code, Some(1), "{text}{errors}");
    let first = format!("\nfirst: cycle {number} (t = ");
    has(&text, &["\n2 of ", &first, " s), force_n_3: ", " s), position_m_1: "]);
    has(&errors, &["hexad 0.0.9 (commit 0123456789ab)", &format!("hexad {VERSION}")]);
}
