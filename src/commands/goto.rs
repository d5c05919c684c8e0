//! `hexad goto`: moves the platform to a pose and holds it there under control.
//!
//! Before the platform moves, the reference generator computes the whole motion offline. A target or a path outside the
//! workspace is refused with leg, value and bound. `--dry-run` only prints the motion.

use core::fmt;
use std::time::{Duration, Instant};

use clap::Args;

use super::arguments::{MachineFile, duration, number_within};
use super::failure::Failure;
use super::quantity::length_within;
use super::target::pose_options::PoseOptions;
use super::target::{
    Deviation, TargetError, TargetSource, constants, has_received, is_reached, pose_of, reference_x, target_x,
};
use crate::analysis::target_motion::{TargetMotion, target_motion};
use crate::config::Config;
use crate::control::constants::Constants;
use crate::control::signals::limits::Limit;
use crate::control::supervision::in_position::{InPosition, InPositionWindow};
use crate::daemon::nanoseconds;
use crate::model::LEGS;
use crate::model::rigid::Twist;
use crate::operator::protocol::AnswerLine;
use crate::operator::requests::status;
use crate::output::files::print;
use crate::output::numbers::{AXES, MotionDigits, axis_unit, fixed, percent, significant};
use crate::realtime::stop_request::Stop;

/// Longest time of the motion, as a multiple of the computed time, and an addition \[s\].
const LONGEST_SHARE: f64 = 1.5;
const LONGEST_EXTRA_S: f64 = 5.0;

#[derive(Debug, Args)]
pub struct GotoArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    target: PoseOptions,
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
        let constants = constants(&config);
        let ([from, base], origin) = self.start(&config, &constants)?;
        let base = if self.home { config.machine.home } else { base };
        let to = self.target.applied_to(base, self.relative);
        let motion = target_motion(&constants, &pose_of(&from), &pose_of(&to), self.speed, |_, _| ())
            .map_err(TargetError::Refused)?;
        let window = self.window(&config);
        if self.dry_run {
            return Ok(print(Plan {
                constants: &constants,
                digits: MotionDigits::new(config.resolution()),
                window: &window,
                from: &from,
                origin,
                to: &to,
                speed: self.speed,
                motion: &motion,
            })?);
        }
        print(format_args!("{:.2} s to the target\n", motion.duration_s))?;
        let stop = Stop::on_signals()?;
        let within = self.engage.then(|| Duration::from_secs_f64(self.within));
        let mut source = TargetSource::open(&config, within, &stop)?;
        source.set_speed(self.speed);
        Ok(drive(source, &constants, [from, to], &window, motion.duration_s, &stop)?)
    }

    /// When the platform counts as arrived.
    fn window(&self, config: &Config) -> InPositionWindow {
        let InPositionWindow { tolerance_m, tolerance_rad, settling_ns } = config.deployment.in_position;
        let wanted_m = self.tolerance.unwrap_or(tolerance_m);
        let tolerance_rad = tolerance_rad * wanted_m / tolerance_m;
        InPositionWindow { tolerance_m: wanted_m, tolerance_rad, settling_ns }
    }

    /// X at the beginning of the motion, X to which coordinates are added, which is the target that is held if there is
    /// one, and the origin of the first as text.
    fn start(
        &self,
        config: &Config,
        constants: &Constants,
    ) -> Result<([[f64; 6]; 2], &'static str), TargetError> {
        match status(&config.name) {
            Ok(answer) => reference_x(config, &answer)
                .map(|x| ([x, target_x(constants, &answer).unwrap_or(x)], "where the platform is"))
                .ok_or(TargetError::UnknownPose(answer.text)),
            Err(_) if self.dry_run => Ok(([config.machine.home; 2], "home, as no daemon answers")),
            Err(error) => Err(error.into()),
        }
    }
}

/// Publishes the target until the platform is in position; after a signal, until the reference is at rest.
/// Control begins at the pose of the platform.
fn drive(
    mut source: TargetSource,
    constants: &Constants,
    [from, to]: [[f64; 6]; 2],
    window: &InPositionWindow,
    duration_s: f64,
    stop: &Stop,
) -> Result<(), TargetError> {
    let settling_s = window.settling_ns as f64 * 1e-9;
    let longest_s = LONGEST_SHARE * duration_s + LONGEST_EXTRA_S + settling_s;
    let (mut resting, mut arrival, mut has_reference_arrived) = (None, InPosition::default(), false);
    loop {
        if stop.is_repeated() {
            return Err(TargetError::Interrupted);
        }
        let Some(since) = source.active_since() else {
            if stop.is_requested() {
                return Err(TargetError::InterruptedEarly);
            }
            source.publish(from)?;
            continue;
        };
        if stop.is_requested() && resting.is_none() {
            (resting, has_reference_arrived) = (Some(source.resting_x(constants)?), false);
            source.set_speed(1.0);
        }
        let x = resting.unwrap_or(to);
        source.publish(x)?;
        let elapsed_s = since.elapsed().as_secs_f64();
        if elapsed_s > longest_s {
            return Err(too_late(&source, &x, window, longest_s));
        }
        // An older status would have another pose, or another target if the way is short.
        let (requested, answer) = source.status().newest;
        if requested < since || !has_received(&answer, &x) {
            continue;
        }
        // Kept, because the reference is the measured pose plus its error, with the noise of both.
        has_reference_arrived |= is_reached(&source.present_x()?, &x);
        if resting.is_some() && has_reference_arrived {
            return Err(TargetError::Interrupted);
        }
        let error = error_to(&answer, &x).filter(|_| has_reference_arrived);
        let requested_ns = nanoseconds(requested.duration_since(since).as_secs_f64());
        if resting.is_none() && arrival.update(window, requested_ns, &x, error.as_ref()) {
            return arrived(&source, since, error.unwrap_or_default());
        }
    }
}

/// The target minus the measured pose; `None` if it is unknown.
fn error_to(answer: &AnswerLine, x: &[f64; 6]) -> Option<Twist> {
    let pose = answer.status.as_ref()?.pose?;
    Some(pose_of(&pose).displacement_to(&pose_of(x)))
}

/// The error of a target that was not reached in time.
fn too_late(source: &TargetSource, x: &[f64; 6], window: &InPositionWindow, longest_s: f64) -> TargetError {
    let error = error_to(&source.status().newest.1, x);
    match error.filter(|_| source.present_x().is_ok_and(|present| is_reached(&present, x))) {
        Some(error) => TargetError::NotInPosition(longest_s, Deviation(error), *window),
        None => TargetError::TimedOut(longest_s),
    }
}

/// Reports the pose of the platform.
fn arrived(source: &TargetSource, since: Instant, error: Twist) -> Result<(), TargetError> {
    let (elapsed_s, answer) = (since.elapsed().as_secs_f64(), source.status().newest.1);
    let report = answer.status.unwrap_or_default();
    let text = format!(
        "in position after {elapsed_s:.2} s, {} from the target; the platform stands under control\n{}{}",
        Deviation(error),
        heading(),
        row("pose", &report.pose.unwrap_or_default(), MotionDigits::new(report.resolution))
    );
    // The platform has moved, so a closed standard output is not a failure.
    let _ = print(text);
    Ok(())
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

/// Planned motion of the reference.
struct Plan<'a> {
    window: &'a InPositionWindow,
    constants: &'a Constants,
    digits: MotionDigits,
    from: &'a [f64; 6],
    origin: &'static str,
    to: &'a [f64; 6],
    speed: f64,
    motion: &'a TargetMotion,
}

impl fmt::Display for Plan<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { constants, digits, window, from, origin, to, speed, motion } = self;
        let Constants { parameters, .. } = constants;
        let actuator = &constants.machine().actuator;
        let rows = row("from", from, *digits) + &row("to", to, *digits);
        let digits = digits.mm;
        writeln!(f, "{}{rows}from is {origin}", heading())?;
        writeln!(
            f,
            "duration  {:.3} s, then {:.3} s in position within {} mm and {} mrad",
            motion.duration_s,
            window.settling_ns as f64 * 1e-9,
            significant(1e3 * window.tolerance_m),
            significant(1e3 * window.tolerance_rad)
        )?;
        writeln!(
            f,
            "velocity  at most {} mm/s and {} deg/s",
            significant(1e3 * motion.velocity_m_s),
            significant(motion.velocity_rad_s.to_degrees())
        )?;
        writeln!(
            f,
            "leg  length mm (stroke {} to {})  largest rate mm/s (of {})",
            fixed(1e3 * actuator.min_length, digits - 2),
            fixed(1e3 * actuator.max_length, digits - 2),
            fixed(1e3 * actuator.max_rate, digits - 2)
        )?;
        for (leg, ([shortest, longest], rate)) in
            (1..=LEGS).zip(motion.lengths_m.iter().zip(motion.leg_rates_m_s))
        {
            let [shortest, longest, rate] = [*shortest, *longest, rate].map(|x| fixed(1e3 * x, digits));
            writeln!(f, "{leg:>3}  {shortest:>9} to {longest:>9}  {rate:>19}")?;
        }
        let shares = Limit::ALL.into_iter().zip(motion.limited_shares).filter(|(_, share)| *share > 0.0);
        let limits: Vec<_> =
            shares.map(|(limit, share)| format!("{} {}", limit.name(), percent(share))).collect();
        let limits = limits.join(", ");
        if limits.is_empty() {
            return writeln!(f, "limited by the rate of the loop alone, because the way is short");
        }
        writeln!(
            f,
            "limited by {limits} of the time, with {} of [limits] (limits.scale, limits.autonomous_scale and --speed)",
            percent(speed * parameters.limits_scale * parameters.limits.autonomous_scale)
        )
    }
}

/// Line with X in millimetres and degrees.
fn row(name: &str, x: &[f64; 6], digits: MotionDigits) -> String {
    let numbers: String = x
        .iter()
        .enumerate()
        .map(|(k, x)| format!("{:>11}", fixed(x * axis_unit(k).0, digits.of_axis(k))))
        .collect();
    format!("{name:10}{numbers}\n")
}

/// Heading with the names of X, above [`row`].
fn heading() -> String {
    let names: String = AXES
        .iter()
        .enumerate()
        .map(|(k, axis)| format!("{:>11}", format!("{axis} {}", axis_unit(k).1)))
        .collect();
    format!("{:10}{names}\n", "")
}
