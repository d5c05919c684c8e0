//! Every system call of the real-time thread from its first release to its last, seen by strace.
//!
//! The sleep alone is not traced: strace leaves it to a filter in the kernel, so the loop keeps its pace. A
//! fourth daemon loses its pace: there the sleeps are looked at, one by one.
//!
//! The thread asks for its own usage (getrusage) right before the first release and right after the last
//! cycle; what lies between these two calls is the loop's.

use std::fs;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use hexad::daemon::report::Report;

use crate::support::children::{Hexad, hexad};
use crate::support::machine::{Machine, PATIENT, PERIOD_NS};
use crate::support::peer::Controlled;
use hexad_support::not_run::lacking;

const STRACE: [&str; 5] = ["-D", "-f", "-q", "--seccomp-bpf", "-e"];
const ALL_BUT_SLEEPS: &str = "trace=!clock_nanosleep";
const ALL: &str = "trace=all";

/// Cycles that must have been watched.
const LEAST_CYCLES: u64 = 1000;

#[test]
#[ignore = "second tier: measures, so it runs alone"]
// What is traced waits for the tracer, which has no priority.
#[apply(alone)]
fn the_loop_calls_the_system_for_its_sleep_only() {
    if let Err(error) = Command::new("strace").arg("--version").output() {
        lacking(&format!("strace: {error}; apt-get install strace"));
        return;
    }
    watch([("sleep", ALL_BUT_SLEEPS), ("hybrid", ALL_BUT_SLEEPS), ("external", ALL_BUT_SLEEPS)]);
    watch([("sleep", ALL)]);
}

/// Daemons at once, while peers die.
fn watch<const N: usize>(daemons: [(&str, &str); N]) {
    let mut watched = daemons.map(|(release, calls)| (release, calls, traced(release, calls)));
    for _ in 0..3 {
        sleep(Duration::from_millis(500));
        watched.iter_mut().for_each(|(.., controlled)| controlled.replace_peer());
    }
    for (release, calls, controlled) in watched {
        judge(release, calls, &controlled.finish().1);
    }
}

fn traced(release: &str, calls: &str) -> Controlled {
    let machine = Machine::with("system-calls", &format!("[realtime]\nrelease = \"{release}\"\n{PATIENT}"));
    let daemon = hexad();
    let mut command = Command::new("strace");
    command.args(STRACE).arg(calls).arg("-o").arg(machine.path("trace")).arg(daemon.get_program());
    command.arg("run").arg("--config").arg(&machine.file).arg("--report").arg(machine.path("report.json"));
    for (name, value) in daemon.get_envs() {
        match value {
            Some(value) => command.env(name, value),
            None => command.env_remove(name),
        };
    }
    let daemon = Hexad::spawn(&machine, "run", command);
    Controlled::with(machine, daemon)
}

fn judge(release: &str, traced: &str, machine: &Machine) {
    let trace = whole_trace(machine);
    let report = Report::read(&machine.path("report.json")).expect("the report");
    let [(before, calls), (_, io_calls)] = ["hexad-rt", "hexad-io"].map(|name| of_the_loop(&trace, name));
    let is_wait = |call: &&str| match release {
        "external" => call.starts_with("futex(") && call.contains("FUTEX_WAIT"),
        _ => call.starts_with("clock_nanosleep("),
    };
    let (waits, others): (Vec<&str>, Vec<&str>) = calls.iter().copied().partition(is_wait);
    println!(
        "{release}, {traced}: {} cycles; calls of the real-time thread: {} waits, {} others, {before} before the \
         first release; of the io thread among peers that die: {}",
        report.cycles,
        waits.len(),
        others.len(),
        io_calls.len()
    );
    assert!(report.cycles > LEAST_CYCLES, "{release}: {} cycles", report.cycles);
    // What it did before, and what peers make the io thread do, would not have been missed.
    assert!(
        before > 0 && io_calls.iter().any(|call| call.starts_with("mmap(")),
        "{release}: nothing is seen"
    );
    assert!(others.is_empty(), "{release}: {} calls: {:#?}", others.len(), &others[..others.len().min(5)]);
    assert_eq!(waits.is_empty(), release != "external" && traced == ALL_BUT_SLEEPS, "{release}");
    if traced == ALL {
        one_sleep_per_point(&waits);
    }
}

/// Each sleep is until a point of the grid, and no two are until the same.
fn one_sleep_per_point(sleeps: &[&str]) {
    let until = |sleep: &&str| {
        let (_, seconds) = sleep.split_once("{tv_sec=").expect("seconds");
        let (seconds, rest) = seconds.split_once(", tv_nsec=").expect("nanoseconds");
        let (nanoseconds, _) = rest.split_once('}').expect("an end");
        let [seconds, nanoseconds] =
            [seconds, nanoseconds].map(|number| number.parse::<u64>().expect("a number"));
        seconds * 1_000_000_000 + nanoseconds
    };
    let until_ns: Vec<_> = sleeps.iter().map(until).collect();
    assert!(until_ns.windows(2).all(|pair| pair[0] < pair[1]), "two sleeps until one point");
    let off_grid = until_ns.iter().find(|instant_ns| **instant_ns % PERIOD_NS != PERIOD_NS / 2);
    assert_eq!(off_grid, None, "a sleep that no cycle needs");
}

/// The trace, when strace has written its end: it outlives the daemon by a moment.
fn whole_trace(machine: &Machine) -> String {
    for _ in 0..1000 {
        let text = fs::read_to_string(machine.path("trace")).expect("the trace");
        if text.lines().last().is_some_and(|line| line.ends_with("+++ exited with 0 +++")) {
            return text;
        }
        sleep(Duration::from_millis(10));
    }
    panic!("strace does not end");
}

/// How many calls a thread made before its loop, and the calls of the loop.
fn of_the_loop<'t>(trace: &'t str, name: &str) -> (usize, Vec<&'t str>) {
    let named = format!("prctl(PR_SET_NAME, \"{name}\"");
    let line = trace.lines().find(|line| line.contains(&named)).unwrap_or_else(|| panic!("no thread {name}"));
    let thread = line.split_whitespace().next().expect("a thread number");
    let calls =
        trace.lines().filter_map(|line| line.strip_prefix(thread)?.strip_prefix(' ').map(str::trim_start));
    // A call that is interrupted by another thread's has a second line.
    let calls: Vec<_> = calls.filter(|call| !call.starts_with("<...")).collect();
    let marks: Vec<_> =
        (0..calls.len()).filter(|k| calls[*k].starts_with("getrusage(RUSAGE_THREAD")).collect();
    let [.., first, last] = marks[..] else { panic!("{name} never ended its loop: {marks:?}") };
    (first, calls[first + 1..last].to_vec())
}
