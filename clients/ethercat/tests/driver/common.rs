//! Files, segments and buses of the tests.

use hexad_ethercat::bus::{Bus, Frames};
use hexad_ethercat::drives_file::{DrivesFile, ErrorList};
use hexad_ethercat::inventory;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::simulated_link::SimulatedLink;
use hexad_ethercat::simulation;
use hexad_ethercat::startup::{self, OpDevices, PreOpDevices};
use hexad_ethercat::sync_clock::SyncClock;
use hexad_machine::config::Config;

pub const DRIVES: &str = include_str!("../data/motion_base-drives.toml");
/// The clock of a computer that has been up for a day.
pub const START_NS: u64 = 86_400_000_000_000;

pub fn drives() -> DrivesFile {
    DrivesFile::parse(DRIVES, "test").unwrap()
}

/// The motion base, released by its driver.
pub fn machine() -> Config {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/motion_base.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let text = format!("{text}\n[realtime]\nrelease = \"external\"\n[drive]\ndelay_us = 1000.0\n");
    Config::parse(&text, "motion_base").unwrap_or_else(|error| panic!("{error}"))
}

/// The same drives without serial numbers, as most are delivered.
pub fn without_serials() -> String {
    (101..=106)
        .fold(DRIVES.to_string(), |text, serial| text.replace(&format!("serial = {serial}"), "serial = 0"))
}

/// The same, known by their position alone, where each was jogged.
pub fn by_position() -> String {
    let mut positions = 1..;
    let legs = without_serials().replace("[drive]", "[drive]\nidentity = \"position\"");
    let parts: Vec<_> = legs.split("jogged_serial = 0").map(String::from).collect();
    parts
        .into_iter()
        .reduce(|text, part| format!("{text}jogged_position = {}{part}", positions.next().unwrap()))
        .unwrap()
}

pub fn segment() -> Segment {
    simulation::segment(&drives(), &machine(), START_NS)
}

/// Drives whose brakes can be tested, with the standard object.
pub fn testable_drives() -> DrivesFile {
    DrivesFile::parse(&DRIVES.replace("[drive]\n", BRAKE_HOLD), "test").unwrap()
}

pub const BRAKE_HOLD: &str = "[drive]
sdo = [{ index = 0x60fe, sub = 1, bytes = 4, value = 0 }, { index = 0x60fe, sub = 2, bytes = 4, value = 0 }]
brake_hold = [{ index = 0x60fe, sub = 1, bytes = 4, value = 1 }, { index = 0x60fe, sub = 2, bytes = 4, value = 1 }]
";

pub type TestBus<'f> = Bus<'f, SimulatedLink>;

pub fn bus(frames: &Frames, segment: Segment) -> TestBus<'_> {
    let now_ns = segment.now_ns();
    Bus::new(frames, SimulatedLink::new(segment, now_ns)).unwrap()
}

/// Devices in PRE-OP that agree with the file.
pub fn checked(bus: &mut TestBus, file: &DrivesFile) -> Result<PreOpDevices, ErrorList> {
    let devices = startup::find(bus)?;
    match inventory::contradictions(bus, &devices, file) {
        errors if errors.is_empty() => Ok(devices),
        errors => Err(ErrorList(errors)),
    }
}

pub fn up(bus: &mut TestBus, file: &DrivesFile) -> Result<(OpDevices, SyncClock), ErrorList> {
    let devices = checked(bus, file)?;
    startup::bring_up(bus, devices, file)
}
