//! The offline commands, through the real binary, against forces computed with 80 digits by an
//! independent method (`tests/data/make_vectors.py`).

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod forward;
mod inverse;
mod refusals;
mod tables;
mod unsolved;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hexad_support::{Table, data};
use tempfile::TempDir;

/// What a run of the binary left behind.
struct Ran {
    code: Option<i32>,
    /// Standard error.
    message: String,
    folder: TempDir,
}

impl Ran {
    fn output(&self) -> PathBuf {
        self.folder.path().join("out.csv")
    }

    /// The output of a run that went well, every number in its shortest form.
    fn table(&self) -> Table {
        assert_eq!(self.code, Some(0), "{}", self.message);
        self.complete_table()
    }

    /// The output, whatever the exit code.
    fn complete_table(&self) -> Table {
        let table = Table::read(&self.output());
        table.rows.iter().flatten().for_each(|text| assert_shortest(text));
        assert_eq!(self.files(), ["out.csv"]);
        table
    }

    /// Names of what is in the folder of the output.
    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
}

/// `hexad COMMAND --config CONFIG --input INPUT --output <new folder>/out.csv OPTIONS`
fn hexad(command: &str, config: &Path, input: &Path, options: &[&str]) -> Ran {
    let folder = TempDir::new().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_hexad"))
        .arg(command)
        .arg("--config")
        .arg(config)
        .arg("--input")
        .arg(input)
        .arg("--output")
        .arg(folder.path().join("out.csv"))
        .args(options)
        .output()
        .unwrap();
    assert!(output.stdout.is_empty());
    Ran { code: output.status.code(), message: String::from_utf8(output.stderr).unwrap(), folder }
}

/// The same on a machine of `tests/data` and its own vectors.
fn hexad_on_vectors(command: &str, name: &str, options: &[&str]) -> Ran {
    hexad(command, &data(name, "toml"), &data(name, "csv"), options)
}

/// A number that reads back the same, prints back the same, and has no digit that could be left out.
fn assert_shortest(text: &str) {
    let value: f64 = text.parse().unwrap();
    assert_eq!(format!("{value:?}"), text);
    if value.is_finite() {
        let digits = |text: &str| {
            let mantissa = text.split(['e', 'E']).next().unwrap();
            let digits: String = mantissa.chars().filter(char::is_ascii_digit).collect();
            digits.trim_matches('0').to_string()
        };
        assert_eq!(digits(text), digits(&format!("{value:e}")), "{text}");
    }
}

/// `t`, then these.
fn with_t(columns: &[&str]) -> Vec<String> {
    ["t"].iter().chain(columns).map(ToString::to_string).collect()
}

/// `stem_1 ... stem_6` of each.
fn six_each(stems: &[&str]) -> Vec<String> {
    stems.iter().flat_map(|stem| (1..=6).map(move |leg| format!("{stem}_{leg}"))).collect()
}
