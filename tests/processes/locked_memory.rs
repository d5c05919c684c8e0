//! A longer run with all memory locked: the real-time thread meets no page for the first time, allocates
//! nothing, and what is locked is not much. Needs root (CAP_IPC_LOCK).

use std::fs;
use std::time::{Duration, Instant};

use hexad::daemon::report::Report;

use crate::support::children::{HANG, Hexad};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;
use crate::support::trio::{start_daemon, start_plant};
use crate::support::{operator, rules};
use hexad_support::certificate::Certificate;
use hexad_support::not_run::lacking;

/// Length of the motion \[s\].
const MOTION_S: u64 = 5;
const LONG_MOTION_S: u64 = 59;

/// What the daemon may keep in memory: 64 MB, and 32 MB of the last 30 s \[kB\].
const MOST_KB: u64 = 96 * 1024;

/// `sysconf(_SC_CLK_TCK)`: 100 on every Linux that matters.
const TICKS_PER_S: f64 = 100.0;

#[test]
#[ignore = "second tier: needs real-time rights"]
#[apply(beside_others)]
fn certificate_the_real_time_thread_uses_nothing_it_did_not_have() {
    let certificate = Certificate::new("locked memory", MOTION_S, LONG_MOTION_S);
    let seconds = certificate.total();
    let machine = Machine::patient("locked-memory");
    let recorder = Recorder::start(&machine.name);
    let plant = start_plant(&machine);
    let daemon = start_daemon(&machine);
    daemon.says("running");
    if daemon.words().contains("no locked memory") {
        lacking(&daemon.words());
        return;
    }
    let start = Instant::now();
    let setpoints = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", &seconds.to_string()]);
    operator::engage(&machine);
    let moved = setpoints.ends_within(Duration::from_secs(seconds) + HANG);
    certificate.advance(seconds);
    assert_eq!(moved.status.code(), Some(0), "{}", moved.stderr);
    let simulated_s = start.elapsed().as_secs_f64();

    let resident_kb = resident_kb(daemon.id());
    let plant_cpu_s = cpu_s(plant.id());
    daemon.stops();
    plant.stops();
    let report = Report::read(&machine.path("report.json")).expect("the report");
    println!(
        "{simulated_s:.1} s: daemon {resident_kb} kB resident; plant {:.4} CPU s per simulated second; {:?}; {:?}",
        plant_cpu_s / simulated_s,
        report.deadline_misses,
        report.rt_thread
    );
    let used = report.rt_thread;
    assert_eq!((used.allocations, used.major_faults, used.minor_faults), (0, 0, 0), "{used:#?}");
    assert!(resident_kb < MOST_KB, "{resident_kb} kB");
    assert!(report.faults.is_empty(), "{:#?}", report.faults);
    rules::hold(&recorder.finish());
    certificate.finish(format_args!(
        "{seconds} s in motion, no allocation and no page fault of the real-time thread, {resident_kb} kB resident"
    ));
}

fn resident_kb(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).expect("the status of a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("VmRSS");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}

/// User and system time.
fn cpu_s(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).expect("the times of a process");
    // The name, in parentheses, may hold anything.
    let (_, after_name) = stat.rsplit_once(')').expect("a name");
    let fields: Vec<_> = after_name.split_whitespace().collect();
    let [user, system] = [fields[11], fields[12]].map(|ticks| ticks.parse::<f64>().expect("a number"));
    (user + system) / TICKS_PER_S
}
