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

impl Ended {
    /// It must have succeeded; its standard output.
    pub fn succeeds(self) -> String {
        assert_eq!(self.status.code(), Some(0), "{}{}", self.stdout, self.stderr);
        self.stdout
    }

    /// It must have failed with this code, and these words on standard error, which is returned.
    pub fn fails(self, code: i32, words: &str) -> String {
        let Self { status, stdout, stderr } = self;
        assert_eq!(status.code(), Some(code), "{stdout}{stderr}");
        assert!(stderr.contains(words), "{words:?} must be in {stderr}");
        stderr
    }
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

    pub fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }

    /// SIGSTOP, and all its threads stand. One of them has to run to begin with that: on a busy machine this
    /// takes a while.
    pub fn hold(&self) {
        self.signal("STOP");
        self.waits(|| all_stopped(self.id()), "stop");
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
        self.waits(|| self.words().contains(words), &format!("say {words:?}"));
    }

    /// Waits until it has said this, or has ended.
    pub fn says_or_has_ended(&mut self, words: &str) {
        let start = Instant::now();
        while !self.words().contains(words) && self.runs() {
            assert!(
                start.elapsed() < HANG,
                "{} must say {words:?}, and said:\n{}",
                self.command,
                self.words()
            );
            sleep(LOOK);
        }
    }

    /// Waits until something is so.
    pub fn waits(&self, is_so: impl Fn() -> bool, what: &str) {
        let start = Instant::now();
        while !is_so() {
            assert!(start.elapsed() < HANG, "{} must {what}, and said:\n{}", self.command, self.words());
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
            assert!(start.elapsed() < limit, "{} does not end:\n{}", self.command, self.words());
            sleep(LOOK);
        };
        Ended { status, stdout: self.printed(), stderr: self.words() }
    }

    /// Waits for its end.
    pub fn ends(self) -> Ended {
        self.ends_within(HANG)
    }

    /// Sends a signal; it must end in order.
    pub fn stops_on(self, signal: &str, limit: Duration) -> Ended {
        self.signal(signal);
        let command = self.command.clone();
        let ended = self.ends_within(limit);
        assert_eq!(ended.status.code(), Some(0), "{command} after SIG{signal}:\n{}", ended.stderr);
        ended
    }

    /// It must end in order on SIGTERM; all of its standard error.
    pub fn stops(self) -> String {
        self.stops_on("TERM", HANG).stderr
    }

    /// Sends a signal to what is at work: it must end in order, and say that it was interrupted. Returns its standard error.
    pub fn interrupted_on(self, signal: &str) -> String {
        self.signal(signal);
        self.ends().fails(130, "hexad: interrupted")
    }
}

/// Sends a signal by name. By the shell, which every system has: tests hold no unsafe code.
pub fn signal(process: u32, name: &str) {
    let line = format!("kill -s {name} {process}");
    let status = Command::new("sh").args(["-c", &line]).status().expect("a shell");
    assert!(status.success(), "{line}: {status}");
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
    Hexad::spawn(machine, "hexad", command).ends()
}
