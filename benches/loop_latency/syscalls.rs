//! The system calls of the real-time thread, counted by strace from outside: one sleep a cycle and no other.

use std::fs;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use super::Failure;
use super::contest::{start_daemon, until_active};
use super::driver::Driver;
use super::rig::{Process, Release, Rig};

/// Traced at this rate for so long; strace makes each call some ten times slower.
const RATE_HZ: u32 = 1000;
const TRACED: Duration = Duration::from_secs(1);

/// Name of the daemon's real-time thread.
const THREAD: &str = "hexad-rt";

/// Names and counts, the most frequent first.
pub fn of_the_loop(rig: &Rig, release: Release) -> Result<Vec<(String, u64)>, Failure> {
    let _driver = Driver::start(rig, 1, RATE_HZ)?;
    let mut daemons = [start_daemon(rig, 0, RATE_HZ, release)?];
    until_active(&mut daemons)?;
    let [mut daemon] = daemons;
    let thread = thread_of(daemon.id())?;
    let counts = rig.path("strace.txt");
    let mut command = Command::new("strace");
    command.args(["--summary-only", "--summary-columns=name,calls"]);
    command.arg(format!("--attach={thread}")).arg("--output").arg(&counts);
    let mut strace = Process::start(rig, &mut command)?;
    sleep(TRACED);
    strace.must_run()?;
    // It ends by the signal, after writing its summary.
    drop(strace);
    daemon.stop()?;
    let text = fs::read_to_string(counts)?;
    let mut calls: Vec<_> = text.lines().filter_map(count).filter(|(name, _)| name != "total").collect();
    if calls.is_empty() {
        return Err(format!("strace counted nothing:\n{text}").into());
    }
    calls.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    Ok(calls)
}

/// A line of the summary; the head and the rules have no number.
fn count(line: &str) -> Option<(String, u64)> {
    let mut words = line.split_whitespace();
    let (name, count) = (words.next()?, words.next()?.parse().ok()?);
    Some((name.into(), count))
}

fn thread_of(process: u32) -> Result<String, Failure> {
    for entry in fs::read_dir(format!("/proc/{process}/task"))? {
        let path = entry?.path();
        if fs::read_to_string(path.join("comm"))?.trim_end() == THREAD {
            let name = path.file_name().ok_or("a thread without a number")?;
            return Ok(name.to_string_lossy().into_owned());
        }
    }
    Err(format!("the daemon has no thread {THREAD}").into())
}
