//! `hexad goto`: moves the platform, or a tool, to a pose and holds it there under control.
//!
//! The daemon computes the whole motion before the platform moves. A target or a path outside the workspace is refused with
//! leg, value and bound. `--dry-run` computes it here and only prints it. A tool moves along a straight path. `--table` goes to many
//! targets, one after the other, and writes where the platform was.

use clap::Args;

use self::plan::PlanText;
use self::pose_options::PoseOptions;
use self::table::TableOptions;
use super::arguments::{EngageOptions, MachineFile, number_within};
use super::failure::Failure;
use super::frame_options::{FrameOptions, UnitOptions};
use super::motion_client::MotionClient;
use super::quantity::length_within;
use hexad_client::operator::motion_fields::{GOTO, TargetFields};
use hexad_client::operator::protocol::{AnswerLine, RequestLine};
use hexad_client::operator::requests::status;
use hexad_client::realtime::stop_request::Stop;
use hexad_daemon::constants;
use hexad_daemon::motion_requests::order::GotoOrder;
use hexad_daemon::motion_requests::plan::{GotoPlan, window};
use hexad_daemon::target_source::Observation;
use hexad_machine::config::Config;
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::files::print;

mod plan;
mod pose_options;
mod table;
mod visit_log;

#[derive(Debug, Args)]
pub struct GotoArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    target: PoseOptions,
    #[command(flatten)]
    frames: FrameOptions,
    #[command(flatten)]
    units: UnitOptions,
    /// Add the coordinates to the target that is held, or to the present pose if no target is held
    #[arg(long)]
    relative: bool,
    /// Take the coordinates that are not given from the home pose
    #[arg(long, conflicts_with = "relative")]
    home: bool,
    /// Share of the limits of autonomous motions, for example 50%
    #[arg(long, value_name = "SHARE", default_value = "100%", value_parser = speed)]
    speed: f64,
    /// Distance from the target at which the platform has arrived, with its unit, instead of in_position.tolerance_m; the angle in proportion
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Compute the way and its duration; move nothing. Without a daemon it begins at home
    #[arg(long, conflicts_with = "engage")]
    dry_run: bool,
    #[command(flatten)]
    engage: EngageOptions,
    #[command(flatten)]
    table: TableOptions,
}

impl GotoArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let has_target = !self.target.is_empty() || self.home;
        if !has_target && self.table.paths().is_none() {
            let text = "no target: give coordinates, for example --x 100mm, or --home, or --table";
            return Err(Failure::before_start(text));
        }
        let config = self.machine.load()?;
        if let Some(paths) = self.table.paths() {
            return self.visit_table(&config, paths);
        }
        if self.dry_run {
            return self.print_plan(&config);
        }
        let (coordinates, stop) = (self.frames.coordinates(&config)?, Stop::on_signals()?);
        let mut client = MotionClient::connect(&config.name, &stop)?;
        let arrived = client.carry_out(self.line(&config, self.target.coordinates())?, |text| {
            // The platform moves, so a closed standard output is not a failure.
            let _ = print(format_args!("{text}\n"));
            Ok(())
        })?;
        let AnswerLine { status, .. } = client.status_under_control()?;
        let report = status.unwrap_or_default();
        let pose = coordinates.tool_x(&report.pose.unwrap_or_default());
        let format = CoordinateFormat::new(self.units.units(), report.resolution);
        let pose = format.table(&coordinates.label, &[("pose", Some(pose), 0)]);
        let _ = print(format_args!("{}\n{pose}", arrived.text));
        Ok(())
    }

    /// The request for a target.
    fn line(&self, config: &Config, target: [Option<f64>; 6]) -> Result<RequestLine, Failure> {
        let [tool, work] = self.frames.fields(config)?;
        Ok(RequestLine {
            tool,
            work,
            target: Some(TargetFields::new(target)),
            relative: self.relative,
            home: self.home,
            speed: Some(self.speed),
            tolerance_m: self.tolerance,
            ..self.engage.line(GOTO)
        })
    }

    /// What the daemon makes of the request.
    fn order(&self, target: [Option<f64>; 6]) -> GotoOrder {
        let Self { relative, home, speed: speed_share, tolerance: tolerance_m, .. } = *self;
        GotoOrder { target, relative, home, speed_share, tolerance_m }
    }

    /// Prints the motion that the request would begin.
    fn print_plan(&self, config: &Config) -> Result<(), Failure> {
        let (coordinates, constants) = (self.frames.coordinates(config)?, constants(config));
        let (seen, origin) = origin(config);
        let order = self.order(self.target.coordinates());
        let is_straight = self.frames.tool.is_some();
        let plan = GotoPlan::new(config, &constants, &order, &coordinates, is_straight, &seen, || true)?;
        Ok(print(PlanText {
            plan: &plan,
            window: &window(config, self.tolerance),
            constants: &constants,
            coordinates: &coordinates,
            units: self.units.units(),
            resolution: config.resolution(),
            origin,
            speed: self.speed,
        })?)
    }
}

/// Where a dry run begins, and as text: where the platform is, or at home.
fn origin(config: &Config) -> (Observation, &'static str) {
    let home = config.machine.home;
    match status(&config.name).ok().and_then(|answer| Observation::of_answer(&answer, 0, &home)) {
        Some(seen) => (seen, "where the platform is"),
        None => (
            Observation { reference_or_measured_x: Some(home), ..Observation::default() },
            "home, as no daemon answers",
        ),
    }
}

/// Speed as a share, given as a number or in per cent.
fn speed(text: &str) -> Result<f64, String> {
    match text.strip_suffix('%') {
        Some(percent) => number_within(percent.trim(), 1.0..=100.0, " %").map(|percent| percent / 100.0),
        None => number_within(text, 0.01..=1.0, ""),
    }
}

/// Tolerance \[m\].
fn tolerance(text: &str) -> Result<f64, String> {
    length_within(text, ["1nm", "100mm"])
}
