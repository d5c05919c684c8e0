//! Commands that use the bus for a moment.

use std::fs;
use std::path::Path;

use hexad_client::realtime::stop_request::Stop;
use hexad_ethercat::bus::{Bus, Frames};
use hexad_ethercat::cia402::Goal;
use hexad_ethercat::drives_file::{DrivesFile, LegSection, SdoWrite};
use hexad_ethercat::process_data::{Exchange, ProcessData};
use hexad_ethercat::raw_socket::RawSocket;
use hexad_ethercat::startup::{self, OpDevices, PreOpDevices};
use hexad_ethercat::{
    brake_test, file_edit, identity, inventory, jog as jogging, machine_check, objects, scan as scanning,
};
use hexad_machine::config::Config;
use hexad_machine::text::files::print;

use super::{
    Failure, after_start, before_start, load_and_warn, load_drives, load_machine, load_text, none_of, open,
};

/// Prints a line. A pipe that is closed must end no command while drives are enabled.
macro_rules! say {
    ($($text:tt)*) => { drop(print(format_args!("{}\n", format_args!($($text)*)))) };
}

/// Cycles for which faults are acknowledged, after as many without.
const RESET_CYCLES: u32 = 100;

/// A leg that moves by less does not show its direction \[m\].
const MIN_WAY_M: f64 = 5e-5;

pub fn scan(interface: &str, name: &str) -> Result<(), Failure> {
    let frames = Frames::new();
    let mut bus = open(&frames, interface)?;
    let devices = startup::find(&mut bus).map_err(before_start)?;
    drop(print(scanning::drives_file(&mut bus, &devices, name, interface)));
    Ok(())
}

pub fn check(drives: &Path, machine: Option<&Path>, is_offline: bool) -> Result<(), Failure> {
    let file = load_drives(drives)?;
    let machine = machine.map(load_machine).transpose()?;
    let mut errors = file.unchecked_directions();
    errors.extend(machine.map_or(vec![], |machine| machine_check::contradictions(&file, &machine)));
    if !is_offline {
        let frames = Frames::new();
        let (mut bus, devices) = pre_op(&frames, &file)?;
        errors.extend(inventory::contradictions(&mut bus, &devices, &file));
    }
    none_of(errors)?;
    say!("{}: no error", drives.display());
    file.warnings().into_iter().for_each(|text| say!("{text}"));
    Ok(())
}

fn pre_op<'f>(frames: &'f Frames, file: &DrivesFile) -> Result<(Bus<'f, RawSocket>, PreOpDevices), Failure> {
    let mut bus = open(frames, &file.bus.interface)?;
    let devices = startup::find(&mut bus).map_err(before_start)?;
    Ok((bus, devices))
}

fn leg_section(file: &DrivesFile, leg: usize) -> Result<&LegSection, Failure> {
    let section = leg.checked_sub(1).and_then(|index| file.legs.get(index));
    section.ok_or_else(|| before_start(format!("leg {leg}: legs are 1 to {}", file.legs.len())))
}

/// Checked drives in OP.
pub(super) fn operational<'f>(
    frames: &'f Frames,
    file: &DrivesFile,
    middle_m: f64,
) -> Result<(Bus<'f, RawSocket>, OpDevices, ProcessData), Failure> {
    let (mut bus, devices) = pre_op(frames, file)?;
    none_of(inventory::contradictions(&mut bus, &devices, file))?;
    let (devices, clock) = startup::bring_up(&mut bus, devices, file).map_err(before_start)?;
    Ok((bus, devices, ProcessData::new(file, middle_m, clock)))
}

/// Tests the brakes of legs with `brake_hold`. The inner error: a brake does not hold.
pub(super) fn test_brakes(
    file: &DrivesFile,
    machine: &Config,
    stop: &Stop,
) -> Result<Result<(), String>, Failure> {
    if file.legs.iter().all(|leg| leg.brake_hold.is_empty()) {
        return Ok(Ok(()));
    }
    let frames = Frames::new();
    let machine = &machine.machine;
    let middle_m = machine.actuator.min_length_m.midpoint(machine.actuator.max_length_m);
    let (mut bus, devices, mut data) = operational(&frames, &file.clone().with_brakes_held(), middle_m)?;
    let outcome = brake_test::test(&mut bus, &devices, &mut data, file, machine, || stop.is_requested());
    leave(bus, devices);
    Ok(outcome)
}

pub fn brakes(drives: &Path, machine: &Path) -> Result<(), Failure> {
    let (file, machine) = (load_and_warn(drives)?, load_machine(machine)?);
    none_of([file.unchecked_directions(), machine_check::contradictions(&file, &machine)].concat())?;
    let stop = Stop::on_signals().map_err(before_start)?;
    test_brakes(&file, &machine, &stop)?.map_err(after_start)?;
    say!("{}", if stop.is_requested() { "the test was stopped" } else { "the tested brakes hold" });
    Ok(())
}

pub fn jog(drives: &Path, leg: usize, permille: i16, seconds: f64, is_unloaded: bool) -> Result<(), Failure> {
    let file = load_and_warn(drives)?;
    let section = leg_section(&file, leg)?;
    if !is_unloaded {
        return Err(before_start(
            "the brake of the leg opens: confirm with --unloaded that it carries no load",
        ));
    }
    if !(permille.unsigned_abs() <= section.max_torque_permille.unsigned_abs()
        && (0.0..=10.0).contains(&seconds))
    {
        return Err(before_start("permille must be within max_torque_permille, seconds in [0, 10]"));
    }
    let stop = Stop::on_signals().map_err(before_start)?;
    let frames = Frames::new();
    // Only the change of the length counts.
    let (mut bus, devices, mut data) = operational(&frames, &file, section.units().length_m(0))?;
    let force_n = f64::from(permille) * section.units().newtons_per_permille().abs();
    let cycles = (seconds * 1e6 / f64::from(file.bus.period_us)) as u64;
    say!("leg {leg}: pushing with {force_n:.0} N; Ctrl-C ends it");
    let found = jogging::jog(&mut bus, &devices, &mut data, leg - 1, force_n, cycles, || stop.is_requested());
    leave(bus, devices);
    let jogging::Jog { way_m, is_direction_right } = found.map_err(after_start)?;
    if way_m.abs() < MIN_WAY_M {
        return Err(after_start(format!(
            "leg {leg}: it did not move: is its brake open? Try more --permille"
        )));
    }
    let (way_mm, word) = (way_m * 1e3, if way_m > 0.0 { "longer" } else { "shorter" });
    say!("leg {leg}: by its encoder it is {:.3} mm {word}; look whether it is", way_mm.abs());
    edit(drives, leg, &section.direction_record(is_direction_right))?;
    if is_direction_right {
        say!("leg {leg}: if it is not, `sign` is wrong");
        return Ok(());
    }
    Err(after_start(format!(
        "leg {leg}: a force of {force_n:.0} N moved it by {way_mm:.3} mm: encoder and torque have opposite directions; correct \
         the polarity (0x607e) or the feedback of the drive"
    )))
}

/// Changes values of a leg in the file.
fn edit(drives: &Path, leg: usize, values: &[(&str, Option<String>)]) -> Result<(), Failure> {
    let text = file_edit::with_values(&load_text(drives)?, leg, values)
        .ok_or_else(|| after_start(format!("{}: has no section of leg {leg}", drives.display())))?;
    fs::write(drives, text).map_err(|error| after_start(format!("{}: {error}", drives.display())))
}

/// Returns the devices to SAFE-OP, so that no watchdog trips.
pub(super) fn leave(mut bus: Bus<RawSocket>, devices: OpDevices) {
    // Devices that do not follow trip their watchdog: the drives stop as well.
    let _ = bus.wire.run(devices.into_safe_op(&bus.main));
}

pub fn zero(drives: &Path, leg: usize, length_m: f64) -> Result<(), Failure> {
    let file = load_and_warn(drives)?;
    let section = leg_section(&file, leg)?;
    let frames = Frames::new();
    let (mut bus, devices) = pre_op(&frames, &file)?;
    let position = section.position - 1;
    let found = inventory::identities(&mut bus, &devices);
    let identity = found.get(position).ok_or_else(|| before_start(format!("leg {leg}: no device")))?;
    if let Some(why) = identity::ambiguity(*identity, &found)
        && section.identity == identity::IdentityBy::Serial
    {
        return Err(before_start(format!("leg {leg}: {why}")));
    }
    let counts = bus.objects(&devices, position).value(objects::POSITION, 0).map_err(after_start)?;
    let offset_m = length_m - counts as f64 * section.units().metres_per_count();
    let values = [("serial", Some(identity.serial.to_string())), ("offset_m", Some(format!("{offset_m:?}")))];
    edit(drives, leg, &values)?;
    say!("leg {leg}: offset_m = {offset_m:?} with the drive of {}", identity::in_words(identity.serial));
    Ok(())
}

pub fn reset(drives: &Path) -> Result<(), Failure> {
    let file = load_drives(drives)?;
    let frames = Frames::new();
    let (mut bus, devices, mut data) = operational(&frames, &file, 0.0)?;
    for cycle in 0..2 * RESET_CYCLES {
        let goal = if cycle < RESET_CYCLES { Goal::Disabled } else { Goal::Reset };
        for (drive, outputs) in data.drives.iter_mut().zip(&mut data.outputs) {
            *outputs = drive.command(goal, 0.0);
        }
        let exchange = data.next_exchange(&mut bus, &devices);
        if let Some(cause) = data.stop_cause(exchange).filter(|_| exchange == Exchange::Incomplete) {
            return Err(after_start(cause));
        }
    }
    leave(bus, devices);
    let faults = (1..).zip(&data.drives).filter(|(_, drive)| drive.state().is_fault());
    let lines: Vec<_> = faults
        .map(|(leg, drive)| format!("leg {leg}: the fault {:#06x} remains", drive.inputs().error_code))
        .collect();
    if lines.is_empty() { Ok(()) } else { Err(after_start(lines.join("\n"))) }
}

fn integer(text: &str) -> Option<i64> {
    text.strip_prefix("0x").map_or_else(|| text.parse().ok(), |digits| i64::from_str_radix(digits, 16).ok())
}

/// Index and subindex.
fn object(text: &str) -> Result<(u16, u8), Failure> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = integer(index).and_then(|index| index.try_into().ok());
    let sub = integer(sub).and_then(|sub| sub.try_into().ok());
    index
        .zip(sub)
        .ok_or_else(|| before_start(format!("{text}: must be an index and a subindex, as 0x6064:0")))
}

pub fn read(drives: &Path, leg: usize, text: &str) -> Result<(), Failure> {
    let (index, sub) = object(text)?;
    let file = load_drives(drives)?;
    let position = leg_section(&file, leg)?.position - 1;
    let frames = Frames::new();
    let (mut bus, devices) = pre_op(&frames, &file)?;
    let value = bus.objects(&devices, position).value(index, sub).map_err(after_start)?;
    say!("{index:#06x}:{sub} = {value} ({value:#x})");
    Ok(())
}

pub fn write(drives: &Path, leg: usize, text: &str, value: &str, bytes: u8) -> Result<(), Failure> {
    let (index, sub) = object(text)?;
    let value = integer(value).ok_or_else(|| before_start(format!("{value}: must be an integer")))?;
    if !matches!(bytes, 1 | 2 | 4) {
        return Err(before_start(format!("bytes = {bytes}: must be 1, 2 or 4")));
    }
    let file = load_drives(drives)?;
    let position = leg_section(&file, leg)?.position - 1;
    let frames = Frames::new();
    let (mut bus, devices) = pre_op(&frames, &file)?;
    bus.objects(&devices, position).write(SdoWrite { index, sub, bytes, value }).map_err(after_start)
}
