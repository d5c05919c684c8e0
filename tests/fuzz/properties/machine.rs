//! The file that explains every key, with other numbers: what no mutation of text finds, as it takes many
//! digits that fit each other.
//!
//! The input is a list of edits of five bytes: which number, and what it becomes. From [`SCALE`] on, all
//! numbers with its key are multiplied instead, and by the last index every length.

use std::sync::LazyLock;

use toml::{Table, Value};

use super::config;

const REFERENCE: &str = include_str!("../../../config/reference.toml");

/// Indices from here on multiply.
const SCALE: u8 = 128;

/// Whether the machine is accepted; panics where either answer is wrong.
pub fn hold(input: &[u8]) -> bool {
    let mut file = EVERY_KEY.clone();
    for edit in input.chunks_exact(5) {
        let (index, bytes) = edit.split_first().expect("five bytes");
        change(&mut file, *index, f32::from_le_bytes(bytes.try_into().expect("four bytes")).into());
    }
    config::hold(toml::to_string(&file).expect("a table of numbers").as_bytes())
}

/// The reference, and the lines that are comments there as their keys have no default.
static EVERY_KEY: LazyLock<Value> = LazyLock::new(|| {
    let given = |line: &'static str| line.strip_prefix("# ").filter(|rest| rest.contains(" = ["));
    let lines: Vec<_> = REFERENCE.lines().map(|line| given(line).unwrap_or(line)).collect();
    lines.join("\n").parse::<Table>().expect("the reference is sound").into()
});

fn change(file: &mut Value, index: u8, number: f64) {
    let mut keys = vec![];
    each_number("", file, &mut |key, _| keys.push(key.to_owned()));
    let chosen = usize::from(index % SCALE) % keys.len();
    let mut count = 0;
    each_number("", file, &mut |key, x| {
        let every_length = index == u8::MAX && (key.ends_with("_m") || key == "pose");
        if every_length || index >= SCALE && key == keys[chosen] {
            *x *= number;
        } else if index < SCALE && count == chosen {
            *x = number;
        }
        count += 1;
    });
}

/// Visits the floating-point numbers with their keys.
fn each_number(key: &str, value: &mut Value, visit: &mut impl FnMut(&str, &mut f64)) {
    match value {
        Value::Float(x) => visit(key, x),
        Value::Array(items) => items.iter_mut().for_each(|item| each_number(key, item, visit)),
        Value::Table(table) => table.iter_mut().for_each(|(key, item)| each_number(key, item, visit)),
        _ => {}
    }
}
