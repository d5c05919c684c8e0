//! `hexad advise`: error and time of each model fidelity over an envelope or a trajectory, and which one suffices.

use core::fmt;
use core::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::arguments::MachineFile;
use super::failure::{CommandError, Failure};
use super::offline_tables::{read_trajectory, task_state};
use super::progress::item_bar;
use crate::analysis::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use crate::analysis::fidelity_choice::FidelityComparison;
use crate::analysis::fidelity_error::{ErrorStatistics, FIDELITY_COUNT, FidelitySample};
use crate::config::Config;
use crate::config::fidelity::envelope;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::rigid::Motion;
use crate::output::csv_table::TableError;
use crate::output::files::print;
use crate::output::numbers::{AXES, axis_unit, percent, plain_percent, significant};
use crate::output::text_table::{Left, Right, text_table};

/// Motions that are timed: enough to be different ones, few enough to stay in the cache.
const TIMED_MOTIONS: usize = 256;

/// Batches timed per fidelity, one fidelity after the other, so that a disturbance of the computer affects all.
const TIMING_ROUNDS: usize = 101;

/// Least share of time that a fidelity with more terms must save to be recommended instead; less is noise.
const MIN_TIME_SAVED: f64 = 0.1;

#[derive(Debug, clap::Args)]
pub struct AdviseArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// A CSV file with t, X, X', X'', instead of the envelope
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
}

impl AdviseArguments {
    pub fn execute(self) -> Result<(), Failure> {
        Ok(print(Advice::new(&self.machine.load()?, self.trajectory.as_deref())?)?)
    }
}

/// Error that prevents advice.
#[derive(Debug, thiserror::Error)]
pub enum AdviseError {
    #[error(transparent)]
    Table(#[from] TableError),
    #[error("{}: no row can be evaluated: {outside} are outside the actuators' stroke, {singular} at singular poses; correct the trajectory", path.display())]
    NothingEvaluated { path: PathBuf, outside: u64, singular: u64 },
}

impl CommandError for AdviseError {}

/// Errors and times of all fidelities over a set of motions; displays as a table with a recommendation.
pub struct Advice {
    name: String,
    /// The set of motions, in lines of text.
    scene: String,
    /// Largest force of an actuator \[N\].
    max_force: f64,
    comparison: FidelityComparison,
    /// Median time of an evaluation, in the order of [`Fidelity::ALL`] \[ns\].
    times: [f64; FIDELITY_COUNT],
    tolerance: f64,
}

impl Advice {
    /// Evaluates the configured envelope, or a trajectory.
    pub fn new(config: &Config, trajectory: Option<&Path>) -> Result<Self, AdviseError> {
        let model = InverseDynamics::new(&config.machine);
        let (scene, comparison, motions) = match trajectory {
            Some(path) => judge_trajectory(&model, path)?,
            None => judge_envelope(config, &model),
        };
        Ok(Self {
            name: config.name.clone(),
            scene,
            max_force: config.machine.actuator.max_force,
            comparison,
            times: time(&model, &motions),
            tolerance: config.deployment.control.fidelity_tolerance,
        })
    }

    /// The fastest fidelity within the tolerance that a control loop can use.
    fn choice(&self) -> Fidelity {
        let time = |fidelity: Fidelity| {
            let times = Fidelity::ALL.into_iter().zip(self.times);
            times.filter(|(timed, _)| *timed == fidelity).map(|(_, time)| time).sum::<f64>()
        };
        let first = self.comparison.choice(self.tolerance);
        let allowed = self.comparison.within(self.tolerance).map(|error| error.fidelity);
        allowed.filter(|fidelity| fidelity.has_inertia()).fold(first, |best, fidelity| {
            if time(fidelity) < (1.0 - MIN_TIME_SAVED) * time(best) { fidelity } else { best }
        })
    }
}

fn judge_envelope(config: &Config, model: &InverseDynamics) -> (String, FidelityComparison, Vec<Motion>) {
    let envelope = envelope(config, model);
    let comparison = FidelityComparison::of_envelope(model, &envelope);
    let origin = if config.deployment.envelope.is_some() {
        "its [envelope]"
    } else {
        "an envelope derived from the machine"
    };
    let points = comparison.all.evaluated - comparison.inside.evaluated;
    let scene = format!(
        "{origin}:\n{}{} motions spread over the inside, {points} of {CORNER_COUNT} at corners, and a climb from the worst of them",
        limits(envelope.bounds()),
        comparison.inside.evaluated
    );
    let within =
        |k| Some(envelope.at(&MotionEnvelope::spread(k))).filter(|s| FidelitySample::take(model, s).is_ok());
    let drawn = 0..16 * TIMED_MOTIONS as u32;
    let mut motions: Vec<_> = drawn.filter_map(within).take(TIMED_MOTIONS).map(|s| s.motion()).collect();
    if motions.is_empty() {
        motions.push(envelope.at(&envelope.rest()).motion());
    }
    (scene, comparison, motions)
}

/// The ranges of an envelope as a table.
fn limits(limits: &EnvelopeBounds) -> String {
    let ranges = limits.pose_min.iter().zip(&limits.pose_max);
    let motion = limits.velocity.iter().zip(&limits.acceleration);
    let rows = AXES.into_iter().zip(ranges.zip(motion)).enumerate().map(
        |(axis, (name, ((low, high), (velocity, acceleration))))| {
            let (scale, unit) = axis_unit(axis);
            let [low, high, velocity, acceleration] =
                [low, high, velocity, acceleration].map(|x| significant(x * scale));
            [
                name.into(),
                format!("{low} to {high} {unit}"),
                format!("{velocity} {unit}/s"),
                format!("{acceleration} {unit}/s2"),
            ]
        },
    );
    text_table(2, &[("", Left), ("offset from home", Right), ("rate", Right), ("acceleration", Right)], rows)
}

fn judge_trajectory(
    model: &InverseDynamics,
    path: &Path,
) -> Result<(String, FidelityComparison, Vec<Motion>), AdviseError> {
    let table = read_trajectory(path)?;
    let rows = table.rows();
    let (mut tally, bar) = (ErrorStatistics::default(), item_bar(rows.len(), "rows"));
    let every = rows.len().div_ceil(TIMED_MOTIONS);
    let mut motions = vec![];
    for (k, row) in rows.iter().enumerate() {
        bar.inc(1);
        let state = task_state(row);
        let sample = FidelitySample::take(model, &state);
        tally.add(&sample);
        if sample.is_ok() && k % every == 0 {
            motions.push(state.motion());
        }
    }
    bar.finish_and_clear();
    if tally.evaluated == 0 {
        let ErrorStatistics { outside, singular, .. } = tally;
        return Err(AdviseError::NothingEvaluated { path: path.into(), outside, singular });
    }
    let scene = format!("the rows of {}:\n{} motions", path.display(), tally.evaluated);
    Ok((scene, FidelityComparison::of_rows(tally), motions))
}

/// Median time of an evaluation of each fidelity \[ns\].
fn time(model: &InverseDynamics, motions: &[Motion]) -> [f64; FIDELITY_COUNT] {
    let mut rounds = [const { Vec::new() }; FIDELITY_COUNT];
    for _ in 0..TIMING_ROUNDS {
        for (times, fidelity) in rounds.iter_mut().zip(Fidelity::ALL) {
            let start = Instant::now();
            for motion in motions {
                black_box(model.forces_of(fidelity, black_box(motion)));
            }
            times.push(start.elapsed().as_secs_f64() * 1e9 / motions.len().max(1) as f64);
        }
    }
    rounds.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    })
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, scene, max_force, comparison, times, tolerance } = self;
        let (inside, all) = (&comparison.inside, &comparison.all);
        writeln!(f, "{name} over {scene}")?;
        for (count, what) in
            [(all.outside, "outside the actuators' stroke"), (all.singular, "at singular poses")]
        {
            if count > 0 {
                writeln!(f, "passed over: {count} motions {what}")?;
            }
        }
        write!(f, "peak force {} N", significant(all.peak))?;
        if all.peak > *max_force {
            write!(f, ", {} times the actuators' limit", significant(all.peak / max_force))?;
        }
        if inside.peak < all.peak {
            write!(f, "; {} N among the motions inside", significant(inside.peak))?;
        }
        let header = ["mean", "RMS", "max", "mean %", "RMS %", "max %", "ns"];
        let [mean, rms, max, mean_share, rms_share, max_share, ns] = header.map(|name| (name, Right));
        let columns =
            [("fidelity", Left), mean, rms, max, mean_share, rms_share, max_share, ns, ("leaves out", Left)];
        let rows = comparison.errors.iter().zip(times).map(|(error, time)| {
            let share = |error: f64| if error == 0.0 { 0.0 } else { 100.0 * error / inside.peak };
            let [mean, rms, max] = [error.mean, error.rms, error.max].map(significant);
            let shares = [share(error.mean), share(error.rms), 100.0 * error.share].map(significant);
            let [mean_share, rms_share, max_share] = shares;
            let (name, left_out_terms) =
                (error.fidelity.name().into(), error.fidelity.left_out_terms().into());
            [name, mean, rms, max, mean_share, rms_share, max_share, format!("{time:.0}"), left_out_terms]
        });
        writeln!(f, "\n\nerror of a leg's force [N], and as a share of the peak force [%]:")?;
        write!(f, "{}", text_table(1, &columns, rows))?;
        self.fmt_recommendation(f, &plain_percent(*tolerance))
    }
}

impl Advice {
    fn fmt_recommendation(&self, f: &mut fmt::Formatter<'_>, tolerance: &str) -> fmt::Result {
        let choice = self.choice();
        writeln!(f, "\nrecommended: fidelity = \"{}\", at a tolerance of {tolerance}", choice.name())?;
        let kept: Vec<_> = self.comparison.errors.iter().filter(|error| error.fidelity != choice).collect();
        for error in &self.comparison.errors {
            if error.fidelity == choice && choice != Fidelity::Exact {
                let (what, max, share) =
                    (choice.left_out_terms(), significant(error.max), percent(error.share));
                writeln!(f, "  leaving out {what} costs at most {max} N, {share}")?;
            }
        }
        let within = |fidelity: Fidelity| {
            self.comparison.within(self.tolerance).any(|error| error.fidelity == fidelity)
        };
        for error in kept.into_iter().rev().filter(|error| !within(error.fidelity)) {
            let (what, share) = (error.fidelity.left_out_terms(), percent(error.share));
            writeln!(f, "  leaving out {what} would cost {share}")?;
        }
        if within(Fidelity::Gravity) {
            writeln!(
                f,
                "  gravity alone is within the tolerance too, but a loop without inertia has no feedback"
            )?;
        }
        Ok(())
    }
}
