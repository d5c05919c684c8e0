//! Child processes of a demonstration. They end with it at the latest.

use core::time::Duration;
use std::ffi::OsStr;
use std::process::{Child, Command, ExitStatus, Stdio, id};
use std::thread::sleep;
use std::time::Instant;
use std::{env, io};

use hexad_client::realtime::process::terminate;
use hexad_daemon::CONFIGURATION_LOG;
use hexad_machine::log::{FILTER_VARIABLES, FORMAT_VARIABLE, format_name};

/// Environment variable with the process ID of the parent. A child stops when that process dies.
pub const PARENT_VARIABLE: &str = "HEXAD_PARENT";

/// Time in which a process must stop before it is killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);

/// Running child process, killed when dropped.
pub struct ChildProcess {
    pub name: &'static str,
    child: Child,
}

impl ChildProcess {
    /// Starts `hexad <name> <arguments>`; only its warnings are shown, unless a filter is set.
    pub fn start<S: AsRef<OsStr>>(
        name: &'static str,
        arguments: impl IntoIterator<Item = S>,
    ) -> io::Result<Self> {
        let mut command = Command::new(env::current_exe()?);
        if FILTER_VARIABLES.iter().all(|name| env::var_os(name).is_none()) {
            // Warnings about the configuration concern a copy. The demonstration itself shows those of the
            // original file.
            command.env("HEXAD_LOG", format!("warn,{CONFIGURATION_LOG}=error"));
        }
        let child = command
            .arg(name)
            .args(arguments)
            .env(FORMAT_VARIABLE, format_name())
            .env(PARENT_VARIABLE, id().to_string())
            .stdin(Stdio::null())
            .spawn()?;
        Ok(Self { name, child })
    }

    /// Exit status, if the process has ended.
    pub fn exit_status(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }

    /// Stops the process and waits for its end. Kills it if it does not end in time.
    pub fn stop(mut self) -> io::Result<ExitStatus> {
        if self.exit_status()?.is_none() {
            terminate(self.child.id());
        }
        let began = Instant::now();
        loop {
            if let Some(status) = self.exit_status()? {
                return Ok(status);
            }
            if began.elapsed() > STOP_TIMEOUT {
                self.child.kill()?;
            }
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        // Both calls fail only if the process has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
