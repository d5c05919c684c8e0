//! The processes of a demonstration: started, watched, stopped; never left behind.

use core::time::Duration;
use std::ffi::OsStr;
use std::process::{Child, Command, ExitStatus, Stdio, id};
use std::thread::sleep;
use std::time::Instant;
use std::{env, io};

use crate::realtime::process::terminate;

/// Environment variable with the process number of the demo: a child stops when that process dies.
pub const PARENT: &str = "HEXAD_PARENT";

/// Time for a process to stop in order before it is killed.
const PATIENCE: Duration = Duration::from_secs(5);

/// A running child; killed when dropped.
pub struct Process {
    pub name: &'static str,
    child: Child,
}

impl Process {
    /// Starts `hexad <name> <arguments>`; only its warnings are shown.
    pub fn start<S: AsRef<OsStr>>(
        name: &'static str,
        arguments: impl IntoIterator<Item = S>,
    ) -> io::Result<Self> {
        let child = Command::new(env::current_exe()?)
            .arg(name)
            .args(arguments)
            .env("HEXAD_LOG", "warn")
            .env(PARENT, id().to_string())
            .stdin(Stdio::null())
            .spawn()?;
        Ok(Self { name, child })
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }

    /// Asks it to stop and waits; kills it if it does not.
    pub fn stop(mut self) -> io::Result<ExitStatus> {
        if self.ended()?.is_none() {
            terminate(self.child.id());
        }
        let asked = Instant::now();
        loop {
            if let Some(status) = self.ended()? {
                return Ok(status);
            }
            if asked.elapsed() > PATIENCE {
                self.child.kill()?;
            }
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail only if it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
