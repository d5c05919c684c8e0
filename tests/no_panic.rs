//! Nothing in the real-time loop can panic, allocate, lock, or call the system but to sleep: shown on the
//! machine code of the `hexad` that was built with the tests.
//!
//! From [`LOOP`] the test follows every call and jump, whether or not it is ever taken, for every instruction
//! set that may be dispatched to. All ways must stay in the functions of the executable and end in the
//! [`ALLOWED`] ones of the C library: time and memory. Not arithmetic, which glibc rounds in other places on
//! processors with FMA, so that a replay would not repeat every bit. Everything else is forbidden, also what
//! nobody has thought of: no name of a panic has to be known, because each ends in output, `abort`, calls
//! through pointers. Forbidden as well are these themselves: calls through pointers, bare system calls, and
//! traps (`ud2`), the panics that abort without a word.
//!
//! What is not shown:
//!
//! - what the C library does in the functions that it is trusted with, and that they are bound at the start
//!   (the toolchain's default);
//! - processor exceptions: memory that is not there (each `unsafe` has its argument instead), stack used up.
//!   Division of integers by zero is none, the compiler puts a panic before it;
//! - that loops end;
//! - anything before the first release and after the last cycle.
//!
//! Where the analysis cannot tell it refuses; the head of `x86_64.rs` says what it can tell. [`controls`] do
//! what is forbidden, one by one, and have to be found out.
//!
//! Only for optimized code, for without optimization no check is ever proved away.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed assertion is how a test speaks"
)]
#![allow(clippy::std_instead_of_core, reason = "tests have an operating system")]

mod aarch64;
mod controls;
mod executable;
mod reach;
mod x86_64;

use std::env::current_exe;
use std::path::Path;

use executable::Executable;
use reach::reached_from;

/// The loop, from the first release to the end of the last cycle.
const LOOP: &str = "hexad_client::realtime::cyclic::run_cycles";

/// What the loop may call of the C library, and from where, if not from everywhere.
const ALLOWED: &[(&str, Option<&str>)] = &[
    ("memcpy", None),
    ("memmove", None),
    ("memset", None),
    // In the vDSO.
    ("clock_gettime", None),
    // The sleeps, until an instant or a message.
    ("clock_nanosleep", None),
    ("syscall", Some("hexad_client::realtime::futex::wait")),
];

/// What the walk has to come by, or it goes astray: both sleeps, the angles of the setpoint, the last resort
/// of the model.
const LANDMARKS: [&str; 4] =
    ["clock_nanosleep", "syscall", "libm::math::sincos::sincos", "hexad_core::model::lu::solve"];

/// The instruction sets that the model is compiled for, beside the one that all processors of a kind have.
#[cfg(target_arch = "x86_64")]
const INSTRUCTION_SETS: [&str; 2] = ["::vectorize_sse4_2", "::vectorize_avx2"];
#[cfg(not(target_arch = "x86_64"))]
const INSTRUCTION_SETS: [&str; 0] = [];

#[test]
fn the_loop_only_computes_sleeps_and_reads_the_clock() {
    let executable = Executable::read(Path::new(env!("CARGO_BIN_EXE_hexad")));
    let reached = reached_from(&executable, LOOP, ALLOWED);
    assert!(reached.forbidden.is_empty(), "the loop can get to\n{}", reached.forbidden.join("\n"));
    for name in LANDMARKS {
        let found = reached.functions.contains(name) || reached.imports.contains(name);
        assert!(found, "the walk did not come to {name}: {reached:#?}");
    }
    for name in INSTRUCTION_SETS {
        let found = reached.functions.iter().any(|function| function.ends_with(name));
        assert!(found, "the walk did not come to {name}: {reached:#?}");
    }
}

#[test]
fn whatever_is_forbidden_is_found() {
    let executable = Executable::read(&current_exe().unwrap());
    for (function, finding) in controls::all() {
        let forbidden = reached_from(&executable, function, ALLOWED).forbidden;
        let beyond = |way: &String| way.strip_prefix(function).is_some_and(|way| way.contains(finding));
        let found = forbidden.iter().any(beyond);
        assert!(found, "{function} does not lead to {finding}: {forbidden:#?}");
    }
    for function in controls::clean::all() {
        let forbidden = reached_from(&executable, function, ALLOWED).forbidden;
        assert!(forbidden.is_empty(), "{function}: {forbidden:#?}");
    }
}
