//! States of the application layer of a device, as in the registers 0x0120 and 0x0130; ETG1000.6 chapter 5.3.

/// Registers only.
pub const INIT: u8 = 1;
/// Mailbox.
pub const PRE_OP: u8 = 2;
/// Inputs.
pub const SAFE_OP: u8 = 4;
/// Inputs and outputs.
pub const OP: u8 = 8;
/// The last change was refused, or the device left its state; register 0x0134 has the code.
pub const ERROR: u8 = 0x10;
