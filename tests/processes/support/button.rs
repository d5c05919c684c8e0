//! An emergency-stop button: a client of the control socket that takes the time.

use std::io::{BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout};

use super::disturbance::{line_of, python};

/// Path of the socket, and number of stops; for each line that it reads that many are sent at once, each over a connection of its own:
/// the first over one that it makes when the time is taken. It writes a line with that time, the time when all was sent, and the answers.
const PYTHON_CLIENT: &str = r#"
import socket, sys, time
def connect():
    link = socket.socket(socket.AF_UNIX)
    link.connect(sys.argv[1])
    return link
for _ in sys.stdin:
    others = [connect() for _ in range(int(sys.argv[2]) - 1)]
    sent = time.monotonic_ns()
    links = [connect(), *others]
    for link in links:
        link.sendall(b'{"version": 1, "request": "estop", "wait": true}\n')
    delivered = time.monotonic_ns()
    print(sent, delivered, *(link.makefile().readline().strip() for link in links), flush=True)
"#;

/// Sends `estop` from a process of its own: in this one it would wait for the memory of whatever records or floods.
pub struct Button {
    /// Stops that it sends at once.
    count: usize,
    child: Child,
    words: BufReader<ChildStdout>,
}

impl Button {
    pub fn connect(user: &[&str], socket: &Path, count: usize) -> Self {
        let mut child = python(user, PYTHON_CLIENT, &[socket.as_os_str(), count.to_string().as_ref()]);
        let words = BufReader::new(child.stdout.take().expect("a pipe"));
        Self { count, child, words }
    }

    /// The instant before it connected, and the one when all was sent \[ns\].
    pub fn press(&mut self) -> [u64; 2] {
        self.child.stdin.as_mut().expect("a pipe").write_all(b"\n").expect("to write");
        let line = line_of(&mut self.words);
        let mut parts = line.splitn(3, ' ');
        let mut instant_ns = || parts.next().and_then(|part| part.parse().ok()).expect("an instant");
        let instants_ns = [instant_ns(), instant_ns()];
        let done = parts.next().map_or(0, |answers| answers.matches("\"result\":\"done\"").count());
        assert_eq!(done, self.count, "{line}");
        instants_ns
    }

    pub fn finish(mut self) {
        drop(self.child.stdin.take());
        self.child.wait().expect("its end");
    }
}
