//! In simulated time the recorder holds the loop: no cycle is lost however little of a processor it gets.

use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use hexad::realtime::setup::scheduling;

use super::{files, read, start_recording};
use crate::support::children::{HANG, Hexad};
use crate::support::machine::Machine;
use crate::support::threads::Thread;

/// The processor that the log thread and the recorder share with a thread that never ends.
const CPU: usize = 0;

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn in_lock_step_a_recorder_without_a_processor_loses_no_cycle() {
    let machine = Machine::with("lock-step-recorder", "[realtime]\nrelease = \"lockstep\"");
    let daemon = start_recording(&machine);
    for name in ["hexad-log", "hexad-recorder"] {
        let thread = Thread::of(daemon.id(), name).id();
        for (program, arguments) in [("taskset", ["-cp", "0"].as_slice()), ("chrt", &["--idle", "-p", "0"])] {
            let output = Command::new(program).args(arguments).arg(&thread).output().unwrap();
            assert!(output.status.success(), "{program}: {output:?}");
        }
    }
    let is_over = AtomicBool::new(false);
    thread::scope(|threads| {
        threads.spawn(|| {
            scheduling::bind_to_cpu(CPU).unwrap();
            while !is_over.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
        let plant = Hexad::start::<&str>(&machine, "plant", &[]);
        let source = Hexad::start(&machine, "move", &["--motion", "sines", "--seconds", "3", "--engage"]);
        let ended = source.ends_within(10 * HANG);
        is_over.store(true, Ordering::Relaxed);
        ended.succeeds();
        plant.stops();
    });
    daemon.stops();
    let (summary, cycles) = read(&files(&machine, "record")[0]);
    assert!(summary.unfinished.is_none() && cycles.len() > 3000, "{}", cycles.len());
    let gaps = cycles.windows(2).filter(|pair| pair[1].cycle != pair[0].cycle + 1).count();
    assert_eq!(gaps, 0, "of {} cycles", cycles.len());
}
