//! Objects of a drive over its mailbox: service data objects (SDO).

use ethercrab::EtherCrabWireReadSized;
use ethercrab::error::{Error, MailboxError, PduError};

use crate::bus::Bus;
use crate::drives_file::SdoWrite;
use crate::link::Link;
use crate::startup::PreOpDevices;

/// Emergencies in place of a response after which a transfer is given up.
const MAX_EMERGENCIES: u32 = 8;

/// An error of the bus in words.
pub(crate) fn words(error: Error) -> String {
    match error {
        Error::Timeout(_) => "no response in time: look at cable and power of the drives".into(),
        Error::Mailbox(MailboxError::Aborted { code, address, sub_index }) => {
            format!("object {address:#06x}:{sub_index}: {code}")
        }
        other => other.to_string(),
    }
}

/// Access to the objects of the drive at a position of the bus, from 0.
pub struct Objects<'b, 'f, L> {
    bus: &'b mut Bus<'f, L>,
    devices: &'b PreOpDevices,
    position: usize,
}

impl<'f, L: Link> Bus<'f, L> {
    /// Objects of the drive at a position, from 0.
    pub fn objects<'b>(&'b mut self, devices: &'b PreOpDevices, position: usize) -> Objects<'b, 'f, L> {
        Objects { bus: self, devices, position }
    }
}

impl<L: Link> Objects<'_, '_, L> {
    /// Reads an object that is as long as the type.
    pub fn read<T: EtherCrabWireReadSized>(&mut self, index: u16, sub: u8) -> Result<T, Error> {
        self.repeated(|objects| {
            let device = objects.devices.subdevice(&objects.bus.main, objects.position)?;
            objects.bus.wire.run(device.sdo_read(index, sub))
        })
    }

    /// Value of an object of 1, 2 or 4 bytes.
    pub fn value(&mut self, index: u16, sub: u8) -> Result<i64, String> {
        let is_short = |error: &Error| matches!(error, Error::Wire(_) | Error::Pdu(PduError::Decode));
        let mut value = self.read::<i32>(index, sub).map(i64::from);
        if value.as_ref().is_err_and(is_short) {
            value = self.read::<i16>(index, sub).map(i64::from);
        }
        if value.as_ref().is_err_and(is_short) {
            value = self.read::<i8>(index, sub).map(i64::from);
        }
        value.map_err(words)
    }

    /// Writes an object.
    pub fn write(&mut self, write: SdoWrite) -> Result<(), String> {
        let SdoWrite { index, sub, bytes, value } = write;
        let written = self.repeated(|objects| {
            let Bus { main, wire } = &mut *objects.bus;
            let device = objects.devices.subdevice(main, objects.position)?;
            match bytes {
                1 => wire.run(device.sdo_write(index, sub, value as u8)),
                2 => wire.run(device.sdo_write(index, sub, value as u16)),
                _ => wire.run(device.sdo_write(index, sub, value as u32)),
            }
        });
        written.map_err(words)
    }

    /// Repeats a transfer in whose place the device sent an emergency.
    fn repeated<T>(&mut self, mut transfer: impl FnMut(&mut Self) -> Result<T, Error>) -> Result<T, Error> {
        for _ in 1..MAX_EMERGENCIES {
            self.bus.wire.emergency = None;
            let result = transfer(self);
            if self.bus.wire.emergency.is_none() {
                return result;
            }
        }
        transfer(self)
    }
}
