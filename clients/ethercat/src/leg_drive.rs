//! Drive of one leg, from what it has latched to what it is commanded. Knows no bus and no clock.

use crate::cia402::{CYCLIC_SYNCHRONOUS_TORQUE, DriveState, Goal, control_word};
use crate::drives_file::{Brake, LegSection};
use crate::process_image::{Inputs, Outputs};
use crate::units::{Counter, LegUnits, TorqueRounding};

/// One drive.
#[derive(Clone, Copy, Debug)]
pub struct LegDrive {
    units: LegUnits,
    max_torque_permille: i16,
    brake: Brake,
    counter: Counter,
    has_position: bool,
    rounding: TorqueRounding,
    inputs: Inputs,
    /// Since when operation is enabled \[ns\].
    enabled_ns: Option<u64>,
}

impl LegDrive {
    /// Drive of a leg whose length is nearer to `length_m` than to half the range of its encoder.
    pub fn new(leg: &LegSection, length_m: f64) -> Self {
        let units = leg.units();
        Self {
            units,
            max_torque_permille: leg.max_torque_permille,
            brake: leg.brake,
            counter: Counter::new(units.counts(length_m), units.position_bits),
            has_position: false,
            rounding: TorqueRounding::default(),
            inputs: Inputs::default(),
            enabled_ns: None,
        }
    }

    /// Takes in what the drive latched at an instant \[ns\].
    pub fn receive(&mut self, inputs: Inputs, now_ns: u64) {
        self.inputs = inputs;
        self.counter = self.counter.continued(inputs.position);
        self.has_position = true;
        let is_enabled = self.state() == DriveState::OperationEnabled;
        self.enabled_ns = is_enabled.then(|| self.enabled_ns.unwrap_or(now_ns));
    }

    /// What was latched last.
    pub fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// State of the drive.
    pub fn state(&self) -> DriveState {
        DriveState::of_status_word(self.inputs.status_word)
    }

    /// Length of the leg \[m\]; `None` before the first position.
    pub fn length_m(&self) -> Option<f64> {
        self.has_position.then(|| self.units.length_m(self.counter.counts()))
    }

    /// Force that the drive reports \[N\].
    pub fn force_n(&self) -> f64 {
        f64::from(self.inputs.torque) * self.units.newtons_per_permille()
    }

    /// Whether the drive applies target torques.
    pub fn is_enabled(&self) -> bool {
        self.enabled_ns.is_some() && self.inputs.mode == CYCLIC_SYNCHRONOUS_TORQUE
    }

    /// Whether the leg is free.
    pub fn is_brake_open(&self, now_ns: u64) -> bool {
        match self.brake {
            Brake::StatusBit(bit) => self.is_enabled() && self.inputs.status_word >> bit & 1 == 1,
            Brake::InputBit(bit) => self.inputs.digital_inputs >> bit & 1 == 1,
            Brake::OpenMs(time_ms) => {
                let open_ns = u64::from(time_ms) * 1_000_000;
                self.enabled_ns.is_some_and(|enabled_ns| now_ns.saturating_sub(enabled_ns) >= open_ns)
            }
        }
    }

    /// Command towards a goal, with a force once operation is enabled.
    pub fn command(&mut self, goal: Goal, force_n: f64) -> Outputs {
        let state = self.state();
        let may_push = goal == Goal::Enabled && state == DriveState::OperationEnabled;
        let target_torque = if may_push {
            self.rounding.command(force_n, &self.units, self.max_torque_permille)
        } else {
            self.rounding = TorqueRounding::default();
            0
        };
        Outputs { control_word: control_word(state, goal), target_torque }
    }
}
