//! Tests that cannot run here: each is named with its reason.
//!
//! A running test can only pass or fail for Rust's test harness, which counts these as passed. So they are named
//! below its result, on standard error. With `HEXAD_REQUIRE_REALTIME=1` one that lacks a right or a tool fails.

use std::sync::Mutex;
use std::{env, thread};

/// Tests and reasons, in the order in which they gave up.
static NOT_RUN: Mutex<Vec<String>> = Mutex::new(vec![]);

/// The calling test does not run for lack of a right or a tool.
pub fn lacking(what: &str) {
    let is_required = env::var_os("HEXAD_REQUIRE_REALTIME").is_some_and(|value| value == "1");
    assert!(!is_required, "HEXAD_REQUIRE_REALTIME=1, and this test lacks {what}");
    not_run(what);
}

/// The calling test does not run for what no right and no tool would change: the kernel, the processors, the host.
pub fn not_run(why: &str) {
    let test = thread::current().name().unwrap_or("a test").to_owned();
    add(format!("    {test}: {}", why.trim()));
}

/// Adds those that another test process has named on its standard error.
pub fn repeat(errors: &str) {
    let named = errors.lines().skip_while(|line| !line.starts_with("NOT RUN: ")).skip(1);
    named.take_while(|line| line.starts_with("    ")).for_each(|line| add(line.into()));
}

#[allow(unsafe_code, reason = "the harness has no other end of a run that a test could use")]
fn add(line: String) {
    let mut not_run = NOT_RUN.lock().expect("the list of tests");
    if not_run.is_empty() {
        // SAFETY: the function is safe to call at any time.
        unsafe { libc::atexit(print) };
    }
    not_run.push(line);
}

/// At the end of the process, below the result of the harness.
extern "C" fn print() {
    if let Ok(not_run) = NOT_RUN.lock() {
        eprintln!("NOT RUN: {} of the tests counted as passed\n{}\n", not_run.len(), not_run.join("\n"));
    }
}
