//! `hexad goto --table`: goes to the targets of a table, one after the other, and writes where the platform was at each.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::ProgressIterator;
use nalgebra::Vector6;

use super::visit_log::VisitLog;
use super::{GotoArguments, origin};
use crate::commands::arguments::duration;
use crate::commands::failure::Failure;
use crate::commands::motion_client::{MotionClient, MotionError};
use crate::commands::offline_tables::read_targets;
use crate::commands::orientation::{OrientationFormat, ROTATION_HELP};
use crate::commands::progress::item_bar;
use hexad_client::messages::{LeasedSubscriber, MeasuredMessage};
use hexad_client::operator::protocol::{RequestLine, RequestResult};
use hexad_client::operator::requests::status;
use hexad_client::operator::status_report::{StatusReport, StopNumber};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::task::{pose_of, task_coordinates};
use hexad_daemon::constants;
use hexad_daemon::motion_requests::plan::GotoPlan;
use hexad_daemon::target_source::Observation;
use hexad_machine::analysis::target_motion::check_target;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::csv_table::{NumberTable, TableErrors, six};
use hexad_machine::text::files::{name_of, print, remark};

/// Interval at which measured messages are taken: their buffer is full after 12 ms at 20 kHz.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Largest difference between the target of a row and the one that the daemon holds \[rad\], \[m\]: rounding of the frames.
const SAME: f64 = 1e-9;

#[derive(Debug, Args)]
#[command(next_help_heading = "Table of targets")]
pub struct TableOptions {
    /// Go to the targets of this CSV, one a row; `-` is standard input. All rows are checked before anything moves
    ///
    /// Columns alpha, beta, gamma, x, y, z, with the units of `hexad move --trajectory`.
    #[arg(long, value_name = "FILE", requires = "output", conflicts_with_all = ["PoseOptions", "relative", "home"])]
    table: Option<PathBuf>,
    /// CSV to write, a row for each target: target and reached pose, mean lengths and their standard deviations, time
    #[arg(long, value_name = "FILE", requires = "table")]
    output: Option<PathBuf>,
    /// Go on after the rows that the output has
    #[arg(long, requires = "table")]
    resume: bool,
    #[arg(long, help = ROTATION_HELP, value_name = "ORDER", default_value = "xyz", value_parser = OrientationFormat::by_name())]
    #[arg(requires = "table")]
    rotation: OrientationFormat,
    /// Time over which the lengths are averaged at each target [s]
    #[arg(long, value_name = "SECONDS", default_value_t = 0.5, value_parser = duration, requires = "table")]
    average: f64,
}

impl TableOptions {
    /// Path of the table, and of the output that it requires.
    pub fn paths(&self) -> Option<[&Path; 2]> {
        Some([self.table.as_deref()?, self.output.as_deref()?])
    }
}

/// A table of targets with its frames.
struct Targets<'a> {
    arguments: &'a GotoArguments,
    config: &'a Config,
    path: &'a Path,
    coordinates: Coordinates,
    table: NumberTable,
}

impl GotoArguments {
    /// Visits the targets of the table.
    pub(super) fn visit_table(&self, config: &Config, [path, output]: [&Path; 2]) -> Result<(), Failure> {
        let TableOptions { resume, rotation, .. } = &self.table;
        let coordinates = self.frames.coordinates(config)?;
        let table = read_targets(path, *rotation, &coordinates.tool_x(&config.machine.home))?;
        let targets = Targets { arguments: self, config, path, coordinates, table };
        let count = targets.table.rows().len();
        if self.dry_run {
            let stop = Stop::on_signals()?;
            let (seen, origin) = origin(config);
            let seconds = targets.check(0, seen, &stop)?;
            return Ok(print(format_args!(
                "{count} rows, {seconds:.2} s of motion, from {origin}; nothing moves\n"
            ))?);
        }
        let mut log = VisitLog::open(output, *resume, config, &targets.coordinates, &targets.table)?;
        let (before, stop) = (log.count(), Stop::on_signals()?);
        let outcome = targets.visit(&mut log, &stop);
        let [visited, elsewhere] = log.close();
        let rows = format!("{visited} of {count} rows are in {}", output.display());
        match outcome {
            Err(failure) if visited == 0 => Err(failure),
            Err(Failure { exit_code, message }) => Err(Failure {
                exit_code: if exit_code == 2 && visited > before { 1 } else { exit_code },
                message: format!("{message}\n{rows}; --resume goes on after them"),
            }),
            Ok(()) if elsewhere > 0 => Err(Failure::after_start(format!(
                "{rows}, {elsewhere} of them not in position (column in_position)"
            ))),
            Ok(()) => {
                let stands = if visited > before { "; the platform stands under control" } else { "" };
                Ok(print(format_args!("{rows}, all in position{stands}\n"))?)
            }
        }
    }
}

impl Targets<'_> {
    /// Checks the rows from the given one on: each target, and the way from the row before. Returns the duration of the motion \[s\].
    fn check(&self, first: usize, seen: Observation, stop: &Stop) -> Result<f64, Failure> {
        let Self { arguments, config, path, coordinates, table } = self;
        let (constants, is_straight) = (constants(config), arguments.frames.tool.is_some());
        let at =
            |x| Observation { reference_or_measured_x: Some(x), target: Some(x), ..Observation::default() };
        let go_on = || !stop.is_requested();
        // After a target that cannot be reached only the next target is checked, as there is no way to it.
        let (mut from, mut duration_s) = (Some(seen), 0.0);
        let mut errors = TableErrors::new(name_of(path));
        let bar = item_bar(table.rows().len() - first, "rows checked");
        for (row, line) in table.rows().iter().zip(table.lines()).skip(first).progress_with(bar) {
            let target = six(row, 1);
            let to = coordinates.platform_x(&target);
            let (order, seen) = (arguments.order(target.map(Some)), from.unwrap_or_else(|| at(to)));
            match GotoPlan::new(config, &constants, &order, coordinates, is_straight, &seen, go_on) {
                Ok(plan) => {
                    duration_s += plan.motion.duration_s;
                    from = Some(at(to));
                }
                Err(_) if stop.is_requested() => return Err(MotionError::InterruptedEarly.into()),
                Err(error) if error.result() == RequestResult::Invalid => {
                    errors.add(format!("line {line}: {error}"));
                    from = check_target(&constants, &pose_of(&to)).is_ok().then(|| at(to));
                }
                Err(error) => return Err(error.into()),
            }
        }
        match errors.into_result() {
            Ok(()) => Ok(duration_s),
            Err(error) => Err(Failure::before_start(format_args!(
                "{error}\nnothing has moved; correct these rows, or add rows for another way"
            ))),
        }
    }

    /// Visits the rows after those in the log. Only the first motion may take control, and none after a stop.
    fn visit(&self, log: &mut VisitLog, stop: &Stop) -> Result<(), Failure> {
        let Self { arguments, config, coordinates, table, .. } = self;
        let first = log.count();
        if first == table.rows().len() {
            return Ok(());
        }
        let mut measured = config.join()?.leased_subscriber(usize::MAX, u64::MAX)?;
        let answer = status(&config.name)?;
        let stops = answer.status.as_ref().and_then(|report| report.stops);
        let seen = Observation::of_answer(&answer, 0, &config.machine.home).unwrap_or_default();
        self.check(first, seen, stop)?;
        // Another user has other topics, in which nothing arrives: that must not show only at the first target.
        average(&mut measured, arguments.table.average, stop)
            .map_err(|error| if stop.is_requested() { MotionError::InterruptedEarly } else { error })?;
        let mut client = MotionClient::connect(&config.name, stop)?;
        let bar = item_bar(table.rows().len(), "rows");
        let rows = table.rows().iter().zip(table.lines()).enumerate().skip(first);
        let outcome = rows.into_iter().try_for_each(|(number, (row, line))| -> Result<(), Failure> {
            bar.set_position(number as u64);
            let target = six(row, 1);
            let request = arguments.line(config, target.map(Some))?;
            let request = RequestLine { engage: request.engage && number == first, stops, ..request };
            let is_in_position = match client.carry_out(request, |_| Ok(())) {
                Err(MotionError::TimedOut(text)) if client.status_under_control().is_ok() => {
                    bar.suspend(|| remark(format_args!("line {line}: {text}")));
                    false
                }
                arrived => arrived.map(|_| true)?,
            };
            let lengths = average(&mut measured, arguments.table.average, stop)?;
            let report = client.status_under_control()?.status.unwrap_or_default();
            let platform = self.platform_x(&target, &lengths, &report, stops)?;
            Ok(log.append([target, coordinates.tool_x(&platform)], is_in_position, lengths)?)
        });
        bar.finish_and_clear();
        outcome
    }

    /// X of the platform by its mean lengths. An error if it does not stand at this target any more.
    fn platform_x(
        &self,
        target: &[f64; 6],
        [mean, _]: &[[f64; 6]; 2],
        report: &StatusReport,
        stops: Option<StopNumber>,
    ) -> Result<[f64; 6], MotionError> {
        let machine = &self.config.machine;
        let to = self.coordinates.platform_x(target);
        let is_held = |held: &[f64; 6]| held.iter().zip(&to).all(|(a, b)| (a - b).abs() < SAME);
        if report.stops != stops || !report.target.as_ref().is_some_and(is_held) {
            let text = "a stop or another request to move came while lengths were averaged; ask again if this is still wanted";
            return Err(MotionError::Failed(text.into()));
        }
        let mut tracker = Tracker::new(machine, pose_of(&report.pose.unwrap_or(to)));
        match tracker.find(machine, mean) {
            (TrackingResult::Found, _) => Ok(task_coordinates(tracker.pose(), &machine.home)),
            _ => Err(MotionError::Failed(format!("no pose near the target has the mean lengths {mean:?} m"))),
        }
    }
}

/// Mean and standard deviation of each length in the measured messages of the next seconds \[m\].
fn average(
    measured: &mut LeasedSubscriber<MeasuredMessage>,
    seconds: f64,
    stop: &Stop,
) -> Result<[[f64; 6]; 2], MotionError> {
    // Those of the way.
    measured.receive_latest(true);
    let (mut count, mut mean, mut squares) = (0.0, Vector6::zeros(), Vector6::zeros());
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    while Instant::now() < until {
        if stop.is_requested() {
            return Err(MotionError::Interrupted);
        }
        while let Some(message) = measured.receive(true) {
            count += 1.0;
            let step = Vector6::from(message.length_m) - mean;
            mean += step / count;
            squares += step.component_mul(&(Vector6::from(message.length_m) - mean));
        }
        stop.wait(POLL_INTERVAL);
    }
    if count < 2.0 {
        let text = format!(
            "{count} measured messages within {seconds} s, must be 2 at least; look at the driver, and run this command as the user of the daemon"
        );
        return Err(MotionError::Failed(text));
    }
    Ok([mean.into(), squares.map(|sum: f64| (sum / (count - 1.0)).sqrt()).into()])
}
