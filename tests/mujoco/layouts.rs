//! The declarations that `hexad messages` prints are those of the Rust structs, as the compilers of Rust and C and
//! Python's ctypes see them. That they also have the documented type names shows when they connect.

use std::mem::{align_of, offset_of, size_of};
use std::process::Command;

use crate::{file, python};
use hexad::messages::layout::{Declared, Kind, Layout};
use hexad::messages::{ForceMessage, Header, MESSAGES, StatusMessage};
use hexad_support::libhexad::declared;

/// A line for each struct and one for each of its fields.
fn lines(layout: &Layout, seen: &mut Vec<&'static str>) -> String {
    let schema = layout.topic.map_or(0, |topic| topic.schema);
    let mut lines = format!("{} {schema} {} {}\n", layout.type_name, layout.size, layout.align);
    let mut nested = String::new();
    for field in layout.fields {
        lines += &format!("  {} {}\n", field.name, field.offset);
        if let Kind::Struct(inner) = field.kind
            && !seen.contains(&inner.type_name)
        {
            seen.push(inner.type_name);
            nested += &self::lines(inner, seen);
        }
    }
    lines + &nested
}

fn all_lines() -> String {
    let mut seen = vec![];
    MESSAGES.iter().map(|layout| lines(layout, &mut seen)).collect()
}

const PRINT: &str = "
import ctypes, hexad.messages
seen = []
def show(struct):
    print(struct.type_name(), struct.schema if hasattr(struct, 'topic') else 0, ctypes.sizeof(struct), ctypes.alignment(struct))
    nested = []
    for name, kind in struct._fields_:
        print(' ', name, getattr(struct, name).offset)
        inner = getattr(kind, '_type_', kind)
        nested += [inner] if hasattr(inner, '_fields_') else []
    for inner in nested:
        if inner not in seen:
            seen.append(inner)
            show(inner)
for name in ['Setpoint', 'Measured', 'Force', 'Status', 'Statistics']:
    message = getattr(hexad.messages, name)
    assert message.type_name() == 'hexad_' + message.topic
    show(message)
";

#[test]
fn python_sees_the_layouts_of_rust() {
    assert_eq!(python::printed(PRINT), all_lines());
}

/// The header asserts every size and offset itself.
#[test]
fn a_c_compiler_sees_the_layouts_of_rust() {
    let header = declared("c");
    let accepts = |name: &str, text: &str| {
        let path = file(name);
        std::fs::write(&path, text).unwrap();
        let compiler = Command::new("cc")
            .args(["-std=c11", "-Wall", "-Werror", "-fsyntax-only", "-x", "c"])
            .arg(&path)
            .output();
        compiler.expect("NOT RUN: a C compiler, cc").status.success()
    };
    assert!(accepts("messages.h", &header));
    // One assertion for size and alignment of each struct and one for each field, and they can fail.
    let asserted = header.matches("static_assert(").count();
    let ours = all_lines();
    let fields = ours.lines().filter(|line| line.starts_with(' ')).count();
    let structs = ours.lines().count() - fields;
    assert!(
        structs > 10 && fields > 80 && asserted == 2 * structs + fields,
        "{asserted} assertions for:\n{ours}"
    );
    let wrong = header.replace("uint32_t active_limits", "uint64_t active_limits");
    assert!(wrong != header && !accepts("wrong.h", &wrong));
}

/// The list of fields says what the compiler does, here where a mistake would be seen least.
#[test]
fn the_list_of_fields_is_that_of_the_structs() {
    let header = Header::LAYOUT;
    assert_eq!((header.size, header.align), (size_of::<Header>(), align_of::<Header>()));
    let field = |layout: &Layout, name: &str| *layout.fields.iter().find(|field| field.name == name).unwrap();
    assert_eq!(field(&ForceMessage::LAYOUT, "checksum").offset, offset_of!(ForceMessage, checksum));
    assert_eq!(field(&StatusMessage::LAYOUT, "io").offset, offset_of!(StatusMessage, io));
    let columns = StatusMessage::LAYOUT.columns("");
    assert_eq!(columns.len(), StatusMessage::default().numbers().len());
    for name in ["header_sequence", "diagnostic_value", "x_6", "io_rejected_schema"] {
        assert!(columns.iter().any(|column| column == name), "{name}: {columns:?}");
    }
}

/// A force of simulated time 1 s, good but for one thing at a time.
const JUDGE: &str = "
import hexad, zlib
from hexad.messages import Header
def judged(now_ns=1_000_000_000, **fields):
    force = hexad.Force(Header(hexad.Force.schema, 0, 7, 1, 1_000_000_000), valid=1, force_n=(1, 2, 3, 4, 5, 6))
    damaged = fields.pop('damaged', 0)
    for name, value in fields.items():
        setattr(force, name, value)
    force.checksum = damaged ^ zlib.crc32(bytes(force)[:hexad.Force.checksum.offset])
    return hexad.judge(force, now_ns, 50_000_000)
print(judged(), judged(now_ns=1_050_000_000), judged(now_ns=1_050_000_001), judged(now_ns=999_999_999))
print(judged(valid=0), judged(damaged=1), judged(force_n=(1, 2, 3, 4, 5, float('nan'))))
";

#[test]
fn python_applies_no_force_that_is_old_or_early_or_not_valid_or_damaged() {
    if python::is_lacking() {
        return;
    }
    assert_eq!(python::printed(JUDGE), "True True False False\nFalse False False\n");
}
