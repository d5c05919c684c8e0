//! The load: computing, memory traffic and system calls on every processor, at ordinary priority.

use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use super::Failure;
use super::rig::{Process, Rig};

/// Until its workers are at work.
const START: Duration = Duration::from_millis(300);

/// Ends by itself after this long even if nobody ends it \[s\]: longer than a group of rounds.
const LONGEST_S: u32 = 120;

/// stress-ng; stopped when dropped.
pub struct Load(#[allow(dead_code, reason = "stopped when dropped")] Process);

impl Load {
    pub fn start(rig: &Rig) -> Result<Self, Failure> {
        let mut command = Command::new("stress-ng");
        let allowed = &rig.processors.allowed;
        command.args(["--vm", "1", "--vm-bytes", "64M", "--switch", "1", "--quiet"]).args([
            format!("--cpu={}", allowed.iter().count()),
            format!("--taskset={allowed}"),
            format!("--timeout={LONGEST_S}"),
        ]);
        let mut process = Process::start(rig, &mut command)?;
        sleep(START);
        process.must_run()?;
        Ok(Self(process))
    }
}
