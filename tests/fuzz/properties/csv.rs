//! Any bytes as a table: for inverse dynamics, for forward kinematics, and as a trajectory.

use std::path::Path;
use std::sync::LazyLock;

use hexad::commands::forward_kinematics::{StartPose, forward_kinematics};
use hexad::commands::inverse_dynamics::inverse_dynamics;
use hexad::commands::r#move::trajectory::Trajectory;
use hexad::commands::orientation::OrientationFormat;
use hexad::config::Config;
use hexad::model::fidelity::Fidelity;
use hexad::model::machine::Machine;
use hexad::text::csv_table::{NumberTable, TableError, legs, length_columns, trajectory_columns};
use hexad::text::csv_writer::CsvWriter;

use super::{line_number, lines};

/// Name of the input in error texts.
const PLACE: &str = "fuzz.csv";

/// Errors shown at most, and one line for those beyond.
const MAX_ERRORS: usize = 20 + 1;

/// No number of a table is larger.
const LARGEST: f64 = 1e12;

static MACHINE: LazyLock<Machine> = LazyLock::new(|| {
    Config::parse(include_str!("../../../config/fried2008.toml"), "fried2008.toml").expect("sound").machine
});

/// Whether the input is accepted by one of the readers; panics where an answer is wrong.
pub fn hold(input: &[u8]) -> bool {
    let (source, text) = (input, as_read(input));
    let input = text.as_slice();
    let read = |required: &[String], optional: &[String]| {
        let table = NumberTable::from_reader(source, Path::new(PLACE), required, optional);
        match &table {
            Ok(table) => check_table(table, required.len(), optional.len(), input),
            Err(error) => check_refusal(error, input),
        }
        table.ok()
    };
    let motions = read(&trajectory_columns(), &[]);
    if let Some(table) = &motions {
        for (is_joint_space, stems) in [(false, 5), (true, 5 + 11)] {
            let mut written = inverse_dynamics(&MACHINE, Fidelity::Exact, is_joint_space, table).0;
            check_output(table, &mut written, 1 + stems * 6);
        }
        check_trajectory(table, input);
    }
    let lengths = read(&length_columns(), &legs("length_rate"));
    if let Some(table) = &lengths {
        let with_rates = table.rows().first().is_some_and(|row| row.len() > length_columns().len());
        let width = if with_rates { 10 + 6 } else { 10 };
        for start in [StartPose::Previous, StartPose::Home] {
            check_output(
                table,
                &mut forward_kinematics(&MACHINE, start, OrientationFormat::OF_X, table).output,
                width,
            );
        }
    }
    motions.is_some() || lengths.is_some()
}

/// The text of an input: UTF-8 with line feeds.
fn as_read(input: &[u8]) -> Vec<u8> {
    let units =
        |of: fn([u8; 2]) -> u16| -> Vec<u16> { input[2..].as_chunks().0.iter().copied().map(of).collect() };
    let mut text = match input {
        [0xff, 0xfe, ..] => String::from_utf16_lossy(&units(u16::from_le_bytes)).into_bytes(),
        [0xfe, 0xff, ..] => String::from_utf16_lossy(&units(u16::from_be_bytes)).into_bytes(),
        _ => input.into(),
    };
    let end = text.iter().position(|byte| b"\r\n".contains(byte)).unwrap_or(0);
    if text.get(end) == Some(&b'\r') && text.get(end + 1) != Some(&b'\n') {
        text.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    }
    text
}

/// Rows of one width, of finite numbers, each with its line.
fn check_table(table: &NumberTable, required: usize, optional: usize, input: &[u8]) {
    let width = table.rows().first().expect("at least one row").len();
    assert!(width == required || width == required + optional, "{width} columns");
    assert_eq!(table.rows().len(), table.lines().len());
    assert!(table.lines().is_sorted_by(|a, b| a < b), "a line each: {:?}", table.lines());
    for (row, line) in table.rows().iter().zip(table.lines()) {
        assert_eq!(row.len(), width);
        assert!(row.iter().all(|x| x.abs() <= LARGEST), "{row:?}");
        let number = line_number(&line.to_string(), input);
        check_line(row[0], number, input);
    }
}

/// The time of a row is in the line that it is said to begin in, where no quote hides what a line is.
fn check_line(t: f64, number: usize, input: &[u8]) {
    let line = input.split(|byte| *byte == b'\n').nth(number - 1).expect("a line of the input");
    let of_other_unit: [&[u8]; 4] = [b"t_", b"ms", b"us", b"ns"];
    let is_in_seconds = !input.windows(2).any(|name| of_other_unit.contains(&name));
    if !input.contains(&b'"') && is_in_seconds {
        let times = String::from_utf8_lossy(line);
        let is_there = times.split([',', ';', '\t', '|']).any(|x| x.trim().parse() == Ok(t));
        let with_commas =
            || times.split([';', '\t', '|']).any(|x| x.trim().replacen(',', ".", 1).parse() == Ok(t));
        assert!(is_there || with_commas(), "{t} is not in line {number}: {times}");
    }
}

/// A line per error, each with its place and its bound.
fn check_refusal(error: &TableError, input: &[u8]) {
    let TableError::Content(errors) = error else { panic!("bytes can be read: {error}") };
    assert!((1..=MAX_ERRORS).contains(&errors.len()), "{} errors", errors.len());
    let message = error.to_string();
    let lines = lines(&message);
    assert_eq!(lines.len(), errors.len(), "a line each: {message}");
    for line in lines {
        let what = line.strip_prefix(PLACE).and_then(|rest| rest.strip_prefix(": ")).expect(line);
        if let Some(rest) = what.strip_prefix("line ") {
            let (number, what) = rest.split_once(": ").expect(what);
            line_number(number, input);
            assert!(what.contains("must ") || what.starts_with("missing columns "), "no bound: {line}");
        } else {
            let of_file = what == "no rows: must have at least one";
            assert!(of_file || what.starts_with("and ") && what.ends_with(" more"), "no place: {line}");
        }
    }
}

/// What a command writes has a row for each of the input's, with its time to the last bit; numbers that a
/// row has not are NaN, none is infinite.
fn check_output(input: &NumberTable, output: &mut CsvWriter, width: usize) {
    let rows: Vec<&str> = str::from_utf8(output.text()).expect("text").lines().skip(1).collect();
    assert_eq!(rows.len(), input.rows().len());
    for (row, input) in rows.into_iter().zip(input.rows()) {
        let numbers: Vec<f64> = row.split(',').map(|x| x.parse().expect("a number")).collect();
        assert_eq!(numbers.len(), width);
        assert_eq!(numbers[0].to_bits(), input[0].to_bits());
        assert!(!numbers.iter().any(|x| x.is_infinite()), "{row}");
    }
}

/// A trajectory that is accepted has finite setpoints wherever it is asked; else the refusal is one of a
/// table.
fn check_trajectory(table: &NumberTable, input: &[u8]) {
    match Trajectory::from_rows(table, Path::new(PLACE)) {
        Err(error) => check_refusal(&error, input),
        Ok(trajectory) => {
            let duration = trajectory.duration();
            assert!(duration.is_finite() && duration >= 0.0, "{duration} s");
            let starts = table.rows().iter().map(|row| row[0] - table.rows()[0][0]);
            let shares = (0..=64).map(|k| duration * f64::from(k) / 64.0);
            for t in starts.flat_map(|t| [t, t + 1e-7, t + 1e-3]).chain(shares) {
                let state = trajectory.at(t.min(duration));
                assert!(state.is_finite(), "at {t}: {state:?}");
            }
        }
    }
}
