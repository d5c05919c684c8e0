//! CiA 402 (IEC 61800-7-201): states of a drive, and the control words that change them. Knows no bus.

/// Cyclic synchronous torque, the mode of 0x6060 in which a drive applies the target torque of every cycle.
pub const CYCLIC_SYNCHRONOUS_TORQUE: i8 = 10;
/// Bit of 0x6502 (supported drive modes) of that mode.
pub const CYCLIC_SYNCHRONOUS_TORQUE_BIT: u32 = 1 << 9;

/// State of the power drive system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// The drive starts.
    #[default]
    NotReady,
    /// Power may not be switched on.
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power is on; no torque.
    SwitchedOn,
    /// The target torque acts.
    OperationEnabled,
    /// The drive stops by itself.
    QuickStop,
    /// The drive reacts to a fault.
    FaultReaction,
    /// Power is off until the fault is reset.
    Fault,
}

impl DriveState {
    /// State in a status word (0x6041).
    pub fn of_status_word(word: u16) -> Self {
        match (word & 0x6f, word & 0x4f) {
            (_, 0x0f) => Self::FaultReaction,
            (_, 0x08) => Self::Fault,
            (_, 0x40) => Self::SwitchOnDisabled,
            (0x21, _) => Self::ReadyToSwitchOn,
            (0x23, _) => Self::SwitchedOn,
            (0x27, _) => Self::OperationEnabled,
            (0x07, _) => Self::QuickStop,
            _ => Self::NotReady,
        }
    }

    /// Status word of the state, with voltage present.
    pub fn status_word(self) -> u16 {
        match self {
            Self::NotReady => 0x00,
            Self::SwitchOnDisabled => 0x250,
            Self::ReadyToSwitchOn => 0x231,
            Self::SwitchedOn => 0x233,
            Self::OperationEnabled => 0x237,
            Self::QuickStop => 0x217,
            Self::FaultReaction => 0x21f,
            Self::Fault => 0x218,
        }
    }

    /// Whether a fault keeps the power off.
    pub fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }
}

/// State that a driver requests of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Goal {
    /// No power: the drive coasts until its brake has closed.
    #[default]
    Disabled,
    /// The drive stops by its quick stop; without motion, no power.
    Stopped,
    /// Operation enabled.
    Enabled,
    /// A fault is acknowledged; from any other state, no power.
    Reset,
}

const DISABLE_VOLTAGE: u16 = 0x00;
const QUICK_STOP: u16 = 0x02;
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE_OPERATION: u16 = 0x0f;
const FAULT_RESET: u16 = 0x80;

/// Control word (0x6040) that leads from a state towards a goal. A fault is only acknowledged where the goal is the reset;
/// the drive reacts to the rising edge of its bit, and the word without a fault does not have it.
pub fn control_word(state: DriveState, goal: Goal) -> u16 {
    use DriveState::{Fault, OperationEnabled, QuickStop, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    match (goal, state) {
        (Goal::Reset, Fault) => FAULT_RESET,
        (Goal::Enabled, SwitchOnDisabled) => SHUTDOWN,
        (Goal::Enabled, ReadyToSwitchOn) => SWITCH_ON,
        (Goal::Enabled, SwitchedOn | OperationEnabled) => ENABLE_OPERATION,
        (Goal::Stopped, OperationEnabled | QuickStop) => QUICK_STOP,
        _ => DISABLE_VOLTAGE,
    }
}

/// State that follows a control word: the transitions of the state machine, without those that a drive makes by itself.
/// `is_reset_edge`: the bit of the fault reset has risen.
pub fn commanded_state(state: DriveState, word: u16, is_reset_edge: bool) -> DriveState {
    use DriveState::{Fault, OperationEnabled, QuickStop, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    let has = |bits: u16| word & bits == bits;
    match state {
        Fault if is_reset_edge => SwitchOnDisabled,
        ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStop if !has(0x02) => SwitchOnDisabled,
        OperationEnabled if !has(0x04) => QuickStop,
        ReadyToSwitchOn | SwitchedOn if !has(0x04) => SwitchOnDisabled,
        SwitchOnDisabled if word & 0x07 == SHUTDOWN => ReadyToSwitchOn,
        SwitchedOn | OperationEnabled if word & 0x07 == SHUTDOWN => ReadyToSwitchOn,
        ReadyToSwitchOn if word & 0x07 == SWITCH_ON => SwitchedOn,
        SwitchedOn if has(ENABLE_OPERATION) => OperationEnabled,
        OperationEnabled if !has(0x08) => SwitchedOn,
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [DriveState; 8] = [
        DriveState::NotReady,
        DriveState::SwitchOnDisabled,
        DriveState::ReadyToSwitchOn,
        DriveState::SwitchedOn,
        DriveState::OperationEnabled,
        DriveState::QuickStop,
        DriveState::FaultReaction,
        DriveState::Fault,
    ];

    #[test]
    fn a_status_word_and_its_state_agree_whatever_the_other_bits_are() {
        for state in ALL {
            // Warning, remote, target reached, limit active, vendor bits.
            for others in [0, 0x80, 0x200, 0x400, 0x800, 0xf780] {
                let word = state.status_word() & 0x6f | others;
                assert_eq!(DriveState::of_status_word(word), state, "{word:#06x}");
            }
        }
        // The voltage bit 4 and, in a fault, bit 5 mean nothing.
        assert_eq!(DriveState::of_status_word(0x0028), DriveState::Fault);
        assert_eq!(DriveState::of_status_word(0x0060), DriveState::SwitchOnDisabled);
    }

    /// States after following control words towards a goal.
    fn path(mut state: DriveState, goal: Goal) -> Vec<DriveState> {
        let (mut visited, mut last) = (vec![], 0);
        for _ in 0..6 {
            let word = control_word(state, goal);
            let next = commanded_state(state, word, word & !last & FAULT_RESET != 0);
            last = word;
            if next == state {
                break;
            }
            state = next;
            visited.push(state);
        }
        visited
    }

    #[test]
    fn control_words_lead_to_the_goal() {
        use DriveState::*;
        let ways: [(DriveState, Goal, &[DriveState]); 8] = [
            (SwitchOnDisabled, Goal::Enabled, &[ReadyToSwitchOn, SwitchedOn, OperationEnabled]),
            (OperationEnabled, Goal::Stopped, &[QuickStop]),
            (OperationEnabled, Goal::Disabled, &[SwitchOnDisabled]),
            (SwitchedOn, Goal::Stopped, &[SwitchOnDisabled]),
            (QuickStop, Goal::Enabled, &[SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled]),
            (Fault, Goal::Reset, &[SwitchOnDisabled]),
            (OperationEnabled, Goal::Reset, &[SwitchOnDisabled]),
            (OperationEnabled, Goal::Enabled, &[]),
        ];
        for (from, goal, way) in ways {
            assert_eq!(path(from, goal), way, "from {from:?} to {goal:?}");
        }
    }

    #[test]
    fn a_fault_stays_until_it_is_reset() {
        for goal in [Goal::Disabled, Goal::Stopped, Goal::Enabled] {
            assert_eq!(path(DriveState::Fault, goal), [], "{goal:?}");
        }
        assert_eq!(commanded_state(DriveState::Fault, FAULT_RESET, false), DriveState::Fault, "no edge");
    }
}
