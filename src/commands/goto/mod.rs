//! `hexad goto`: moves the platform, or a tool, to a pose and holds it there under control.
//!
//! Before the platform moves, the reference generator computes the whole motion offline. A target or a path outside the
//! workspace is refused with leg, value and bound. `--dry-run` only prints the motion. A tool moves along a straight path.

use std::time::Duration;

use clap::Args;

use self::drive::{Goal, drive};
use self::plan::{Plan, both_coordinates};
use self::stream::Stream;
use super::arguments::{MachineFile, duration, number_within};
use super::coordinates::{Coordinates, FrameOptions};
use super::failure::Failure;
use super::quantity::length_within;
use super::target::pose_options::PoseOptions;
use super::target::{TargetError, TargetSource, constants, is_reached, pose_of, reference_x, target_x};
use crate::analysis::target_motion::{TargetMotion, TargetRefusal, target_motion};
use crate::analysis::tool_motion::ToolMotion;
use crate::config::Config;
use crate::control::constants::Constants;
use crate::control::supervision::in_position::InPositionWindow;
use crate::motion::tool_path::ToolPath;
use crate::operator::requests::status;
use crate::output::files::print;
use crate::output::numbers::MotionDigits;
use crate::realtime::stop_request::Stop;

mod drive;
mod plan;
mod stream;

#[derive(Debug, Args)]
pub struct GotoArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    target: PoseOptions,
    #[command(flatten)]
    frames: FrameOptions,
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
    #[arg(long)]
    dry_run: bool,
    /// Take control, if the platform is not under control
    #[arg(long, conflicts_with = "dry_run")]
    engage: bool,
    /// Longest to wait for control [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true, requires = "engage")]
    within: f64,
}

impl GotoArguments {
    pub fn execute(self) -> Result<(), Failure> {
        if self.target.is_empty() && !self.home {
            return Err(Failure {
                exit_code: 2,
                message: "no target: give coordinates, for example --x 100mm, or --home".into(),
            });
        }
        let config = self.machine.load()?;
        let (coordinates, constants) = (self.frames.coordinates(&config)?, constants(&config));
        let digits = MotionDigits::new(config.resolution());
        let ([from, base], origin) = self.start(&config, &constants)?;
        let base = if self.home { config.machine.home } else { base };
        let to = coordinates.platform_x(&self.target.applied_to(coordinates.tool_x(&base), self.relative));
        let refused = |refusal: TargetRefusal| match self.frames.is_empty() {
            true => TargetError::Refused(refusal),
            false => TargetError::RefusedInFrames(refusal, both_coordinates(&coordinates, digits, &to)),
        };
        let (motion, stream) =
            self.motion(&config, &constants, &coordinates, [from, to]).map_err(|error| match error {
                TargetError::Refused(refusal) => refused(refusal),
                other => other,
            })?;
        let window = self.window(&config);
        if self.dry_run {
            return Ok(print(Plan {
                constants: &constants,
                coordinates: &coordinates,
                digits,
                window: &window,
                from: &from,
                origin,
                to: &to,
                speed: self.speed,
                motion: &motion,
                is_straight: stream.is_some(),
            })?);
        }
        print(format_args!("{:.2} s to the target\n", motion.duration_s))?;
        let stop = Stop::on_signals()?;
        let within = self.engage.then(|| Duration::from_secs_f64(self.within));
        let mut source = TargetSource::open(&config, within, &stop)?;
        source.set_speed(self.speed);
        let goal = Goal {
            constants: &constants,
            coordinates: &coordinates,
            from,
            to,
            window,
            duration_s: motion.duration_s,
        };
        Ok(drive(source, &goal, stream, &stop)?)
    }

    /// The motion to the target: of the reference, or of a tool along a straight path, with its setpoints.
    fn motion(
        &self,
        config: &Config,
        constants: &Constants,
        coordinates: &Coordinates,
        [from, to]: [[f64; 6]; 2],
    ) -> Result<(TargetMotion, Option<Stream>), TargetError> {
        let [from, to] = [from, to].map(|x| pose_of(&x));
        if self.frames.tool.is_none() {
            return Ok((target_motion(constants, &from, &to, self.speed, |_, _| ())?, None));
        }
        let path = ToolPath::new(coordinates.frames(), &from, &to);
        let stream = Stream::new(config, ToolMotion::fastest(constants, path, self.speed)?)?;
        Ok((stream.motion().survey(constants), Some(stream)))
    }

    /// When the platform counts as arrived.
    fn window(&self, config: &Config) -> InPositionWindow {
        let InPositionWindow { tolerance_m, tolerance_rad, settling_ns } = config.deployment.in_position;
        let wanted_m = self.tolerance.unwrap_or(tolerance_m);
        let tolerance_rad = tolerance_rad * wanted_m / tolerance_m;
        InPositionWindow { tolerance_m: wanted_m, tolerance_rad, settling_ns }
    }

    /// X at the beginning of the motion, X to which coordinates are added, which is the target that is held if there is
    /// one, and the origin of the first as text. A motion from a target that is reached begins there, without the noise of its
    /// measurement.
    fn start(
        &self,
        config: &Config,
        constants: &Constants,
    ) -> Result<([[f64; 6]; 2], &'static str), TargetError> {
        match status(&config.name) {
            Ok(answer) => reference_x(config, &answer)
                .map(|x| {
                    let held = target_x(constants, &answer).unwrap_or(x);
                    ([if is_reached(&x, &held) { held } else { x }, held], "where the platform is")
                })
                .ok_or(TargetError::UnknownPose(answer.text)),
            Err(_) if self.dry_run => Ok(([config.machine.home; 2], "home, as no daemon answers")),
            Err(error) => Err(error.into()),
        }
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
