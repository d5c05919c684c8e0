//! Several machines on one host: each has processors of its own, and one command lists them all.

use serde_json::Value;

use crate::support::children::run;
use crate::support::machine::Machine;
use crate::support::trio::start_daemon;

/// A machine whose threads are bound to these processors.
fn bound(test: &str, cpu: usize, io_cpu: usize) -> Machine {
    Machine::with(test, &format!("[realtime]\ncpu = {cpu}\nio_cpu = {io_cpu}"))
}

/// Columns of a machine in the list.
fn listed(machine: &Machine) -> Option<Vec<String>> {
    let stdout = run(machine, &["status"]).succeeds();
    let line = stdout.lines().find(|line| line.starts_with(&format!("{} ", machine.name)))?;
    Some(line.split_whitespace().map(String::from).collect())
}

#[test]
#[apply(beside_others)]
fn two_machines_may_not_share_a_processor() {
    // That a thread cannot be bound to these is only a warning.
    let (first, second, third) =
        (bound("first", 1000, 1001), bound("second", 1002, 1000), bound("third", 1003, 1002));
    let daemon = start_daemon(&first);
    let reason = format!(
        "cannot use processor 1000: {} does (process {}); give each machine its own [realtime] cpu and io_cpu",
        first.name,
        daemon.id()
    );
    start_daemon(&second).ends().fails(1, &reason);
    assert_eq!(listed(&second), None, "its record is gone");
    let beside = start_daemon(&third);
    beside.stops();
    daemon.stops();
    // Its processor is free now.
    start_daemon(&second).stops();
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn the_list_of_machines_has_each_with_state_and_rate() {
    let machines = [bound("listed", 1020, 1021), Machine::patient("listed")];
    let daemons = machines.each_ref().map(start_daemon);
    for (machine, (daemon, processors)) in
        machines.iter().zip(daemons.iter().zip([&["1020,", "1021"][..], &["any"]]))
    {
        let columns = listed(machine).expect("a line");
        assert_eq!(columns[1..5], ["off", "1", "1000", "Hz"]);
        assert_eq!(columns[5..5 + processors.len()], *processors);
        assert_eq!(columns[5 + processors.len()], daemon.id().to_string());
    }
    let lines = run(&machines[0], &["status", "--json"]).stdout;
    let answers: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    for (machine, daemon) in machines.iter().zip(&daemons) {
        let answer = answers.iter().find(|it| it["status"]["machine"] == *machine.name).expect("its answer");
        assert_eq!((&answer["state"], &answer["result"]), (&"off".into(), &"done".into()));
        assert_eq!(answer["status"]["process_id"], daemon.id());
    }
    // One that does not answer is there all the same.
    let [held, other] = daemons;
    held.hold();
    assert_eq!(listed(&machines[0]).expect("a line")[1..3], ["unknown", "unknown"]);
    held.signal("CONT");
    for daemon in [held, other] {
        daemon.stops();
    }
    assert!(machines.iter().all(|machine| listed(machine).is_none()));
}
