//! Tables as other tools write them: what is unambiguous is read, the rest is refused in one line that shows the header.

use std::path::{Path, PathBuf};

use super::hexad;
use hexad_support::{Table, data};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Forces of a table of poses.
fn forces(machine: &Path, name: &str) -> Table {
    hexad("inverse-dynamics", machine, &data(name, "csv"), &[]).table()
}

/// Largest difference of the first rows of two tables of forces \[N\].
fn difference(a: &Table, b: &Table, rows: usize) -> f64 {
    let differences = (0..rows).flat_map(|row| {
        let [a, b] = [a, b].map(|table| table.legs(row, "force"));
        a.into_iter().zip(b).map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
    });
    differences.fold(0.0, f64::max)
}

#[test]
fn tables_of_other_tools_are_read() {
    let machine = file("config/reference.toml");
    let base = forces(&machine, "table_base");
    for name in ["bracket_units", "numpy_savetxt", "pipe"] {
        let found = difference(&base, &forces(&machine, &format!("table_{name}")), base.rows.len());
        // Degrees and millimetres are rounded otherwise.
        assert!(found < 1e-6, "{name}: {found} N");
    }
    // Of a shorter table the forces at rest are the same.
    for (name, rows) in [("leading_comments", 9), ("sep_line", 10), ("units_row", 10)] {
        let table = forces(&machine, &format!("table_{name}"));
        assert!(table.rows.len() == rows && difference(&base, &table, 1) < 1e-6, "{name}");
    }
}

/// Roll, pitch and yaw are not the angles of hexad in every tool, so they are not guessed.
#[test]
fn angles_of_another_name_are_refused_with_the_header() {
    let ran = hexad(
        "inverse-dynamics",
        &file("config/reference.toml"),
        &file("tests/data/table_paren_units.csv"),
        &[],
    );
    assert_eq!((ran.code, ran.message.lines().count()), (Some(2), 1), "{}", ran.message);
    for words in
        ["line 1: missing columns", "the header is \"Time (s),Roll (deg)", "the nearest right one is \"t"]
    {
        assert!(ran.message.contains(words), "{words}: {}", ran.message);
    }
}

#[test]
fn a_yaw_that_passes_half_a_turn_is_continued() {
    let machine = data("yaw180", "toml");
    let [wrapped, unwrapped] =
        ["table_yaw180_wrapped", "table_yaw180_unwrapped"].map(|name| forces(&machine, name));
    let found = difference(&wrapped, &unwrapped, wrapped.rows.len().max(unwrapped.rows.len()));
    let largest =
        (0..wrapped.rows.len()).flat_map(|row| wrapped.legs(row, "force")).fold(0.0, |a, b| b.abs().max(a));
    assert!(found < 1e-6 && (30.0..50.0).contains(&largest), "{found} N of {largest} N");
}
