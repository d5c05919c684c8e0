//! What distinguishes a drive from others, and what is known of it: offset and direction belong to one drive.

use serde::Deserialize;

use crate::drives_file::{DrivesFile, LegSection};

/// Vendor, product and serial number of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Number that the EtherCAT Technology Group has assigned.
    pub vendor: u32,
    /// Of the vendor.
    pub product: u32,
    /// Of the device.
    pub serial: u32,
}

/// How another drive at the position of a leg is noticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdentityBy {
    /// By its serial number.
    Serial,
    /// Not at all, unless vendor or product differ.
    Position,
}

/// A serial number, of which 0 is none.
pub fn in_words(serial: u32) -> String {
    if serial == 0 { "no serial number (0)".into() } else { format!("serial number {serial}") }
}

/// Why an identity among those of all drives does not distinguish its drive, if it does not.
pub fn ambiguity(identity: Identity, all: &[Identity]) -> Option<String> {
    let count = all.iter().filter(|other| **other == identity).count();
    let number = match identity.serial {
        0 => in_words(0),
        serial if count > 1 => format!("{}, as {count} drives have", in_words(serial)),
        _ => return None,
    };
    Some(format!(
        "its drive has {number}: exchanged cables or a replaced drive would not be noticed; give it a number of its own with the \
         tool of its vendor, then zero and jog, or accept this danger: identity = \"position\""
    ))
}

impl DrivesFile {
    /// Legs whose drive the file does not identify as it says, in words.
    pub fn unidentified(&self) -> Vec<String> {
        let all = self.legs.each_ref().map(LegSection::identity);
        let errors = (1..).zip(&self.legs).filter_map(|(number, leg)| {
            let error = match (leg.identity, ambiguity(leg.identity(), &all)) {
                (IdentityBy::Serial, error) => error?,
                (IdentityBy::Position, Some(_)) => return None,
                (IdentityBy::Position, None) => {
                    format!("serial = {} identifies its drive: remove identity = \"position\"", leg.serial)
                }
            };
            Some(format!("leg {number}: {error}"))
        });
        errors.collect()
    }

    /// Legs whose drive is not identified, or whose direction has not been checked with it, in words.
    pub fn unchecked_directions(&self) -> Vec<String> {
        let errors = (1..).zip(&self.legs).filter_map(|(number, leg)| {
            let (is_checked, drive) = match leg.identity {
                IdentityBy::Serial => {
                    (leg.jogged_serial == Some(leg.serial), format!("of serial number {}", leg.serial))
                }
                IdentityBy::Position => {
                    (leg.jogged_position == Some(leg.position), format!("at position {}", leg.position))
                }
            };
            (!is_checked)
                .then(|| format!("leg {number}: its direction was not checked with the drive {drive}: jog"))
        });
        // A direction belongs to a drive: first the drives.
        Some(self.unidentified()).filter(|errors| !errors.is_empty()).unwrap_or_else(|| errors.collect())
    }
}

impl LegSection {
    /// Numbers of its drive.
    pub fn identity(&self) -> Identity {
        Identity { vendor: self.vendor, product: self.product, serial: self.serial }
    }

    /// Keys that record that the direction was found right or wrong with the present drive.
    pub fn direction_record(&self, is_right: bool) -> [(&'static str, Option<String>); 2] {
        let by_serial = self.identity == IdentityBy::Serial;
        let (serial, position) = (self.serial.to_string(), self.position.to_string());
        [
            ("jogged_serial", (is_right && by_serial).then_some(serial)),
            ("jogged_position", (is_right && !by_serial).then_some(position)),
        ]
    }
}
