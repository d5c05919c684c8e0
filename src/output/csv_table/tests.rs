//! Tables that are read, and texts of what is refused.

use std::io::repeat;

use super::*;
use crate::output::csv_rows::MAX_ROW_BYTES;

/// Error text for CSV with the columns t and x.
fn refusal(source: impl Read) -> String {
    let columns = ["t".into(), "x".into()];
    NumberTable::from_reader(source, Path::new("x.csv"), &columns, &[]).unwrap_err().to_string()
}

#[test]
fn endless_text_is_refused() {
    for byte in *b"1\",\n\0" {
        let bound = "x.csv: line 1: a row longer than 65536 bytes: must be at most that long";
        assert_eq!(refusal(repeat(byte)), bound);
        let bound = "x.csv: line 2: a row longer than 65536 bytes: must be at most that long";
        assert_eq!(refusal(b"t,x\n".chain(repeat(byte))), bound);
    }
    // A quote that is not closed, below a sound row.
    let bound = "x.csv: line 3: a row longer than 65536 bytes: must be at most that long";
    assert_eq!(refusal(b"t,x\n1,2\n\"1,".chain(repeat(b'2'))), bound);
}

#[test]
fn a_long_row_is_read_to_its_bound() {
    let columns = ["t".into(), "x".into()];
    let rows = |notes: usize| format!("t,x,notes\n1,2,{}\n", "n".repeat(notes));
    let read = |text: String| NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &columns, &[]);
    assert_eq!(read(rows(MAX_ROW_BYTES - 5)).unwrap().rows(), [[1.0, 2.0]]);
    assert!(read(rows(2 * MAX_ROW_BYTES)).is_err());
}

#[test]
fn rows_without_end_are_refused() {
    struct EndlessRows;
    impl Read for EndlessRows {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            for (i, byte) in buffer.iter_mut().enumerate() {
                *byte = if i % 2 == 0 { b'1' } else { b'\n' };
            }
            Ok(buffer.len() & !1)
        }
    }
    let message = refusal(b"t,x\n".chain(EndlessRows));
    assert!(message.starts_with("x.csv: line 2: 1 fields: must be 2, as in the header\n"), "{message}");
    assert!(
        message.ends_with(&format!("\nx.csv: and {} more", MAX_ROWS + 1 - MAX_ERRORS_SHOWN)),
        "{message}"
    );
}

#[test]
fn values_are_shown_cut_and_on_one_line() {
    let text = format!("t,x\n1,\"1\n\u{1b}[2J\"\n2,{}\n3,-1e13\n", "9".repeat(400));
    let wanted = [
        "x.csv: line 2: x = \"1 \\u{1b}[2J\": must be a number",
        &format!("x.csv: line 4: x = {}...: must be finite", "9".repeat(60)),
        "x.csv: line 5: x = -1e13: must be at most 1e12 in magnitude",
    ];
    assert_eq!(refusal(text.as_bytes()), wanted.join("\n"));
}

#[test]
fn semicolons_tabs_decimal_commas_and_units_are_read() {
    let columns = ["t".into(), "x".into()];
    let read = |text: &str| NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &columns, &[]);
    let expected = [[0.0, 1.5], [0.25, -2e-3]];
    for text in [
        "t,x\n0,1.5\n0.25,-2e-3\n",
        "t;x\n0;1,5\n0,25;-2e-3\n",
        "\u{feff}t;x\r\n0;1.5\r\n0.25;-2e-3",
        "t\tx\n0\t1,5\n0.25\t-2e-3\n",
        "t_ms,x_mm\n0,1500\n250,-2\n",
        "\n t_ms ; x_um \n0;1500000\n250,0;-2000\n",
    ] {
        let table = read(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        for (row, expected) in table.rows().iter().zip(expected) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{text}: {row:?}");
        }
        assert_eq!(table.rows().len(), 2, "{text}");
    }
    for (text, words) in [
        (
            "t,x\n0,1,5\n",
            "line 2: 3 fields: must be 2, as in the header; with decimal commas the fields must be",
        ),
        ("t;x\n0;1.000,5\n", "line 2: x = \"1.000,5\": must be a number"),
        ("t;x\n0;1,000,5\n", "line 2: x = \"1,000,5\": must be a number"),
        ("t,x_cm\n0,1\n", "line 1: missing columns x (x_cm: its units are m, mm, um)"),
        ("t,x,x_mm\n0,1,1000\n", "line 1: column x appears 2 times: must appear once"),
    ] {
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains(words), "{words}: {message}");
    }
}

#[test]
fn errors_of_the_header_name_its_line() {
    for text in ["\nt,y\n", "\r\nt,y\r\n", "\nt,y"] {
        assert_eq!(refusal(text.as_bytes()), "x.csv: line 2: missing columns x");
    }
}

#[test]
fn each_row_has_its_line() {
    let columns = ["t".into(), "x".into()];
    for end in ["\n", "\r\n"] {
        let text = "t,x\n1,2\n\n3,\"4\n\"\n5,\"6\"\n\n\n7,8".replace('\n', end);
        for text in [text.clone(), text + end] {
            let table = NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &columns, &[]).unwrap();
            assert_eq!(table.lines(), [2, 4, 6, 9], "{text:?}");
            assert_eq!(table.rows(), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]);
        }
    }
}
