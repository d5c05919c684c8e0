//! Objects of drives over their mailboxes: service data objects (SDO).

use ethercrab::EtherCrabWireReadSized;
use ethercrab::error::{Error, MailboxError, PduError};

use crate::bus::Bus;
use crate::drives_file::SdoWrite;
use crate::link::Link;
use crate::startup::PreOpDevices;

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

impl<L: Link> Bus<'_, L> {
    /// Reads an object of at most 4 bytes.
    pub fn sdo_read<T: EtherCrabWireReadSized>(
        &mut self,
        devices: &PreOpDevices,
        position: usize,
        index: u16,
        sub: u8,
    ) -> Result<T, Error> {
        self.with_emergency(|bus| {
            let device = devices.subdevice(&bus.main, position)?;
            bus.wire.run(device.sdo_read(index, sub))
        })
    }

    /// Value of an object of 1, 2 or 4 bytes.
    pub fn sdo_value(
        &mut self,
        devices: &PreOpDevices,
        position: usize,
        index: u16,
        sub: u8,
    ) -> Result<i64, String> {
        // A response that is shorter than the type is an error of its own kind.
        let is_short = |error: &Error| matches!(error, Error::Wire(_) | Error::Pdu(PduError::Decode));
        let value = match self.sdo_read::<i32>(devices, position, index, sub) {
            Err(error) if is_short(&error) => match self.sdo_read::<i16>(devices, position, index, sub) {
                Err(error) if is_short(&error) => {
                    self.sdo_read::<i8>(devices, position, index, sub).map(i64::from)
                }
                other => other.map(i64::from),
            },
            other => other.map(i64::from),
        };
        value.map_err(words)
    }

    /// Writes an object.
    pub fn sdo_write(
        &mut self,
        devices: &PreOpDevices,
        position: usize,
        write: SdoWrite,
    ) -> Result<(), String> {
        let SdoWrite { index, sub, bytes, value } = write;
        self.with_emergency(|bus| {
            let device = devices.subdevice(&bus.main, position)?;
            match bytes {
                1 => bus.wire.run(device.sdo_write(index, sub, value as u8)),
                2 => bus.wire.run(device.sdo_write(index, sub, value as u16)),
                _ => bus.wire.run(device.sdo_write(index, sub, value as u32)),
            }
        })
        .map_err(words)
    }

    /// Repeats a transfer in whose place the device sent an emergency. Each emergency is kept in the wire's list.
    fn with_emergency<T>(
        &mut self,
        mut transfer: impl FnMut(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        loop {
            self.wire.emergency = None;
            let result = transfer(self);
            if self.wire.emergency.is_none() {
                return result;
            }
        }
    }
}
