//! An operator at the command line.

use super::children::{Ended, run};
use super::machine::Machine;

/// Less than the tests wait for any process.
const WITHIN_S: &str = "45";

/// `hexad REQUEST` with more arguments, to its end.
pub fn ask(machine: &Machine, request: &str, more: &[&str]) -> Ended {
    let file = machine.file.display().to_string();
    let within: &[&str] = if more.contains(&"--within") { &[] } else { &["--within", WITHIN_S] };
    run(machine, &[&[request, "--config", &file], within, more].concat())
}

/// A request that must be carried out and lead to one of these states.
pub fn does(machine: &Machine, request: &str, more: &[&str], states: &[&str]) {
    let Ended { status, stdout, stderr } = ask(machine, request, more);
    assert_eq!(status.code(), Some(0), "{request}: {stderr}");
    assert!(states.contains(&stdout.trim_end()), "{request} led to {stdout}");
}

/// A request that must not be carried out, and the words why.
pub fn is_refused(machine: &Machine, request: &str, more: &[&str], words: &str) {
    let Ended { status, stdout, stderr } = ask(machine, request, more);
    assert_eq!((status.code(), stdout.as_str()), (Some(1), ""), "{request}: {stderr}");
    assert!(stderr.contains(words), "{request}: {words:?} must be in {stderr}");
}

/// Takes control as soon as everything is there.
pub fn engage(machine: &Machine) {
    does(machine, "engage", &["--wait"], &["active"]);
}

/// Out of a fault; with the pose known it is ready at once.
pub fn clear(machine: &Machine) {
    does(machine, "clear", &[], &["off", "standby"]);
}

/// Out of a fault, into control.
pub fn clear_and_engage(machine: &Machine) {
    is_refused(machine, "engage", &["--wait"], "engage was refused: not possible in state fault (");
    clear(machine);
    engage(machine);
}
