use core::ops::RangeInclusive;
use std::fs::{self, File};
use std::path::Path;
use std::sync::mpsc::channel;

use super::*;
use crate::memory_queue::{CycleMemory, MemoryProducer, MemoryQueue};
use crate::recording::Item;
use crate::recording::reader::Recording;
use crate::replay::{Replay, recorded_controller, replay};
use hexad_client::messages::GapMessage;
use hexad_core::control::controller::Controller;
use hexad_core::control::signals::inputs::{Input, Measurement};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;
use hexad_machine::config::Config;

/// Items of the only file of a test, and its replay.
struct Outcome {
    report: RecorderReport,
    items: Vec<Item>,
    replay: Replay,
}

fn loaded(gains: &str) -> Loaded {
    let text = include_str!("../../../config/fried2008.toml");
    Loaded::new(Config::parse(&format!("{text}\n[control]\n{gains}"), "a test").unwrap())
}

/// Input of a cycle. The platform is moved by hand, so that the memory differs in each cycle.
fn input(machine: &Machine, cycle: u64) -> Input {
    let mut x = machine.home;
    x[3] += 1e-3 * (cycle as f64 * 0.01).sin();
    let length_m = leg_lengths(machine, &TaskState::at_rest(x).motion().pose);
    let release_ns = cycle * 1_000_000;
    let measurement = Some(Measurement { time_ns: release_ns, length_m, ..Measurement::default() });
    Input { release_ns, measurement, ..Input::default() }
}

/// Runs cycles as the real-time thread and the log thread do. Passes on those that are not lost, each changed
/// by `change`.
fn run_cycles(
    controller: &mut Controller,
    memories: &mut MemoryProducer<'_>,
    queue: &SyncSender<Recorded>,
    numbers: RangeInclusive<u64>,
    is_lost: impl Fn(u64) -> bool,
    change: impl Fn(&mut CycleMessage),
) {
    let machine = loaded("").config.machine;
    for cycle in numbers {
        let input = input(&machine, cycle);
        memories.begin_cycle(controller.memory());
        let message = CycleMessage::new(&input, &controller.step(&input));
        let mut message = CycleMessage { cycle, due_ns: input.release_ns, ..message };
        change(&mut message);
        if !is_lost(cycle) {
            queue.send(Recorded::Cycle(message)).unwrap();
        }
    }
}

/// Records the cycles in a folder. Returns the report and the files.
fn recorded_in(
    folder: &Path,
    loaded: &Loaded,
    hand_over: impl FnOnce(&mut Controller, &mut MemoryProducer<'_>, &SyncSender<Recorded>),
) -> (RecorderReport, Vec<PathBuf>) {
    let folders = Folders { record: Some(folder.into()), ..Folders::default() };
    let mut memory_queue = MemoryQueue::new();
    let (memories, consumer) = memory_queue.split();
    let (recorder, links) = Recorder::new(loaded, consumer, &folders);
    let report = thread::scope(|threads| {
        let recorder = threads.spawn(|| recorder.run());
        let mut memories = MemoryProducer::new(memories);
        hand_over(&mut loaded.controller.clone(), &mut memories, &links.cycles);
        drop(links);
        recorder.join().unwrap()
    });
    let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    (report, paths)
}

/// Records the cycles. Returns the report, and for each file the items and the replay.
fn files_of(
    loaded: &Loaded,
    hand_over: impl FnOnce(&mut Controller, &mut MemoryProducer<'_>, &SyncSender<Recorded>),
) -> (RecorderReport, Vec<(Vec<Item>, Replay)>) {
    let folder = tempfile::tempdir().unwrap();
    let (report, paths) = recorded_in(folder.path(), loaded, hand_over);
    let file = |path: &PathBuf| {
        let recording = Recording::open(path).unwrap();
        let mut items = vec![];
        recording.each(|item| items.push(item)).unwrap();
        let info = recording.summary().unwrap().info;
        let config = Config::parse(&info.configuration, "a recording").unwrap();
        let (_, replay) = replay(&recording, recorded_controller(&info, &config)).unwrap();
        (items, replay)
    };
    (report, paths.iter().map(file).collect())
}

/// Records cycles except those for which `is_lost` is true.
fn recorded(count: u64, is_lost: impl Fn(u64) -> bool, change: impl Fn(&mut CycleMessage)) -> Outcome {
    let (report, mut files) = files_of(&loaded(""), |controller, memories, queue| {
        run_cycles(controller, memories, queue, 1..=count, is_lost, change);
    });
    let (items, replay) = files.pop().unwrap();
    assert!(files.is_empty());
    Outcome { report, items, replay }
}

fn numbers(replay: &Replay) -> [u64; 3] {
    [replay.compared, replay.unknown_count(), replay.different]
}

#[test]
fn lost_cycles_are_counted_and_marked_and_the_replay_goes_on_behind_them() {
    // The queue holds 2000 cycles. The copy of the memory may be ahead of the recorder by as many.
    let Outcome { report, items, replay } = recorded(9000, |cycle| (1501..=1510).contains(&cycle), |_| ());
    assert_eq!((report.cycles, report.missing, report.is_repeatable), (8990, 10, false));
    let mark = Item::Gap(GapMessage { first_cycle: 1501, cycles: 10 });
    let gap = items.iter().position(|item| *item == mark).unwrap();
    assert!(matches!(&items[gap + 1], Item::Cycle(after) if after.cycle == 1511));
    let [compared, unknown, different] = numbers(&replay);
    assert_eq!((compared + unknown, different), (8990, 0));
    assert!((1500 + 4000..8990).contains(&compared), "{compared} compared");
    let resumed = items.iter().find_map(|item| match item {
        Item::Memory { cycle, .. } if *cycle > 1501 => Some(*cycle),
        _ => None,
    });
    assert_eq!(resumed, Some(1511 + unknown), "from this memory on everything is compared");
    assert_eq!(replay.unknown, [1511..=1510 + unknown]);
}

#[test]
fn an_output_that_differs_behind_a_gap_is_noticed() {
    let change = |cycle: &mut CycleMessage| {
        if cycle.cycle == 8500 {
            cycle.force_n[2] = f64::from_bits(cycle.force_n[2].to_bits() ^ 1);
        }
    };
    let Outcome { report, replay, .. } = recorded(9000, |cycle| cycle == 1501, change);
    assert!(!report.is_repeatable);
    assert_eq!(replay.different, 1);
    let first = replay.first.unwrap();
    assert_eq!((first.cycle, first.field.as_str()), (8500, "force_n_3"));
}

#[test]
fn both_sides_of_a_reload_are_repeated_and_each_has_its_configuration() {
    let (before, after) = (loaded(""), Arc::new(loaded("position_bandwidth_hz = 3.0")));
    let (report, files) = files_of(&before, |controller, memories, queue| {
        run_cycles(controller, memories, queue, 1..=1500, |_| false, |_| ());
        controller.exchange_configuration(&mut after.controller.clone());
        queue.send(Recorded::Configuration(after)).unwrap();
        run_cycles(controller, memories, queue, 1501..=3000, |_| false, |_| ());
    });
    assert!(report.is_repeatable && report.missing == 0, "{report:?}");
    let replayed: Vec<_> = files.iter().map(|(_, replay)| numbers(replay)).collect();
    assert_eq!(replayed, [[1500, 0, 0], [1500, 0, 0]]);
    let [(first, _), (second, _)] = files.as_slice() else { return };
    assert_eq!((report.cycles, first.len()), (3000, 1502));
    assert!(matches!(second.first(), Some(Item::Memory { cycle: 1501, .. })), "{:?}", second.first());
}

/// A recorder without folders, advanced by the test.
fn in_memory(count: u64) -> (Recorder<'static>, SyncSender<WindowOrder>) {
    let loaded = loaded("");
    let queue: &'static mut MemoryQueue = Box::leak(Box::new(MemoryQueue::new()));
    let (memories, consumer) = queue.split();
    let (mut recorder, links) = Recorder::new(&loaded, consumer, &Folders::default());
    let mut memories = MemoryProducer::new(memories);
    let (sender, cycles) = sync_channel(count as usize);
    run_cycles(&mut loaded.controller.clone(), &mut memories, &sender, 1..=count, |_| false, |_| ());
    for handed in cycles.try_iter() {
        if let Recorded::Cycle(cycle) = handed {
            recorder.add(&cycle);
        }
    }
    (recorder, links.orders)
}

/// Cycles of a window of the last seconds. Asserts that a replay repeats them.
fn window(recorder: &mut Recorder<'_>, orders: &SyncSender<WindowOrder>, last_s: f64) -> Vec<u64> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("last.mcap");
    let (answer, answered) = channel();
    orders.send(WindowOrder { file: File::create(&path).unwrap(), last_s, answer }).unwrap();
    recorder.windows.advance(&recorder.context, &recorder.tape);
    recorder.windows.finish(&recorder.context, &recorder.tape);
    let written = answered.recv().unwrap().unwrap();
    let written: u64 = written.strip_suffix(" cycles").unwrap().parse().unwrap();
    let recording = Recording::open(&path).unwrap();
    let mut cycles = vec![];
    let summary = recording.each(|item| {
        if let Item::Cycle(cycle) = item {
            cycles.push(cycle.cycle);
        }
    });
    assert_eq!((summary.unwrap().unfinished, cycles.len() as u64), (None, written));
    let (_, replay) = replay(&recording, loaded("").controller).unwrap();
    assert_eq!(numbers(&replay), [written, 0, 0], "last {last_s} s");
    cycles
}

#[test]
fn the_last_seconds_are_in_memory_without_a_folder() {
    let (mut recorder, orders) = in_memory(40_500);
    for (last_s, first) in [(1.0, 39_001), (2.6, 37_001), (30.0, 11_001), (1e9, 11_001)] {
        let cycles = window(&mut recorder, &orders, last_s);
        assert!(cycles.iter().copied().eq(first..=40_500), "{last_s} s: from {:?}", cycles.first());
    }
}

#[test]
fn the_copy_of_a_memory_is_that_before_its_cycle_and_is_made_only_where_there_is_room() {
    let mut controller = loaded("").controller;
    let mut queue = MemoryQueue::new();
    let (producer, mut consumer) = queue.split();
    let mut memories = MemoryProducer::new(producer);
    let (sender, _cycles) = sync_channel(100);
    run_cycles(&mut controller, &mut memories, &sender, 1..=50, |_| false, |_| ());
    let CycleMemory { cycle, .. } = consumer.dequeue().unwrap();
    assert_eq!(cycle, 1);
    let before = crate::recording::memory_bytes(controller.memory());
    memories.begin_cycle(controller.memory());
    controller.step(&Input { release_ns: 51_000_000, ..Input::default() });
    let copy = consumer.dequeue().unwrap();
    assert_eq!((copy.cycle, crate::recording::memory_bytes(&copy.memory)), (51, before));
}

/// The disk accepts no data for longer than memory lasts.
#[test]
fn a_long_outage_of_the_disk_is_counted_and_the_recording_goes_on() {
    const OUTAGE: u64 = 45_000;
    const END: u64 = 50_000;
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("record");
    fs::write(&record, "no folder").unwrap();
    let (report, paths) = recorded_in(&record, &loaded(""), |controller, memories, queue| {
        run_cycles(controller, memories, queue, 1..=OUTAGE, |_| false, |_| ());
        // Its writer makes the folder, if it is the first.
        fs::remove_file(&record).unwrap();
        run_cycles(controller, memories, queue, OUTAGE + 1..=END, |_| false, |_| ());
    });
    let [path] = paths.as_slice() else { panic!("one file: {paths:?}") };
    let mut gaps = vec![];
    let add_gap = |item| {
        if let Item::Gap(gap) = item {
            gaps.push(gap);
        }
    };
    let summary = Recording::open(path).unwrap().each(add_gap).unwrap();
    let RecorderReport { cycles, missing, unwritten, is_repeatable, .. } = report;
    assert_eq!((cycles, missing, is_repeatable), (END, 0, true));
    assert_eq!((summary.first.cycle, summary.cycles), (unwritten + 1, END - unwritten));
    assert_eq!(gaps, [GapMessage { first_cycle: 1, cycles: unwritten }], "the file says so, too");
    // Memory holds 30 s. The next attempt is 2 s later, after the cycles that a busy recorder takes at once:
    // at most the queue, 2 s.
    let least = OUTAGE - 30_000 - 2_000 - 1_000;
    assert!((least..=OUTAGE - 30_000 + 2_000 + 2_000).contains(&unwritten), "{unwritten}");
}
