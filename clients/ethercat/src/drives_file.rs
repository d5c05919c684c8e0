//! `NAME-drives.toml`: interface, timing, and the six drives of a machine.

use hexad_core::model::LEGS;
use serde::Deserialize;
use toml::{Table, Value};

use crate::identity::IdentityBy;
use crate::units::LegUnits;

/// Drives of one machine.
#[derive(Clone, Debug)]
pub struct DrivesFile {
    /// Bus and timing.
    pub bus: BusSection,
    /// In the order of the legs.
    pub legs: [LegSection; LEGS],
}

/// Top level of the file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusSection {
    /// `name` of the machine file.
    pub name: String,
    /// Network interface that only the drives are connected to.
    pub interface: String,
    /// Period of SYNC0, and of the daemon's loop.
    pub period_us: u32,
    /// The drives stop by themselves after so long without outputs.
    pub watchdog_ms: u32,
    /// Frames lost in a row that stop all drives.
    pub lost_frames: u32,
    /// Longest wait for the forces that respond to a measurement.
    pub answer_us: u32,
    /// From SYNC0, at which the encoders are latched, to the frame that fetches them.
    pub shift_us: u32,
    /// How the drives stop when no force may be applied.
    pub on_brake: OnBrake,
}

/// Reaction when no force may be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnBrake {
    /// Quick stop of the drive (0x605a), which closes the brake.
    QuickStop,
    /// Power off; the brake closes.
    DisableVoltage,
}

/// One drive and its leg.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LegSection {
    /// Position on the bus, from 1.
    pub position: usize,
    /// Vendor of the drive.
    pub vendor: u32,
    /// Product code.
    pub product: u32,
    /// Serial number of the drive whose encoder the offset belongs to.
    pub serial: u32,
    /// How another drive in its place is noticed.
    pub identity: IdentityBy,
    /// Serial number of the drive with which `jog` has found the right direction.
    pub jogged_serial: Option<u32>,
    /// The same for a drive without a serial number: its position, which proves nothing about a drive that was exchanged.
    pub jogged_position: Option<usize>,
    /// Of the motor's encoder.
    pub counts_per_rev: f64,
    /// Bits of its position, single-turn and multi-turn together.
    pub position_bits: u32,
    /// Revolutions of the motor for one of the screw.
    pub gear: f64,
    /// Travel for one revolution of the screw.
    pub lead_m: f64,
    /// Of gear and screw.
    pub efficiency: f64,
    /// 1 if increasing counts and positive torque lengthen the leg, else -1.
    pub sign: i8,
    /// Length at count 0; written by `zero`.
    pub offset_m: f64,
    /// Of the motor.
    pub rated_torque_n_m: f64,
    /// Largest command in thousandths of the rated torque.
    pub max_torque_permille: i16,
    /// How the open brake is known.
    pub brake: Brake,
    /// Objects to be written at the start.
    pub sdo: Vec<SdoWrite>,
    /// Objects that are written after these for the test of the brake: they keep it closed while operation is enabled.
    pub brake_hold: Vec<SdoWrite>,
    /// Largest motion of the closed brake under its test load.
    pub max_slip_m: f64,
    /// Object that maps the outputs; the driver writes the mapping.
    pub rx_pdo: u16,
    /// Object that maps the inputs.
    pub tx_pdo: u16,
}

/// How the open brake is known: CiA 402 has no standard bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Brake {
    /// Bit of the status word (0x6041).
    StatusBit(u8),
    /// Bit of the digital inputs (0x60fd).
    InputBit(u8),
    /// Time after operation enabled \[ms\].
    OpenMs(u32),
}

/// Object and its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SdoWrite {
    /// Index of the object.
    pub index: u16,
    /// Subindex.
    #[serde(default)]
    pub sub: u8,
    /// 1, 2 or 4.
    pub bytes: u8,
    /// The value; negative ones in two's complement.
    pub value: i64,
}

/// Values of the top level that a file need not state.
const BUS_DEFAULTS: &str = r#"
period_us = 1000
watchdog_ms = 20
lost_frames = 3
answer_us = 400
shift_us = 100
on_brake = "quick_stop"
"#;
/// The same of a leg.
const LEG_DEFAULTS: &str = r#"
identity = "serial"
position_bits = 32
gear = 1.0
efficiency = 1.0
sdo = []
brake_hold = []
max_slip_m = 0.0005
rx_pdo = 0x1600
tx_pdo = 0x1a00
"#;

/// Errors that were found together, a line each.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct ErrorList(pub Vec<String>);

impl DrivesFile {
    /// Reads and checks a text; error texts name it `place`.
    pub fn parse(text: &str, place: &str) -> Result<Self, ErrorList> {
        let parsed = |text: &str| text.parse().map_err(|error| ErrorList(vec![format!("{place}: {error}")]));
        let (mut table, mut defaults): (Table, Table) = (parsed(BUS_DEFAULTS)?, parsed(LEG_DEFAULTS)?);
        table.extend(parsed(text)?);
        if let Some(Value::Table(drive)) = table.remove("drive") {
            defaults.extend(drive);
        }
        let rows = table.remove("leg").and_then(|legs| legs.as_array().cloned()).unwrap_or_default();
        let mut errors = vec![];
        let mut log = |section: &str, error: String| errors.push(format!("{place}: {section}{error}"));
        if rows.len() != LEGS {
            log("", format!("has {} sections [[leg]], needs {LEGS}", rows.len()));
        }
        let bus = read::<BusSection>(table).map_err(|error| log("", error)).ok();
        bus.iter().flat_map(BusSection::errors).for_each(|error| log("", error));
        let mut legs = vec![];
        for (number, row) in (1..).zip(rows) {
            let section = format!("leg[{number}].");
            let Value::Table(row) = row else { continue };
            let mut merged = defaults.clone();
            merged.entry("position").or_insert(Value::Integer(number));
            merged.extend(row);
            match read::<LegSection>(merged) {
                Ok(leg) => {
                    leg.errors().into_iter().for_each(|error| log(&section, error));
                    legs.push(leg);
                }
                Err(error) => log(&section, error),
            }
        }
        for (index, leg) in legs.iter().enumerate() {
            if legs.iter().take(index).any(|other| other.position == leg.position) {
                log(&format!("leg[{}].", index + 1), format!("position = {} is used twice", leg.position));
            }
        }
        match (bus, legs.try_into()) {
            (Some(bus), Ok(legs)) if errors.is_empty() => Ok(Self { bus, legs }),
            _ => Err(ErrorList(errors)),
        }
    }

    /// What the file leaves to people, in words: drives that nothing identifies, brakes that are not tested.
    pub fn warnings(&self) -> Vec<String> {
        let legs = |is_named: fn(&LegSection) -> bool| {
            let named = (1u32..).zip(&self.legs).filter(|(_, leg)| is_named(leg));
            let numbers: Vec<_> = named.map(|(number, _)| number.to_string()).collect();
            (!numbers.is_empty()).then(|| numbers.join(", "))
        };
        let unidentified = legs(|leg| leg.identity == IdentityBy::Position).map(|legs| {
            format!(
                "the drives of legs {legs} are known by their position alone (identity = \"position\"): exchanged cables or a \
                 replaced drive are not noticed and the platform moves to wrong poses; after work on them compare each length"
            )
        });
        let untested = legs(|leg| leg.brake_hold.is_empty())
            .map(|legs| format!("the brakes of legs {legs} are not tested: no brake_hold"));
        unidentified.into_iter().chain(untested).collect()
    }

    /// The same drives, with brakes that stay closed while operation is enabled.
    pub fn with_brakes_held(mut self) -> Self {
        self.legs.iter_mut().for_each(|leg| leg.sdo.extend(&leg.brake_hold));
        self
    }

    /// Legs, counted from 0, in the order of their drives on the bus.
    pub fn by_position(&self) -> [(usize, &LegSection); LEGS] {
        let mut next = 0..;
        let mut legs = self.legs.each_ref().map(|leg| (next.next().unwrap_or_default(), leg));
        legs.sort_by_key(|(_, leg)| leg.position);
        legs
    }
}

fn read<T: for<'d> Deserialize<'d>>(table: Table) -> Result<T, String> {
    Value::Table(table).try_into().map_err(|error| error.to_string().trim().replace('\n', " "))
}

/// Adds an error for each key whose value is outside of its bounds.
fn check(errors: &mut Vec<String>, rows: &[(&str, f64, f64, f64)]) {
    let outside = rows.iter().filter(|(_, value, low, high)| !(*low..=*high).contains(value));
    errors.extend(
        outside.map(|(key, value, low, high)| format!("{key} = {value}: must be in [{low}, {high}]")),
    );
}

impl BusSection {
    fn errors(&self) -> Vec<String> {
        let period_us = f64::from(self.period_us);
        let mut errors = vec![];
        check(
            &mut errors,
            &[
                ("period_us", period_us, 250.0, 10_000.0),
                ("watchdog_ms", self.watchdog_ms.into(), (2.0 * period_us / 1000.0).ceil(), 100.0),
                ("lost_frames", self.lost_frames.into(), 1.0, 10.0),
                ("shift_us", self.shift_us.into(), 0.0, period_us / 2.0),
                ("answer_us", self.answer_us.into(), 50.0, period_us / 2.0),
            ],
        );
        errors
    }
}

impl LegSection {
    fn errors(&self) -> Vec<String> {
        let mut errors = vec![];
        let brake = match self.brake {
            Brake::StatusBit(bit) => ("brake.status_bit", bit.into(), 0.0, 15.0),
            Brake::InputBit(bit) => ("brake.input_bit", bit.into(), 0.0, 31.0),
            Brake::OpenMs(time) => ("brake.open_ms", time.into(), 0.0, 2000.0),
        };
        check(
            &mut errors,
            &[
                ("position", self.position as f64, 1.0, LEGS as f64),
                ("counts_per_rev", self.counts_per_rev, 100.0, 1e9),
                ("position_bits", self.position_bits.into(), 8.0, 32.0),
                ("gear", self.gear, 0.01, 1000.0),
                ("lead_m", self.lead_m, 1e-4, 1.0),
                ("efficiency", self.efficiency, 0.1, 1.0),
                ("offset_m", self.offset_m, -1e4, 1e4),
                ("rated_torque_n_m", self.rated_torque_n_m, 1e-3, 1e4),
                ("max_torque_permille", self.max_torque_permille.into(), 1.0, 30_000.0),
                ("max_slip_m", self.max_slip_m, 1e-5, 5e-3),
                brake,
            ],
        );
        if self.sign.abs() != 1 {
            errors.push(format!("sign = {}: must be 1 or -1", self.sign));
        }
        let writes = self.sdo.iter().chain(&self.brake_hold);
        for write in writes.filter(|write| !matches!(write.bytes, 1 | 2 | 4)) {
            errors.push(format!("sdo {:#06x}: bytes = {}: must be 1, 2 or 4", write.index, write.bytes));
        }
        let is_restored = |held: &&SdoWrite| {
            self.sdo.iter().any(|write| (write.index, write.sub) == (held.index, held.sub))
        };
        for SdoWrite { index, sub, .. } in self.brake_hold.iter().filter(|held| !is_restored(held)) {
            errors.push(format!(
                "brake_hold {index:#06x}:{sub}: sdo must contain the object with its value for operation"
            ));
        }
        errors
    }

    /// Encoder, screw and motor.
    pub fn units(&self) -> LegUnits {
        LegUnits {
            counts_per_rev: self.counts_per_rev,
            position_bits: self.position_bits,
            gear: self.gear,
            lead_m: self.lead_m,
            efficiency: self.efficiency,
            sign: f64::from(self.sign),
            offset_m: self.offset_m,
            rated_torque_n_m: self.rated_torque_n_m,
        }
    }

    /// Largest force of the drive within its limit \[N\].
    pub fn max_force_n(&self) -> f64 {
        self.units().newtons_per_permille().abs() * f64::from(self.max_torque_permille)
    }
}
