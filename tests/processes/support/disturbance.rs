//! What else goes on while an emergency stop is sent: taken slots, floods, users outside of the group, full file systems.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;

use super::background::Background;
use crate::always_stops::{Hostile, Slots};

/// A user outside of the group.
const OUTSIDER: &[&str] = &["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"];

/// So many threads do something with a new connection without pause; it prints what it must not do.
const PYTHON: &str = r#"
import array, socket, sys, threading, time
line = b'{"version": 1, "request": "status"}\n'
files = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0] * 60))]
def outsider(link):
    print("entered", flush=True)
def pass_files(link):
    link.sendmsg([line], files)
    link.recv(65536)
def act():
    while True:
        try:
            link = socket.socket(socket.AF_UNIX)
            link.connect(sys.argv[1])
            globals()[sys.argv[2]](link)
        except OSError:
            time.sleep(0.0001)
for _ in range(int(sys.argv[3])):
    threading.Thread(target=act, daemon=True).start()
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
    /// Four connections of the group that engage without pause.
    Requests,
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
    Requests(Background<u64>),
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
            Situation::Requests => Self::Requests(flood(socket)),
            Situation::Connections => Self::Connections(Hostile::start(socket, 64)),
            Situation::Outsiders => Self::process(OUTSIDER, socket, "outsider", "64"),
            Situation::Files => Self::process(&["/usr/bin/env"], socket, "pass_files", "16"),
            Situation::Full => {
                Self::Full(["/dev/shm", "/tmp"].map(|folder| filled(Path::new(folder))).into())
            }
        }
    }

    fn process(user: &[&str], socket: &Path, act: &str, count: &str) -> Self {
        let mut child = python(user, PYTHON, &[socket.as_os_str(), act.as_ref(), count.as_ref()]);
        let mut words = BufReader::new(child.stdout.take().expect("a pipe"));
        assert_eq!(line_of(&mut words), "here");
        Self::Process(child, words)
    }

    pub fn end(self) {
        match self {
            Self::None | Self::Slots { .. } => {}
            Self::Requests(flood) => {
                let sent = flood.finish();
                assert!(sent.iter().all(|sent| *sent > 100), "{sent:?} requests");
            }
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

/// Requests without pause; the number of those that were answered. So it is under control again as soon as the fault is cleared, and not
/// before.
fn flood(socket: &Path) -> Background<u64> {
    let socket = socket.to_owned();
    Background::start(4, move |_, stop| {
        let mut stream = UnixStream::connect(&socket).expect("a connection");
        let mut answers = BufReader::new(stream.try_clone().expect("the same connection")).lines();
        let mut answered = 0;
        while !stop.load(Ordering::Relaxed) {
            stream.write_all(b"{\"version\": 1, \"request\": \"engage\"}\n").expect("to send");
            answers.next().expect("an answer").expect("an answer");
            answered += 1;
        }
        answered
    })
}
