//! What is on the bus, and everything in which it contradicts a drives file.

use hexad_core::model::LEGS;

use crate::bus::Bus;
use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE_BIT;
use crate::drives_file::{DrivesFile, LegSection};
use crate::identity::{Identity, ambiguity, in_words};
use crate::link::Link;
use crate::objects;
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
            0 => bus.objects(devices, position).read(0x1018, 4).unwrap_or(0),
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
        if *identity != leg.identity() {
            errors.push(format!("leg {number}: {}", identity_error(leg.identity(), *identity, &found)));
            continue;
        }
        let lacks = drive_errors(bus, devices, leg);
        errors.extend(lacks.into_iter().map(|error| format!("leg {number}: {error}")));
    }
    errors
}

fn identity_error(expected: Identity, found: Identity, all: &[Identity]) -> String {
    let Identity { vendor, product, serial } = expected;
    if let Some(position) = all.iter().position(|identity| *identity == expected)
        && ambiguity(expected, all).is_none()
    {
        return format!(
            "its drive, serial number {serial}, is at position {}: cables exchanged?",
            position + 1
        );
    }
    if (found.vendor, found.product) == (vendor, product) {
        let [found, expected] = [found.serial, serial].map(in_words);
        return format!(
            "drive with {found} instead of {expected}: measure its offset again (zero), then jog"
        );
    }
    let found = format!("vendor {:#x}, product {:#x}", found.vendor, found.product);
    format!("{found} instead of vendor {vendor:#x}, product {product:#x}")
}

/// What a drive lacks.
fn drive_errors<L: Link>(bus: &mut Bus<L>, devices: &PreOpDevices, leg: &LegSection) -> Vec<String> {
    let mut objects = bus.objects(devices, leg.position - 1);
    let mut errors = vec![];
    for index in [objects::CONTROL_WORD, objects::STATUS_WORD, objects::TARGET_TORQUE] {
        errors.extend(objects.value(index, 0).err());
    }
    match objects.value(objects::SUPPORTED_MODES, 0) {
        Ok(modes) if modes & i64::from(CYCLIC_SYNCHRONOUS_TORQUE_BIT) == 0 => {
            errors.push(format!("has no cyclic synchronous torque mode: 0x6502 = {modes:#x}"));
        }
        result => errors.extend(result.err()),
    }
    let (rated_n_m, max_permille) = (leg.rated_torque_n_m, leg.max_torque_permille);
    match objects.value(objects::MAX_TORQUE, 0) {
        Ok(limit) if limit < i64::from(max_permille) => {
            errors.push(format!(
                "max_torque_permille = {max_permille} exceeds the drive's limit {limit} (0x6072)"
            ));
        }
        result => errors.extend(result.err()),
    }
    // Optional in CiA 402: then the file alone states it.
    if let Ok(found_mn_m) = objects.value(objects::RATED_TORQUE, 0) {
        let found_n_m = found_mn_m as f64 * 1e-3;
        if (found_n_m - rated_n_m).abs() > RATED_TORQUE_TOLERANCE * rated_n_m {
            errors.push(format!("rated torque {found_n_m} N m (0x6076), the file has {rated_n_m}"));
        }
    }
    errors
}
