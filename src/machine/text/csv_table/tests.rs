//! Tables that are read, and texts of what is refused.

use std::io::repeat;

use super::*;
use crate::text::csv_rows::MAX_ROW_BYTES;

/// CSV with the columns t and x.
fn read(source: impl Read) -> Result<NumberTable, TableError> {
    NumberTable::from_reader(source, Path::new("x.csv"), &["t".into(), "x".into()], &[])
}

fn refusal(source: impl Read) -> String {
    read(source).unwrap_err().to_string()
}

#[test]
fn endless_text_is_refused() {
    let bound =
        |line| format!("x.csv: line {line}: a row longer than 65536 bytes: must be at most that long");
    for byte in *b"1\",\n\0" {
        assert_eq!(refusal(repeat(byte)), bound(1));
        assert_eq!(refusal(b"t,x\n".chain(repeat(byte))), bound(2));
    }
    // A quote that is not closed, below a sound row.
    assert_eq!(refusal(b"t,x\n1,2\n\"1,".chain(repeat(b'2'))), bound(3));
}

#[test]
fn a_long_row_is_read_to_its_bound() {
    let rows = |notes: usize| read(format!("t,x,notes\n1,2,{}\n", "n".repeat(notes)).as_bytes());
    assert_eq!(rows(MAX_ROW_BYTES - 5).unwrap().rows(), [[1.0, 2.0]]);
    assert!(rows(2 * MAX_ROW_BYTES).is_err());
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
    let first =
        format!("x.csv: line 2: 1 fields: must be 2, as in the header (first of {MAX_ROWS} such rows)");
    let last = format!("x.csv: line {}: a row after {MAX_ROWS}: must be at most those", MAX_ROWS + 2);
    assert_eq!(message, format!("{first}\n{last}"));
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
    let expected = [[0.0, 1.5], [0.25, -2e-3]];
    for text in [
        "t,x\n0,1.5\n0.25,-2e-3\n",
        "t;x\n0;1,5\n0,25;-2e-3\n",
        "\u{feff}t;x\r\n0;1.5\r\n0.25;-2e-3",
        "t\tx\n0\t1,5\n0.25\t-2e-3\n",
        "t_ms,x_mm\n0,1500\n250,-2\n",
        "\n t_ms ; x_um \n0;1500000\n250,0;-2000\n",
    ] {
        let table = read(text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"));
        for (row, expected) in table.rows().iter().zip(expected) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{text}: {row:?}");
        }
        assert_eq!(table.rows().len(), 2, "{text}");
    }
    for (text, words) in [
        ("t,x\n0,1,5\n", "line 2: 3 fields: must be 2, as in the header; with decimal commas the fields "),
        ("t;x\n0;1.000,5\n", "line 2: x = \"1.000,5\": must be a number"),
        ("t;x\n0;1,000,5\n", "line 2: x = \"1,000,5\": must be a number"),
        ("t,x_cm\n0,1\n", "line 1: missing columns x (x_cm: its units are m, mm, um, nm)"),
        ("t,x,x_mm\n0,1,1000\n", "line 1: column x appears 2 times: must appear once"),
    ] {
        let message = refusal(text.as_bytes());
        assert!(message.contains(words), "{words}: {message}");
    }
}

#[test]
fn errors_of_the_header_name_its_line() {
    for text in ["\nt,y\n", "\r\nt,y\r\n", "\nt,y"] {
        let message = refusal(text.as_bytes());
        assert!(message.starts_with("x.csv: line 2: missing columns x: the header is \"t,y\";"), "{message}");
    }
}

/// What programs write around the same two rows, bytes as in the file.
#[test]
fn headers_of_other_programs_are_read() {
    let utf16 =
        |text: &str, of: fn(u16) -> [u8; 2]| -> Vec<u8> { text.encode_utf16().flat_map(of).collect() };
    let columns = ["t".into(), "x".into(), "x_rate".into()];
    for text in [
        "# exported by \"a tool\n# 2026-11-25\nt,x,x_rate\n0,1.5,2\n# \"half\n0.25,-2e-3,3\n".as_bytes(),
        b"# from numpy\n# t,x,x_rate\n0.0e+00,1.5,2\n0.25,-2e-3,3\n",
        b"#t;x;x_rate\n0;1,5;2\n0,25;-2e-3;3\n",
        b"sep=;\r\nt;x;x_rate;a,b\r\n0;1,5;2;\r\n0,25;-2e-3;3;\r\n",
        b"sep=\t\nt\tx\tx_rate\n0\t1.5\t2\n0.25\t-2e-3\t3\n",
        b"t [ms],x [mm],x_rate [mm/s]\n0,1500,2000\n250,-2,3000\n",
        b"x (um),t (s),x_rate (m_s)\n1500000,0,2\n-2000,0.25,3\n",
        b"t,x,note,x_rate\ns,mm,,mm/s\n0,1500,a,2000\n0.25,-2,b,3000\n",
        b"t_ms,x,x_rate\n[ms],(m),\n0,1.5,2\n250,-2e-3,3\n",
        b"t|x|x_rate\n0|1.5|2\n0.25|-2e-3|3\n",
        b"\n,,\nt,x,x_rate\n,,\n0,1.5,2\n,,\n0.25,-2e-3,3\n,,\n,,\n",
        b"t,x,x_rate\r0,1.5,2\r0.25,-2e-3,3",
        &utf16("\u{feff}t;x;x_rate\r\n0;1,5;2\r\n0,25;-2e-3;3\r\n", u16::to_le_bytes),
        &utf16("\u{feff}t\tx [µm]\tx_rate\n0\t1500000\t2\n0.25\t-2000\t3", u16::to_be_bytes),
    ] {
        let shown = String::from_utf8_lossy(text);
        let table = NumberTable::from_reader(text, Path::new("x.csv"), &columns, &[])
            .unwrap_or_else(|error| panic!("{shown}: {error}"));
        assert_eq!(table.rows().len(), 2, "{shown}");
        for (found, right) in table.rows().iter().flatten().zip([0.0, 1.5, 2.0, 0.25, -2e-3, 3.0]) {
            assert!((found - right).abs() < 1e-15, "{shown}: {found}, not {right}");
        }
    }
    assert_eq!(read(&b"t,x\r0,1\r\r1,2\r"[..]).unwrap().lines(), [2, 4]);
}

#[test]
fn what_is_not_read_is_one_sentence() {
    let read =
        |text: &str| NumberTable::from_reader(text.as_bytes(), Path::new("x.csv"), &pose_columns(), &[]);
    let angles = "with R = Rx(alpha) Ry(beta) Rz(gamma); --rotation names another order or quaternions";
    for (text, wanted) in [
        (
            "Time (s),Roll (deg),Pitch (deg),Yaw (deg),X (mm),Y (cm),Z (mm)\n0,0,0,0,0,0,650\n",
            format!("line 1: missing columns t, alpha, beta, gamma, x, y, z: the header is \"Time (s),Roll (deg),Pitch (deg),Yaw (deg),X (mm),Y (cm),Z (mm)\"; the nearest right one is \"t (s),alpha (deg),beta (deg),gamma (deg),x (mm),y_m,z (mm)\", {angles}"),
        ),
        (
            "0;0;0;0;0;0;0.65\n",
            format!("line 1: missing columns t, alpha, beta, gamma, x, y, z: the header is \"0;0;0;0;0;0;0.65\"; the nearest right one is \"t;alpha;beta;gamma;x;y;z\", {angles}"),
        ),
        (
            "t,alpha,beta,gamma,x,y [cm],note\n0,0,0,0,0,0,\n",
            "line 1: missing columns y (y [cm]: its units are m, mm, um, nm), z: the header is \"t,alpha,beta,gamma,x,y [cm],note\"; the nearest right one is \"t,alpha,beta,gamma,x,y_m,note,z\"".into(),
        ),
        (
            "t,alpha,beta,gamma,x_mm,y,z\ns,rad,rad,rad,m,cm,m\n",
            "line 2: unit of x_mm = \"m\": must be as in the header\nx.csv: line 2: unit of y = \"cm\": must be m, mm, um, nm".into(),
        ),
        (
            &("t,alpha,beta,gamma,x,y,z\n".to_string() + &"0,0,0,0,off,0,0\n".repeat(300) + &"0,0,0,0\n".repeat(200)),
            "line 2: x = \"off\": must be a number (first of 300 such cells)\nx.csv: line 302: 4 fields: must be 7, as in the header (first of 200 such rows)".into(),
        ),
    ] {
        assert_eq!(read(text).unwrap_err().to_string(), format!("x.csv: {wanted}"));
    }
}

#[test]
fn each_row_has_its_line() {
    for end in ["\n", "\r\n"] {
        let text = "t,x\n1,2\n\n3,\"4\n\"\n5,\"6\"\n\n\n7,8".replace('\n', end);
        for text in [text.clone(), text + end] {
            let table = read(text.as_bytes()).unwrap();
            assert_eq!(table.lines(), [2, 4, 6, 9], "{text:?}");
            assert_eq!(table.rows(), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]);
        }
    }
}
