//! `hexad replay`: computes the cycles of a recording again and compares the outputs.

use core::fmt::Write as _;
use core::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Args;
use fearless_simd::Level;

use super::failure::Failure;
use hexad_core::model::machine::at_most_256_bits;
use hexad_daemon::recorder::instruction_set;
use hexad_daemon::recording::copy::copy;
use hexad_daemon::recording::reader::{Recording, Summary};
use hexad_daemon::recording::{Item, RunInfo};
use hexad_daemon::replay::{Replay, other_controller, recorded_config, recorded_controller, replay};
use hexad_daemon::version::{self, VERSION};
use hexad_machine::config::Config;
use hexad_machine::text::files::print;

/// Largest number of ranges of cycles that are listed.
const MAX_RANGES: usize = 10;

#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// Recording of `hexad run --record` or `--faults`
    #[arg(value_name = "FILE")]
    recording: PathBuf,
    /// Show what would have been different with this configuration
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Copy this part, in seconds from the first cycle, to `--output`; it begins up to a second sooner, where a replay can begin
    #[arg(long, value_name = "FROM..TO", value_parser = part, requires = "output")]
    extract: Option<Part>,
    /// File for the part
    #[arg(long, short, value_name = "FILE", requires = "extract")]
    output: Option<PathBuf>,
}

/// Part of a recording \[s\].
#[derive(Clone, Debug)]
struct Part(RangeInclusive<f64>);

fn part(text: &str) -> Result<Part, String> {
    let (from, to) = text.split_once("..").ok_or("must be two numbers of seconds, as in 12.5..14")?;
    match (from.trim().parse(), to.trim().parse()) {
        (Ok(from), Ok(to)) if from <= to => Ok(Part(from..=to)),
        (Ok(_), Ok(_)) => Err("the end must not be before the beginning".into()),
        _ => Err("must be two numbers of seconds, as in 12.5..14".into()),
    }
}

impl ReplayArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let recording = Recording::open(&self.recording)?;
        if let (Some(Part(part)), Some(output)) = (self.extract, self.output) {
            let times_ns = times_of(&recording, &part)?;
            let messages = copy(&recording, &output, times_ns)?;
            return Ok(print(format_args!("{}: {messages} messages\n", output.display()))?);
        }
        let info = recording.summary()?.info;
        let recorded = recorded_config(&info, processor())?;
        let other = self.config.as_deref().map(Config::load).transpose()?;
        let controller = match &other {
            Some(config) => other_controller(config),
            None => recorded_controller(&info, &recorded),
        };
        let (summary, replay) = replay(&recording, controller)?;
        recording.remark(&summary);
        print(description(&recording, &summary, &replay, other.as_ref().unwrap_or(&recorded)))?;
        if replay.compared == 0 {
            return Err(Failure::after_start(format_args!(
                "no cycle could be compared: the recording has the controller's memory of hexad {}, and this is \
                 hexad {VERSION}; use that version",
                recorded_version(&info)
            )));
        }
        let is_tolerated = info.instruction_set != instruction_set(recorded.machine.level)
            && replay.is_rounding(recorded.deployment.realtime.period_s());
        if replay.different > 0 && other.is_none() && !is_tolerated {
            return Err(Failure::after_start(format_args!(
                "{} of the cycles differ: hexad {VERSION} has other outputs than hexad {}, which made the recording",
                replay.different,
                recorded_version(&info)
            )));
        }
        Ok(())
    }
}

/// Version and commit of hexad that made a recording.
fn recorded_version(info: &RunInfo) -> String {
    format!("{} (commit {})", info.version, info.commit)
}

/// Instruction set that the daemon would use.
fn processor() -> Level {
    at_most_256_bits(Level::new())
}

/// Range of `log_time` \[ns\] of a part, extended to the point where a replay can begin.
fn times_of(recording: &Recording, part: &RangeInclusive<f64>) -> Result<RangeInclusive<u64>, Failure> {
    let summary = recording.summary()?;
    recording.remark(&summary);
    let Summary { first, info, .. } = summary;
    let (mut begin, mut end, mut repeatable, mut length_s) = (None, None, None, 0.0);
    recording.each(|item| match item {
        Item::Memory { cycle, .. } => repeatable = Some(cycle),
        Item::Cycle(cycle) => {
            length_s = cycle.due_ns.saturating_sub(first.due_ns) as f64 * 1e-9;
            if length_s <= *part.start() && (repeatable == Some(cycle.cycle) || begin.is_none()) {
                begin = Some(cycle.due_ns);
            }
            if part.contains(&length_s) {
                end = Some(cycle.due_ns);
            }
        }
        Item::Gap(_) => {}
    })?;
    let at = |due_ns: u64| due_ns.wrapping_add(info.clock_offset_ns);
    match (begin, end) {
        (Some(begin), Some(end)) => Ok(at(begin)..=at(end)),
        _ => Err(Failure::after_start(format_args!(
            "no cycle is in {part:?} s; the recording is {length_s:.3} s long"
        ))),
    }
}

fn description(recording: &Recording, summary: &Summary, replay: &Replay, config: &Config) -> String {
    let Summary { info, first, cycles, .. } = summary;
    let mut text = format!(
        "{}: {}, {cycles} cycles from number {}, hexad {}, {}, {}\n",
        recording.path().display(),
        info.name,
        first.cycle,
        recorded_version(info),
        info.instruction_set,
        info.fidelity,
    );
    let [here, used] = [processor(), config.machine.level].map(instruction_set);
    if info.instruction_set != here {
        let _ = writeln!(text, "the instruction set is another one here: {here}; computed with {used}");
    }
    if [info.version.as_str(), &info.commit] != [version::NUMBER, version::COMMIT] {
        let _ = writeln!(text, "the version is another one here: hexad {VERSION}");
    }
    if !replay.unknown.is_empty() {
        let ranges: Vec<_> = replay.unknown.iter().take(MAX_RANGES).map(|it| format!("{it:?}")).collect();
        let more = replay.unknown.len().saturating_sub(MAX_RANGES);
        let more = if more > 0 { format!(", and in {more} more places") } else { String::new() };
        let _ = writeln!(
            text,
            "{} cycles cannot be repeated, as the memory of the controller is unknown: {}{more}",
            replay.unknown_count(),
            ranges.join(", ")
        );
    }
    let Replay { compared, different, .. } = replay;
    match (&replay.first, replay.largest()) {
        (Some(first), Some(largest)) => {
            let _ = writeln!(text, "{different} of {compared} cycles differ");
            for (name, it) in [("first", first), ("largest", largest)] {
                let _ = writeln!(
                    text,
                    "{name}: cycle {} (t = {:.6} s), {}: {:?}, recorded {:?}, difference {:.1e}",
                    it.cycle,
                    it.time_s,
                    it.field,
                    it.replayed,
                    it.recorded,
                    it.size()
                );
            }
        }
        _ => {
            let _ = writeln!(text, "{compared} cycles repeated: every output is the same to the bit");
        }
    }
    text
}
