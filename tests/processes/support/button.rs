//! An emergency-stop button: a client of the control socket that takes the time.

use std::io::{BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout};

use super::disturbance::{line_of, python};

/// Path of the socket; for each line that it reads a line with the time, the time when all was sent, and the answer.
const PYTHON_CLIENT: &str = r#"
import socket, sys, time
for _ in sys.stdin:
    sent = time.monotonic_ns()
    link = socket.socket(socket.AF_UNIX)
    link.connect(sys.argv[1])
    link.sendall(b'{"version": 1, "request": "estop", "wait": true}\n')
    delivered = time.monotonic_ns()
    print(sent, delivered, link.makefile().readline().strip(), flush=True)
"#;

/// Sends `estop` from a process of its own: in this one it would wait for the memory of whatever records or floods.
pub struct Button {
    child: Child,
    words: BufReader<ChildStdout>,
}

impl Button {
    pub fn connect(user: &[&str], socket: &Path) -> Self {
        let mut child = python(user, PYTHON_CLIENT, socket);
        let words = BufReader::new(child.stdout.take().expect("a pipe"));
        Self { child, words }
    }

    /// The instant before it connected, and the one when all was sent \[ns\].
    pub fn press(&mut self) -> [u64; 2] {
        self.child.stdin.as_mut().expect("a pipe").write_all(b"\n").expect("to write");
        let line = line_of(&mut self.words);
        let mut parts = line.splitn(3, ' ');
        let mut instant_ns = || parts.next().and_then(|part| part.parse().ok()).expect("an instant");
        let instants_ns = [instant_ns(), instant_ns()];
        assert!(parts.next().is_some_and(|answer| answer.contains("\"result\":\"done\"")), "{line}");
        instants_ns
    }

    pub fn finish(mut self) {
        drop(self.child.stdin.take());
        self.child.wait().expect("its end");
    }
}
