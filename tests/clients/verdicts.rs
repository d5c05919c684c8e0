//! Rust, C, C++ and Python read and write the same bytes and apply the same forces: of ten thousand messages, good and
//! damaged, early, late and of other schemas.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use hexad::messages::layout::{FieldType, Layout};
use hexad::messages::{ForceMessage, MESSAGES, Message};
use hexad::model::random::Random;

use crate::file;
use hexad_support::libhexad::with_library;
use hexad_support::python::output;

/// Force messages, and messages of each other topic.
const FORCES: usize = 10_000;
const OTHERS: usize = 1000;

/// An instant of a computer that has been up for a day, and the longest age \[ns\].
const NOW_NS: u64 = 86_400_000_000_000;
const LONGEST_AGE_NS: u64 = 20_000_000;

/// A message that may be applied but for one thing, or altogether.
fn message(random: &mut Random) -> ForceMessage {
    let mut below = |bound: u64| (random.uniform() * bound as f64) as u64;
    let mut message = ForceMessage { valid: 1, state: 3, release_ns: NOW_NS, ..ForceMessage::default() };
    message.force_n = core::array::from_fn(|_| below(40_000) as f64 - 20_000.0);
    message.header.schema = ForceMessage::SCHEMA;
    (message.header.epoch, message.header.sequence) = (1 + below(NOW_NS), 1 + below(1 << 40));
    message.header.time_ns = NOW_NS - below(LONGEST_AGE_NS);
    let leg = below(6) as usize;
    let bits = message.force_n[leg].to_bits();
    let (is_sealed_after, damage) = (below(2) == 0, below(16));
    if !is_sealed_after {
        message.seal();
    }
    match damage {
        0 => message.force_n[leg] = f64::from_bits(bits ^ 1 << below(64)),
        1 => message.force_n[leg] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][below(3) as usize],
        2 => message.valid = below(3) as u32,
        3 => message.header.schema += 1,
        4 => message.header.time_ns = NOW_NS + 1,
        5 => message.header.time_ns = NOW_NS - LONGEST_AGE_NS - below(2),
        6 => message.header.time_ns = [0, u64::MAX][below(2) as usize],
        7 => message.checksum ^= 1 << below(32),
        8 => message.reserved = 1,
        9 => message.header.reserved = 1,
        10 => message.header.time_ns = NOW_NS,
        _ => {}
    }
    if is_sealed_after && damage != 7 {
        message.seal();
    }
    message
}

/// Messages of one topic, and of forces a line each: whether it may be applied, `valid`, `state`.
fn messages(layout: &Layout, random: &mut Random) -> (Vec<u8>, String) {
    let (mut content, mut verdicts) = (vec![], String::new());
    if layout.type_name != "hexad_force" {
        content.extend((0..OTHERS * layout.size).map(|_| (random.uniform() * 256.0) as u8));
        return (content, verdicts);
    }
    for _ in 0..FORCES {
        let message = message(random);
        message.visit(&mut |_, bytes| content.extend_from_slice(bytes));
        let verdict = u32::from(message.may_be_applied(NOW_NS, LONGEST_AGE_NS));
        // With two fields by their names: copies alone do not show that names are exchanged.
        let _ = writeln!(verdicts, "{verdict} {} {}", message.valid, message.state);
    }
    (content, verdicts)
}

/// A program in C and C++ that copies every message field by field, by their names, and prints its verdicts.
fn program_in_c() -> String {
    let mut text = String::from("#include <hexad.h>\n#include <stdio.h>\n#include <string.h>\n");
    for Layout { type_name, fields, .. } in MESSAGES {
        let copies: String = fields
            .iter()
            .map(|field| format!("memcpy(&out.{0}, &in.{0}, sizeof out.{0});\n", field.name))
            .collect();
        let verdict = if *type_name == "hexad_force" {
            format!(
                "printf(\"%d %u %u\\n\", hexad_judge_force(&in, UINT64_C({NOW_NS}), {LONGEST_AGE_NS}) == HEXAD_OK, \
                 (unsigned)in.valid, (unsigned)in.state);"
            )
        } else {
            String::new()
        };
        let _ = write!(
            text,
            "static void copy_{type_name}(FILE *from, FILE *to) {{\nstruct {type_name} in, out;\nwhile (fread(&in, \
             sizeof in, 1, from) == 1) {{\nmemset(&out, 0x5a, sizeof out);\n{copies}{verdict}\nfwrite(&out, sizeof out, \
             1, to);\n}}\n}}\n"
        );
    }
    let count = 1 + 2 * MESSAGES.len();
    let _ = writeln!(
        text,
        "int main(int count, char **arguments) {{\nFILE *from, *to;\nint at = 1;\nif (count != {count}) return 1;"
    );
    for Layout { type_name, .. } in MESSAGES {
        let _ = write!(
            text,
            "from = fopen(arguments[at++], \"rb\");\nto = fopen(arguments[at++], \"wb\");\nif (!from || !to) return \
             1;\ncopy_{type_name}(from, to);\nfclose(from);\nfclose(to);\n"
        );
    }
    text + "return 0;\n}\n"
}

const PROGRAM_IN_PYTHON: &str = "
import ctypes, sys, hexad
from hexad import messages
verdicts = ''
for at, name in enumerate(['Setpoint', 'Measured', 'Force', 'Status', 'Statistics']):
    kind = getattr(messages, name)
    source, target = sys.argv[1 + 2 * at : 3 + 2 * at]
    content, copied = open(source, 'rb').read(), b''
    for start in range(0, len(content), ctypes.sizeof(kind)):
        message = kind.from_buffer_copy(content, start)
        copy = kind.from_buffer_copy(b'\\x5a' * ctypes.sizeof(kind))
        for field, _ in kind._fields_:
            setattr(copy, field, getattr(message, field))
        copied += bytes(copy)
        if name == 'Force':
            verdicts += f'{hexad.judge(message, NOW, LONGEST):d} {message.valid} {message.state}\\n'
    open(target, 'wb').write(copied)
print(verdicts, end='')
";

/// Compiles the program; the path of the executable.
fn compiled(compiler: &str, arguments: &[&str], source: &Path) -> Command {
    let program = file(&format!("verdicts-{}", compiler.replace('+', "p")));
    let flags =
        output(with_library(Command::new("pkg-config")).args(["--cflags", "--libs", "hexad"])).unwrap();
    let mut command = Command::new(compiler);
    command.args(arguments).args(["-Wall", "-Wextra", "-Werror", "-o"]).arg(&program).arg(source);
    output(command.args(flags.split_whitespace())).unwrap();
    with_library(Command::new(program))
}

#[test]
fn every_language_copies_the_same_bytes_and_applies_the_same_forces() {
    let mut random = Random::new(14);
    let (mut verdicts, mut contents) = (String::new(), vec![]);
    for layout in MESSAGES {
        let (content, judged) = messages(layout, &mut random);
        verdicts += &judged;
        fs::write(file(&format!("{}.bin", layout.type_name)), &content).unwrap();
        contents.push(content);
    }
    let [source, script] = ["verdicts.c", "verdicts.py"].map(file);
    fs::write(&source, program_in_c()).unwrap();
    let python =
        PROGRAM_IN_PYTHON.replace("NOW", &NOW_NS.to_string()).replace("LONGEST", &LONGEST_AGE_NS.to_string());
    fs::write(&script, python).unwrap();
    let mut interpreter = with_library(Command::new("python3"));
    interpreter.arg(script);
    let programs = [
        ("C", compiled("cc", &["-std=c11"], &source)),
        ("C++", compiled("c++", &["-x", "c++", "-std=c++11"], &source)),
        ("Python", interpreter),
    ];
    for (language, mut program) in programs {
        let copy = |layout: &Layout| file(&format!("{}-{language}.bin", layout.type_name));
        for layout in MESSAGES {
            program.arg(file(&format!("{}.bin", layout.type_name))).arg(copy(layout));
        }
        assert!(output(&mut program).unwrap() == verdicts, "{language} judges otherwise");
        for (layout, content) in MESSAGES.into_iter().zip(&contents) {
            assert!(fs::read(copy(layout)).unwrap() == *content, "{language}: {}", layout.type_name);
        }
    }
    let applied = verdicts.lines().filter(|line| line.starts_with('1')).count();
    println!("{applied} of {FORCES} may be applied");
    assert!((3 * FORCES / 10..8 * FORCES / 10).contains(&applied), "{applied}");
}
