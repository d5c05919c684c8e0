//! What is on the bus, and everything in which it contradicts a drives file.

use hexad::model::LEGS;

use crate::bus::Bus;
use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE_BIT;
use crate::drives_file::{DrivesFile, LegSection};
use crate::link::Link;
use crate::objects;
use crate::sdo::words;
use crate::segment::sii::Identity;
use crate::startup::PreOpDevices;

/// Rated torques of file and drive may differ by this share: drives round it.
const RATED_TORQUE_TOLERANCE: f64 = 0.01;

/// Vendor, product and serial number of each device.
pub fn identities<L: Link>(bus: &mut Bus<L>, devices: &PreOpDevices) -> Vec<Identity> {
    let found: Vec<_> = devices.iter(&bus.main).map(|device| device.identity()).collect();
    let mut identities = vec![];
    for (position, found) in found.iter().enumerate() {
        // Many devices have no serial number in their EEPROM, but in their identity object.
        let serial = match found.serial {
            0 => bus.sdo_read(devices, position, 0x1018, 4).unwrap_or(0),
            serial => serial,
        };
        identities.push(Identity { vendor: found.vendor_id, product: found.product_id, serial });
    }
    identities
}

/// Everything about the devices that contradicts the file.
pub fn contradictions<L: Link>(bus: &mut Bus<L>, devices: &PreOpDevices, file: &DrivesFile) -> Vec<String> {
    let found = identities(bus, devices);
    let mut errors = vec![];
    if found.len() != LEGS {
        errors.push(format!("{} of {LEGS} drives on the bus", found.len()));
    }
    for (number, leg) in (1..).zip(&file.legs) {
        let Some(identity) = found.get(leg.position - 1) else {
            errors.push(format!("leg {number}: no device at position {}", leg.position));
            continue;
        };
        let expected = Identity { vendor: leg.vendor, product: leg.product, serial: leg.serial };
        if *identity != expected {
            errors.push(format!("leg {number}: {}", identity_error(expected, *identity, &found)));
            continue;
        }
        let alias = devices.subdevice(&bus.main, leg.position - 1).map(|device| device.alias_address());
        if let (Some(expected), Ok(alias)) = (leg.alias, alias)
            && alias != expected
        {
            errors.push(format!("leg {number}: alias {alias}, the file has {expected}"));
        }
        errors.extend(
            drive_errors(bus, devices, leg).into_iter().map(|error| format!("leg {number}: {error}")),
        );
    }
    errors
}

fn identity_error(expected: Identity, found: Identity, all: &[Identity]) -> String {
    let elsewhere = all.iter().position(|identity| *identity == expected).map(|position| position + 1);
    match elsewhere {
        Some(position) => {
            format!(
                "its drive, serial number {}, is at position {position}: cables exchanged?",
                expected.serial
            )
        }
        None if (found.vendor, found.product) == (expected.vendor, expected.product) => format!(
            "drive with serial number {} instead of {}: measure its offset again (zero)",
            found.serial, expected.serial
        ),
        None => format!(
            "vendor {:#x}, product {:#x} instead of vendor {:#x}, product {:#x}",
            found.vendor, found.product, expected.vendor, expected.product
        ),
    }
}

/// What a drive lacks.
fn drive_errors<L: Link>(bus: &mut Bus<L>, devices: &PreOpDevices, leg: &LegSection) -> Vec<String> {
    let position = leg.position - 1;
    let mut errors = vec![];
    match bus.sdo_read::<u32>(devices, position, objects::SUPPORTED_MODES, 0) {
        Ok(modes) if modes & CYCLIC_SYNCHRONOUS_TORQUE_BIT == 0 => {
            errors.push(format!("has no cyclic synchronous torque mode: 0x6502 = {modes:#x}"));
        }
        Ok(_) => {}
        Err(error) => errors.push(words(error)),
    }
    // Optional in CiA 402: then the file alone states it.
    if let Ok(rated_mn_m) = bus.sdo_read::<u32>(devices, position, objects::RATED_TORQUE, 0) {
        let rated_n_m = f64::from(rated_mn_m) * 1e-3;
        if (rated_n_m - leg.rated_torque_n_m).abs() > RATED_TORQUE_TOLERANCE * leg.rated_torque_n_m {
            errors.push(format!(
                "rated torque {rated_n_m} N m (0x6076), the file has {}",
                leg.rated_torque_n_m
            ));
        }
    }
    match bus.sdo_read::<u16>(devices, position, objects::MAX_TORQUE, 0) {
        Ok(limit) if i32::from(limit) < i32::from(leg.max_torque_permille) => errors.push(format!(
            "max_torque_permille = {} exceeds the drive's limit {limit} (0x6072)",
            leg.max_torque_permille
        )),
        Ok(_) => {}
        Err(error) => errors.push(words(error)),
    }
    for index in [objects::CONTROL_WORD, objects::STATUS_WORD, objects::TARGET_TORQUE] {
        if let Err(error) = bus.sdo_read::<u16>(devices, position, index, 0) {
            errors.push(words(error));
        }
    }
    errors
}
