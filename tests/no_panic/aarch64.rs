//! Where AArch64 code leaves a function. All instructions are words; the bits are those of the Arm
//! Architecture Reference Manual, C4.1 (branches, exceptions, system), and no branch hides elsewhere.

use super::executable::{Constants, Leap, Leaps};

pub fn leaps(code: &[u8], address: u64, _: &Constants) -> Leaps {
    let words: Vec<u32> =
        code.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    let leap = |index: usize| {
        let at = address + 4 * index as u64;
        Some((at, leap(&words[..=index], at)?))
    };
    (0..words.len()).filter_map(leap).collect()
}

/// The leap of the last of `words`, which is at `address`.
fn leap(words: &[u32], address: u64) -> Option<Leap> {
    let word = *words.last()?;
    let to =
        |bits: u32, shift: u32| Some(Leap::To(address.wrapping_add_signed(signed(word >> shift, bits) * 4)));
    let register = word >> 5 & 31;
    match word {
        // B, BL
        _ if word & 0x7C00_0000 == 0x1400_0000 => to(26, 0),
        // B.cond, CBZ, CBNZ
        _ if word & 0xFF00_0000 == 0x5400_0000 || word & 0x7E00_0000 == 0x3400_0000 => to(19, 5),
        // TBZ, TBNZ
        _ if word & 0x7E00_0000 == 0x3600_0000 => to(14, 5),
        // RET
        _ if word & 0xFFFF_FC1F == 0xD65F_0000 => None,
        // BR of a jump table: the table holds distances, so the target is a sum (ADD). A pointer is not.
        _ if word & 0xFFFF_FC1F == 0xD61F_0000 && is_sum(words, register) => None,
        // Every other branch to a register: BR, BLR, and those with authentication.
        _ if word & 0xFE00_0000 == 0xD600_0000 => Some(pointer(words, address, register)),
        // SVC, HVC, SMC, BRK, HLT, DCPS; UDF
        _ if word & 0xFF00_0000 == 0xD400_0000 || word & 0xFFFF_0000 == 0 => Some(Leap::Trap),
        _ => None,
    }
}

/// Whether the instruction before the last adds two registers to `register`.
fn is_sum(words: &[u32], register: u32) -> bool {
    matches!(words, [.., add, _] if add & 0xFF00_001F == 0x8B00_0000 | register)
}

/// A linker's stub: ADRP x16, page; LDR x17, [x16, offset]; ADD x16, x16, offset; BR x17.
fn pointer(words: &[u32], address: u64, register: u32) -> Leap {
    if let [.., adrp, ldr, add, _] = *words
        && register == 17
        && adrp & 0x9F00_001F == 0x9000_0010
        && ldr & 0xFFC0_03FF == 0xF940_0211
        && add & 0xFFC0_03FF == 0x9100_0210
    {
        let pages = signed((adrp >> 5 & 0x7_FFFF) << 2 | adrp >> 29 & 3, 21);
        let page = ((address - 12) & !0xFFF).wrapping_add_signed(pages << 12);
        return Leap::ThroughPointerAt(page + u64::from(ldr >> 10 & 0xFFF) * 8);
    }
    Leap::Somewhere
}

/// The lowest bits as a signed number.
fn signed(word: u32, bits: u32) -> i64 {
    i64::from((word << (32 - bits)) as i32 >> (32 - bits))
}
