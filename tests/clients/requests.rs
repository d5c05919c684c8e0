//! Operators' requests by libhexad, where the control socket answers and where it does not.

use std::fs;
use std::process::{self, Command};

use crate::start_daemon;
use hexad_support::libhexad::with_library;
use hexad_support::process::Process;
use hexad_support::python::output;

/// Sends a request, and prints what becomes of it.
const PROGRAM: &str = "
import sys, hexad
try:
    hexad.request(sys.argv[1], sys.argv[2], within_s=10.0)
    print('OK')
except hexad.HexadError as error:
    print(error.result.name, error)
";

fn ask(name: &str, request: &str) -> String {
    let mut command = with_library(Command::new("python3"));
    output(command.args(["-c", PROGRAM, name, request])).unwrap().trim_end().to_owned()
}

/// By the shell: tests hold no unsafe code.
fn signal(daemon: &Process, signal: &str) {
    let line = format!("kill -s {signal} {}", daemon.child.id());
    assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
}

const STOPPED: &str = "fault: emergency stop";

#[test]
fn an_emergency_stop_needs_no_socket() {
    let name = format!("no-socket-{}", process::id());
    let daemon = start_daemon(&name, "");
    assert_eq!(ask(&name, "estop"), "OK");
    daemon.says(STOPPED);
    assert_eq!(ask(&name, "clear"), "OK");
    let words = daemon.words();
    let socket = words.lines().find_map(|line| line.split_once("control socket: ")).unwrap().1;
    fs::remove_file(socket).unwrap();
    let answer = ask(&name, "clear");
    let words =
        format!("TIMED_OUT clear is not confirmed: process {} does not answer at ", daemon.child.id());
    assert!(answer.starts_with(&words), "{answer}");
    // There is no other signal for `off`.
    assert_eq!(ask(&name, "off"), "OK");
    daemon.has_said(STOPPED, 2);
    assert_eq!(ask(&name, "estop"), "OK");
    daemon.stops();
    let answer = ask(&name, "estop");
    assert!(answer.starts_with(&format!("NO_DAEMON no daemon runs for {name}")), "{answer}");
}

#[test]
fn a_held_daemon_is_not_called_stopped_and_stops_when_it_goes_on() {
    let name = format!("held-{}", process::id());
    let daemon = start_daemon(&name, "");
    signal(&daemon, "STOP");
    let answer = ask(&name, "estop");
    let words =
        format!("estop by SIGUSR1 to process {}, and it has not reported the result", daemon.child.id());
    assert!(answer.starts_with("TIMED_OUT ") && answer.contains(&words), "{answer}");
    assert!(!daemon.words().contains(STOPPED));
    signal(&daemon, "CONT");
    daemon.says(STOPPED);
    daemon.stops();
}
