//! Objects of a simulated drive, and the service data objects (SDO) over CoE that read and write them, ETG1000.6 chapter 5.6.

use std::collections::BTreeMap;

use super::device::DeviceModel;
use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE_BIT;
use crate::identity::Identity;
use crate::objects;

/// Name that object 0x1008 shows.
const DEVICE_NAME: &[u8] = b"hexad simulated servo drive";

const ABORT_COMMAND: u32 = 0x0504_0001;
const ABORT_READ_ONLY: u32 = 0x0601_0002;
const ABORT_NO_OBJECT: u32 = 0x0602_0000;
const ABORT_LENGTH: u32 = 0x0607_0010;
const ABORT_STATE: u32 = 0x0800_0022;

#[derive(Clone, Copy, Debug)]
struct Object {
    value: u64,
    bytes: u8,
    is_writable: bool,
}

/// Object that is part of the process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedObject {
    /// Index and subindex.
    pub key: (u16, u8),
    /// Length in the process data.
    pub bytes: usize,
}

/// Objects of one drive by index and subindex.
#[derive(Clone, Debug)]
pub struct ObjectDictionary(BTreeMap<(u16, u8), Object>);

impl ObjectDictionary {
    /// Objects of a device.
    pub fn new(model: &DeviceModel) -> Self {
        let mut objects = BTreeMap::new();
        let mut add = |index, sub, value: u32, bytes, is_writable| {
            objects.insert((index, sub), Object { value: value.into(), bytes, is_writable });
        };
        // Servo drive of the profile 402.
        add(0x1000, 0, 0x0002_0192, 4, false);
        let Identity { vendor, product, serial } = model.identity;
        for (sub, value) in (0..).zip([4, vendor, product, 1, serial]) {
            add(0x1018, sub, value, if sub == 0 { 1 } else { 4 }, false);
        }
        // Uses of the sync managers, which SOEM reads.
        for (sub, value) in (0..).zip([4, 1, 2, 3, 4]) {
            add(0x1c00, sub, value, 1, false);
        }
        let rated_mn_m = (model.units.rated_torque_n_m * 1000.0).round() as u32;
        let modes = CYCLIC_SYNCHRONOUS_TORQUE_BIT | 1 << 7 | 1 << 8;
        for (index, sub, value, bytes) in [
            (objects::ERROR_CODE, 0, 0, 2),
            (objects::STATUS_WORD, 0, 0, 2),
            (objects::MODE_DISPLAY, 0, 0, 1),
            (objects::POSITION, 0, 0, 4),
            (objects::ACTUAL_TORQUE, 0, 0, 2),
            (objects::DIGITAL_INPUTS, 0, 0, 4),
            (objects::ENCODER_RESOLUTION, 1, model.units.counts_per_rev as u32, 4),
            (objects::ENCODER_RESOLUTION, 2, 1, 4),
            (objects::RATED_TORQUE, 0, rated_mn_m, 4),
            (objects::SUPPORTED_MODES, 0, modes, 4),
        ] {
            add(index, sub, value, bytes, false);
        }
        for (index, sub, value, bytes) in [
            (objects::CONTROL_WORD, 0, 0, 2),
            (objects::MODE, 0, 0, 1),
            (objects::TARGET_TORQUE, 0, 0, 2),
            (objects::MAX_TORQUE, 0, model.max_torque_permille.into(), 2),
            (objects::DIGITAL_OUTPUTS, 1, 0, 4),
            (objects::DIGITAL_OUTPUTS, 2, 0, 4),
            // Reaction to the quick stop; interpolation time; synchronization of outputs and inputs.
            (0x605a, 0, 2, 2),
            (0x60c2, 1, 1, 1),
            (0x60c2, 2, 0xfd, 1),
            (0x1c32, 1, 2, 2),
            (0x1c33, 1, 2, 2),
        ] {
            add(index, sub, value, bytes, true);
        }
        map_process_data(&mut objects);
        Self(objects)
    }

    /// Value of an object; 0 if there is none.
    pub fn get(&self, index: u16) -> u64 {
        self.value((index, 0))
    }

    /// Value of an object by index and subindex; 0 if there is none.
    pub fn value(&self, key: (u16, u8)) -> u64 {
        self.0.get(&key).map_or(0, |object| object.value)
    }

    /// Sets an object of the firmware, whether it is writable over the bus or not.
    pub fn set(&mut self, index: u16, value: u64) {
        if let Some(object) = self.0.get_mut(&(index, 0)) {
            object.value = value & (!0 >> (64 - 8 * u32::from(object.bytes)));
        }
    }

    /// Removes an object, as of a drive that does not have it.
    pub fn remove(&mut self, index: u16) {
        self.0.retain(|key, _| key.0 != index);
    }

    /// Objects of the process data that an assignment (0x1c12, 0x1c13) leads to.
    pub fn process_data(&self, assignment: u16) -> Vec<MappedObject> {
        let entries = |index: u16| (1..=self.value((index, 0)) as u8).map(move |sub| (index, sub));
        entries(assignment)
            .flat_map(|key| entries(self.value(key) as u16))
            .map(|key| {
                let entry = self.value(key) as u32;
                MappedObject {
                    key: ((entry >> 16) as u16, (entry >> 8) as u8),
                    bytes: usize::from(entry as u8) / 8,
                }
            })
            .collect()
    }

    /// Copies outputs from the process data into their objects.
    pub fn load(&mut self, map: &[MappedObject], mut data: &[u8]) {
        for object in map {
            let Some((bytes, rest)) = data.split_at_checked(object.bytes) else { return };
            let mut value = [0; 8];
            value[..bytes.len()].copy_from_slice(bytes);
            if let Some(object) = self.0.get_mut(&object.key) {
                object.value = u64::from_le_bytes(value);
            }
            data = rest;
        }
    }

    /// Copies inputs from their objects into the process data.
    pub fn store(&self, map: &[MappedObject], mut data: &mut [u8]) {
        for object in map {
            let Some((bytes, rest)) = data.split_at_mut_checked(object.bytes) else { return };
            bytes.copy_from_slice(&self.value(object.key).to_le_bytes()[..object.bytes]);
            data = rest;
        }
    }

    /// Response to the CoE message in a mailbox, without its length; `None` where the message is none of the protocol. Process
    /// data may only be mapped where `is_pre_op`.
    pub fn respond(&mut self, mailbox: &[u8], is_pre_op: bool) -> Option<Vec<u8>> {
        let &[_, _, _, _, _, kind, _, service, command, low, high, sub, a, b, c, d, ..] = mailbox else {
            return None;
        };
        if kind & 0xf != 3 || service >> 4 != 2 {
            return None;
        }
        let mut response = vec![0, 0, 0, 0, 0, kind, 0, 3 << 4, 0, low, high, sub, 0, 0, 0, 0];
        let index = u16::from_le_bytes([low, high]);
        let result = match command >> 5 {
            2 if index == 0x1008 => {
                response[8] = 0x41;
                response[12] = DEVICE_NAME.len() as u8;
                response.extend(DEVICE_NAME);
                return Some(response);
            }
            2 => self.0.get(&(index, sub)).ok_or(ABORT_NO_OBJECT).map(|object| {
                response[12..16].copy_from_slice(&object.value.to_le_bytes()[..4]);
                0x43 | (4 - object.bytes) << 2
            }),
            1 => {
                self.write((index, sub), command, u32::from_le_bytes([a, b, c, d]), is_pre_op).map(|()| 0x60)
            }
            _ => Err(ABORT_COMMAND),
        };
        match result {
            Ok(command) => response[8] = command,
            Err(abort) => {
                (response[7], response[8]) = (2 << 4, 0x80);
                response[12..16].copy_from_slice(&abort.to_le_bytes());
            }
        }
        Some(response)
    }

    fn write(&mut self, key: (u16, u8), command: u8, value: u32, is_pre_op: bool) -> Result<(), u32> {
        let object = self.0.get_mut(&key).ok_or(ABORT_NO_OBJECT)?;
        let is_mapping =
            matches!(key.0, 0x1600..=0x1bff | objects::RX_PDO_ASSIGNMENT | objects::TX_PDO_ASSIGNMENT);
        if !object.is_writable {
            return Err(ABORT_READ_ONLY);
        }
        if command & 2 == 0 || 4 - (command >> 2 & 3) != object.bytes {
            return Err(ABORT_LENGTH);
        }
        if is_mapping && !is_pre_op {
            return Err(ABORT_STATE);
        }
        object.value = u64::from(value) & (!0 >> (64 - 8 * u32::from(object.bytes)));
        Ok(())
    }
}

/// Mapping with which a drive is delivered.
fn map_process_data(objects: &mut BTreeMap<(u16, u8), Object>) {
    let outputs = [0x6040_0010u32, 0x6071_0010, 0x6060_0008];
    let inputs = [0x6041_0010u32, 0x6064_0020, 0x6077_0010, 0x6061_0008];
    for (mapping, assignment, entries) in [
        (0x1600, objects::RX_PDO_ASSIGNMENT, &outputs[..]),
        (0x1a00, objects::TX_PDO_ASSIGNMENT, &inputs[..]),
    ] {
        for sub in 0..=2u8 {
            let value = [1, u64::from(mapping), 0][usize::from(sub)];
            let bytes = if sub == 0 { 1 } else { 2 };
            objects.insert((assignment, sub), Object { value, bytes, is_writable: true });
        }
        let count = Object { value: entries.len() as u64, bytes: 1, is_writable: true };
        objects.insert((mapping, 0), count);
        for sub in 1..=8u8 {
            let entry = entries.get(usize::from(sub) - 1).copied().unwrap_or(0);
            objects.insert((mapping, sub), Object { value: entry.into(), bytes: 4, is_writable: true });
        }
    }
}
