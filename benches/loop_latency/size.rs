//! Cost against size: how many platforms one process, and how many daemons one processor, carry without an
//! overrun.
//!
//! Every cycle of a size does the same work. So an overrun of the size's own shows in many cycles, and one that
//! comes from outside, a pause of the host, in few: a repetition carries while fewer than one cycle in a hundred
//! overruns, and a size while most of its repetitions do. Daemons also have to be in control and to send 99
//! of 100 forces within the period, as their io threads share a processor too.

use std::thread::sleep;
use std::time::Duration;

use hexad::output::charts::LineStyle;
use serde::Deserialize;

use super::contest::{read_daemon, start_daemon, until_active};
use super::distribution::{Distribution, us};
use super::driver::Driver;
use super::fleet;
use super::rig::{Process, Release, Rig};
use super::support::Failure;
use super::support::charts::Charts;
use super::support::omissions::Omissions;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width, fit_ranges};

const FILE: &str = "loop_size.csv";

/// Rates of the loop \[Hz\].
pub const RATES: [u32; 2] = [1000, 4000];

/// The largest size that carries is known to this factor.
const RESOLUTION: f64 = 1.04;

/// What a size is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Controllers stepped by one loop.
    Platforms,
    /// Daemons whose loops share one processor, and whose io threads share another.
    Daemons,
}

impl Unit {
    pub fn name(self) -> &'static str {
        match self {
            Self::Platforms => "platforms in one process",
            Self::Daemons => "daemons on one processor",
        }
    }
}

/// One repetition of a size.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    /// Wake-up to output; of daemons, release to force sent.
    pub busy: Distribution,
    pub carries: bool,
}

/// What one size took.
pub struct Size {
    pub unit: Unit,
    pub rate_hz: u32,
    pub count: usize,
    pub busy: Distribution,
    pub repetitions: usize,
    /// Repetitions that carried.
    pub carried: usize,
}

impl Size {
    fn carries(&self) -> bool {
        2 * self.carried > self.repetitions
    }
}

/// How much to try.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Some of [`RATES`].
    pub rates: &'static [u32],
    pub repetitions: usize,
    pub seconds: f64,
    /// A search ends here, whatever carries.
    pub most_platforms: usize,
    pub most_daemons: usize,
}

/// Doubles the size until it does not carry, then halves the gap; ends at a size that cannot be measured.
pub fn search(rig: &Rig, unit: Unit, rate_hz: u32, effort: Effort, omissions: &mut Omissions) -> Vec<Size> {
    let most = match unit {
        Unit::Platforms => effort.most_platforms,
        Unit::Daemons => effort.most_daemons,
    };
    let mut sizes = vec![];
    let (mut carried, mut beyond) = (0, None);
    loop {
        let count = match beyond {
            None if carried == most => break,
            None => (2 * carried).clamp(1, most),
            Some(beyond) if beyond > carried + 1 && beyond as f64 > carried as f64 * RESOLUTION => {
                usize::midpoint(carried, beyond)
            }
            Some(_) => break,
        };
        let Some(size) = measure(rig, unit, rate_hz, count, effort, omissions) else { break };
        if size.carries() {
            carried = count;
        } else {
            beyond = Some(count);
        }
        sizes.push(size);
    }
    sizes.sort_by_key(|size| size.count);
    sizes
}

/// The repetitions that can be measured; `None` if none can.
fn measure(
    rig: &Rig,
    unit: Unit,
    rate_hz: u32,
    count: usize,
    effort: Effort,
    omissions: &mut Omissions,
) -> Option<Size> {
    let mut size = Size { unit, rate_hz, count, busy: Distribution::default(), repetitions: 0, carried: 0 };
    for _ in 0..effort.repetitions {
        let trial = match unit {
            Unit::Platforms => fleet::trial(rig, rate_hz, count, effort.seconds),
            Unit::Daemons => daemons(rig, rate_hz, count, effort.seconds),
        };
        let what = format!("{count} {} at {rate_hz} Hz", unit.name());
        let Some(trial) = omissions.attempt(unit.name(), what, trial) else { continue };
        size.busy.merge(&trial.busy);
        size.repetitions += 1;
        size.carried += usize::from(trial.carries);
    }
    Some(size).filter(|size| size.repetitions > 0)
}

/// So many daemons at once.
fn daemons(rig: &Rig, rate_hz: u32, count: usize, seconds: f64) -> Result<Trial, Failure> {
    let _driver = Driver::start(rig, count, rate_hz)?;
    let mut daemons: Vec<Process> = vec![];
    for number in 0..count {
        daemons.push(start_daemon(rig, number, rate_hz, Release::Sleep)?);
    }
    let begun = until_active(&mut daemons);
    if begun.is_ok() {
        sleep(Duration::from_secs_f64(seconds));
    }
    daemons.iter_mut().for_each(Process::ask_to_stop);
    let cycles_before = match begun {
        Ok(cycles) => cycles,
        Err(failure) if count == 1 => return Err(failure),
        // Those that run leave too little for the rest to begin.
        Err(_) => return Ok(Trial::default()),
    };
    let period_ns = 1_000_000_000 / u64::from(rate_hz);
    let mut trial = Trial { carries: true, ..Trial::default() };
    for (number, (daemon, before)) in daemons.iter_mut().zip(cycles_before).enumerate() {
        daemon.finish()?;
        let round = read_daemon(rig, number)?;
        let sent = round.end_to_end.count() - round.end_to_end.later_than(period_ns);
        let cycles = round.wakeup.count();
        // Only cycles in control have a force.
        let in_control = cycles.saturating_sub(before);
        trial.carries &=
            is_rare(round.overruns, cycles) && is_rare(in_control.saturating_sub(sent), in_control);
        trial.busy.merge(&round.end_to_end);
    }
    Ok(trial)
}

/// Too few of the cycles to come from the size.
pub fn is_rare(count: u64, cycles: u64) -> bool {
    100 * count < cycles
}

/// The largest size that carries, 0 if none does, and whether a larger one was measured; `None` if no size was.
fn largest(sizes: &[Size], unit: Unit, rate_hz: u32) -> Option<(usize, bool)> {
    let of_kind = || sizes.iter().filter(|size| size.unit == unit && size.rate_hz == rate_hz);
    let most = of_kind().map(|size| size.count).max()?;
    let first_beyond = of_kind().filter(|size| !size.carries()).map(|size| size.count).min();
    let carried =
        of_kind().map(|size| size.count).filter(|count| *count < first_beyond.unwrap_or(usize::MAX));
    let largest = carried.max().unwrap_or(0);
    Some((largest, largest < most))
}

pub fn print(sizes: &[Size]) {
    println!("\nlargest size that most repetitions carry");
    for unit in [Unit::Platforms, Unit::Daemons] {
        for rate_hz in RATES {
            let Some((count, is_largest)) = largest(sizes, unit, rate_hz) else { continue };
            let at_least = if is_largest { "" } else { "at least " };
            println!("{rate_hz:>6} Hz: {at_least}{count} {}", unit.name());
        }
    }
}

/// `unit, rate_hz, count, cycles, busy_p50_us, busy_p99_us, busy_max_us, repetitions, repetitions_carried`
///
/// The first row is a single step of one controller, outside of a loop, if it was measured.
pub fn write_csv(charts: &Charts, sizes: &[Size], steps: &Distribution) -> Result<(), Failure> {
    let header = [
        "unit",
        "rate_hz",
        "count",
        "cycles",
        "busy_p50_us",
        "busy_p99_us",
        "busy_max_us",
        "repetitions",
        "repetitions_carried",
    ];
    let record =
        |unit: &str, rate_hz: String, count: usize, busy: &Distribution, repetitions: [String; 2]| {
            let [p50, p99, max] = [busy.quantile(0.5), busy.quantile(0.99), busy.max()].map(us);
            let times =
                [busy.count().to_string(), format!("{p50:.2}"), format!("{p99:.2}"), format!("{max:.1}")];
            [unit.into(), rate_hz, count.to_string()].into_iter().chain(times).chain(repetitions)
        };
    let step = record("Controller::step", String::new(), 1, steps, ["1".into(), String::new()]);
    let step = Some(step).filter(|_| steps.count() > 0);
    let sizes = sizes.iter().map(|size| {
        let Size { unit, rate_hz, count, busy, repetitions, carried } = size;
        record(unit.name(), rate_hz.to_string(), *count, busy, [repetitions, carried].map(usize::to_string))
    });
    charts.write_csv(FILE, &header, step.into_iter().chain(sizes))
}

/// What the chart needs of a row. The step of one controller has no rate.
#[derive(Deserialize)]
struct Figure {
    unit: String,
    rate_hz: Option<u32>,
    count: usize,
    busy_p50_us: f64,
    busy_p99_us: f64,
    repetitions: usize,
    repetitions_carried: Option<usize>,
}

impl Figure {
    fn carries(&self) -> bool {
        self.repetitions_carried.is_some_and(|carried| 2 * carried > self.repetitions)
    }
}

type Quantile = fn(&Figure) -> f64;

/// Busy time of a cycle against the number of platforms, with the periods as bounds.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let of_rate = |rate_hz: u32| {
        let of_unit = figures.rows.iter().filter(|row| row.unit == Unit::Platforms.name());
        of_unit.filter(move |row| row.rate_hz == Some(rate_hz))
    };
    let most = figures.rows.iter().map(|row| row.count).max().unwrap_or(1);
    let (mut lines, mut points) = (vec![], vec![]);
    for (color, rate_hz) in RATES.into_iter().enumerate() {
        let period_us = 1e6 / f64::from(rate_hz);
        let bound = vec![(1.0, period_us), (most as f64, period_us)];
        lines.push(Line { points: bound, style: LineStyle::Dashed, color, width: Width::Curve });
        let quantiles: [(Quantile, _); 2] =
            [(|row| row.busy_p50_us, Width::Curve), (|row| row.busy_p99_us, Width::Hair)];
        for (quantile, width) in quantiles {
            let line = of_rate(rate_hz).map(|row| (row.count as f64, quantile(row))).collect();
            lines.push(Line { points: line, style: LineStyle::Solid, color, width });
        }
        points.extend(of_rate(rate_hz).map(|row| Point {
            at: (row.count as f64, row.busy_p50_us),
            mark: if row.carries() { Mark::Disc } else { Mark::Ring },
            color,
            label: Label::None,
        }));
    }
    let mut drawn = vec![Scatter {
        x_label: "platforms",
        y_label: "wake-up to output [µs]",
        points,
        lines,
        ..Scatter::default()
    }];
    fit_ranges(&mut drawn, true);
    let sizes = RATES.into_iter().filter_map(|rate_hz| {
        let most = of_rate(rate_hz).next_back()?.count;
        let carried = of_rate(rate_hz).take_while(|row| row.carries()).last().map_or(0, |row| row.count);
        let at_least = if carried == most { "at least " } else { "" };
        Some(format!("{at_least}{carried} at {} kHz", rate_hz / 1000))
    });
    let sizes: Vec<_> = sizes.collect();
    let title = format!("Platforms driven by one loop on one processor: {}", sizes.join(", "));
    let legend = vec![
        (Sample::Line(LineStyle::Solid, Width::Curve, 0), "1 kHz, median"),
        (Sample::Line(LineStyle::Solid, Width::Hair, 0), "1 kHz, 99th percentile"),
        (Sample::Line(LineStyle::Solid, Width::Curve, 1), "4 kHz, median"),
        (Sample::Line(LineStyle::Solid, Width::Hair, 1), "4 kHz, 99th percentile"),
        (Sample::Mark(Mark::Ring, 0), "overruns in most runs"),
        (Sample::Line(LineStyle::Dashed, Width::Curve, 0), "period"),
    ];
    Grid { title: &figures.titled(&title), legend, columns: 1, charts: drawn }
        .write_svg(&charts.path("loop_size.svg"))?;
    Ok(())
}
