//! Firmware of a simulated drive: states of CiA 402, brake, torque.

use crate::cia402::{CYCLIC_SYNCHRONOUS_TORQUE, DriveState, commanded_state};

/// From operation enabled until the brake is open \[ns\].
pub const BRAKE_OPENING_NS: u64 = 30_000_000;
/// From the quick stop until the power is off \[ns\].
const QUICK_STOP_NS: u64 = 200_000_000;
/// Bit of the status word, specific to the mode: the drive follows the target torque.
const FOLLOWS_TARGET: u16 = 1 << 12;
/// Bit of the digital inputs that shows the open brake, in the part of the vendor.
pub const BRAKE_INPUT: u8 = 16;

/// What the main device commands in one cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveCommand {
    /// 0x6040
    pub control_word: u16,
    /// 0x6060
    pub mode: i8,
    /// 0x6071
    pub target_torque: i16,
    /// 0x6072
    pub max_torque: u16,
    /// 0x60fe: the brake stays closed.
    pub is_brake_set: bool,
}

/// State of one drive.
#[derive(Clone, Copy, Debug)]
pub struct ServoDrive {
    /// Present state.
    pub state: DriveState,
    /// 0x603f
    pub error_code: u16,
    /// The leg is free.
    pub is_brake_open: bool,
    /// 0x6077
    pub torque: i16,
    /// 0x6061
    pub mode: i8,
    last_word: u16,
    entered_ns: u64,
}

impl Default for ServoDrive {
    fn default() -> Self {
        Self {
            state: DriveState::SwitchOnDisabled,
            error_code: 0,
            is_brake_open: false,
            torque: 0,
            mode: 0,
            last_word: 0,
            entered_ns: 0,
        }
    }
}

impl ServoDrive {
    /// Switches the power off until the fault is reset.
    pub fn trip(&mut self, error_code: u16) {
        self.error_code = error_code;
        self.state = DriveState::Fault;
        (self.is_brake_open, self.torque) = (false, 0);
    }

    /// One cycle of the firmware.
    pub fn cycle(&mut self, now_ns: u64, command: DriveCommand) {
        let DriveCommand { control_word: word, mode, target_torque, max_torque, is_brake_set } = command;
        let is_reset_edge = word & !self.last_word & 0x80 != 0;
        self.last_word = word;
        let mut next = commanded_state(self.state, word, is_reset_edge);
        if next == DriveState::QuickStop && self.state == next && now_ns >= self.entered_ns + QUICK_STOP_NS {
            next = DriveState::SwitchOnDisabled;
        }
        if next != self.state {
            (self.state, self.entered_ns) = (next, now_ns);
        }
        if next != DriveState::Fault {
            self.error_code = 0;
        }
        self.mode = mode;
        let is_enabled = next == DriveState::OperationEnabled;
        self.is_brake_open = is_enabled && !is_brake_set && now_ns >= self.entered_ns + BRAKE_OPENING_NS;
        let bound = max_torque.min(i16::MAX as u16) as i16;
        self.torque = if is_enabled && mode == CYCLIC_SYNCHRONOUS_TORQUE {
            target_torque.clamp(-bound, bound)
        } else {
            0
        };
    }

    /// 0x6041
    pub fn status_word(&self) -> u16 {
        self.state.status_word() | if self.is_brake_open { FOLLOWS_TARGET } else { 0 }
    }

    /// 0x60fd
    pub fn digital_inputs(&self) -> u32 {
        u32::from(self.is_brake_open) << BRAKE_INPUT
    }
}
