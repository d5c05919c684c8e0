//! The command `hexad` as a process, for tests of a client: their own program in this role, as cargo builds no program of another
//! package for them.

use std::env;
use std::path::Path;
use std::process::Command;

use clap::Parser;
use hexad::commands::CommandLine;
use hexad::log::{self, LogFormat};

const ARGUMENTS: &str = "HEXAD_TEST_ARGUMENTS";

/// The command `hexad`; `command` runs a program with arguments on the host of a test.
pub fn hexad(command: impl Fn(&Path, &str) -> Command, arguments: &str) -> Command {
    let role = "--exact hexad_process --ignored --nocapture --quiet";
    let mut command = command(&env::current_exe().unwrap(), role);
    command.env(ARGUMENTS, arguments);
    command
}

/// What the program does in that role, in a function of the same name:
/// `#[test] #[ignore = "not a test, but the process that tests start"] fn hexad_process()`.
pub fn play_role() {
    let arguments = env::var(ARGUMENTS).unwrap();
    let command = CommandLine::parse_from(["hexad"].into_iter().chain(arguments.split(' ')));
    let _log = log::install(LogFormat::Text);
    if let Err(failure) = command.execute() {
        panic!("{}", failure.message);
    }
}
