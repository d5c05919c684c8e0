//! Trajectory of a setpoint source: a built-in motion, an excitation, or the rows of a file.

use core::ops::ControlFlow;
use std::path::Path;

use tracing::info;

use crate::commands::failure::Failure;
use crate::commands::offline_tables::{check_times, read_trajectory, task_state, time};
use crate::commands::orientation::OrientationFormat;
use crate::commands::progress::millisecond_bar;
use hexad_core::model::task::TaskState;
use hexad_core::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad_core::motion::excitation::Excitation;
use hexad_core::motion::frames::Frames;
use hexad_core::motion::trajectory::{Knot, interpolate};
use hexad_daemon::precheck::Precheck;
use hexad_machine::analysis::excitation_design::design;
use hexad_machine::analysis::sampled_loop::edge;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::csv_table::{NumberTable, TableError, TableErrors};
use hexad_machine::text::files::name_of;
use hexad_machine::text::numbers::percent;

/// Largest X' and X'' at the ends of a trajectory that count as at rest, per second.
const MAX_REST_RATE: f64 = 1e-3;

/// Largest ratio of the distance from the rates to the distance between the poses. Distant rows may leave out
/// a part of the distance; a time in milliseconds gives a ratio of a thousand.
const MAX_WAY_RATIO: f64 = 30.0;

/// Smallest amplitude of a built-in motion, as a share of its usual one. A smaller motion is invisible.
pub(super) const MIN_AMPLITUDE_SHARE: f64 = 1e-3;

/// Duration of the fast motion at the end of an excitation, which shows the delay of the drives \[s\].
const DELAY_MOTION_S: f64 = 10.0;

const NOT_EXCITING: &str = "no motion about home within the limits shows the parameters: home must be further from the ends \
    of the stroke and from the bounds of [envelope], or --amplitude larger";

/// X, X', X'' as a function of time, from rest to rest.
#[derive(Clone, Debug)]
pub enum Trajectory {
    BuiltIn(FittedMotion),
    Excitation(Box<Excitation>),
    Knots(Vec<Knot>),
    /// Knots of a tool in a work frame, and home of the platform, near which its angles are.
    Tool(Vec<Knot>, Box<Frames>, [f64; 6]),
}

impl Trajectory {
    /// A built-in motion, as large as the drives allow and the daemon accepts.
    pub fn built_in(config: &Config, motion: BuiltInMotion, seconds: f64) -> Result<Self, Failure> {
        Ok(Self::BuiltIn(Self::fitted(config, motion, seconds)?))
    }

    fn fitted(config: &Config, motion: BuiltInMotion, seconds: f64) -> Result<FittedMotion, Failure> {
        let largest = fit(&config.machine, motion, seconds);
        let smallest = MIN_AMPLITUDE_SHARE / largest.angle_share;
        let sized = |share| {
            let motion = largest.smaller(share);
            move |t| motion.at(t)
        };
        Ok(largest.smaller(accepted_share(config, motion.name(), seconds, smallest, sized)?))
    }

    /// An excitation of so many counted periods, with a share of the largest amplitude that drives and daemon accept.
    pub fn excitation(
        config: &Config,
        periods: u32,
        amplitude: f64,
        seed: u64,
    ) -> Result<Excitation, Failure> {
        let machine = &config.machine;
        let precheck = Precheck::new(config).with_reserve();
        let design = design(machine, amplitude, seed, |state| precheck.keeps_limits(state))
            .ok_or_else(|| Failure::before_start(NOT_EXCITING))?;
        let delay_motion = Self::fitted(config, BuiltInMotion::Sines, DELAY_MOTION_S)?.smaller(amplitude);
        let largest = Excitation::new(machine, design.series, periods, delay_motion);
        let sized = |share| {
            let motion = largest.smaller(share);
            move |t| motion.at(t)
        };
        let share = accepted_share(config, "excitation", largest.duration(), MIN_AMPLITUDE_SHARE, sized)?;
        Ok(largest.smaller(share))
    }

    /// A trajectory from a CSV file. It must begin and end at rest, its times must increase, and the daemon
    /// must accept it. Its columns are coordinates of a tool in a work frame, if these are given.
    pub fn from_file(
        config: &Config,
        coordinates: &Coordinates,
        path: &Path,
        group: Option<&str>,
        format: OrientationFormat,
    ) -> Result<Self, Failure> {
        let home = config.machine.home;
        let table = read_trajectory(path, group, format, &coordinates.tool_x(&home))?;
        let path = name_of(path);
        let trajectory = match (Self::from_rows(&table, path)?, coordinates.is_empty()) {
            (Self::Knots(knots), false) => Self::Tool(knots, Box::new(coordinates.frames()), home),
            (trajectory, _) => trajectory,
        };
        trajectory.check(config, &table, path)?;
        Ok(trajectory)
    }

    /// Reports each row before which the daemon would refuse a setpoint.
    fn check(&self, config: &Config, table: &NumberTable, path: &Path) -> Result<(), TableError> {
        let precheck = Precheck::new(config);
        let times: Vec<f64> = table.rows().iter().map(|row| time(row)).collect();
        let (Some(first), Some(last)) = (times.first().copied(), times.last().copied()) else {
            return Ok(());
        };
        let mut errors = TableErrors::new(path);
        let mut reported = None;
        let bar = millisecond_bar(last - first).with_message("checking the whole motion");
        precheck.follow(
            |t| self.at(t - first),
            [first, last],
            |refusal| {
                // The setpoint belongs to the row after it, or to the last row.
                let row = times.partition_point(|time| *time < refusal.t_s);
                let line = table.lines().get(row).or(table.lines().last());
                if let Some(line) = line.filter(|line| reported != Some(**line)) {
                    errors.add(format!("line {line}: on the way to it, at {refusal}"));
                    reported = Some(*line);
                }
                ControlFlow::Continue(())
            },
            |since_s| {
                bar.set_position((1e3 * since_s) as u64);
                true
            },
        );
        bar.finish_and_clear();
        errors.into_result()
    }

    /// A trajectory from a table with its columns. Error texts use the name `path`.
    pub fn from_rows(table: &NumberTable, path: &Path) -> Result<Self, TableError> {
        let mut errors = TableErrors::new(path);
        let knots: Vec<_> =
            table.rows().iter().map(|row| Knot { t_s: time(row), state: task_state(row) }).collect();
        let rows = || knots.iter().zip(table.lines());
        check_times(table, &mut errors);
        if let (Some(ratio), Some(line)) = (way_ratio(&knots), table.lines().get(1)) {
            errors.add(format!(
                "line {line}: by its rates the way is {ratio:.0} times that by its poses: t must be in s; name the column t_ms if it is in ms"
            ));
        }
        for (end, row) in [("first", rows().next()), ("last", rows().next_back())] {
            let Some((Knot { state, .. }, line)) = row else { continue };
            for (quantity, largest) in [("rate", state.xd.amax()), ("acceleration", state.xdd.amax())] {
                if largest > MAX_REST_RATE {
                    errors.add(format!(
                        "line {line}: {end} row: {quantity} {largest:?}: must be at rest, at most {MAX_REST_RATE:?}"
                    ));
                }
            }
        }
        errors.into_result()?;
        Ok(Self::Knots(knots))
    }

    /// Duration \[s\].
    pub fn duration(&self) -> f64 {
        match self {
            Self::BuiltIn(scene) => scene.duration_s,
            Self::Excitation(excitation) => excitation.duration(),
            Self::Knots(knots) | Self::Tool(knots, ..) => {
                knots.last().map_or(0.0, |b| b.t_s) - knots.first().map_or(0.0, |a| a.t_s)
            }
        }
    }

    /// X, X', X'' at `t`, within the duration.
    pub fn at(&self, t: f64) -> TaskState {
        match self {
            Self::BuiltIn(scene) => scene.at(t),
            Self::Excitation(excitation) => excitation.at(t),
            Self::Knots(knots) => at_knots(knots, t),
            Self::Tool(knots, frames, home) => {
                let platform = frames.platform_motion(&at_knots(knots, t).motion());
                // Without rates the zeros are refused.
                TaskState::of_motion(&platform, home).unwrap_or_default()
            }
        }
    }
}

/// The state `t` seconds after the first knot.
fn at_knots(knots: &[Knot], t: f64) -> TaskState {
    interpolate(knots, knots.first().map_or(0.0, |first| first.t_s) + t).unwrap_or_default()
}

/// Largest share of a motion's amplitude, at most 1, with which the daemon accepts the whole motion with reserve.
/// `sized` returns the motion with a share of its amplitude; `smallest` is the least share.
fn accepted_share<M: Fn(f64) -> TaskState>(
    config: &Config,
    name: &'static str,
    seconds: f64,
    smallest: f64,
    sized: impl Fn(f64) -> M,
) -> Result<f64, Failure> {
    let precheck = Precheck::new(config).with_reserve();
    let refusal = |share: f64| precheck.refusal(sized(share), [0.0, seconds]);
    let Some(too_large) = refusal(1.0) else { return Ok(1.0) };
    if let Some(refusal) = refusal(smallest) {
        let share = percent(MIN_AMPLITUDE_SHARE);
        return Err(Failure::before_start(format_args!(
            "{name} of {seconds} s would be refused even with {share} of its usual amplitude: {refusal}"
        )));
    }
    let share = edge(0.0, 1.0, |share| refusal(share).is_none());
    info!("{name} with {} of the amplitude that the drives carry: with more, at {too_large}", percent(share));
    Ok(share)
}

/// Ratio of the distance from the rates to the distance between the poses, if it is too large for one motion.
fn way_ratio(knots: &[Knot]) -> Option<f64> {
    let (mut by_rates, mut by_poses) = (0.0, 0.0);
    for (a, b) in knots.iter().zip(knots.iter().skip(1)) {
        by_rates += 0.5 * (a.state.xd.norm() + b.state.xd.norm()) * (b.t_s - a.t_s);
        by_poses += (b.state.x - a.state.x).norm();
    }
    let ratio = by_rates / by_poses;
    (ratio > MAX_WAY_RATIO && ratio.is_finite()).then_some(ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_machine::text::csv_table::trajectory_columns;

    /// A row at rest with these t and x.
    fn row(t: &str, x: &str) -> String {
        format!("{t},0,0,0,{x},0,0{}\n", ",0".repeat(12))
    }

    fn read(rows: &[String]) -> Result<Trajectory, TableError> {
        let text = trajectory_columns().join(",") + "\n" + &rows.concat();
        let path = Path::new("x.csv");
        let table = NumberTable::from_reader(text.as_bytes(), path, &trajectory_columns(), &[]).unwrap();
        Trajectory::from_rows(&table, path)
    }

    #[test]
    fn rows_that_are_too_near_are_refused_each_with_its_line() {
        let rows = [row("0", "1"), row("1e-300", "2"), row("0.5", "2"), row("0.5", "1")];
        assert_eq!(
            read(&rows).unwrap_err().to_string(),
            "x.csv: line 3: t = 1e-300 after t = 0.0: must increase, by at least 1e-6\n\
             x.csv: line 5: t = 0.5 after t = 0.5: must increase, by at least 1e-6"
        );
    }

    #[test]
    fn times_in_milliseconds_are_seen_by_the_rates() {
        let text = |unit: &str, step: f64| {
            let mut text = trajectory_columns().join(",").replacen("t,", &format!("t{unit},"), 1) + "\n";
            for k in 0..=20 {
                let profile = hexad_core::motion::minimum_jerk::rise(0.1 * f64::from(k), 2.0);
                text += &format!(
                    "{},0,0,0,{},0,0,0,0,0,{},0,0,0,0,0,{},0,0\n",
                    step * f64::from(k),
                    profile.value_share,
                    profile.rate_per_s,
                    profile.accel_per_s2
                );
            }
            text
        };
        let read = |text: String| {
            let path = Path::new("x.csv");
            let table = NumberTable::from_reader(text.as_bytes(), path, &trajectory_columns(), &[]).unwrap();
            Trajectory::from_rows(&table, path)
        };
        let message = read(text("", 100.0)).unwrap_err().to_string();
        let words = "line 3: by its rates the way is 1000 times that by its poses: t must be in s; name the column t_ms";
        assert!(message.contains(words), "{message}");
        for (unit, step) in [("", 0.1), ("_ms", 100.0)] {
            let trajectory = read(text(unit, step)).unwrap();
            assert!((trajectory.duration() - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_refusal_of_many_rows_is_short() {
        let message = read(&vec![row("0", "1"); 1000]).unwrap_err().to_string();
        assert_eq!(message.lines().count(), 21);
        assert!(message.ends_with("\nx.csv: and 979 more"), "{message}");
    }

    #[test]
    fn the_largest_numbers_still_make_setpoints() {
        let trajectory = read(&[row("-1e12", "1e12"), row("0", "-1e12"), row("1e-6", "1e12")]).unwrap();
        for t in [0.0, 0.5e12, 1e12, trajectory.duration()] {
            assert!(trajectory.at(t).is_finite(), "{t}");
        }
    }
}
