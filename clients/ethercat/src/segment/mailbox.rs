//! Mailbox of a simulated device.

use super::device::{Device, MEMORY};
use crate::al_state::PRE_OP;

impl Device {
    pub(super) fn receive_mailbox(&mut self) {
        let (start, length, _) = self.sync_manager(0);
        let is_pre_op = self.memory[0x130] & 0xf == PRE_OP;
        let response = self.objects.respond(&self.memory[start..start + length], is_pre_op);
        let has_emergency = self.send_emergency();
        match response {
            Some(response) if !has_emergency => self.fill_mailbox(&response),
            response => self.waiting_response = response,
        }
    }

    /// Puts the emergency into the mailbox, if there is one.
    pub(super) fn send_emergency(&mut self) -> bool {
        let Some(code) = self.emergency.take_if(|_| self.memory[0x80d] & 8 == 0) else { return false };
        let [low, high] = code.to_le_bytes();
        self.fill_mailbox(&[0, 0, 0, 0, 0, 3, 0, 0x10, low, high, 0x81, 0, 0, 0, 0, 0]);
        true
    }

    pub(super) fn fill_mailbox(&mut self, message: &[u8]) {
        let (start, length, _) = self.sync_manager(1);
        let length = length.min(MEMORY - start);
        self.memory[start..start + length].fill(0);
        self.put(start, &message[..message.len().min(length)]);
        self.put(start, &(message.len() as u16 - 6).to_le_bytes());
        self.memory[0x80d] |= 8;
    }
}
