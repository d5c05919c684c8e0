//! `hexad advise`: error and time of each model fidelity over an envelope or a trajectory, and which one suffices.

use core::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;

use self::report::{AdviceReport, FidelityRow, SCHEMA};
use super::arguments::{GROUP_HELP, MachineFile};
use super::failure::Failure;
use super::offline_tables::{read_trajectory, task_state};
use super::orientation::{OrientationFormat, ROTATION_HELP};
use super::progress::item_bar;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::rigid::Motion;
use hexad_machine::analysis::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use hexad_machine::analysis::fidelity_choice::FidelityComparison;
use hexad_machine::analysis::fidelity_error::{ErrorStatistics, FIDELITY_COUNT, FidelitySample};
use hexad_machine::config::Config;
use hexad_machine::config::fidelity::envelope;
use hexad_machine::text::csv_table::{GROUPS, NumberTable};
use hexad_machine::text::files::{print, print_json};
use hexad_machine::text::numbers::{AXES, axis_unit, significant};
use hexad_machine::text::text_table::{Left, Right, text_table};

mod report;

/// Number of timed motions: enough to vary, few enough for the cache.
const TIMED_MOTIONS: usize = 256;

/// Batches timed per fidelity. The fidelities alternate, so that a disturbance of the computer affects all of
/// them.
const TIMING_ROUNDS: usize = 101;

#[derive(Debug, clap::Args)]
pub struct AdviseArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// A CSV file as for `hexad move`, instead of the envelope; `-` is standard input
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    #[arg(long, help = ROTATION_HELP, value_name = "ORDER", default_value = "xyz", value_parser = OrientationFormat::by_name(), requires = "trajectory")]
    rotation: OrientationFormat,
    #[arg(long, help = GROUP_HELP, value_name = "GROUP", value_parser = PossibleValuesParser::new(GROUPS), requires = "trajectory")]
    group: Option<String>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl AdviseArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let path = self.trajectory.as_deref();
        let read = |path| read_trajectory(path, self.group.as_deref(), self.rotation, &config.machine.home);
        let table = path.map(read).transpose()?;
        let report = advise(&config, path.zip(table.as_ref()))?;
        if self.json {
            print_json(&report)?
        } else {
            print(report)?
        }
        Ok(())
    }
}

/// Evaluates the configured envelope or the trajectory of a file.
fn advise(config: &Config, trajectory: Option<(&Path, &NumberTable)>) -> Result<AdviceReport, Failure> {
    let model = InverseDynamics::new(&config.machine);
    let (scene, comparison, motions) = match trajectory {
        Some((path, table)) => judge_trajectory(&model, path, table)?,
        None => judge_envelope(config, &model),
    };
    let (times, tolerance) = (time(&model, &motions), config.deployment.control.fidelity_tolerance_share);
    let (inside, all) = (&comparison.inside, &comparison.all);
    let errors = comparison.errors.iter().zip(times);
    let is_within = |of: Fidelity| comparison.within(tolerance).any(|error| error.fidelity == of);
    let rows = errors
        .map(|(error, time_ns)| FidelityRow::new(error, time_ns, inside.peak_n, is_within(error.fidelity)));
    Ok(AdviceReport {
        schema: SCHEMA,
        machine: config.name.clone(),
        scene,
        evaluated: all.evaluated,
        outside_stroke: all.outside,
        singular: all.singular,
        peak_force_n: all.peak_n,
        peak_inside_n: inside.peak_n,
        max_force_n: config.machine.actuator.weakest_available_force_n(),
        tolerance,
        fidelities: rows.collect(),
        recommended: comparison.choice(tolerance).name(),
    })
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
    table: &NumberTable,
) -> Result<(String, FidelityComparison, Vec<Motion>), Failure> {
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
        return Err(Failure::before_start(format_args!(
            "{}: no row can be evaluated: {outside} are outside the actuators' stroke, {singular} at singular poses; \
             correct the trajectory",
            path.display()
        )));
    }
    let scene = format!("the rows of {}:\n{} motions", path.display(), tally.evaluated);
    Ok((scene, FidelityComparison::of_rows(tally), motions))
}

/// Shortest time of an evaluation of each fidelity \[ns\]: whatever else runs on the computer only adds to it. It is
/// shown and decides nothing, so that advice is the same twice and the same as of `fidelity = "auto"`.
fn time(model: &InverseDynamics, motions: &[Motion]) -> [f64; FIDELITY_COUNT] {
    let mut shortest = [f64::INFINITY; FIDELITY_COUNT];
    for _ in 0..TIMING_ROUNDS {
        for (shortest, fidelity) in shortest.iter_mut().zip(Fidelity::ALL) {
            let start = Instant::now();
            for motion in motions {
                black_box(model.forces_of(fidelity, black_box(motion)));
            }
            let time_ns = start.elapsed().as_secs_f64() * 1e9 / motions.len().max(1) as f64;
            *shortest = shortest.min(time_ns);
        }
    }
    shortest
}
