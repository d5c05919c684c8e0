//! The systemd unit, judged by systemd itself.

#![allow(clippy::expect_used, reason = "a test helper that fails is a failed test")]

mod common;

use std::process::Command;

const UNIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/hexad@.service");

/// Standard output and standard error of `systemd-analyze` with these arguments, and its exit code; none where it is
/// not installed.
fn systemd_analyze(arguments: &[&str]) -> Option<(String, Option<i32>)> {
    let output = match Command::new("systemd-analyze").args(arguments).output() {
        Ok(output) => output,
        Err(error) => {
            common::not_run::lacking(&format!("systemd-analyze: {error}; apt-get install systemd"));
            return None;
        }
    };
    let text = [output.stdout, output.stderr].concat();
    Some((String::from_utf8_lossy(&text).into_owned(), output.status.code()))
}

#[test]
fn verify_prints_nothing() {
    // It returns 0 for some mistakes, such as a misspelt Type, but never silently.
    let Some((text, code)) = systemd_analyze(&["verify", UNIT]) else { return };
    assert_eq!(text, "");
    assert_eq!(code, Some(0));
}

#[test]
fn the_sandbox_is_tight() {
    // Exposure in tenths, 0 is best. What keeps it from zero are shared memory and real time themselves.
    let Some((text, code)) = systemd_analyze(&["security", "--offline=true", "--threshold=20", UNIT]) else {
        return;
    };
    assert_eq!(code, Some(0), "{text}");
}
