//! Process data of one drive: what is mapped, and its bytes.

use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::drives_file::Brake;

/// Outputs as entries of a mapping object: index, subindex, bits.
pub const OUTPUT_ENTRIES: [u32; 3] = [0x6040_0010, 0x6071_0010, 0x6060_0008];
/// Inputs. The digital inputs, at the end, are mapped where the brake is among them.
pub const INPUT_ENTRIES: [u32; 6] =
    [0x6041_0010, 0x6064_0020, 0x6077_0010, 0x603f_0010, 0x6061_0008, 0x60fd_0020];

/// Inputs that are mapped for a drive.
pub fn input_entries(brake: Brake) -> &'static [u32] {
    let has_digital_inputs = matches!(brake, Brake::InputBit(_));
    INPUT_ENTRIES.get(..if has_digital_inputs { 6 } else { 5 }).unwrap_or(&[])
}

/// Command to a drive in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// 0x6040
    pub control_word: u16,
    /// 0x6071, thousandths of the rated torque.
    pub target_torque: i16,
}

impl Outputs {
    /// Writes the bytes; the mode is cyclic synchronous torque in every cycle.
    pub fn write(&self, bytes: &mut [u8]) {
        let [a, b] = self.control_word.to_le_bytes();
        let [c, d] = self.target_torque.to_le_bytes();
        if let Some(part) = bytes.get_mut(..5) {
            part.copy_from_slice(&[a, b, c, d, CYCLIC_SYNCHRONOUS_TORQUE as u8]);
        }
    }
}

/// What a drive has latched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// 0x6041
    pub status_word: u16,
    /// 0x6064
    pub position: i32,
    /// 0x6077, thousandths of the rated torque.
    pub torque: i16,
    /// 0x603f
    pub error_code: u16,
    /// 0x6061
    pub mode: i8,
    /// 0x60fd; 0 where it is not mapped.
    pub digital_inputs: u32,
}

impl Inputs {
    /// Reads the bytes; `None` if there are too few.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (&[a, b, c, d, e, f, g, h, i, j, mode], rest) = bytes.split_first_chunk()?;
        Some(Self {
            status_word: u16::from_le_bytes([a, b]),
            position: i32::from_le_bytes([c, d, e, f]),
            torque: i16::from_le_bytes([g, h]),
            error_code: u16::from_le_bytes([i, j]),
            mode: mode as i8,
            digital_inputs: rest.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes)),
        })
    }
}
