//! Replay: computes the cycles of a recording again and compares every output.

use core::ops::RangeInclusive;
use std::collections::BTreeMap;

use fearless_simd::Level;

use crate::parameters;
use crate::recording::reader::{Recording, Summary};
use crate::recording::{Item, RecordingError, RunInfo, memory_from};
use hexad_client::messages::CycleMessage;
use hexad_client::messages::layout::Declared as _;
use hexad_client::realtime::setup::denormals;
use hexad_core::control::controller::Controller;
use hexad_core::model::fidelity::Fidelity;
use hexad_machine::config::{Config, ConfigError, fidelity};

/// Relative rounding of a determinant of six rows: a few roundings per factor.
const DETERMINANT_ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Field with a quotient whose divisor, a rate, may be zero.
const TIME_TO_SINGULARITY: &str = "time_to_singularity_s";

/// Largest difference between two instruction sets with different rounding, for fields that are not divided
/// by the period.
const TOLERANCE: f64 = 1e-12;

/// One number of an output that a replay computes differently.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Number of the cycle.
    pub cycle: u64,
    /// Release of the cycle, since the first cycle of the recording \[s\].
    pub time_s: f64,
    /// Field of the cycle message.
    pub field: String,
    /// Number in the recording.
    pub recorded: f64,
    /// Number of the replay.
    pub replayed: f64,
    /// Largest number of the field in the recording, over all six legs or a whole matrix.
    pub scale: f64,
}

impl Difference {
    /// Size of the difference, as a ratio of the largest number of the field if that is above 1. A time to a
    /// singularity counts by its inverse: while a platform moves along the singularity, the time is a determinant over
    /// a rate that is rounding only.
    pub fn size(&self) -> f64 {
        let is_time = self.field == TIME_TO_SINGULARITY;
        let [recorded, replayed, scale] = [self.recorded, self.replayed, self.scale]
            .map(|number| if is_time { number.recip() } else { number });
        let difference = (recorded - replayed).abs() / scale.abs().max(1.0);
        if difference.is_nan() { f64::INFINITY } else { difference }
    }

    /// Largest difference that another rounding of another instruction set explains, at a period h \[s\].
    ///
    /// The reference moves from pose to pose. If a pose has the relative rounding e, its velocity has e / h,
    /// and its acceleration e / h^2, which is part of the forces. The time to a singularity is a determinant
    /// over its change in h.
    pub fn tolerance(&self, period_s: f64) -> f64 {
        let rounding = match array(&self.field) {
            "reference_twist" | "error_rate" => f64::EPSILON / period_s,
            TIME_TO_SINGULARITY => DETERMINANT_ROUNDING / period_s,
            "reference_acceleration" | "force_n" | "wrench_error" => f64::EPSILON / (period_s * period_s),
            _ => 0.0,
        };
        TOLERANCE + rounding
    }
}

/// Result of a replay.
#[derive(Clone, Debug, Default)]
pub struct Replay {
    /// Cycles computed again.
    pub compared: u64,
    /// Cycles for which the memory of the controller is unknown: before the first recorded memory, and after
    /// each gap until the next memory.
    pub unknown: Vec<RangeInclusive<u64>>,
    /// Number of cycles with a different output.
    pub different: u64,
    /// The first difference.
    pub first: Option<Difference>,
    /// The largest difference of each field.
    pub largest: BTreeMap<String, Difference>,
}

/// Instruction set whose lanes repeat the bits of the recorded one: the recorded set, or any with the same
/// rounding (`model::fused`). The processor's own set if there is none.
pub fn repeating_level(recorded: &str, level: Level) -> Level {
    #[cfg(target_arch = "x86_64")]
    {
        let rounds_twice = recorded == "Sse4_2";
        let wanted = match (rounds_twice, level.as_avx2()) {
            (true, _) => level.as_sse4_2().map(Level::Sse4_2),
            (false, Some(avx2)) => Some(Level::Avx2(avx2)),
            (false, None) => level.as_sse2().map(Level::Sse2),
        };
        wanted.unwrap_or(level)
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = recorded;
        level
    }
}

/// Configuration of a recording, on the instruction set that repeats its bits on a processor with `level`.
pub fn recorded_config(info: &RunInfo, level: Level) -> Result<Config, ConfigError> {
    let level = repeating_level(&info.instruction_set, level);
    Config::parse_on(level, &info.configuration, "configuration of the recording")
}

/// Controller with the recorded configuration.
pub fn recorded_controller(info: &RunInfo, config: &Config) -> Controller {
    controller(config, Fidelity::by_name(&info.fidelity))
}

/// Controller with another configuration.
pub fn other_controller(config: &Config) -> Controller {
    controller(config, None)
}

fn controller(config: &Config, recorded: Option<Fidelity>) -> Controller {
    let fidelity = recorded.unwrap_or_else(|| fidelity::fidelity(config));
    Controller::new(&config.machine, parameters(&config.machine, &config.deployment, fidelity))
}

/// Computes the cycles of a recording again. `controller` is in the state before its first cycle.
pub fn replay(recording: &Recording, controller: Controller) -> Result<(Summary, Replay), RecordingError> {
    denormals::flush();
    let columns = CycleMessage::LAYOUT.columns("");
    let first_of_array = |column: &String| columns.iter().position(|other| array(other) == array(column));
    let arrays = columns.iter().map(first_of_array).collect();
    let (begin_ns, replay) = (None, Replay::default());
    let mut replayer = Replayer { controller, next_cycle: Some(1), begin_ns, columns, arrays, replay };
    let summary = recording.each(|item| replayer.add(&item))?;
    Ok((summary, replayer.replay))
}

struct Replayer {
    controller: Controller,
    /// Number of the cycle that the controller can compute next; `None` if its memory is unknown.
    next_cycle: Option<u64>,
    begin_ns: Option<u64>,
    columns: Vec<String>,
    /// For each column, the first column of its array.
    arrays: Vec<Option<usize>>,
    replay: Replay,
}

impl Replayer {
    fn add(&mut self, item: &Item) {
        match item {
            Item::Cycle(cycle) => self.step(cycle),
            // A controller without a gap continues with its own memory. Its outputs show any difference.
            Item::Memory { cycle, bytes } if self.next_cycle != Some(*cycle) => {
                if let Some(memory) = memory_from(bytes) {
                    self.controller.set_memory(memory);
                    self.next_cycle = Some(*cycle);
                }
            }
            Item::Memory { .. } => {}
            Item::Gap(_) => self.next_cycle = None,
        }
    }

    fn step(&mut self, cycle: &CycleMessage) {
        let begin_ns = *self.begin_ns.get_or_insert(cycle.due_ns);
        let input = cycle.input().filter(|_| self.next_cycle == Some(cycle.cycle));
        let Some(input) = input else {
            self.replay.add_unknown(cycle.cycle);
            return;
        };
        self.next_cycle = Some(cycle.cycle + 1);
        self.replay.compared += 1;
        let replayed =
            CycleMessage::new(&input, &self.controller.step(&input)).with_number_and_timing_of(cycle);
        if replayed.bytes() == cycle.bytes() {
            return;
        }
        self.replay.different += 1;
        let time_s = cycle.due_ns.saturating_sub(begin_ns) as f64 * 1e-9;
        let (numbers, cycle) = (cycle.numbers(), cycle.cycle);
        let columns = self.columns.iter().zip(&self.arrays);
        for (((field, array), recorded), replayed) in columns.zip(&numbers).zip(replayed.numbers()) {
            if recorded.to_bits() != replayed.to_bits() {
                let of_array = self.arrays.iter().zip(&numbers).filter(|(other, _)| *other == array);
                let scale = of_array.fold(0.0, |scale: f64, (_, number)| scale.max(number.abs()));
                let (field, recorded) = (field.clone(), *recorded);
                self.replay.add(Difference { cycle, time_s, field, recorded, replayed, scale });
            }
        }
    }
}

/// Name of the array to which a column belongs.
fn array(column: &str) -> &str {
    let name = column.trim_end_matches(|letter: char| letter.is_ascii_digit());
    name.strip_suffix('_').unwrap_or(column)
}

impl Replay {
    /// Whether the rounding of another instruction set explains all differences, at a period \[s\].
    pub fn is_rounding(&self, period_s: f64) -> bool {
        self.largest.values().all(|it| it.size() <= it.tolerance(period_s))
    }

    /// The largest difference of all fields.
    pub fn largest(&self) -> Option<&Difference> {
        self.largest.values().max_by(|a, b| a.size().total_cmp(&b.size()))
    }

    /// Number of cycles that could not be computed again.
    pub fn unknown_count(&self) -> u64 {
        self.unknown.iter().map(|range| range.end() - range.start() + 1).sum()
    }

    fn add_unknown(&mut self, cycle: u64) {
        match self.unknown.last_mut().filter(|range| range.end() + 1 == cycle) {
            Some(range) => *range = *range.start()..=cycle,
            None => self.unknown.push(cycle..=cycle),
        }
    }

    fn add(&mut self, difference: Difference) {
        self.first.get_or_insert_with(|| difference.clone());
        let largest =
            self.largest.entry(array(&difference.field).into()).or_insert_with(|| difference.clone());
        if difference.size() > largest.size() {
            *largest = difference;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_rounding_is_explained_by_another_processor() {
        let is_rounding = |field: &str, size: f64| {
            let (field, recorded) = (field.to_string(), 1.0);
            let difference =
                Difference { cycle: 1, time_s: 0.0, field, recorded, replayed: 1.0 + size, scale: 1.0 };
            let largest = BTreeMap::from([(difference.field.clone(), difference)]);
            Replay { largest, ..Replay::default() }.is_rounding(1e-3)
        };
        // For 1 kHz: hardly any difference of a pose, 2e-13 of a velocity, 2e-10 of an acceleration and of
        // forces.
        for (field, tolerated, refused) in [
            ("position_m_2", 9e-13, 2e-12),
            ("reference_twist_1", 1.1e-12, 2e-12),
            ("reference_acceleration_6", 2e-10, 3e-10),
            ("force_n_3", 2e-10, 1e-5),
        ] {
            assert_eq!([tolerated, refused].map(|size| is_rounding(field, size)), [true, false], "{field}");
        }
    }
}
