//! Command lines: what is refused before anything starts, and files that are made from files. Where no process is needed, they are
//! executed in this one.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed assertion is how a test speaks"
)]

use std::path::PathBuf;
use std::process::Command;
use std::{fs, process};

use clap::Parser;
use hexad::commands::CommandLine;
use hexad::config::Config;
use tempfile::TempDir;

mod calibration;
mod damage;
mod output;
mod pages;
mod refusals;
mod rotations;
mod tables;
mod versions;

/// A folder with a machine file; in command lines its path is `@`, and `@M` is `--config` with this file.
struct Folder(TempDir);

impl Folder {
    /// With the machine of the paper, under a name of this process, and more sections.
    fn new(sections: &str) -> Self {
        let folder = Self(TempDir::new().unwrap());
        let text =
            include_str!("../config/fried2008.toml").replace("\"fried2008\"", &format!("\"{}\"", name()));
        folder.write("machine.toml", text + "\n" + sections);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    fn config(&self) -> Config {
        Config::load(&self.path("machine.toml")).unwrap()
    }

    fn arguments(&self, line: &str) -> Vec<String> {
        let line = line.replace("@M", "--config @/machine.toml");
        line.split(' ').map(|word| word.replace('@', self.0.path().to_str().unwrap())).collect()
    }

    /// Executes a command line in this process; exit code and message if it fails.
    fn execute(&self, line: &str) -> Result<(), (u8, String)> {
        let words = ["hexad".to_owned()].into_iter().chain(self.arguments(line));
        let command = CommandLine::try_parse_from(words).map_err(|error| (2, error.to_string()))?;
        command.execute().map_err(|failure| (failure.exit_code, failure.message))
    }

    /// A command line that must not begin: these words must be in its message.
    fn refuses(&self, line: &str, words: &[&str]) -> String {
        let (code, message) = self.execute(line).expect_err(line);
        assert_eq!(code, 2, "{line}: {message}");
        assert!(message.matches("error: ").count() <= 1, "{line}: {message}");
        has(&message, words);
        message
    }

    /// Exit code, output and error output of the program.
    fn run(&self, line: &str) -> (Option<i32>, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        let ended = command.args(self.arguments(line)).env_remove("HEXAD_LOG").output().unwrap();
        let [output, errors] = [ended.stdout, ended.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        (ended.status.code(), output, errors)
    }

    /// Output of the program, which must succeed without a remark.
    fn says(&self, line: &str) -> String {
        let (code, output, errors) = self.run(line);
        assert_eq!((code, errors.as_str()), (Some(0), ""), "{line}: {output}");
        output
    }

    /// Numbers of the table that a command computes in this process from a table.
    fn computes(&self, command: &str, input: &str) -> Vec<Vec<f64>> {
        self.write("input.csv", input);
        let line = format!("{command} @M --input @/input.csv --output @/output.csv");
        self.execute(&line).unwrap_or_else(|error| panic!("{line}: {error:?}"));
        numbers(&self.read("output.csv"))
    }
}

/// Name of the machine: no daemon of it runs.
fn name() -> String {
    format!("commands-{}", process::id())
}

/// All words must be in a text.
fn has(text: &str, words: &[&str]) {
    words.iter().for_each(|word| assert!(text.contains(word), "{word:?} must be in\n{text}"));
}

/// A table with these columns and rows.
fn table(columns: &str, rows: impl IntoIterator<Item = Vec<f64>>) -> String {
    let row = |row: Vec<f64>| row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(",") + "\n";
    format!("{columns}\n") + &rows.into_iter().map(row).collect::<String>()
}

/// Numbers of a table without its header.
fn numbers(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|number| number.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

/// Largest difference between two tables, relative where numbers are large.
fn largest_difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.len() == b.len()));
    let relative = |(a, b): (&f64, &f64)| (a - b).abs() / (1.0 + b.abs());
    a.iter().flatten().zip(b.iter().flatten()).map(relative).fold(0.0, f64::max)
}
