//! Children that are never left behind.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{self, Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{panicking, sleep};
use std::time::{Duration, Instant};

use hexad::commands::demo::children::PARENT_VARIABLE;

use super::machine::Machine;
use super::threads::all_stopped;

/// Longer than this nothing may take that has no length of its own.
pub const HANG: Duration = Duration::from_secs(60);

/// How often to look whether something has happened.
const LOOK: Duration = Duration::from_millis(2);

/// A running `hexad`; killed when dropped.
pub struct Hexad {
    child: Child,
    command: String,
    stdout: PathBuf,
    stderr: PathBuf,
}

/// How one ended.
pub struct Ended {
    pub status: ExitStatus,
    pub stdout: String,
    pub stderr: String,
}

/// The command, for those who start it in a special way. It stops when the tests are killed.
pub fn hexad() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
    command.env(PARENT_VARIABLE, process::id().to_string()).env_remove("HEXAD_LOG").stdin(Stdio::null());
    command
}

impl Hexad {
    /// Starts `hexad <command> --config <machine> <more>`.
    pub fn start<S: AsRef<OsStr>>(machine: &Machine, command: &str, more: &[S]) -> Self {
        let mut arguments = hexad();
        arguments.arg(command).arg("--config").arg(&machine.file).args(more);
        Self::spawn(machine, command, arguments)
    }

    /// Starts any command; `machine` lends its folder to the output.
    pub fn spawn(machine: &Machine, name: &str, mut command: Command) -> Self {
        let number = fs::read_dir(machine.folder()).expect("the folder of the machine").count();
        let [stdout, stderr] = ["stdout", "stderr"].map(|s| machine.path(&format!("{number}-{name}.{s}")));
        let [out, err] = [&stdout, &stderr].map(|path| File::create(path).expect("a file for the output"));
        let child = command.stdout(out).stderr(err).spawn().expect("a process");
        Self { child, command: name.into(), stdout, stderr }
    }

    /// The pipe to its standard input.
    pub fn input(&mut self) -> ChildStdin {
        self.child.stdin.take().expect("a pipe")
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal by name. By the shell: tests hold no unsafe code.
    pub fn signal(&self, name: &str) {
        let line = format!("kill -s {name} {}", self.child.id());
        let status = Command::new("sh").args(["-c", &line]).status().expect("a shell");
        assert!(status.success(), "{line}: {status}");
    }

    /// SIGSTOP, and all its threads stand. One of them has to run to begin with that: on a busy machine this
    /// takes a while.
    pub fn hold(&self) {
        self.signal("STOP");
        let start = Instant::now();
        while !all_stopped(self.id()) {
            assert!(start.elapsed() < HANG, "{} does not stop", self.command);
            sleep(LOOK);
        }
    }

    /// SIGKILL, and it is gone.
    pub fn kill(&mut self) {
        self.child.kill().expect("a signal");
        let status = self.child.wait().expect("an ended process");
        assert_eq!(status.code(), None, "{} was to be killed, and had ended: {status}", self.command);
    }

    /// What it has said on standard error.
    pub fn words(&self) -> String {
        fs::read_to_string(&self.stderr).expect("standard error")
    }

    /// What it has written to standard output.
    pub fn printed(&self) -> String {
        fs::read_to_string(&self.stdout).expect("standard output")
    }

    /// Waits until it has said this.
    pub fn says(&self, words: &str) {
        let start = Instant::now();
        while !self.words().contains(words) {
            let command = &self.command;
            assert!(start.elapsed() < HANG, "{command} must say {words:?}, and said:\n{}", self.words());
            sleep(LOOK);
        }
    }

    /// Waits until it has said this, or has ended.
    pub fn says_or_has_ended(&mut self, words: &str) {
        let start = Instant::now();
        while !self.words().contains(words) && self.runs() {
            let command = &self.command;
            assert!(start.elapsed() < HANG, "{command} must say {words:?}, and said:\n{}", self.words());
            sleep(LOOK);
        }
    }

    /// Whether it has not ended.
    pub fn runs(&mut self) -> bool {
        self.child.try_wait().expect("the state of a process").is_none()
    }

    /// Panics if it has ended.
    pub fn must_run(&mut self) {
        let ended = self.child.try_wait().expect("the state of a process");
        assert!(ended.is_none(), "{} ended: {ended:?}\n{}", self.command, self.words());
    }

    /// Waits for its end.
    pub fn ends_within(mut self, limit: Duration) -> Ended {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("the state of a process") {
                break status;
            }
            let command = &self.command;
            assert!(
                start.elapsed() < limit,
                "{command} must end within {limit:?}, and said:\n{}",
                self.words()
            );
            sleep(LOOK);
        };
        let stdout = fs::read_to_string(&self.stdout).expect("standard output");
        Ended { status, stdout, stderr: self.words() }
    }

    /// Sends a signal; it must end in order.
    pub fn stops_on(self, signal: &str, limit: Duration) -> Ended {
        self.signal(signal);
        let command = self.command.clone();
        let ended = self.ends_within(limit);
        assert_eq!(ended.status.code(), Some(0), "{command} after SIG{signal}:\n{}", ended.stderr);
        ended
    }

    /// Sends a signal to what is at work: it must end in order, and say that it was interrupted.
    pub fn interrupted_on(self, signal: &str, limit: Duration) -> Ended {
        self.signal(signal);
        let command = self.command.clone();
        let ended = self.ends_within(limit);
        assert_eq!(ended.status.code(), Some(130), "{command} after SIG{signal}:\n{}", ended.stderr);
        assert!(ended.stderr.contains("hexad: interrupted"), "{}", ended.stderr);
        ended
    }
}

impl Drop for Hexad {
    fn drop(&mut self) {
        if panicking() {
            eprintln!("--- {} said:\n{}", self.command, fs::read_to_string(&self.stderr).unwrap_or_default());
        }
        // Both fail only if it has ended already. A stopped process dies of SIGKILL too.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a short command to its end.
pub fn run<S: AsRef<OsStr>>(machine: &Machine, arguments: &[S]) -> Ended {
    let mut command = hexad();
    command.args(arguments);
    Hexad::spawn(machine, "hexad", command).ends_within(HANG)
}
