//! A client of the control socket that is not `hexad`.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::children::{Ended, HANG, Hexad};
use super::machine::Machine;
use super::operator::ask;

/// Where a daemon listens, by its own words.
pub fn path_of(daemon: &Hexad) -> PathBuf {
    const WORDS: &str = "control socket: ";
    daemon.says(WORDS);
    daemon.says(".sock\n");
    let words = daemon.words();
    let line = words.lines().find_map(|line| line.split_once(WORDS)).expect("the path");
    line.1.into()
}

/// One connection.
pub struct Client {
    stream: UnixStream,
    answers: BufReader<UnixStream>,
}

impl Client {
    pub fn connect(daemon: &Hexad) -> Self {
        let stream = UnixStream::connect(path_of(daemon)).expect("a connection");
        stream.set_read_timeout(Some(HANG)).expect("a limit");
        let answers = BufReader::new(stream.try_clone().expect("the same connection"));
        Self { stream, answers }
    }

    pub fn send(&mut self, text: &str) {
        self.stream.write_all(text.as_bytes()).expect("to send");
    }

    /// Sends a request with these fields.
    pub fn request(&mut self, name: &str, more: &Value) {
        let mut line = json!({"version": 1, "request": name});
        more.as_object().expect("keys").iter().for_each(|(key, value)| line[key] = value.clone());
        self.send(&format!("{line}\n"));
    }

    /// The answer to a request.
    pub fn ask(&mut self, name: &str, more: &Value) -> Value {
        self.request(name, more);
        self.answer()
    }

    /// The next line.
    pub fn answer(&mut self) -> Value {
        let mut line = String::new();
        self.answers.read_line(&mut line).expect("an answer");
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"))
    }

    /// Whether the daemon has closed it, with or without having read everything.
    pub fn is_closed(&mut self) -> bool {
        let read = self.answers.read_line(&mut String::new());
        read.map_or_else(|error| error.kind() == ErrorKind::ConnectionReset, |count| count == 0)
    }
}

/// The answer of `hexad status --json`.
pub fn status(machine: &Machine) -> Value {
    serde_json::from_str(&machine.hexad("status", &["--json"]).succeeds()).expect("JSON")
}

/// State of the daemon, by its status.
pub fn state(machine: &Machine) -> String {
    status(machine)["state"].as_str().expect("a state").into()
}

/// X of the platform, by the status.
pub fn pose(machine: &Machine) -> [f64; 6] {
    let pose = status(machine)["status"]["pose"].clone();
    core::array::from_fn(|k| pose[k].as_f64().unwrap_or(f64::NAN))
}

/// A request that stops, however it is confirmed; true if by the socket.
pub fn stops(machine: &Machine, request: &str, states: &[&str]) -> bool {
    let Ended { status, stdout, stderr } = ask(machine, request, &[]);
    assert_eq!(status.code(), Some(0), "{request}: {stderr}");
    assert!(states.contains(&stdout.trim_end()), "{request} led to {stdout}: {stderr}");
    stderr.is_empty()
}
