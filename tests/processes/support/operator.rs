//! An operator at the command line.

use hexad::messages::location::user_id;
use hexad::operator::users::user_name;

use super::children::Ended;
use super::machine::Machine;

/// Less than the tests wait for any process.
const WITHIN_S: &str = "45";

/// Name of the user of the tests, as the log and the status show it.
pub fn own_name() -> String {
    user_name(user_id())
}

/// `hexad REQUEST` with more arguments, to its end.
pub fn ask(machine: &Machine, request: &str, more: &[&str]) -> Ended {
    let within: &[&str] = if more.contains(&"--within") { &[] } else { &["--within", WITHIN_S] };
    machine.hexad(request, &[within, more].concat())
}

/// A request that must be carried out and lead to one of these states.
pub fn does(machine: &Machine, request: &str, more: &[&str], states: &[&str]) {
    let state = ask(machine, request, more).succeeds();
    assert!(states.contains(&state.trim_end()), "{request} led to {state}");
}

/// A request that must not be carried out, and the words why.
pub fn is_refused(machine: &Machine, request: &str, more: &[&str], words: &str) {
    let ended = ask(machine, request, more);
    assert_eq!(ended.stdout, "", "{request}");
    ended.fails(1, words);
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
