//! Indices of the objects that the driver uses: CiA 402, and the assignment of process data (ETG1000.6).

/// Outputs are assigned to sync manager 2 here.
pub const RX_PDO_ASSIGNMENT: u16 = 0x1c12;
/// Inputs, to sync manager 3.
pub const TX_PDO_ASSIGNMENT: u16 = 0x1c13;
/// Code of the present fault.
pub const ERROR_CODE: u16 = 0x603f;
/// Control word.
pub const CONTROL_WORD: u16 = 0x6040;
/// Status word.
pub const STATUS_WORD: u16 = 0x6041;
/// Requested mode of operation.
pub const MODE: u16 = 0x6060;
/// Present mode of operation.
pub const MODE_DISPLAY: u16 = 0x6061;
/// Position of the encoder.
pub const POSITION: u16 = 0x6064;
/// Target torque, thousandths of the rated.
pub const TARGET_TORQUE: u16 = 0x6071;
/// Limit of the torque, in thousandths of the rated.
pub const MAX_TORQUE: u16 = 0x6072;
/// Rated torque of the motor, in thousandths of a newton metre.
pub const RATED_TORQUE: u16 = 0x6076;
/// Actual torque, thousandths of the rated.
pub const ACTUAL_TORQUE: u16 = 0x6077;
/// Digital inputs.
pub const DIGITAL_INPUTS: u16 = 0x60fd;
/// Digital outputs: subindex 1 their values, 2 the mask of those that the main device sets. Bit 0 sets the brake.
pub const DIGITAL_OUTPUTS: u16 = 0x60fe;
/// Modes that the drive has.
pub const SUPPORTED_MODES: u16 = 0x6502;
/// Increments of the encoder, and the revolutions of the motor for them.
pub const ENCODER_RESOLUTION: u16 = 0x608f;
