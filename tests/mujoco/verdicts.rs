//! Rust and Python apply the same forces: of a thousand messages, good and damaged, early, late and of other schemas.

use std::fs;

use hexad::messages::layout::FieldType;
use hexad::messages::{ForceMessage, Message};
use hexad::plant::random::Random;

use crate::{file, python};

const MESSAGES: u64 = 1000;

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

const JUDGE: &str = "
import ctypes, hexad, sys
size = ctypes.sizeof(hexad.Force)
content = open('MESSAGES', 'rb').read()
forces = [hexad.Force.from_buffer_copy(content[at:at + size]) for at in range(0, len(content), size)]
print(''.join('01'[force.may_be_applied(NOW, LONGEST)] for force in forces))
";

#[test]
fn rust_and_python_apply_the_same_forces() {
    if python::is_lacking() {
        return;
    }
    let mut random = Random::new(14);
    let (mut content, mut verdicts) = (vec![], String::new());
    for _ in 0..MESSAGES {
        let message = message(&mut random);
        message.visit(&mut |_, bytes| content.extend_from_slice(bytes));
        let may_be_applied = message.may_be_applied(NOW_NS, LONGEST_AGE_NS);
        verdicts.push(if may_be_applied { '1' } else { '0' });
    }
    let path = file("forces.bin");
    fs::write(&path, content).unwrap();
    let script = JUDGE
        .replace("MESSAGES", &path.display().to_string())
        .replace("NOW", &NOW_NS.to_string())
        .replace("LONGEST", &LONGEST_AGE_NS.to_string());
    assert_eq!(python::printed(&script).trim_end(), verdicts);
    let applied = verdicts.matches('1').count();
    println!("{applied} of {MESSAGES} may be applied");
    assert!((300..800).contains(&applied), "{applied}");
}
