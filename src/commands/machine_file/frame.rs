//! A frame in a machine file: the new pose of one that it has, or a new section at the end.

use toml::Spanned;
use toml::de::DeValue;

use super::{Edits, MachineFileError, array, parsed};
use hexad_machine::config::frames::NamedFrame;

/// Decimals of angles \[rad\] and positions \[m\]: less than any machine can be placed or measured.
const DECIMALS: i32 = 12;

/// Text of a machine file with a frame. Everything else stays as it is.
pub fn with_frame(text: &str, frame: &NamedFrame) -> Result<String, MachineFileError> {
    let root = parsed(text)?;
    let pose = array(frame.x.iter().map(|x| number(*x)));
    let is_named = |item: &&Spanned<DeValue>| {
        let name = item.get_ref().as_table().and_then(|table| table.get("name"));
        name.and_then(|name| name.get_ref().as_str()) == Some(&frame.name)
    };
    let rows = root.get_ref().get("frame").and_then(|rows| rows.get_ref().as_array());
    let found = rows.and_then(|rows| rows.iter().find(is_named));
    let mut edits = Edits::new(text);
    match found.and_then(|row| row.get_ref().as_table()?.get("pose")) {
        Some(old) => edits.replacements.push((old.span(), pose)),
        None => {
            let end = edits.line_end;
            let NamedFrame { name, kind, .. } = frame;
            let lines = format!("{end}name = \"{name}\"{end}kind = \"{kind}\"{end}pose = {pose}");
            edits.sections.insert("[frame]".into(), lines);
        }
    }
    let edited = edits.apply();
    parsed(&edited)?;
    Ok(edited)
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
        let added = format!("{text}\n[[frame]]\nname = \"y\"\nkind = \"work\"\npose = {pose}\n");
        assert_eq!(with_frame(text, &frame("y")).unwrap(), added);
        // Sections cannot be added to an array in one line.
        assert!(with_frame("frame = [{name = 'x'}]", &frame("y")).is_err());
    }
}
