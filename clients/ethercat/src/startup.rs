//! From a bus whose devices are in any state to six drives in OP, with every error in words.

use ethercrab::error::{Error, MailboxError, PduError};
use ethercrab::subdevice_group::{DcConfiguration, HasDc, Op};
use ethercrab::{
    AlStatusCode, Command, DcSync, DefaultLock, EtherCrabWireReadSized, RegisterAddress, SubDeviceGroup,
};
use std::time::Duration;

use hexad::model::LEGS;

use crate::bus::{Bus, MAX_DEVICES, MAX_PROCESS_DATA};
use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE_BIT;
use crate::drives_file::{DrivesFile, LegSection, SdoWrite};
use crate::link::Link;
use crate::objects;
use crate::process_image::{OUTPUT_ENTRIES, Outputs, input_entries};
use crate::segment::sii::Identity;
use crate::sync_clock::SyncClock;

/// Devices in PRE-OP: mailboxes, no process data.
pub type PreOpDevices = SubDeviceGroup<MAX_DEVICES, MAX_PROCESS_DATA>;
/// Devices that exchange process data.
pub type OpDevices = SubDeviceGroup<MAX_DEVICES, MAX_PROCESS_DATA, DefaultLock, Op, HasDc>;

/// Address that ethercrab gives to the first device.
pub(crate) const FIRST_ADDRESS: u16 = 0x1000;
/// From the configuration of SYNC0 to its first pulse.
const SYNC0_DELAY: Duration = Duration::from_millis(50);
/// Cycles within which all devices must be in OP.
const MAX_CYCLES_TO_OP: u32 = 3000;
/// Rated torques of file and drive may differ by this share: drives round it.
const RATED_TORQUE_TOLERANCE: f64 = 0.01;

/// Errors that keep the driver from starting, a line each.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct StartupErrors(pub Vec<String>);

impl From<String> for StartupErrors {
    fn from(error: String) -> Self {
        Self(vec![error])
    }
}

/// An error of the bus in words.
fn words(error: Error) -> String {
    match error {
        Error::Timeout(_) => "no response in time: look at cable and power of the drives".into(),
        Error::Mailbox(MailboxError::Aborted { code, address, sub_index }) => {
            format!("object {address:#06x}:{sub_index}: {code}")
        }
        other => other.to_string(),
    }
}

/// Brings all devices to PRE-OP.
pub fn find<L: Link>(bus: &mut Bus<L>) -> Result<PreOpDevices, StartupErrors> {
    let now_ns = bus.wire.link.now_ns();
    let found = bus.wire.run(bus.main.init_single_group(move || now_ns));
    let devices: PreOpDevices = found.map_err(|error| match error {
        Error::Timeout(_) if bus.main.num_subdevices() == 0 => {
            "no device answers: look at cable and power of the drives, and at `interface`".to_string()
        }
        Error::Capacity(_) => format!("more than {MAX_DEVICES} devices on the bus"),
        other => [vec![words(other)], refused_states(bus)].concat().join("\n"),
    })?;
    if devices.is_empty() {
        return Err("no device on the bus: look at cable and power of the drives".to_string().into());
    }
    Ok(devices)
}

/// Devices that refused a state, with their AL status code.
fn refused_states<L: Link>(bus: &mut Bus<L>) -> Vec<String> {
    let mut lines = vec![];
    for position in 0..bus.main.num_subdevices() as u16 {
        let address = FIRST_ADDRESS + position;
        let status =
            bus.wire.run(Command::fprd(address, RegisterAddress::AlStatus.into()).receive::<u16>(&bus.main));
        let code: Result<AlStatusCode, _> =
            bus.wire.run(Command::fprd(address, RegisterAddress::AlStatusCode.into()).receive(&bus.main));
        if let (Ok(status), Ok(code)) = (status, code)
            && status & 0x10 != 0
        {
            lines.push(format!("the device at position {}: AL status code {code}", position + 1));
        }
    }
    lines
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

/// Brings checked devices to OP; the grid of SYNC0.
pub fn bring_up<L: Link>(
    bus: &mut Bus<L>,
    mut devices: PreOpDevices,
    file: &DrivesFile,
) -> Result<(OpDevices, SyncClock), StartupErrors> {
    let mut errors = vec![];
    for (number, leg) in (1..).zip(&file.legs) {
        if let Err(error) = configure(bus, &devices, leg, &file.bus) {
            errors.push(format!("leg {number}: {error}"));
        }
    }
    if !errors.is_empty() {
        return Err(StartupErrors(errors));
    }
    let period = Duration::from_micros(file.bus.period_us.into());
    for mut device in devices.iter_mut(&bus.main) {
        device.set_dc_sync(DcSync::Sync0);
    }
    let clocks =
        DcConfiguration { start_delay: SYNC0_DELAY, sync0_period: period, sync0_shift: Duration::ZERO };
    let Bus { main, wire } = bus;
    let devices = wire.run(async {
        let devices = devices.into_pre_op_pdi(main).await?.configure_dc_sync(main, clocks).await?;
        devices.into_safe_op(main).await?.request_into_op(main).await
    });
    let devices = devices.map_err(|error| not_in(bus, "SAFE-OP", Some(error)))?;
    let clock = reach_op(bus, &devices, file)?;
    Ok((devices, clock))
}

fn not_in<L: Link>(bus: &mut Bus<L>, state: &str, error: Option<Error>) -> StartupErrors {
    let mut lines = refused_states(bus);
    if let Some(code) = bus.wire.emergency.take() {
        lines.push(format!("a drive reported the emergency {code:#06x}"));
    }
    if lines.is_empty() {
        lines.extend(error.map(words));
    }
    StartupErrors(lines.into_iter().map(|line| format!("the drives do not reach {state}: {line}")).collect())
}

/// Mapping, mode, watchdog and the objects of the file.
fn configure<L: Link>(
    bus: &mut Bus<L>,
    devices: &PreOpDevices,
    leg: &LegSection,
    timing: &crate::drives_file::BusSection,
) -> Result<(), String> {
    let position = leg.position - 1;
    let one = |index, sub, bytes, value: u32| SdoWrite { index, sub, bytes, value: value.into() };
    let mut writes = leg.sdo.clone();
    for (assignment, mapping, entries) in [
        (objects::RX_PDO_ASSIGNMENT, leg.rx_pdo, &OUTPUT_ENTRIES[..]),
        (objects::TX_PDO_ASSIGNMENT, leg.tx_pdo, input_entries(leg.brake)),
    ] {
        writes.extend([one(assignment, 0, 1, 0), one(mapping, 0, 1, 0)]);
        writes.extend((1..).zip(entries).map(|(sub, entry)| one(mapping, sub, 4, *entry)));
        writes.push(one(mapping, 0, 1, entries.len() as u32));
        writes.extend([one(assignment, 1, 2, mapping.into()), one(assignment, 0, 1, 1)]);
    }
    writes.push(one(objects::MODE, 0, 1, crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE as u32));
    for write in writes {
        bus.sdo_write(devices, position, write)?;
    }
    // The unit of the watchdog is 100 us by default.
    let wanted = timing.watchdog_ms as u16 * 10;
    let device = devices.subdevice(&bus.main, position).map_err(words)?;
    let register = RegisterAddress::SyncManagerWatchdog;
    bus.wire.run(device.register_write(register, wanted)).map_err(words)?;
    let set: u16 = bus.wire.run(device.register_read(register)).map_err(words)?;
    let divider: u16 = bus.wire.run(device.register_read(RegisterAddress::WatchdogDivider)).map_err(words)?;
    if set != wanted || divider != 2498 {
        return Err(format!(
            "the watchdog is {set} units with divider {divider}, must be {wanted} with 2498"
        ));
    }
    Ok(())
}

/// Exchanges process data until all devices are in OP.
fn reach_op<L: Link>(
    bus: &mut Bus<L>,
    devices: &OpDevices,
    file: &DrivesFile,
) -> Result<SyncClock, StartupErrors> {
    let period_ns = u64::from(file.bus.period_us) * 1000;
    let mut clock = SyncClock::new(period_ns, bus.wire.link.now_ns());
    for position in 0..devices.len() {
        if let Ok(device) = devices.subdevice(&bus.main, position) {
            Outputs::default().write(&mut device.outputs_raw_mut());
        }
    }
    for _ in 0..MAX_CYCLES_TO_OP {
        let wake_ns = clock.next_sync0_ns() + u64::from(file.bus.shift_us) * 1000;
        bus.wire.link.sleep_until(wake_ns);
        clock.advance_to(bus.wire.link.now_ns());
        let Bus { main, wire } = bus;
        let exchanged = wire.run_until(devices.tx_rx_dc(main), wake_ns + period_ns / 2);
        if let Some(Ok(response)) = exchanged {
            let frame_ns = wire.sent_ns.midpoint(wire.received_ns);
            clock.update(frame_ns, response.extra.dc_system_time);
            if response.subdevice_states.iter().all(|state| *state == ethercrab::SubDeviceState::Op) {
                return Ok(clock);
            }
        }
    }
    Err(not_in(bus, "OP", None))
}
