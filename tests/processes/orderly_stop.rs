//! SIGTERM and SIGINT: every process ends by itself, and the daemon brings the platform to rest first.

use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad::daemon::report::Report;

use crate::support::children::{HANG, Hexad};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;
use crate::support::trio::{Trio, fastest, player_ended, start_daemon, start_setpoints};
use crate::support::{operator, rules};

/// What ends later hangs: a busy host has held up the removal of files at the end of all processes for more than 2 s.
const SOON: Duration = Duration::from_secs(20);

/// The daemon first: the platform is in motion under its force. All other tests end everything by SIGTERM.
#[test]
#[apply(beside_others)]
fn sigint_ends_each_process_in_order() {
    let Trio { setpoints, daemon, plant, recorder, machine } = Trio::in_motion("orderly-stop");
    let ended = daemon.stops_on("INT", SOON);
    assert!(ended.stderr.contains("stopping"), "{}", ended.stderr);
    // At rest the daemon says why it does not engage: of two such messages the plant reads the newest.
    plant.says("): brakes closing");
    setpoints.into_iter().for_each(player_ended);
    recorder.until("the platform stands", |recording| {
        recording.measured.last().filter(|m| rules::stands(m)).map(drop)
    });
    plant.stops_on("INT", SOON);

    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.measured.iter().any(|measured| fastest(measured) > 0.1), "it was in motion");
    rules::ends_at_rest(&recording);
    let report = Report::read(&machine.path("report.json")).expect("the report");
    assert!(report.faults.is_empty() && report.cycles > 0, "{report:#?}");
    let counted = counts(&machine.path("histogram.csv"));
    let Report { wakeup_ns, compute_ns, measured_age_ns, end_to_end_ns, .. } = &report;
    let reported = [wakeup_ns, compute_ns, measured_age_ns, end_to_end_ns].map(|times| times.count);
    assert_eq!(counted, reported, "the same times in the report and in the histogram");
    let [force, status] =
        [recording.forces.last().map(|it| it.header), recording.statuses.last().map(|it| it.header)];
    assert_eq!(force.map(|header| header.sequence), status.map(|header| header.sequence));
}

/// How many times of each kind a histogram holds.
fn counts(path: &Path) -> [u64; 4] {
    let text = fs::read_to_string(path).expect("the histogram");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time,ns,count"));
    let rows: Vec<Vec<_>> = lines.map(|line| line.split(',').collect()).collect();
    let number = |text: &str| text.parse::<u64>().unwrap_or_else(|_| panic!("a number: {text:?}"));
    ["wakeup", "compute", "measured_age", "end_to_end"]
        .map(|kind| rows.iter().filter(|row| row[0] == kind).map(|row| number(row[2])).sum())
}

/// Two of them would fight for the forces.
#[test]
#[apply(beside_others)]
fn a_second_daemon_of_the_same_machine_is_refused() {
    let mut trio = Trio::in_motion("second");
    start_daemon(&trio.machine).ends().fails(1, "another daemon does");
    trio.daemon.kill();
    // The lock dies with its holder.
    trio.daemon = start_daemon(&trio.machine);
    operator::engage(&trio.machine);
    trio.finish();
}

#[test]
#[apply(beside_others)]
fn processes_that_wait_for_others_stop_as_well() {
    let machine = Machine::patient("waiting-stop");
    let daemon = start_daemon(&machine);
    daemon.says("off: no measurement");
    let setpoints = start_setpoints(&machine);
    setpoints.says("waiting: the pose of the platform is unknown: no measurement");
    setpoints.interrupted_on("INT");
    daemon.stops();
    let report = Report::read(&machine.path("report.json")).expect("the report");
    assert_eq!(report.tracking.position_max_m, 0.0, "nothing was tracked");
}

#[test]
#[apply(beside_others)]
fn an_interrupted_demo_takes_its_processes_with_it() {
    let machine = Machine::patient("demo-stop");
    let charts = machine.path("charts");
    let demo = Hexad::start(
        &machine,
        "demo",
        &["--seconds".as_ref(), "60".as_ref(), "--charts".as_ref(), charts.as_os_str()],
    );
    let name = format!("{}-demo-{}", machine.name, demo.id());
    let recorder = Recorder::start(&name);
    recorder
        .until("forces are valid", |recording| recording.forces.last().filter(|f| f.valid == 1).map(drop));
    demo.signal("INT");
    demo.ends().fails(1, "stopped by a signal");
    // The daemon is told to stop when the demo is gone; nobody sends after that.
    let count = || {
        let recording = recorder.so_far();
        (recording.measured.len(), recording.statuses.len())
    };
    let start = Instant::now();
    loop {
        let before = count();
        sleep(Duration::from_millis(200));
        if count() == before {
            break;
        }
        assert!(start.elapsed() < HANG, "its children run on");
    }
}
