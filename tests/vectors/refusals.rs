//! Wrong inputs: exit code 2, a message that names file, line, column and value, and no output.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::{Ran, hexad};
use hexad_support::data;

const LENGTHS: &str = "t,length_1,length_2,length_3,length_4,length_5,length_6";
const ROW: &str = "0,1.1,1.1,1.1,1.1,1.1,1.1";

/// Asserts that nothing was written and that the message is these lines after the file's name.
fn assert_refused(ran: &Ran, input: &Path, lines: &[&str]) {
    assert_eq!(ran.code, Some(2), "{}", ran.message);
    assert!(ran.files().is_empty(), "{:?}", ran.files());
    let wanted: Vec<_> = lines.iter().map(|line| format!("{}: {line}", input.display())).collect();
    assert_eq!(ran.message, format!("hexad: {}\n", wanted.join("\n")));
}

/// Asserts how forward kinematics refuses a text.
fn refused(text: impl AsRef<[u8]>, lines: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.csv");
    fs::write(&input, text).unwrap();
    assert_refused(&hexad("forward-kinematics", &data("fried2008", "toml"), &input, &[]), &input, lines);
}

#[test]
fn a_missing_file_is_named() {
    for command in ["forward-kinematics", "inverse-dynamics"] {
        let input = Path::new("absent/in.csv");
        let ran = hexad(command, &data("fried2008", "toml"), input, &[]);
        assert_refused(&ran, input, &["No such file or directory (os error 2)"]);
        let config = Path::new("absent/machine.toml");
        let ran = hexad(command, config, &data("fried2008", "csv"), &[]);
        assert_eq!(ran.code, Some(2));
        assert!(ran.message.starts_with("hexad: absent/machine.toml: could not be read"), "{}", ran.message);
    }
}

#[test]
fn missing_columns_are_named() {
    refused(
        format!("{}\n{ROW}\n", LENGTHS.replace("length_2", "lenght_2").replace("t,", "time,")),
        &["line 1: missing columns t, length_2: \
           the header is \"time,length_1,lenght_2,length_3,length_4,length_5,length_6\"; the nearest right one is \
           \"t,length_1,lenght_2,length_3,length_4,length_5,length_6,length_2\""],
    );
    let all = "line 1: missing columns t, length_1, length_2, length_3, length_4, length_5, length_6";
    let refused = |text: &str, found: &str| {
        refused(text, &[&format!("{all}: {found}; the nearest right one is \"{LENGTHS}\"")]);
    };
    refused("", "there is no header");
    refused("\n\n", "there is no header");
    refused("0,1,2\n", "the header is \"0,1,2\"");
}

#[test]
fn columns_must_be_unambiguous() {
    refused(
        format!("{LENGTHS},length_3,t,length_3\n{ROW},1.1,1,1.1\n"),
        &[
            "line 1: column t appears 2 times: must appear once",
            "line 1: column length_3 appears 3 times: must appear once",
        ],
    );
    let rates = [1, 2, 3, 5, 6].map(|leg| format!("length_rate_{leg}")).join(",");
    let all = "length_rate_1, length_rate_2, length_rate_3, length_rate_4, length_rate_5, length_rate_6";
    refused(
        format!("{LENGTHS},{rates}\n{ROW},0,0,0,0,0\n"),
        &[&format!("line 1: missing columns length_rate_4: of {all} either all or none must be there")],
    );
}

#[test]
fn a_table_without_rows_is_no_input() {
    refused(format!("{LENGTHS}\n"), &["no rows: must have at least one"]);
}

#[test]
fn everything_wrong_with_the_rows_is_reported_at_once() {
    let bad = [
        ("0.1,1.1,1.1", "line 3: 3 fields: must be 7, as in the header"),
        (
            "0.2,1.1,1.1,1.1,1.1,1.1,1.1,1.1",
            "line 4: 8 fields: must be 7, as in the header; with decimal commas the fields must be separated by semicolons",
        ),
        ("0.3,1.1,long,1.1,1.1,1.1,1.1", "line 5: length_2 = \"long\": must be a number"),
        ("0.4,1.1,1.1,,1.1,1.1,1.1", "line 6: length_3 = \"\": must be a number"),
        ("0.5,1.1,1.1,1.1,nan,1.1,1.1", "line 7: length_4 = nan: must be finite"),
        ("0.6,1.1,1.1,1.1,1.1,-inf,1.1", "line 8: length_5 = -inf: must be finite"),
        ("0.7,1.1,1.1,1.1,1.1,1.1,1e999", "line 9: length_6 = 1e999: must be finite"),
        ("NaN,1.1,1.1,1.1,1.1,1.1,1.1", "line 10: t = NaN: must be finite"),
        (
            "0.9,1.1,1.1,1.1,1.1,1.1,1_1",
            "line 11: length_6 = \"1_1\": must be a number (first of 2 such cells)",
        ),
        ("1.0,1.1 m,1.1,1.1,1.1,1.1,0x1", "line 12: length_1 = \"1.1 m\": must be a number"),
    ];
    let rows: Vec<_> = bad.iter().map(|(row, _)| *row).collect();
    let messages: Vec<_> = bad.iter().map(|(_, message)| *message).collect();
    refused(format!("{LENGTHS}\n{ROW}\n{}\n{ROW}\n", rows.join("\n")), &messages);
}

#[test]
fn one_mistake_many_times_is_not_reported_for_ever() {
    let rows = "0,1.1,1.1,1.1,1.1,1.1\n".repeat(123);
    let line = "line 2: 6 fields: must be 7, as in the header (first of 123 such rows)";
    refused(format!("{LENGTHS}\n{rows}"), &[line]);
}

#[test]
fn what_is_not_text_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.csv");
    fs::write(&input, [format!("{LENGTHS}\n{ROW}\n").as_bytes(), b"0,\xff\xfe,1,1,1,1,1\n"].concat())
        .unwrap();
    let ran = hexad("forward-kinematics", &data("fried2008", "toml"), &input, &[]);
    assert_eq!((ran.code, ran.files().len()), (Some(2), 0), "{}", ran.message);
    assert!(ran.message.contains("in.csv") && ran.message.contains("line 3"), "{}", ran.message);
}

#[test]
fn inverse_dynamics_refuses_in_the_same_words() {
    let text = fs::read_to_string(data("fried2008", "csv")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.csv");
    fs::write(&input, text.replacen(",z_accel,", ",z_acceleration,", 1)).unwrap();
    let ran = hexad("inverse-dynamics", &data("fried2008", "toml"), &input, &[]);
    let columns = ["rate", "accel"]
        .map(|part| ["alpha", "beta", "gamma", "x", "y", "z"].map(|axis| format!("{axis}_{part}")).join(", "))
        .join(", ");
    let message = format!("line 1: missing columns z_accel: of {columns} either all or none must be there");
    assert_refused(&ran, &input, &[&message]);
}

/// Runs forward kinematics of a sound machine to an output of choice; its exit code and message.
fn with_output(input: &Path, output: &Path) -> (Option<i32>, String) {
    let ran = Command::new(env!("CARGO_BIN_EXE_hexad"))
        .args(["forward-kinematics", "--config"])
        .arg(data("tilted", "toml"))
        .arg("--input")
        .arg(input)
        .arg("--output")
        .arg(output)
        .output()
        .unwrap();
    (ran.status.code(), String::from_utf8(ran.stderr).unwrap())
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken.csv");
    fs::create_dir(&taken).unwrap();
    for output in [taken, folder.path().join("absent/out.csv")] {
        let (code, message) = with_output(&data("tilted", "csv"), &output);
        assert_eq!(code, Some(2), "{message}");
        assert!(message.contains(output.to_str().unwrap()), "{message}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no .part file");
    }
}

#[test]
fn an_older_output_is_replaced_or_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.csv"), folder.path().join("out.csv"));
    fs::write(&output, "old").unwrap();
    fs::write(&input, LENGTHS).unwrap();
    assert_eq!(with_output(&input, &output).0, Some(2));
    assert_eq!(fs::read_to_string(&output).unwrap(), "old");
    assert_eq!(with_output(&data("tilted", "csv"), &output).0, Some(0));
    assert!(fs::read_to_string(&output).unwrap().starts_with("t,alpha,"));
}
