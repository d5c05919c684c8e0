//! Cost against size: how many platforms one process, and how many daemons one processor, carry without an
//! overrun.
//!
//! Every cycle of a size does the same work. So an overrun of the size's own shows in many cycles, and one that
//! comes from outside, a pause of the host, in few: a repetition carries while fewer than one cycle in a hundred
//! overruns, and a size while most of its repetitions do. Daemons also have to be in control and to send 99
//! of 100 forces within the period, as their io threads share a processor too.

use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use hexad::output::charts::Stroke;
use hexad::output::files::write_whole;
use hexad::output::scatter::{Label, Line, Mark, Point, Sample, Scatter, Width};

use super::contest::{Watch, read_daemon, start_daemon};
use super::distribution::{Distribution, us};
use super::driver::Driver;
use super::rig::{Process, Release, Rig};
use super::{Failure, fleet};

/// Rates of the loop \[Hz\].
pub const RATES: [u32; 2] = [1000, 4000];

/// The largest size that carries is known to this factor.
const RESOLUTION: f64 = 1.04;
/// A search ends here, whatever carries.
const MOST_PLATFORMS: usize = 8192;
const MOST_DAEMONS: usize = 32;

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
    pub repetitions: usize,
    pub seconds: f64,
}

/// Doubles the size until it does not carry, then halves the gap.
pub fn search(rig: &Rig, unit: Unit, rate_hz: u32, effort: Effort) -> Result<Vec<Size>, Failure> {
    let most = match unit {
        Unit::Platforms => MOST_PLATFORMS,
        Unit::Daemons => MOST_DAEMONS,
    };
    let mut sizes = vec![];
    let (mut carried, mut count) = (0, 1);
    loop {
        let size = measure(rig, unit, rate_hz, count, effort)?;
        let carries = size.carries();
        sizes.push(size);
        if !carries || count == most {
            break;
        }
        (carried, count) = (count, (2 * count).min(most));
    }
    let mut beyond = count;
    while beyond > carried + 1 && beyond as f64 > carried as f64 * RESOLUTION {
        let middle = usize::midpoint(carried, beyond);
        let size = measure(rig, unit, rate_hz, middle, effort)?;
        *if size.carries() { &mut carried } else { &mut beyond } = middle;
        sizes.push(size);
    }
    sizes.sort_by_key(|size| size.count);
    Ok(sizes)
}

fn measure(rig: &Rig, unit: Unit, rate_hz: u32, count: usize, effort: Effort) -> Result<Size, Failure> {
    let context = |failure| format!("{count} {} at {rate_hz} Hz: {failure}", unit.name());
    let busy = Distribution::default();
    let mut size = Size { unit, rate_hz, count, busy, repetitions: effort.repetitions, carried: 0 };
    for _ in 0..effort.repetitions {
        let trial = match unit {
            Unit::Platforms => fleet::trial(rig, rate_hz, count, effort.seconds),
            Unit::Daemons => daemons(rig, rate_hz, count, effort.seconds),
        };
        let trial = trial.map_err(context)?;
        size.busy.merge(&trial.busy);
        size.carried += usize::from(trial.carries);
    }
    Ok(size)
}

/// So many daemons at once.
fn daemons(rig: &Rig, rate_hz: u32, count: usize, seconds: f64) -> Result<Trial, Failure> {
    let mut watch = Watch::new(count)?;
    let _driver = Driver::start(rig, count, rate_hz)?;
    let mut daemons: Vec<Process> = vec![];
    for number in 0..count {
        daemons.push(start_daemon(rig, number, rate_hz, Release::Sleep)?);
    }
    let begun = watch.until_active(&mut daemons);
    if begun.is_ok() {
        sleep(Duration::from_secs_f64(seconds));
    }
    daemons.iter_mut().for_each(Process::ask_to_stop);
    match begun {
        Ok(()) => {}
        Err(failure) if count == 1 => return Err(failure),
        // Those that run leave too little for the rest to begin.
        Err(_) => return Ok(Trial::default()),
    }
    let period_ns = 1_000_000_000 / u64::from(rate_hz);
    let mut trial = Trial { carries: true, ..Trial::default() };
    for (number, daemon) in daemons.iter_mut().enumerate() {
        daemon.finish()?;
        let round = read_daemon(rig, number)?;
        let sent = round.end_to_end.count() - round.end_to_end.later_than(period_ns);
        let cycles = round.wakeup.count();
        trial.carries &= is_rare(round.overruns, cycles) && is_rare(cycles.saturating_sub(sent), cycles);
        trial.busy.merge(&round.end_to_end);
    }
    Ok(trial)
}

/// Too few of the cycles to come from the size.
pub fn is_rare(count: u64, cycles: u64) -> bool {
    100 * count < cycles
}

/// The largest size that carries; 0 if none does.
pub fn largest(sizes: &[Size], unit: Unit, rate_hz: u32) -> usize {
    let of_kind = sizes.iter().filter(|size| size.unit == unit && size.rate_hz == rate_hz);
    let first_beyond = of_kind.clone().filter(|size| !size.carries()).map(|size| size.count).min();
    let carried = of_kind.filter(|size| size.count < first_beyond.unwrap_or(usize::MAX));
    carried.map(|size| size.count).max().unwrap_or(0)
}

pub fn print(sizes: &[Size]) {
    println!("\nlargest size that most repetitions carry");
    for unit in [Unit::Platforms, Unit::Daemons] {
        for rate_hz in RATES {
            println!("{rate_hz:>6} Hz: {} {}", largest(sizes, unit, rate_hz), unit.name());
        }
    }
}

/// `unit, rate_hz, count, cycles, busy_p50_us, busy_p99_us, busy_max_us, repetitions, repetitions_carried`
///
/// The first row is a single step of one controller, outside of a loop.
pub fn write_csv(path: &Path, sizes: &[Size], steps: &Distribution) -> Result<(), Failure> {
    let mut csv = csv::Writer::from_writer(vec![]);
    csv.write_record([
        "unit",
        "rate_hz",
        "count",
        "cycles",
        "busy_p50_us",
        "busy_p99_us",
        "busy_max_us",
        "repetitions",
        "repetitions_carried",
    ])?;
    let times = |busy: &Distribution| {
        let cycles = busy.count().to_string();
        let [p50, p99, max] = [busy.quantile(0.5), busy.quantile(0.99), busy.max()].map(us);
        [cycles, format!("{p50:.2}"), format!("{p99:.2}"), format!("{max:.1}")]
    };
    let [cycles, p50, p99, max] = times(steps);
    csv.write_record(["Controller::step", "", "1", &cycles, &p50, &p99, &max, "1", ""])?;
    for Size { unit, rate_hz, count, busy, repetitions, carried } in sizes {
        let [cycles, p50, p99, max] = times(busy);
        let [rate_hz, count] = [*rate_hz as usize, *count].map(|number| number.to_string());
        let [repetitions, carried] = [repetitions, carried].map(usize::to_string);
        csv.write_record([unit.name(), &rate_hz, &count, &cycles, &p50, &p99, &max, &repetitions, &carried])?;
    }
    write_whole(path, &csv.into_inner()?)?;
    Ok(())
}

/// Of the axes: sizes, and times \[us\] from less than one platform takes. They end where the legend has room.
const COUNTS: std::ops::Range<f64> = 1.0..20e3;
const TIMES_US: std::ops::Range<f64> = 0.5..20e3;

/// Busy time of a cycle against the number of platforms, with the periods as bounds.
pub fn write_chart(path: &Path, sizes: &[Size]) -> Result<(), Failure> {
    let (mut lines, mut points) = (vec![], vec![]);
    let largest = RATES
        .map(|rate_hz| format!("{} at {} kHz", largest(sizes, Unit::Platforms, rate_hz), rate_hz / 1000));
    let title = format!("Platforms driven by one loop on one processor: {}", largest.join(", "));
    for (color, rate_hz) in RATES.into_iter().enumerate() {
        let period_us = 1e6 / f64::from(rate_hz);
        let bound = vec![(COUNTS.start, period_us), (COUNTS.end, period_us)];
        lines.push(Line { points: bound, style: Stroke::Dashed, color, width: Width::Curve });
        let of_rate = || sizes.iter().filter(|it| it.unit == Unit::Platforms && it.rate_hz == rate_hz);
        for (q, width) in [(0.5, Width::Curve), (0.99, Width::Hair)] {
            let at = |size: &Size| (size.count as f64, us(size.busy.quantile(q)));
            lines.push(Line { points: of_rate().map(at).collect(), style: Stroke::Solid, color, width });
        }
        for size in of_rate() {
            let at = (size.count as f64, us(size.busy.quantile(0.5)));
            let mark = if size.carries() { Mark::Disc } else { Mark::Ring };
            points.push(Point { at, mark, color, label: Label::None });
        }
    }
    let chart = Scatter {
        title: &title,
        x_label: "platforms",
        y_label: "wake-up to output [µs]",
        x: COUNTS,
        y: TIMES_US,
        points,
        lines,
        legend: vec![
            (Sample::Line(Stroke::Solid, Width::Curve, 0), "1 kHz, median"),
            (Sample::Line(Stroke::Solid, Width::Hair, 0), "1 kHz, 99th percentile"),
            (Sample::Line(Stroke::Solid, Width::Curve, 1), "4 kHz, median"),
            (Sample::Line(Stroke::Solid, Width::Hair, 1), "4 kHz, 99th percentile"),
            (Sample::Mark(Mark::Ring, 0), "overruns in most runs"),
            (Sample::Line(Stroke::Dashed, Width::Curve, 0), "period"),
        ],
    };
    chart.write_svg(path)?;
    Ok(())
}
