//! Builds `shipped` with the profile that ships and runs its tests, beside those of the profile for tests.

#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::process::{Command, Stdio};

use crate::common::not_run;

#[test]
fn the_program_that_ships_passes_its_tests() {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR")).args(["test", "--release", "--test", "shipped"]);
    let ended = cargo.stdin(Stdio::null()).output().unwrap();
    let [output, errors] = [ended.stdout, ended.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    println!("{errors}\n{output}");
    assert!(ended.status.success(), "{cargo:?}: {}", ended.status);
    assert!(output.contains("test result: ok. "), "no test was run");
    not_run::repeat(&errors);
}
