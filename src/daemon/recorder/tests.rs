use core::ops::RangeInclusive;

use super::*;
use crate::control::controller::{Controller, Input, Measurement};
use crate::daemon::replay::{recorded_controller, replay};
use crate::messages::GapMessage;
use crate::recording::Item;
use crate::recording::reader::Recording;

/// The cycles of a run without messages.
fn cycles(controller: &mut Controller, numbers: RangeInclusive<u64>) -> Vec<CycleMessage> {
    let cycle = |cycle: u64| {
        let release_ns = cycle * 1_000_000;
        // Without rates: their estimator has gains of its own.
        let length = [1.2 + 1e-4 * (cycle as f64 * 0.1).sin(); 6];
        let measurement = Some(Measurement { time_ns: release_ns, length, ..Measurement::default() });
        let input = Input { release_ns, measurement, ..Input::default() };
        let message = CycleMessage::new(&input, &controller.step(&input));
        CycleMessage { cycle, due_ns: input.release_ns, ..message }
    };
    numbers.map(cycle).collect()
}

/// What a recorder was given: its report, and of each file the items and the numbers of its replay.
type Recordings = (RecorderReport, Vec<(Vec<Item>, [u64; 3])>);

fn loaded(gains: &str) -> Loaded {
    let text = include_str!("../../../config/fried2008.toml");
    Loaded::new(Config::parse(&format!("{text}\n[control]\n{gains}"), "a test").unwrap())
}

fn recorded(loaded: &Loaded, handed: Vec<Recorded>) -> Recordings {
    let folder = tempfile::tempdir().unwrap();
    let folders = Folders { record: Some(folder.path().into()), ..Folders::default() };
    let (recorder, queue) = Recorder::new(loaded, &folders).unwrap();
    let report = thread::scope(|threads| {
        let recorder = threads.spawn(|| recorder.run());
        handed.into_iter().for_each(|item| queue.send(item).unwrap());
        drop(queue);
        recorder.join().unwrap()
    });
    let mut paths: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let file = |path: &PathBuf| {
        let recording = Recording::open(path).unwrap();
        let mut items = vec![];
        recording.each(|item| items.push(item)).unwrap();
        let info = recording.summary().unwrap().info;
        let config = Config::parse(&info.configuration, "a recording").unwrap();
        let (_, replay) = replay(&recording, recorded_controller(&info, &config)).unwrap();
        (items, [replay.compared, replay.unknown, replay.different])
    };
    (report, paths.iter().map(file).collect())
}

/// Records cycles without those that `is_lost`.
fn recorded_cycles(count: u64, is_lost: impl Fn(u64) -> bool) -> (RecorderReport, Vec<Item>, [u64; 3]) {
    let loaded = loaded("");
    let kept = cycles(&mut loaded.controller.clone(), 1..=count).into_iter();
    let kept = kept.filter(|cycle| !is_lost(cycle.cycle)).map(Recorded::Cycle).collect();
    let (report, mut files) = recorded(&loaded, kept);
    let (items, replayed) = files.pop().unwrap();
    assert!(files.is_empty());
    (report, items, replayed)
}

#[test]
fn lost_cycles_are_counted_and_marked_where_they_are_missing() {
    let (report, items, replayed) = recorded_cycles(3000, |cycle| (1501..=1510).contains(&cycle));
    assert_eq!((report.cycles, report.missing, report.is_repeatable), (2990, 10, false));
    let mark = Item::Gap(GapMessage { first_cycle: 1501, cycles: 10 });
    let gap = items.iter().position(|item| *item == mark).unwrap();
    assert!(matches!(&items[gap + 1], Item::Cycle(after) if after.cycle == 1511));
    let memories = items.iter().filter(|item| matches!(item, Item::Memory { .. })).count();
    assert_eq!([memories, items.len()], [2, 2 + 1 + 2990], "behind the gap the memory is unknown");
    assert_eq!(replayed, [1500, 1490, 0]);
}

#[test]
fn a_whole_recording_is_repeated() {
    let (report, items, replayed) = recorded_cycles(3000, |_| false);
    assert_eq!((report.cycles, report.missing, report.is_repeatable), (3000, 0, true));
    assert_eq!((items.len(), replayed), (3003, [3000, 0, 0]));
}

#[test]
fn both_sides_of_a_reload_are_repeated_and_each_has_its_configuration() {
    let (before, after) = (loaded(""), Arc::new(loaded("position_bandwidth_hz = 3.0")));
    let mut controller = before.controller.clone();
    let mut handed: Vec<_> = cycles(&mut controller, 1..=1500).into_iter().map(Recorded::Cycle).collect();
    controller.exchange_constants(&mut after.controller.clone());
    handed.push(Recorded::Configuration(after));
    handed.extend(cycles(&mut controller, 1501..=3000).into_iter().map(Recorded::Cycle));
    let (report, files) = recorded(&before, handed);
    assert!(report.is_repeatable && report.missing == 0, "{report:?}");
    let replayed: Vec<_> = files.iter().map(|(_, replayed)| *replayed).collect();
    assert_eq!(replayed, [[1500, 0, 0], [1500, 0, 0]]);
    let [_, (items, _)] = files.as_slice() else { return };
    assert!(matches!(items.first(), Some(Item::Memory { cycle: 1501, .. })), "{:?}", items.first());
}
