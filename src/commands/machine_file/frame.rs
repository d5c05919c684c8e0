//! A frame in a machine file: the new pose of one that it has, or a new section at the end.

use toml_edit::{ArrayOfTables, Item, Table, value};

use super::{array, exchange, parsed, value_of, written, wrong_type};
use crate::commands::failure::Failure;
use hexad_machine::config::frames::NamedFrame;

/// Decimals of angles \[rad\] and positions \[m\]: less than any machine can be placed or measured.
const DECIMALS: i32 = 12;

/// Text of a machine file with a frame. Everything else stays as it is.
pub fn with_frame(text: &str, frame: &NamedFrame) -> Result<String, Failure> {
    let mut document = parsed(text)?;
    let pose = array(frame.x.iter().map(|x| number(*x)));
    let sections = document.entry("frame").or_insert(ArrayOfTables::new().into());
    let found = sections.type_name();
    let sections =
        sections.as_array_of_tables_mut().ok_or_else(|| wrong_type("frame", found, "sections [[frame]]"))?;
    let is_named = |table: &&mut Table| table.get("name").and_then(Item::as_str) == Some(&frame.name);
    let row = sections.iter_mut().find(is_named);
    match row.and_then(|row| row.get_mut("pose")?.as_value_mut()) {
        Some(old) => exchange(old, &pose),
        None => sections.push(Table::from_iter([
            ("name", value(&frame.name)),
            ("kind", value(frame.kind.to_string())),
            ("pose", value(value_of(&pose))),
        ])),
    }
    written(text, &document)
}

fn number(x: f64) -> String {
    let scale = 10.0_f64.powi(DECIMALS);
    // No negative zero.
    format!("{:?}", (x * scale).round() / scale + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_machine::config::frames::FrameKind;

    fn frame(name: &str) -> NamedFrame {
        let x = [1e-9, -2e-15, 0.0, 0.1, -0.25, 0.135_012_345_678_9];
        NamedFrame { name: name.into(), kind: FrameKind::Work, x }
    }

    #[test]
    fn a_frame_is_replaced_or_added_and_nothing_else_changes() {
        let text = "name = 'a' # b\n[[frame]]\nname = 'x'\nkind = 'work'\npose = [1, 2, 3, 4, 5, 6] # mine\n\n[limits]\n";
        let pose = "[1e-9, 0.0, 0.0, 0.1, -0.25, 0.135012345679]";
        assert_eq!(with_frame(text, &frame("x")).unwrap(), text.replace("[1, 2, 3, 4, 5, 6]", pose));
        let added = format!("\n[[frame]]\nname = \"y\"\nkind = \"work\"\npose = {pose}\n\n[limits]");
        assert_eq!(with_frame(text, &frame("y")).unwrap(), text.replace("\n[limits]", &added));
        // Sections cannot be added to an array in one line.
        assert!(with_frame("frame = [{name = 'x'}]", &frame("y")).is_err());
    }
}
