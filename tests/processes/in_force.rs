//! What the daemon has asked for is in force: read from `/proc`, thread by thread.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::support::children::Hexad;
use crate::support::machine::Machine;
use crate::support::trio::start_daemon;
use hexad_support::not_run::lacking;

/// Scheduling classes as numbers, and a priority or 0: see sched(7).
const OTHER: (u32, u32) = (0, 0);
const FIFO: u32 = 1;
const DEADLINE: u32 = 6;

/// What a thread has.
#[derive(Debug, PartialEq)]
struct Thread {
    class: (u32, u32),
    cpus: String,
}

#[test]
#[ignore = "second tier: needs real-time rights"]
// Daemons that are bound to the same processor are refused: all others with this one run alone.
#[apply(beside_others)]
fn priorities_and_the_processor_of_the_loop_alone() {
    let Some((daemon, _machine)) = granted("priorities_and_the_processor_of_the_loop_alone", "cpu = 0")
    else {
        return;
    };
    let threads = threads(&daemon);
    let everywhere = threads["hexad"].cpus.clone();
    for (name, class, cpus) in [
        ("hexad", OTHER, &everywhere),
        ("hexad-log", (FIFO, 1), &everywhere),
        ("hexad-recorder", (FIFO, 1), &everywhere),
        ("hexad-control", (FIFO, 2), &everywhere),
        ("hexad-io", (FIFO, 79), &everywhere),
        ("hexad-rt", (FIFO, 80), &"0".to_owned()),
    ] {
        assert_eq!(threads[name], Thread { class, cpus: cpus.clone() }, "{name} of {threads:#?}");
    }
    let status = fs::read_to_string(format!("/proc/{}/status", daemon.id())).expect("the status");
    let locked = status.lines().find_map(|line| line.strip_prefix("VmLck:")).expect("VmLck");
    assert_ne!(locked.trim(), "0 kB");
    assert!(holds_idle_states(&daemon));
    daemon.stops();
}

#[test]
#[ignore = "second tier: needs real-time rights"]
#[apply(beside_others)]
fn sched_deadline_for_the_loop_alone() {
    let test = "sched_deadline_for_the_loop_alone";
    let Some((daemon, _machine)) = granted(test, "scheduler = \"deadline\"") else { return };
    let threads = threads(&daemon);
    let classes: Vec<_> =
        ["hexad", "hexad-control", "hexad-io", "hexad-rt"].iter().map(|name| threads[*name].class).collect();
    assert_eq!(classes, [OTHER, (FIFO, 2), (FIFO, 79), (DEADLINE, 0)]);
    daemon.stops();
}

/// A daemon with these keys of `[realtime]`; none, and said so, where the system lacks the rights.
fn granted(test: &str, settings: &str) -> Option<(Hexad, Machine)> {
    let machine = Machine::with(test, &format!("[realtime]\n{settings}\n"));
    let daemon = start_daemon(&machine);
    daemon.says("running");
    let words = daemon.words();
    if words.contains("WARN no ") {
        lacking(&words);
        return None;
    }
    Some((daemon, machine))
}

/// By name.
fn threads(daemon: &Hexad) -> BTreeMap<String, Thread> {
    let tasks = fs::read_dir(format!("/proc/{}/task", daemon.id())).expect("the threads");
    tasks.map(|task| thread(&task.expect("a thread").path())).collect()
}

fn thread(task: &Path) -> (String, Thread) {
    let [stat, status] =
        ["stat", "status"].map(|name| fs::read_to_string(task.join(name)).expect("a thread"));
    let (name, after_name) = stat.rsplit_once(')').expect("a name");
    let (_, name) = name.split_once('(').expect("a name");
    // Fields 40 and 41 of proc_pid_stat(5); the name is the second.
    let fields: Vec<_> = after_name.split_whitespace().collect();
    let [priority, policy] = [fields[37], fields[38]].map(|field| field.parse().expect("a number"));
    let cpus = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).expect("processors");
    (name.to_owned(), Thread { class: (policy, priority), cpus: cpus.trim().to_owned() })
}

fn holds_idle_states(daemon: &Hexad) -> bool {
    let files = fs::read_dir(format!("/proc/{}/fd", daemon.id())).expect("the open files");
    files
        .flatten()
        .any(|file| fs::read_link(file.path()).is_ok_and(|at| at == Path::new("/dev/cpu_dma_latency")))
}
