//! Recordings of real processes are repeated to the bit. `tests/golden` shows it for every mode, fidelity and policy.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::{Request, State};

use super::{about, files, read, replays_exactly, start_recording};
use crate::support::children::{Ended, HANG, Hexad, hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::ask;
use crate::support::trio::start_plant;

/// Time in which something happens in each part of a run; the motion begins a second after control.
const WHILE: Duration = Duration::from_millis(1800);
/// Time after a source has died: longer than its timeout, and than the stop.
const AFTERWARDS: Duration = Duration::from_millis(1200);

/// Short: the search for its amplitude takes a share of its length.
const MOTION: [&str; 4] = ["--motion", "sines", "--seconds", "6"];

/// Motion, stop, motion, a source that dies, clear, motion, estop, clear.
fn eventful_run() -> Machine {
    let machine = Machine::with("recorded", &format!("{PATIENT}\n[control]\nfidelity = \"auto\"\n"));
    let plant = start_plant(&machine);
    let daemon = start_recording(&machine);
    daemon.says("running");
    for end in ["stop", "", "estop"] {
        let mut source = Hexad::start(&machine, "move", &MOTION);
        let _ = ask(&machine, "engage", &["--wait", "--within", "10"]);
        sleep(WHILE);
        if end.is_empty() {
            if source.runs() {
                source.kill();
            }
            sleep(AFTERWARDS);
        } else {
            let _ = ask(&machine, end, &[]);
        }
        let _ = ask(&machine, "clear", &[]);
    }
    daemon.stops_on("TERM", HANG);
    plant.stops_on("TERM", HANG);
    machine
}

/// The run is in one file, as is each fault; all of them are repeated.
fn holds(machine: &Machine) {
    let recorded = files(machine, "record");
    let [file] = recorded.as_slice() else { panic!("one recording: {recorded:?}") };
    for file in files(machine, "faults").iter().chain([file]) {
        replays_exactly(machine, file);
    }
    let (_, cycles) = read(file);
    let seen: BTreeSet<u32> = cycles.iter().map(|cycle| cycle.state).collect();
    another_system_repeats(machine, file);
    for state in [State::Active, State::Fault] {
        assert!(seen.contains(&(state as u32)), "{state:?} in {seen:?}");
    }
    let requests: BTreeSet<u32> =
        cycles.iter().filter(|cycle| cycle.has_request == 1).map(|it| it.request).collect();
    for request in [Request::Engage, Request::Clear, Request::Stop, Request::Estop] {
        assert!(requests.contains(&(request as u32)), "{request:?} in {requests:?}");
    }
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_recording_is_repeated_cut_converted_and_compared() {
    let machine = eventful_run();
    holds(&machine);
    let file = &files(&machine, "record")[0];
    would_be_different_with_another_configuration(&machine, file);
    a_part_is_repeated_alone(&machine, file);
    let faults = files(&machine, "faults");
    let window = faults.iter().find(|file| file.display().to_string().contains("fault-100-")).unwrap();
    a_window_becomes_a_table(&machine, window);
}

fn would_be_different_with_another_configuration(machine: &Machine, file: &Path) {
    let text = fs::read_to_string(&machine.file).unwrap();
    let other = machine.path("other.toml");
    fs::write(&other, text.replace("[control]", "[control]\nposition_bandwidth_hz = 5.0")).unwrap();
    let Ended { status, stdout, stderr } =
        about(machine, "replay", file, &["--config", &other.display().to_string()]);
    assert_eq!(status.code(), Some(0), "{stderr}");
    let first = stdout.lines().find_map(|line| line.strip_prefix("first: cycle ")).expect("a difference");
    let first: u64 = first.split(' ').next().unwrap().parse().unwrap();
    // Feedback is the first that differs, and with it the forces: under control, and not before.
    let (_, cycles) = read(file);
    let cycle = cycles.iter().find(|cycle| cycle.cycle == first).unwrap();
    assert!([State::Engaging, State::Active].iter().any(|state| *state as u32 == cycle.state), "{cycle:?}");
    // After a pause of the host a slower loop may refuse a measurement as too old.
    let is_refused = cycle.missed_measurements > 0 && stdout.contains(" s), missed_measurements: ");
    let is_force = stdout.contains(" s), force_n_");
    assert!(stdout.contains(" cycles differ\n") && (is_force || is_refused), "{stdout}");
}

fn a_part_is_repeated_alone(machine: &Machine, file: &Path) {
    let part = machine.path("part.mcap");
    let output = part.display().to_string();
    let ended = about(machine, "replay", file, &["--extract", "2.5..3", "--output", &output]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    replays_exactly(machine, &part);
    let (_, cycles) = read(&part);
    // It begins with the memory of cycle 2001, and holds half a second after cycle 2501.
    assert!((2001..=2501).contains(&cycles[0].cycle) && cycles.len() <= 1001, "{}", cycles[0].cycle);
    let ended = about(machine, "replay", file, &["--extract", "1000..1001", "--output", &output]);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.stdout);
    assert!(ended.stderr.contains("no cycle is in 1000.0..=1001.0 s"), "{}", ended.stderr);
}

/// A system repeats it whose C library may use neither AVX2 nor FMA, and rounds its functions in other places.
fn another_system_repeats(machine: &Machine, file: &Path) {
    let mut command = hexad();
    command.arg("replay").arg(file).env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F");
    let Ended { status, stdout, stderr } = Hexad::spawn(machine, "replay", command).ends_within(HANG);
    assert_eq!(status.code(), Some(0), "{stdout}{stderr}");
    assert!(stdout.contains("repeated: every output is the same to the bit\n"), "{stdout}");
}

fn a_window_becomes_a_table(machine: &Machine, window: &Path) {
    let table = machine.path("window.csv");
    let ended = about(machine, "convert", window, &["--csv", &table.display().to_string()]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let text = fs::read_to_string(&table).unwrap();
    let begin = "cycle,t,wakeup_ns,compute_ns,setpoint_t,setpoint_alpha,";
    assert!(text.starts_with(begin), "{}", text.lines().next().unwrap());
    let columns: Vec<_> = text.lines().next().unwrap().split(',').collect();
    let place = |name: &str| columns.iter().position(|column| *column == name).expect(name);
    let [cycle, t, code, force, length] =
        ["cycle", "t", "diagnostic_code", "drive_command_6", "measured_length_6"].map(place);
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        // The last columns are names.
        .map(|line| line.split(',').map(|number| number.parse().unwrap_or(f64::INFINITY)).collect())
        .collect();
    let (summary, cycles) = read(window);
    assert_eq!(rows.len(), cycles.len());
    for (row, message) in rows.iter().zip(&cycles) {
        assert_eq!((row.len(), row[cycle]), (columns.len(), message.cycle as f64));
        assert_eq!(row[force], message.force_n[5]);
        // In the first cycles there may be no measurement.
        let is_missing = message.has_measurement == 0 && row[length].is_nan();
        assert!(is_missing || row[length] == message.measured_length_m[5], "{}", row[length]);
    }
    let fault = rows.iter().find(|row| row[cycle] as u64 == summary.fault.unwrap()).unwrap();
    assert_eq!((fault[t], fault[code]), (0.0, f64::from(DiagnosticCode::SetpointLost as u32)));
    // A second after the fault belongs to it, and what was before.
    assert!(
        rows[rows.len() - 1][t] >= 0.999 && rows[0][t] < -0.5,
        "{} to {}",
        rows[0][t],
        rows[rows.len() - 1][t]
    );
}
