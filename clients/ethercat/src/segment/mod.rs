//! A simulated segment: six CiA 402 drives in a line on EtherCAT, and the mechanics that they move. One clock, no threads, no
//! I/O: the caller passes frames and instants. It allocates nothing while process data are exchanged.
#![allow(
    clippy::indexing_slicing,
    reason = "a simulator: addresses are within a memory of fixed size, or checked before"
)]

pub mod application_layer;
pub mod device;
pub mod local_clock;
mod mailbox;
pub mod mechanics;
pub mod object_dictionary;
pub mod servo_drive;
pub mod sii;

use hexad_core::model::LEGS;

use crate::link::MAX_FRAME;

use self::device::{Device, DeviceModel};
use self::mechanics::{LegForce, Mechanics};

/// Ethernet header, then the header of EtherCAT.
const FIRST_DATAGRAM: usize = 16;
const DATAGRAM_HEADER: usize = 10;
const WORKING_COUNTER: usize = 2;
const ETHERTYPE: [u8; 2] = [0x88, 0xa4];

/// Commands of datagrams, ETG1000.4 table 2.
mod command {
    pub const APRD: u8 = 1;
    pub const APWR: u8 = 2;
    pub const APRW: u8 = 3;
    pub const FPRD: u8 = 4;
    pub const FPWR: u8 = 5;
    pub const FPRW: u8 = 6;
    pub const BRD: u8 = 7;
    pub const BWR: u8 = 8;
    pub const BRW: u8 = 9;
    pub const LRD: u8 = 10;
    pub const LWR: u8 = 11;
    pub const LRW: u8 = 12;
    pub const ARMW: u8 = 13;
    pub const FRMW: u8 = 14;
}

/// Six drives and their mechanics.
#[derive(Clone, Debug)]
pub struct Segment {
    /// In the order in which frames pass.
    pub devices: [Device; LEGS],
    /// What the drives move.
    pub mechanics: Mechanics,
    /// Devices before the cut of the cable.
    pub reachable: usize,
    /// Leg that each device drives, from 0.
    pub leg_of_device: [usize; LEGS],
    now_ns: u64,
}

impl Segment {
    /// Devices that have just been switched on, and the leg of each.
    pub fn new(
        models: [DeviceModel; LEGS],
        leg_of_device: [usize; LEGS],
        mechanics: Mechanics,
        now_ns: u64,
    ) -> Self {
        let mut starts_ns = (1_000_000..).step_by(1_000_000);
        let devices = models.map(|model| Device::new(model, starts_ns.next().unwrap_or_default()));
        Self { devices, mechanics, reachable: LEGS, leg_of_device, now_ns }
    }

    /// Last SYNC0, until which the mechanics have been simulated \[ns\].
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Simulates until an instant \[ns\].
    pub fn advance_to(&mut self, until_ns: u64) {
        loop {
            let due = self.devices.iter().map(|device| device.due_ns(self.now_ns)).zip(0..).min();
            let Some((due_ns, index)) = due.filter(|(due_ns, _)| *due_ns <= until_ns) else { return };
            self.advance_mechanics(due_ns);
            let length = self.mechanics.lengths()[self.leg_of_device[index]];
            self.devices[index].cycle(self.now_ns, length);
        }
    }

    fn advance_mechanics(&mut self, until_ns: u64) {
        let mut forces = [LegForce::default(); LEGS];
        for (device, leg) in self.devices.iter().zip(self.leg_of_device) {
            forces[leg] = device.leg_force();
        }
        self.mechanics.advance(until_ns.saturating_sub(self.now_ns), &forces);
        self.now_ns = self.now_ns.max(until_ns);
    }

    /// Passes a frame through the devices at an instant \[ns\]; whether it is one of EtherCAT and comes back.
    pub fn process(&mut self, now_ns: u64, frame: &mut [u8]) -> bool {
        if frame.len() < FIRST_DATAGRAM + DATAGRAM_HEADER + WORKING_COUNTER || frame[12..14] != ETHERTYPE {
            return false;
        }
        if self.reachable == 0 {
            return false;
        }
        // The first device marks frames that come back.
        frame[6] |= 2;
        for index in 0..self.reachable {
            let is_last = index + 1 == self.reachable;
            // Link at the first port, and unless it is the last, at the second.
            let status: u16 = if is_last { 0x11 } else { 0x31 };
            self.devices[index].put(0x110, &status.to_le_bytes());
            self.devices[index].pass(now_ns, frame);
        }
        true
    }
}

impl Device {
    /// All datagrams of a frame.
    fn pass(&mut self, now_ns: u64, frame: &mut [u8]) {
        let length = usize::from(u16::from_le_bytes([frame[14], frame[15]]) & 0x7ff);
        let end = frame.len().min(FIRST_DATAGRAM + length);
        let mut at = FIRST_DATAGRAM;
        while at + DATAGRAM_HEADER + WORKING_COUNTER <= end {
            let length = u16::from_le_bytes([frame[at + 6], frame[at + 7]]);
            let data_end = at + DATAGRAM_HEADER + usize::from(length & 0x7ff);
            let Some(datagram) = frame.get_mut(at..data_end + WORKING_COUNTER) else { return };
            self.datagram(now_ns, datagram);
            if length & 0x8000 == 0 {
                return;
            }
            at = data_end + WORKING_COUNTER;
        }
    }

    /// One datagram: header, data, working counter.
    fn datagram(&mut self, now_ns: u64, datagram: &mut [u8]) {
        use command::*;
        let (header, rest) = datagram.split_at_mut(DATAGRAM_HEADER);
        let (data, counter) = rest.split_at_mut(rest.len() - WORKING_COUNTER);
        let command = header[0];
        let [position, address] = [2, 4].map(|at| u16::from_le_bytes([header[at], header[at + 1]]));
        if matches!(command, APRD | APWR | APRW | BRD | BWR | BRW | ARMW) {
            header[2..4].copy_from_slice(&position.wrapping_add(1).to_le_bytes());
        }
        let is_addressed = match command {
            APRD | APWR | APRW | ARMW => position == 0,
            FPRD | FPWR | FPRW | FRMW => position == self.u16_at(0x10),
            _ => true,
        };
        let address = usize::from(address);
        let bit = |is_part: bool, weight: u16| if is_part { weight } else { 0 };
        let increment = match command {
            APRD | FPRD | ARMW | FRMW if is_addressed => bit(self.read(now_ns, address, data, false), 1),
            APWR | FPWR | BWR if is_addressed => bit(self.write(now_ns, address, data), 1),
            ARMW | FRMW => bit(self.write(now_ns, address, data), 1),
            BRD => bit(self.read(now_ns, address, data, true), 1),
            APRW | FPRW | BRW if is_addressed => {
                let mut written = [0; MAX_FRAME];
                let written = &mut written[..data.len()];
                written.copy_from_slice(data);
                let is_read = self.read(now_ns, address, data, command == BRW);
                bit(is_read, 1) + bit(self.write(now_ns, address, written), 2)
            }
            LRD | LWR | LRW => {
                let logical = position as u32 | (address as u32) << 16;
                let is_written = command != LRD && self.logical(now_ns, logical, data, true);
                let is_read = command != LWR && self.logical(now_ns, logical, data, false);
                bit(is_read, 1) + bit(is_written, if command == LRW { 2 } else { 1 })
            }
            _ => 0,
        };
        let sum = u16::from_le_bytes([counter[0], counter[1]]).wrapping_add(increment);
        counter.copy_from_slice(&sum.to_le_bytes());
    }

    /// Exchanges the part of logical memory that the FMMUs of one direction map.
    fn logical(&mut self, now_ns: u64, address: u32, data: &mut [u8], is_write: bool) -> bool {
        let mut has_part = false;
        for number in 0..8 {
            let register = 0x600 + 16 * number;
            let direction = if is_write { 2 } else { 1 };
            if self.memory[register + 12] & 1 == 0 || self.memory[register + 11] & direction == 0 {
                continue;
            }
            let start = u64::from(self.u32_at(register));
            let length = u64::from(self.u16_at(register + 4));
            let physical = usize::from(self.u16_at(register + 8));
            let from = start.max(u64::from(address));
            let to = (start + length).min(u64::from(address) + data.len() as u64);
            if from >= to {
                continue;
            }
            let part = (from - u64::from(address)) as usize..(to - u64::from(address)) as usize;
            let memory = physical + (from - start) as usize;
            let part = &mut data[part];
            has_part |= if is_write {
                self.write(now_ns, memory, part)
            } else {
                self.read(now_ns, memory, part, false)
            };
        }
        has_part
    }
}
