//! `hexad advise`: what every fidelity of the ladder of models costs over a scene, in newtons and in time, and
//! which one will do.

use core::fmt;
use core::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget};

use super::offline::{progress, task_state};
use crate::analysis::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use crate::analysis::fidelity_choice::FidelityComparison;
use crate::analysis::fidelity_error::{ErrorStatistics, FIDELITY_COUNT, FidelitySample};
use crate::config::Config;
use crate::config::fidelity::envelope;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::rigid::Motion;
use crate::output::csv_table::{Table, TableError, trajectory_columns};
use crate::output::numbers::{percent, plain_percent, significant};

/// Motions of the scene that are timed: enough to be different ones, few enough to stay in the cache.
const TIMED_MOTIONS: usize = 256;

/// Batches timed per fidelity, one fidelity after the other, so that what disturbs the computer disturbs all.
const ROUNDS: usize = 101;

/// Shorter than this a command needs no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// A fidelity further up the ladder is taken for the cheaper one only if it is quicker by more than this share:
/// less is noise.
const QUICKER: f64 = 0.1;

/// Why there is no advice.
#[derive(Debug, thiserror::Error)]
pub enum AdviseError {
    #[error(transparent)]
    Table(#[from] TableError),
    #[error("{}: no row can be judged, {outside} outside the actuators' stroke, {singular} singular", path.display())]
    NothingJudged { path: PathBuf, outside: u64, singular: u64 },
}

/// A scene, judged and timed.
pub struct Advice {
    name: String,
    /// What was looked at, in lines.
    scene: String,
    /// Of an actuator \[N\].
    max_force: f64,
    comparison: FidelityComparison,
    /// Median time of an evaluation, in the order of [`Fidelity::ALL`] \[ns\].
    times: [f64; FIDELITY_COUNT],
    tolerance: f64,
}

impl Advice {
    /// Judges the configured envelope, or a trajectory.
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

    /// The fidelity that takes the least time of those within the tolerance on which a loop can run.
    fn choice(&self) -> Fidelity {
        let time = |fidelity: Fidelity| {
            let times = Fidelity::ALL.into_iter().zip(self.times);
            times.filter(|(timed, _)| *timed == fidelity).map(|(_, time)| time).sum::<f64>()
        };
        let first = self.comparison.choice(self.tolerance);
        let allowed = self.comparison.within(self.tolerance).map(|error| error.fidelity);
        allowed.filter(|fidelity| fidelity.has_inertia()).fold(first, |best, fidelity| {
            if time(fidelity) < (1.0 - QUICKER) * time(best) { fidelity } else { best }
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

/// The ranges, as motion bases are specified.
fn limits(limits: &EnvelopeBounds) -> String {
    let names = ["alpha", "beta", "gamma", "x", "y", "z"];
    let mut text = format!("{:<8}{:>21}{:>18}{:>20}\n", "", "offset from home", "rate", "acceleration");
    let ranges = limits.pose_min.iter().zip(&limits.pose_max);
    let motion = limits.velocity.iter().zip(&limits.acceleration);
    for (axis, (name, ((low, high), (velocity, acceleration)))) in
        names.into_iter().zip(ranges.zip(motion)).enumerate()
    {
        let (scale, unit) = if axis < 3 { (1.0_f64.to_degrees(), "deg") } else { (1e3, "mm") };
        let [low, high, velocity, acceleration] =
            [low, high, velocity, acceleration].map(|x| significant(x * scale));
        text += &format!(
            "{name:<8}{:>21}{:>18}{:>20}\n",
            format!("{low} to {high} {unit}"),
            format!("{velocity} {unit}/s"),
            format!("{acceleration} {unit}/s2"),
        );
    }
    text
}

fn judge_trajectory(
    model: &InverseDynamics,
    path: &Path,
) -> Result<(String, FidelityComparison, Vec<Motion>), AdviseError> {
    let table = Table::read(path, &trajectory_columns(), &[])?;
    let rows = table.rows();
    let (mut tally, start, mut bar) = (ErrorStatistics::default(), Instant::now(), None::<ProgressBar>);
    let every = rows.len().div_ceil(TIMED_MOTIONS);
    let mut motions = vec![];
    for (k, row) in rows.iter().enumerate() {
        if k % 1024 == 0 && start.elapsed() > PATIENCE {
            bar.get_or_insert_with(|| progress(rows.len(), "rows")).set_position(k as u64);
        }
        let state = task_state(row);
        let sample = FidelitySample::take(model, &state);
        tally.add(&sample);
        if sample.is_ok() && k % every == 0 {
            motions.push(state.motion());
        }
    }
    if let Some(bar) = bar {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        bar.finish_and_clear();
    }
    if tally.evaluated == 0 {
        let ErrorStatistics { outside, singular, .. } = tally;
        return Err(AdviseError::NothingJudged { path: path.into(), outside, singular });
    }
    let scene = format!("the rows of {}:\n{} motions", path.display(), tally.evaluated);
    Ok((scene, FidelityComparison::of_rows(tally), motions))
}

/// Median time of an evaluation of each fidelity \[ns\].
fn time(model: &InverseDynamics, motions: &[Motion]) -> [f64; FIDELITY_COUNT] {
    let mut rounds = [const { Vec::new() }; FIDELITY_COUNT];
    for _ in 0..ROUNDS {
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
        writeln!(f, "\n\n{:<14} {:^26} {:>24}", "", "error of a leg's force [N]", "share of the peak [%]")?;
        let numbers = ["mean", "RMS", "max", "mean", "RMS", "max"].map(|what| format!("{what:>8}")).join(" ");
        writeln!(f, "{:<14} {numbers} {:>5}  leaves out", "fidelity", "ns")?;
        for (error, time) in comparison.errors.iter().zip(times) {
            let share = |error: f64| if error == 0.0 { 0.0 } else { 100.0 * error / inside.peak };
            let [mean, rms, max] = [error.mean, error.rms, error.max].map(significant);
            let shares = [share(error.mean), share(error.rms), 100.0 * error.share].map(significant);
            let [mean_share, rms_share, max_share] = shares;
            writeln!(
                f,
                "{:<14} {mean:>8} {rms:>8} {max:>8} {mean_share:>8} {rms_share:>8} {max_share:>8} {time:>5.0}  {}",
                error.fidelity.name(),
                error.fidelity.left_out_terms()
            )?;
        }
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
