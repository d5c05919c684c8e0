//! Recordings of earlier versions of hexad: their commands read them for ever, and a replay repeats them or shows the difference.

use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{env, fs, thread};

use hexad::commands::plant::hardware;
use hexad::config::Config;
use hexad::control::signals::state::{Request, State};
use hexad::daemon::replay::recorded_controller;
use hexad::messages::lockstep::{REPEAT_INTERVAL, poll_until};
use hexad::messages::{Bus, CommandMessage, CycleMessage, ForceMessage, MeasuredMessage, SetpointMessage};
use hexad::motion::minimum_jerk::{rise, straight_move};
use hexad::output::version::VERSION;
use hexad::realtime::setup::denormals;
use hexad::recording::RunInfo;
use hexad::recording::file::RecordingFile;
use nalgebra::Vector6;

use super::{about, files, read, start_recording};
use crate::common::data;
use crate::support::children::{Ended, HANG};
use crate::support::machine::{Machine, PERIOD_NS};
use crate::support::turns;

/// A recording in `tests/data`, and what is in it.
struct Earlier {
    name: &'static str,
    version: &'static str,
    commit: &'static str,
    /// Cycles in each state, in the order of [`State::ALL`].
    cycles: [usize; State::ALL.len()],
    /// Force of the first leg in some cycle \[N\], and its length \[m\].
    example: (u64, f64, f64),
}

const EARLIER: [Earlier; 1] = [Earlier {
    name: "hexad-2026-11-25",
    version: "0.1.0",
    commit: "8a870b4060c8",
    cycles: [1, 8, 1, 99, 67, 0, 4],
    example: (100, 17.904504276401767, 1.2114118007968577),
}];

impl Earlier {
    fn file(&self) -> PathBuf {
        data(self.name, "mcap")
    }

    fn count(&self) -> usize {
        self.cycles.iter().sum()
    }
}

/// Columns of a table of `hexad convert`.
fn columns(table: &Path, names: [&str; 4]) -> Vec<[String; 4]> {
    let text = fs::read_to_string(table).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let places = names.map(|name| head.split(',').position(|column| column == name).expect(name));
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        places.map(|place| fields[place].into())
    };
    rows.lines().map(row).collect()
}

#[test]
fn recordings_of_earlier_versions_are_reported_converted_and_recovered() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("earlier-read");
    for earlier in &EARLIER {
        let (file, count) = (earlier.file(), earlier.count());
        let page = machine.path("page.html");
        let reported = about(&machine, "report", &file, &["--output", &page.display().to_string()]);
        assert_eq!(reported.status.code(), Some(0), "{}", reported.stderr);
        assert!(reported.stdout.contains(&format!(": {count} cycles, ")), "{}", reported.stdout);
        assert!(fs::read_to_string(&page).unwrap().contains(earlier.commit));

        let table = machine.path("table.csv");
        let converted = about(&machine, "convert", &file, &["--csv", &table.display().to_string()]);
        assert_eq!(converted.status.code(), Some(0), "{}", converted.stderr);
        let rows = columns(&table, ["cycle", "state", "force_1", "measured_length_1"]);
        assert_eq!(rows.len(), count);
        let in_state = |state: State| rows.iter().filter(|row| row[1] == state.name()).count();
        assert_eq!(State::ALL.map(in_state), earlier.cycles);
        let (cycle, force, length) = earlier.example;
        let number = |text: &String| text.parse::<f64>().unwrap();
        let row = rows.iter().find(|row| number(&row[0]) == cycle as f64).unwrap();
        assert_eq!([&row[2], &row[3]].map(number), [force, length]);

        let recovered = about(&machine, "recover", &file, &[]);
        assert!(recovered.stdout.ends_with(": it is complete\n"), "{}", recovered.stdout);
        // As a crash leaves it.
        let bytes = fs::read(&file).unwrap();
        let crashed = machine.path("crashed.mcap");
        fs::write(&crashed, &bytes[..bytes.len() * 2 / 3]).unwrap();
        let Ended { status, stdout, stderr } = about(&machine, "recover", &crashed, &[]);
        assert_eq!(status.code(), Some(0), "{stderr}");
        let (summary, _) = read(&crashed);
        assert!(stdout.contains(&format!(": {} cycles, ", summary.cycles)), "{stdout}");
        assert!(summary.unfinished.is_none() && summary.cycles as usize > count / 3, "{}", summary.cycles);
        is_repeated_or_differs(&machine, &crashed, earlier);
    }
}

/// A replay repeats every cycle, or names the first difference and both versions.
fn is_repeated_or_differs(machine: &Machine, file: &Path, Earlier { version, commit, .. }: &Earlier) {
    let Ended { status, stdout, stderr } = about(machine, "replay", file, &[]);
    let [recorded, here] = [format!("hexad {version} (commit {commit})"), format!("hexad {VERSION}")];
    assert!(stdout.contains(&recorded), "{stdout}");
    assert!(stdout.contains(&format!("the version is another one here: {here}")), "{stdout}");
    let (summary, _) = read(file);
    let same = format!("\n{} cycles repeated: every output is the same to the bit\n", summary.cycles);
    match status.code() {
        Some(0) => assert!(stdout.contains(&same), "{stdout}"),
        _ => assert!(
            status.code() == Some(1)
                && stdout.contains("\nfirst: cycle ")
                && [&recorded, &here].iter().all(|version| stderr.contains(*version)),
            "{stdout}{stderr}"
        ),
    }
}

#[test]
fn recordings_of_earlier_versions_are_repeated_or_the_first_difference_is_named() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("earlier-replayed");
    for earlier in &EARLIER {
        is_repeated_or_differs(&machine, &earlier.file(), earlier);
    }
}

/// What this version computes, as another one would have recorded it.
#[test]
fn a_replay_of_another_version_names_both_versions_and_the_first_difference() {
    let _turn = turns::beside_others();
    let machine = Machine::patient("other-version-replayed");
    let (summary, mut cycles) = read(&EARLIER[0].file());
    let config = Config::parse(&summary.info.configuration, "the recording").unwrap();
    let other = RunInfo { version: "0.0.9".into(), commit: "0123456789ab".into(), ..summary.info };
    let mut controller = recorded_controller(&other, &config);
    // A replay flushes denormal numbers in its thread.
    let compute = || {
        denormals::flush();
        for cycle in &mut cycles {
            let input = cycle.input().unwrap();
            *cycle = CycleMessage::new(&input, &controller.step(&input)).timed_as(cycle);
        }
    };
    thread::scope(|scope| scope.spawn(compute).join().unwrap());
    let write = |name: &str, cycles: &[CycleMessage]| {
        let path = machine.path(name);
        let mut file = RecordingFile::create(&path, &other, None).unwrap();
        cycles.iter().for_each(|cycle| file.write_cycle(cycle).unwrap());
        file.finish().unwrap()
    };
    let same = about(&machine, "replay", &write("same.mcap", &cycles), &[]);
    assert_eq!(same.status.code(), Some(0), "{}{}", same.stdout, same.stderr);
    for words in [
        "hexad 0.0.9 (commit 0123456789ab), ",
        &format!("the version is another one here: hexad {VERSION}\n"),
        "every output is the same to the bit",
    ] {
        assert!(same.stdout.contains(words), "{words} must be in {}", same.stdout);
    }

    let (middle, number) = (cycles.len() / 2, cycles[cycles.len() / 2].cycle);
    cycles[middle].force_n[2] += 1e-9;
    cycles[middle + 1].position_m[0] += 1.0;
    let Ended { status, stdout, stderr } = about(&machine, "replay", &write("other.mcap", &cycles), &[]);
    assert_eq!(status.code(), Some(1), "{stdout}{stderr}");
    assert!(
        stdout.contains("\n2 of ") && stdout.contains(&format!("\nfirst: cycle {number} (t = ")),
        "{stdout}"
    );
    assert!(stdout.contains(" s), force_n_3: ") && stdout.contains(" s), position_m_1: "), "{stdout}");
    for version in ["hexad 0.0.9 (commit 0123456789ab)", &format!("hexad {VERSION}")] {
        assert!(stderr.contains(version), "{version} must be in {stderr}");
    }
}

/// When something happens in a file for `tests/data` \[cycles\].
const REQUESTS: [(u64, Request); 4] =
    [(5, Request::Engage), (105, Request::Stop), (172, Request::Estop), (176, Request::Clear)];
const BEGIN: u64 = 12;
const END: u64 = 180;

/// `HEXAD_RECORD_FILE=FILE`: in lock-step, so that it is the same whoever records it, but for the timing.
#[test]
#[ignore = "records a file for tests/data, for a person"]
fn record() {
    let to = env::var("HEXAD_RECORD_FILE").expect("HEXAD_RECORD_FILE: the file");
    let machine = Machine::with("earlier", "[realtime]\nrelease = \"lockstep\"");
    let config = Config::load(&machine.file).unwrap();
    let (mut hardware, home) = (hardware(&config), Vector6::from(config.machine.home));
    let bus = Bus::join_simulated(&machine.name).expect("to join");
    let mut measured = bus.publisher::<MeasuredMessage>().expect("to publish");
    let mut setpoints = bus.publisher::<SetpointMessage>().expect("to publish");
    let mut requests = bus.publisher::<CommandMessage>().expect("to publish");
    let mut forces = bus.subscriber::<ForceMessage>(8).expect("to subscribe");
    let daemon = start_recording(&machine);
    for cycle in 1..=END {
        let time_ns = cycle * PERIOD_NS;
        let (length_m, length_rate_m_s) = hardware.measure();
        let message =
            MeasuredMessage { length_m, length_rate_m_s, rates_valid: 1, ..MeasuredMessage::default() };
        let t = cycle.saturating_sub(BEGIN) as f64 * 1e-3;
        let task = straight_move(&home, &home.add_scalar(0.02), &rise(t, 0.2));
        let begin = Instant::now();
        let force = loop {
            measured.publish(time_ns, message).expect("to send");
            if let Some((_, request)) = REQUESTS.iter().find(|(at, _)| *at == cycle) {
                requests.publish(time_ns, (*request).into()).expect("to send");
            }
            setpoints.publish(time_ns, (&task).into()).expect("to send");
            let sent = Instant::now();
            let force = poll_until(|| sent.elapsed() > REPEAT_INTERVAL, || forces.receive());
            if let Some(force) = force {
                break force;
            }
            assert!(begin.elapsed() < HANG, "no force for cycle {cycle}");
        };
        hardware.advance(PERIOD_NS, (force.valid == 1).then_some(force.force_n));
    }
    daemon.stops_on("TERM", HANG);
    let recorded = files(&machine, "record");
    fs::copy(&recorded[0], &to).unwrap();
    let (summary, cycles) = read(Path::new(&to));
    let in_state = |state: State| cycles.iter().filter(|it| it.state == state as u32).count();
    println!("{} {} {:?}", summary.info.version, summary.info.commit, State::ALL.map(in_state));
    println!("{:?}", cycles.iter().map(|it| (it.cycle, it.force_n[0], it.measured_length_m[0])).nth(99));
}
