//! What reads files from people, and the controller, against any bytes: no panic, bounded memory and time, and
//! an answer that either works or says place, value and bound.
//!
//! Here the kept seeds run through the properties, with every `cargo test`. The search for new ones:
//!
//! ```sh
//! cargo install cargo-fuzz
//! tests/fuzz/run.sh config 600     # or machine, csv, or step; seconds
//! ```
//!
//! | target | input | reader |
//! | --- | --- | --- |
//! | `config` | a configuration file | `Config` |
//! | `machine` | numbers for `config/reference.toml` | the same, past the syntax |
//! | `csv` | a table | inverse dynamics, forward kinematics, trajectory |
//! | `step` | cycles, requests, inputs of any bits | `Controller::step` |
//!
//! `tests/fuzz/run.sh TARGET merge` adds to the seeds what was found to cover more.
//!
//! To add a target: its properties in `properties/`, a file in `targets/`, seeds in `seeds/`, a test here.
//! What it finds is corrected, with a test beside the code, and kept as a seed.
//!
//! libFuzzer through cargo-fuzz, on the toolchain that builds the daemon, and without sanitizers: these need
//! a nightly one, and the readers have no `unsafe` for them to look into.

#![allow(clippy::panic, clippy::expect_used, clippy::indexing_slicing)]

pub mod properties;

use std::fs;
use std::path::{Path, PathBuf};

use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;

use hexad_support::certificate::Certificate;

/// Memory of this process at its largest: the readers' bounds and the test itself \[kB\].
const MAX_MEMORY_KB: u64 = 256 << 10;

/// Runs every file of these folders through a property. Some must be accepted and some refused.
fn replay(hold: fn(&[u8]) -> bool, folders: &[&str], extension: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut accepted, mut refused) = (0, 0);
    for folder in folders {
        let entries = fs::read_dir(root.join(folder)).expect(folder);
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect(folder).path()).collect();
        files.sort();
        for file in files.iter().filter(|file| file.extension().is_none_or(|found| found == extension)) {
            println!("{}", file.display());
            let taken = hold(&fs::read(file).expect("a seed"));
            *(if taken { &mut accepted } else { &mut refused }) += 1;
        }
    }
    assert!(accepted > 0 && refused > 0, "{accepted} accepted, {refused} refused");
    let status = fs::read_to_string("/proc/self/status").expect("Linux");
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the peak of memory");
    let peak_kb: u64 = peak.trim().trim_end_matches(" kB").parse().expect("a number");
    assert!(peak_kb < MAX_MEMORY_KB, "{peak_kb} kB");
}

#[test]
#[ignore = "second tier: takes long"]
fn configuration_files() {
    replay(properties::config::hold, &["tests/fuzz/seeds/config", "config", "tests/data"], "toml");
}

#[test]
fn machines() {
    replay(properties::machine::hold, &["tests/fuzz/seeds/machine"], "");
}

#[test]
#[ignore = "second tier: takes long"]
fn cycles() {
    replay(properties::step::hold, &["tests/fuzz/seeds/step"], "");
}

/// Cycles with any bits in their inputs, in every mode in turn.
#[test]
fn certificate_random_cycles() {
    let certificate = Certificate::new("random cycles", 500_000, 100_000_000);
    let wanted = certificate.total();
    let mut state = 2008 + certificate.seed();
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D)
    };
    let (mut done, mut programs, mut controlled) = (0, 0, 0);
    while done < wanted {
        let length = 16 + random() % 512;
        let mut program = vec![];
        while program.len() < length as usize {
            let [kind, op, ..] = random().to_le_bytes();
            match kind % 10 {
                // Good cycles, and now and then a request to engage: control is where it matters.
                0..4 => program.push(op & 0xF0),
                4 => program.push(0x16),
                _ => {
                    program.push(op);
                    program.extend(random().to_le_bytes());
                }
            }
        }
        let mode = ControlMode::ALL[programs as usize % ControlMode::ALL.len()];
        let has_rates = programs / 4 % 2 == 0;
        let policy = if programs / 8 % 2 == 0 { ViolationPolicy::Stop } else { ViolationPolicy::Limit };
        let (cycles, reached) = properties::step::run(&program, mode, has_rates, policy);
        (done, programs, controlled) = (done + cycles, programs + 1, controlled + u64::from(reached));
        certificate.advance(cycles);
    }
    certificate
        .finish(format_args!("{done} cycles in {programs} programs, {controlled} of them reached control"));
    assert!(10 * controlled > programs, "{controlled} of {programs} reached control");
}

#[test]
fn tables() {
    replay(properties::csv::hold, &["tests/fuzz/seeds/csv", "tests/data"], "csv");
}
