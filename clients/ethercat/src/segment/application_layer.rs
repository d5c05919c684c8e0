//! States of the application layer of a simulated device, and the watchdog of its outputs; ETG1000.6 chapter 5.3.

use super::device::Device;
use super::object_dictionary::MappedObject;
use super::sii::{MAILBOX_LENGTH, SYNC_MANAGER_STARTS};
use crate::al_state::{ERROR, INIT, OP, PRE_OP, SAFE_OP};
use crate::cia402::DriveState;
use crate::objects;

impl Device {
    pub(super) fn refuse(&mut self, code: u16) {
        self.memory[0x130] |= ERROR;
        self.put(0x134, &code.to_le_bytes());
    }

    pub(super) fn request_state(&mut self) {
        let request = self.memory[0x120] & 0xf;
        if self.memory[0x120] & ERROR != 0 {
            self.memory[0x130] &= 0xf;
            self.put(0x134, &[0; 2]);
        }
        let state = self.memory[0x130] & 0xf;
        if self.memory[0x130] & ERROR != 0 && request > state {
            return;
        }
        if let Some((_, code)) = self.refusal.filter(|refusal| refusal.0 == request) {
            return self.refuse(code);
        }
        self.is_op_requested = false;
        match (state, request) {
            (_, INIT) => self.memory[0x130] = INIT,
            (INIT, PRE_OP) => {
                let [receive, send, ..] = SYNC_MANAGER_STARTS;
                let expected = [receive, send].map(|start| (start.into(), MAILBOX_LENGTH.into(), true));
                if [self.sync_manager(0), self.sync_manager(1)] == expected {
                    self.memory[0x130] = PRE_OP;
                } else {
                    self.refuse(0x16);
                }
            }
            (PRE_OP, SAFE_OP) => self.check_process_data(),
            (SAFE_OP, OP) => (self.is_op_requested, self.outputs_ns) = (true, None),
            (PRE_OP, PRE_OP) | (SAFE_OP | OP, PRE_OP | SAFE_OP) | (OP, OP) => self.memory[0x130] = request,
            _ => self.refuse(0x11),
        }
    }

    pub(super) fn check_process_data(&mut self) {
        self.outputs = self.objects.process_data(objects::RX_PDO_ASSIGNMENT);
        self.inputs = self.objects.process_data(objects::TX_PDO_ASSIGNMENT);
        let bytes = |map: &[MappedObject]| map.iter().map(|object| object.bytes).sum::<usize>();
        let is_as_mapped = |manager: (usize, usize, bool), map| manager.1 == bytes(map) && manager.2;
        if !is_as_mapped(self.sync_manager(2), &self.outputs) {
            self.refuse(0x1d);
        } else if !is_as_mapped(self.sync_manager(3), &self.inputs) {
            self.refuse(0x1e);
        } else {
            self.memory[0x130] = SAFE_OP;
        }
    }

    /// Time of the watchdog of the outputs \[ns\]; 0 without one.
    pub fn watchdog_ns(&self) -> u64 {
        (u64::from(self.u16_at(0x400)) + 2) * 40 * u64::from(self.u16_at(0x420))
    }

    /// The outputs have not been written for the time of the watchdog of sync manager 2.
    pub(super) fn check_watchdog(&mut self, now_ns: u64) {
        let watchdog_ns = self.watchdog_ns();
        let age_ns = now_ns.saturating_sub(self.outputs_ns.unwrap_or(now_ns));
        if self.memory[0x130] == OP && watchdog_ns > 0 && age_ns > watchdog_ns {
            self.memory[0x130] = SAFE_OP;
            self.refuse(0x1b);
            self.memory[0x440] = 0;
            self.outputs_ns = None;
            if self.drive.state != DriveState::SwitchOnDisabled {
                self.drive.trip(0x7500);
            }
        }
    }
}
