//! `hexad move --udp --dry-run`: what a stream is like, and what the limits would make of it, before it moves anything.

use core::fmt::Write as _;
use std::net::SocketAddr;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::receiver::{Arrived, Receiver, SILENCE_CAUSES};
use super::stream::{BLEND_S, StreamOptions, blended};
use super::survey::StreamSurvey;
use crate::commands::failure::Failure;
use crate::commands::progress::millisecond_bar;
use crate::output::charts::{LineStyle, Panel, Series, write_svg};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::reference::ReferenceGenerator;
use hexad_core::control::setpoint::pose_samples::PoseSamples;
use hexad_core::control::setpoint::target::Target;
use hexad_core::control::signals::limits::{Limit, LimitSet};
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::rigid::{Acceleration, Motion, Twist};
use hexad_core::model::task::{pose_of, task_coordinates};
use hexad_daemon::constants;
use hexad_machine::config::Config;
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::files::print;
use hexad_machine::text::numbers::{AXES, axis_unit, percent, significant};
use hexad_machine::text::units::MotionUnits;

/// Ranges below which nobody feels a motion \[rad\], \[m\].
const STANDING_RAD: f64 = 2e-3;
const STANDING_M: f64 = 1e-3;

/// Time between two looks at the socket.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// Receives for some seconds after the first datagram, prints what came, and draws it. An error if nothing came, or if its units can
/// hardly be right.
pub fn run(
    config: &Config,
    address: SocketAddr,
    options: &StreamOptions,
    duration_s: f64,
    stop: &Stop,
) -> Result<(), Failure> {
    let mut receiver = Receiver::open(config, address, options)?;
    let arrived = receive(&mut receiver, duration_s, stop);
    let (Some(first), Some(last)) = (arrived.first(), arrived.last()) else {
        let causes = if receiver.is_silent() { format!(": {SILENCE_CAUSES}") } else { String::new() };
        return Err(Failure::after_start(receiver.description() + &causes));
    };
    let constants = constants(config);
    let mut survey = StreamSurvey::over(duration_s);
    arrived.iter().for_each(|it| survey.add(&constants, it.arrival_ns, &it.x));
    let [low, high] = survey.range.unwrap_or_default();
    let span_s = seconds_since_or_0(first.arrival_ns, last.arrival_ns);
    let mut text = format!("{} in {span_s:.1} s, {}\n", receiver.description(), timing(&arrived));
    let format = CoordinateFormat::new(MotionUnits::default(), config.resolution());
    text += &format.table("about home", &[("lowest", Some(low), 0), ("highest", Some(high), 0)]);
    let followed = Followed::new(config, &arrived);
    let _ = writeln!(text, "{}", followed.summary());
    let ranges: Vec<_> = high.iter().zip(low).map(|(high, low)| high - low).collect();
    for (name, ranges, least) in
        [("its angles", ranges.get(..3), STANDING_RAD), ("its positions", ranges.get(3..), STANDING_M)]
    {
        let widest = ranges.into_iter().flatten().copied().fold(0.0, f64::max);
        if widest > 0.0 && widest < least {
            let _ =
                writeln!(text, "{name} hardly change: are the numbers in larger units than the format says?");
        }
    }
    if let Some(path) = &options.output {
        followed.draw(path, config)?;
        let _ = writeln!(text, "{}", path.display());
    }
    print(text)?;
    survey.warning().map_or(Ok(()), |warning| Err(Failure::after_start(warning)))
}

fn receive(receiver: &mut Receiver, duration_s: f64, stop: &Stop) -> Vec<Arrived> {
    let (mut began, mut arrived, mut was_silent) = (Instant::now(), vec![], true);
    let bar = millisecond_bar(duration_s);
    while !stop.is_requested() && began.elapsed().as_secs_f64() < duration_s {
        bar.set_position(began.elapsed().as_millis() as u64);
        sleep(POLL_INTERVAL);
        while let Some(sample) = receiver.read() {
            if core::mem::take(&mut was_silent) {
                began = Instant::now();
            }
            arrived.extend(sample);
        }
    }
    bar.finish_and_clear();
    arrived
}

/// Rate, losses and ages. A pose is missing where the stamps leave room for one.
fn timing(arrived: &[Arrived]) -> String {
    let steps = arrived.iter().zip(arrived.iter().skip(1));
    let mut steps: Vec<_> = steps.map(|(a, b)| seconds_since_or_0(a.time_ns, b.time_ns)).collect();
    let mut ages: Vec<_> = arrived.iter().map(|it| seconds_since_or_0(it.time_ns, it.arrival_ns)).collect();
    steps.sort_by(f64::total_cmp);
    ages.sort_by(f64::total_cmp);
    let at = |sorted: &[f64], share: f64| {
        sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or_default()
    };
    let usual = at(&steps, 0.5);
    if usual <= 0.0 {
        return "too few for a rate".into();
    }
    let missing: f64 = steps.iter().map(|step| (step / usual).round() - 1.0).filter(|it| *it > 0.0).sum();
    let lost = percent(missing / (missing + arrived.len() as f64));
    let [half, late] =
        [at(&ages, 0.5), ages.last().copied().unwrap_or_default()].map(|age| significant(1e3 * age));
    format!(
        "every {} ms, {lost} missing, held up by {half} ms (median) to {late} ms",
        significant(1e3 * usual)
    )
}

/// Time \[s\], X of the stream with its blend, and X of the reference.
type Cycle = (f64, [f64; 6], [f64; 6]);

/// The stream, and how the reference follows it.
struct Followed {
    cycles: Vec<Cycle>,
    /// Largest deviation \[m\], \[rad\].
    deviation: [f64; 2],
    /// Delay of the wanted motion behind the stream \[s\].
    delay_s: f64,
    /// Cycles that count, those at a limit, and which.
    counted: usize,
    limited: usize,
    limits: LimitSet,
}

impl Followed {
    /// The reference begins at rest at home, as if people boarded there.
    fn new(config: &Config, arrived: &[Arrived]) -> Self {
        let (constants, home) = (constants(config), config.machine.home);
        let period_ns = constants.parameters.period_ns;
        let mut reference = ReferenceGenerator::new(&constants);
        let (twist, acceleration) = (Twist::default(), Acceleration::default());
        // A machine file is refused whose home has no stop.
        reference.verify_start(&constants, &Motion { pose: pose_of(&home), twist, acceleration }).ok();
        let first_ns = arrived.first().map_or(0, |it| it.arrival_ns);
        reference.begin_placed_motion(first_ns);
        let (mut samples, mut waiting) = (PoseSamples::default(), arrived.iter().peekable());
        let mut now_ns = first_ns;
        let (cycles, limits) = (vec![], LimitSet::default());
        // The start from rest, in which nobody sees the interval of the poses yet, counts as little as it lasts.
        let last_ns = arrived.last().map_or(0, |it| it.arrival_ns);
        let after_s = BLEND_S.min(0.5 * seconds_since_or_0(first_ns, last_ns));
        let mut followed = Self { cycles, deviation: [0.0; 2], delay_s: 0.0, counted: 0, limited: 0, limits };
        while waiting.peek().is_some() {
            while let Some(it) = waiting.next_if(|it| it.arrival_ns <= now_ns) {
                let x = blended(&home, &it.x, first_ns, it.arrival_ns);
                samples.push(now_ns, it.time_ns, &pose_of(&x));
            }
            reference.advance(&constants, now_ns, Some(&Target::Samples(&samples)));
            followed.add(
                seconds_since_or_0(first_ns, now_ns),
                &reference,
                samples.target(now_ns),
                &home,
                after_s,
            );
            now_ns += period_ns;
        }
        followed.delay_s = samples.delay_s(now_ns);
        followed
    }

    fn add(
        &mut self,
        t: f64,
        reference: &ReferenceGenerator,
        wanted: Option<Motion>,
        home: &[f64; 6],
        after_s: f64,
    ) {
        let (wanted, present) = (wanted.map_or(pose_of(home), |it| it.pose), reference.motion().pose);
        self.cycles.push((t, task_coordinates(&wanted, home), task_coordinates(&present, home)));
        if t < after_s {
            return;
        }
        self.counted += 1;
        let error = wanted.displacement_to(&present);
        for (largest, error) in self.deviation.iter_mut().zip([error.linear.norm(), error.angular.norm()]) {
            *largest = largest.max(error);
        }
        self.limited += usize::from(!reference.active_limits().is_empty());
        self.limits = self.limits.union(reference.active_limits());
    }

    fn summary(&self) -> String {
        let [mm, deg] = [1e3 * self.deviation[0], self.deviation[1].to_degrees()].map(significant);
        let late = significant(1e3 * self.delay_s);
        let share = percent(self.limited as f64 / self.counted.max(1) as f64);
        let names = Limit::ALL.into_iter().filter(|it| self.limits.contains(*it)).map(Limit::name);
        let names: Vec<_> = names.collect();
        let of = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
        format!(
            "the platform would follow {late} ms later, within {mm} mm and {deg} deg, at a limit for {share} of the time{of}"
        )
    }

    fn draw(&self, path: &Path, config: &Config) -> Result<(), Failure> {
        let home = config.machine.home;
        let lines: Vec<_> = (0..AXES.len())
            .map(|k| {
                let line = |x: fn(&Cycle) -> &[f64; 6]| -> Vec<_> {
                    let of = |x: &[f64; 6]| x.get(k).copied().unwrap_or_default();
                    let about_home = |cycle| axis_unit(k).0 * (of(x(cycle)) - of(&home));
                    self.cycles.iter().map(|cycle| (cycle.0, about_home(cycle))).collect()
                };
                (line(|cycle| &cycle.1), line(|cycle| &cycle.2))
            })
            .collect();
        let panel = |y_label, axes: core::ops::Range<usize>| {
            let series = axes.flat_map(|k| {
                let (wanted, present) = lines.get(k)?;
                let of = |label, points, style| Series { label, points, style, color: k % 3 };
                Some([
                    of(AXES.get(k).copied()?, present.as_slice(), LineStyle::Solid),
                    of("", wanted.as_slice(), LineStyle::Dashed),
                ])
            });
            Panel { y_label, series: series.flatten().collect() }
        };
        let title = format!("{}: the stream (dashed) and how the limits permit to follow it", config.name);
        Ok(write_svg(
            path,
            &title,
            "time [s]",
            &[panel("position about home [mm]", 3..6), panel("angles about home [deg]", 0..3)],
        )?)
    }
}
