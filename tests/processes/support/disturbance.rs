//! What else goes on while an emergency stop is sent: taken slots, floods, users outside of the group, full file systems.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, spawn};

use hexad::control::signals::state::Request;
use hexad::messages::clock::monotonic_ns;
use hexad::messages::{Bus, CommandMessage};

use crate::always_stops::{Hostile, Slots};

/// A user outside of the group.
const OUTSIDER: &[&str] = &["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];

/// 64 that connect again and again; the number of those that succeeded.
const PYTHON_OUTSIDERS: &str = r#"
import socket, sys, threading, time
entered = 0
def knock():
    global entered
    while True:
        try:
            socket.socket(socket.AF_UNIX).connect(sys.argv[1])
            entered += 1
            print("entered", flush=True)
        except OSError:
            time.sleep(0.0001)
for _ in range(64):
    threading.Thread(target=knock, daemon=True).start()
print("here", flush=True)
time.sleep(3600)
"#;

/// 16 that send lines with more files than the daemon receives.
const PYTHON_FILES: &str = r#"
import array, socket, sys, threading, time
line = b'{"version": 1, "request": "status"}\n'
files = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0] * 60))]
def send():
    while True:
        try:
            link = socket.socket(socket.AF_UNIX)
            link.connect(sys.argv[1])
            link.sendmsg([line], files)
            link.recv(65536)
        except OSError:
            time.sleep(0.0001)
for _ in range(16):
    threading.Thread(target=send, daemon=True).start()
print("here", flush=True)
time.sleep(3600)
"#;

/// What else goes on during an emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    /// Nothing else goes on; the user of the daemon, who is root.
    Quiet,
    /// Every slot of the shared memory is taken.
    Slots,
    /// Requests without pause on the topic.
    Messages,
    /// 64 connections of the group that stay silent, send halves, send without end.
    Connections,
    /// 64 users outside of the group.
    Outsiders,
    /// 16 connections of the group that pass files.
    Files,
    /// 32 emergency stops at once.
    Together,
    /// Sent by a member of the group.
    Member,
    /// `/dev/shm` and `/tmp` are full.
    Full,
}

/// What disturbs, until it is dropped.
pub enum Disturbance {
    None,
    Slots {
        _slots: Box<Slots>,
    },
    Messages(Vec<Flood>),
    Connections(Hostile),
    /// A process that says no word unless it gets what it must not.
    Process(Child, BufReader<std::process::ChildStdout>),
    Full(Vec<PathBuf>),
}

impl Disturbance {
    pub fn begin(situation: Situation, machine: &str, socket: &Path) -> Self {
        match situation {
            Situation::Quiet | Situation::Member | Situation::Together => Self::None,
            Situation::Slots => Self::Slots { _slots: Box::new(Slots::fill(machine)) },
            Situation::Messages => Self::Messages((0..4).map(|_| Flood::start(machine)).collect()),
            Situation::Connections => Self::Connections(Hostile::start(socket, 64)),
            Situation::Outsiders => Self::process(OUTSIDER, PYTHON_OUTSIDERS, socket),
            Situation::Files => Self::process(&["/usr/bin/env"], PYTHON_FILES, socket),
            Situation::Full => {
                Self::Full(["/dev/shm", "/tmp"].map(|folder| filled(Path::new(folder))).into())
            }
        }
    }

    fn process(user: &[&str], program: &str, socket: &Path) -> Self {
        let mut child = python(user, program, &[socket.as_os_str()]);
        let mut words = BufReader::new(child.stdout.take().expect("a pipe"));
        assert_eq!(line_of(&mut words), "here");
        Self::Process(child, words)
    }

    pub fn end(self) {
        match self {
            Self::None | Self::Slots { .. } => {}
            Self::Messages(floods) => floods.into_iter().for_each(Flood::finish),
            Self::Connections(hostile) => println!("the connections sent {} bytes", hostile.finish()),
            Self::Process(mut child, mut words) => {
                child.kill().expect("a signal");
                child.wait().expect("its end");
                assert_eq!(line_of(&mut words), "", "nobody outside of the group may enter");
            }
            Self::Full(files) => files.iter().for_each(|file| fs::remove_file(file).expect("a file")),
        }
    }
}

pub fn python(user: &[&str], program: &str, arguments: &[&OsStr]) -> Child {
    let mut command = Command::new(user[0]);
    command.args(&user[1..]).args(["/usr/bin/env", "python3", "-c", program]).args(arguments);
    command
        .env("PATH", "/usr/bin:/bin")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("a process")
}

pub fn line_of(words: &mut impl BufRead) -> String {
    let mut line = String::new();
    words.read_line(&mut line).expect("a line");
    line.trim().into()
}

/// Fills the file system of a folder to its last byte.
fn filled(folder: &Path) -> PathBuf {
    let path = folder.join("full");
    let mut file = fs::File::create(&path).expect("a file");
    for size in [1 << 20, 1 << 12, 1] {
        while file.write_all(&vec![1; size]).is_ok() {}
    }
    path
}

/// Requests without pause on the topic.
pub struct Flood {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<u64>>,
}

impl Flood {
    fn start(machine: &str) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let thread = {
            let (stop, machine) = (stop.clone(), machine.to_owned());
            spawn(move || {
                let bus = Bus::join(&machine).expect("to join");
                let mut commands = bus.publisher::<CommandMessage>().expect("to publish");
                let mut sent = 0;
                while !stop.load(Ordering::Relaxed) {
                    // So it is under control again as soon as the fault is cleared, and not before.
                    sent += u64::from(commands.publish(monotonic_ns(), Request::Engage.into()).is_ok());
                }
                sent
            })
        };
        Self { stop, thread: Some(thread) }
    }

    fn finish(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let sent = self.thread.take().expect("taken only here").join().expect("a publisher");
        assert!(sent > 1000, "{sent} requests");
    }
}

/// Also when a test has failed: the others need the processors.
impl Drop for Flood {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}
