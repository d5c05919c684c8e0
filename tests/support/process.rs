//! Processes of tests, with their output in a file.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::{panicking, sleep};
use std::time::{Duration, Instant};

/// Longer than this nothing takes, on any host.
pub const HANG: Duration = Duration::from_secs(120);

/// A child that is not left behind, and what it says.
pub struct Process {
    pub child: Child,
    /// File of its output.
    pub log: PathBuf,
}

impl Process {
    /// Starts a command; its output goes into a file.
    pub fn start(mut command: Command, log: PathBuf) -> Self {
        let output = File::create(&log).unwrap();
        command.stdin(Stdio::null()).stdout(output.try_clone().unwrap()).stderr(output);
        Self { child: command.spawn().unwrap(), log }
    }

    /// All of its output.
    pub fn words(&self) -> String {
        fs::read_to_string(&self.log).unwrap()
    }

    /// Waits for words in its output.
    pub fn says(&self, words: &str) {
        self.has_said(words, 1);
    }

    /// Waits until its output has words so many times.
    pub fn has_said(&self, words: &str, times: usize) {
        let began = Instant::now();
        while self.words().matches(words).count() < times {
            assert!(began.elapsed() < HANG, "it must say {words:?}, and said:\n{}", self.words());
            sleep(Duration::from_millis(2));
        }
    }

    /// Waits for its end, without failure.
    pub fn ends_well(self) {
        self.ends_well_within(HANG);
    }

    /// The same for what may take longer.
    pub fn ends_well_within(mut self, longest: Duration) {
        let began = Instant::now();
        loop {
            match self.child.try_wait().unwrap() {
                Some(status) => return assert!(status.success(), "{status}:\n{}", self.words()),
                None => assert!(began.elapsed() < longest, "it does not end:\n{}", self.words()),
            }
            sleep(Duration::from_millis(2));
        }
    }

    /// Ends it in order. By the shell: tests hold no unsafe code.
    pub fn stops(self) {
        let line = format!("kill -s TERM {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
        self.ends_well();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if panicking() {
            eprintln!("--- {}:\n{}", self.log.display(), self.words());
        }
        // Both fail only if it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
