//! From a bus whose devices are in any state to six drives in OP, with every error in words.

use std::time::Duration;

use ethercrab::error::Error;
use ethercrab::subdevice_group::{DcConfiguration, HasDc, Op};
use ethercrab::{
    AlStatusCode, Command, DcSync, DefaultLock, RegisterAddress, SubDeviceGroup, SubDeviceState,
};

use crate::bus::{Bus, MAX_DEVICES, MAX_PROCESS_DATA};
use crate::cia402::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::drives_file::{BusSection, DrivesFile, ErrorList, LegSection, SdoWrite};
use crate::link::Link;
use crate::objects;
use crate::process_image::{OUTPUT_ENTRIES, Outputs, input_entries};
use crate::sdo::words;
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

/// Brings all devices to PRE-OP.
pub fn find<L: Link>(bus: &mut Bus<L>) -> Result<PreOpDevices, ErrorList> {
    let now_ns = bus.wire.link.now_ns();
    let found = bus.wire.run(bus.main.init_single_group(move || now_ns));
    let devices: PreOpDevices = found.map_err(|error| {
        ErrorList(vec![match error {
            Error::Timeout(_) if bus.main.num_subdevices() == 0 => {
                "no device answers: look at cable and power of the drives, and at `interface`".to_string()
            }
            Error::Capacity(_) => format!("more than {MAX_DEVICES} devices on the bus"),
            other => [vec![words(other)], refused_states(bus)].concat().join("\n"),
        }])
    })?;
    if devices.is_empty() {
        return Err(ErrorList(vec!["no device on the bus: look at cable and power of the drives".into()]));
    }
    Ok(devices)
}

/// Devices that refused a state, with their AL status code.
fn refused_states<L: Link>(bus: &mut Bus<L>) -> Vec<String> {
    let mut lines = vec![];
    for position in 0..bus.main.num_subdevices() as u16 {
        let read = |register: RegisterAddress| Command::fprd(FIRST_ADDRESS + position, register.into());
        let status = bus.wire.run(read(RegisterAddress::AlStatus).receive::<u16>(&bus.main));
        let code = bus.wire.run(read(RegisterAddress::AlStatusCode).receive::<AlStatusCode>(&bus.main));
        if let (Ok(status), Ok(code)) = (status, code)
            && status & 0x10 != 0
        {
            lines.push(format!("the device at position {}: AL status code {code}", position + 1));
        }
    }
    lines
}

/// Brings checked devices to OP; the grid of SYNC0.
pub fn bring_up<L: Link>(
    bus: &mut Bus<L>,
    mut devices: PreOpDevices,
    file: &DrivesFile,
) -> Result<(OpDevices, SyncClock), ErrorList> {
    let mut errors = file.unidentified();
    for (number, leg) in (1..).zip(&file.legs) {
        if let Err(error) = configure(bus, &devices, leg, &file.bus) {
            errors.push(format!("leg {number}: {error}"));
        }
    }
    if !errors.is_empty() {
        return Err(ErrorList(errors));
    }
    let sync0_period = Duration::from_micros(file.bus.period_us.into());
    for mut device in devices.iter_mut(&bus.main) {
        device.set_dc_sync(DcSync::Sync0);
    }
    let clocks = DcConfiguration { start_delay: SYNC0_DELAY, sync0_period, sync0_shift: Duration::ZERO };
    let Bus { main, wire } = bus;
    let devices = wire.run(async {
        let devices = devices.into_pre_op_pdi(main).await?.configure_dc_sync(main, clocks).await?;
        devices.into_safe_op(main).await?.request_into_op(main).await
    });
    let devices = devices.map_err(|error| not_in(bus, "SAFE-OP", Some(error)))?;
    let clock = reach_op(bus, &devices, &file.bus).ok_or_else(|| not_in(bus, "OP", None))?;
    Ok((devices, clock))
}

fn not_in<L: Link>(bus: &mut Bus<L>, state: &str, error: Option<Error>) -> ErrorList {
    let mut lines = refused_states(bus);
    if let Some(code) = bus.wire.emergency.take() {
        lines.push(format!("a drive reported the emergency {code:#06x}"));
    }
    if lines.is_empty() {
        lines.extend(error.map(words));
    }
    ErrorList(lines.into_iter().map(|line| format!("the drives do not reach {state}: {line}")).collect())
}

/// Mapping, mode, watchdog and the objects of the file.
fn configure<L: Link>(
    bus: &mut Bus<L>,
    devices: &PreOpDevices,
    leg: &LegSection,
    timing: &BusSection,
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
    writes.push(one(objects::MODE, 0, 1, CYCLIC_SYNCHRONOUS_TORQUE as u32));
    for write in writes {
        bus.objects(devices, position).write(write)?;
    }
    // The unit of the watchdog is 100 us by default.
    let wanted = timing.watchdog_ms as u16 * 10;
    let device = devices.subdevice(&bus.main, position).map_err(words)?;
    let register = RegisterAddress::SyncManagerWatchdog;
    bus.wire.run(device.register_write(register, wanted)).map_err(words)?;
    let set: u16 = bus.wire.run(device.register_read(register)).map_err(words)?;
    let divider: u16 = bus.wire.run(device.register_read(RegisterAddress::WatchdogDivider)).map_err(words)?;
    if set != wanted || divider != 2498 {
        return Err(format!("the watchdog is {set} units of divider {divider}, must be {wanted} of 2498"));
    }
    Ok(())
}

/// Exchanges process data until all devices are in OP.
fn reach_op<L: Link>(bus: &mut Bus<L>, devices: &OpDevices, timing: &BusSection) -> Option<SyncClock> {
    let period_ns = u64::from(timing.period_us) * 1000;
    let mut clock = SyncClock::new(period_ns, bus.wire.link.now_ns());
    for position in 0..devices.len() {
        if let Ok(device) = devices.subdevice(&bus.main, position) {
            Outputs::default().write(&mut device.outputs_raw_mut());
        }
    }
    for _ in 0..MAX_CYCLES_TO_OP {
        let wake_ns = clock.next_sync0_ns() + u64::from(timing.shift_us) * 1000;
        bus.wire.link.sleep_until(wake_ns);
        clock.advance_to(bus.wire.link.now_ns());
        let Bus { main, wire } = bus;
        let exchanged = wire.run_until(devices.tx_rx_dc(main), wake_ns + period_ns / 2);
        if let Some(Ok(response)) = exchanged {
            let frame_ns = wire.sent_ns.midpoint(wire.received_ns);
            clock.update(frame_ns, response.extra.dc_system_time);
            if response.subdevice_states.iter().all(|state| *state == SubDeviceState::Op) {
                return Some(clock);
            }
        }
    }
    None
}
