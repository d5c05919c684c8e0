//! `hexad excite`: plays a motion from which parameters of the machine and the delay of the drives can be identified.
//!
//! The motion is designed for the machine and its limits. The command prints what it will show, then plays it as
//! `hexad move` plays a trajectory, or writes it to a file.

use std::path::PathBuf;

use clap::Args;

use super::arguments::{MachineFile, number_within};
use super::failure::Failure;
use super::r#move::PlaybackOptions;
use super::r#move::trajectory::Trajectory;
use hexad_core::model::regressor::{COULOMB, REFLECTED, VISCOUS};
use hexad_core::model::{LEGS, machine::Machine};
use hexad_core::motion::excitation::{Excitation, PERIOD_S};
use hexad_machine::analysis::excitation_design::{Sensitivities, base_parameter_values};
use hexad_machine::analysis::identification::expected_deviations;
use hexad_machine::config::Config;
use hexad_machine::text::csv_table::trajectory_columns;
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::files::{is_standard, print};
use hexad_machine::text::numbers::{percent, plain_percent, significant};
use hexad_machine::text::text_table::{Left, Right, text_table};

/// Noise of the forces for which deviations are predicted, as a ratio of `actuator.max_force_n`, and its rate \[Hz\].
const NOISE_RATIO: f64 = 0.01;
const NOISE_RATE_HZ: f64 = 100.0;

/// Time between the rows of a file \[s\]. Quintic interpolation between them errs by 1e-12 of the amplitude.
const ROW_S: f64 = 0.01;

#[derive(Debug, Args)]
pub struct ExciteArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Number of counted periods of 10 s
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=1000))]
    periods: u32,
    /// Amplitude as a share of the largest that drives and limits allow, as for an unknown payload 0.05
    #[arg(long, value_name = "SHARE", default_value_t = 0.7, value_parser = amplitude)]
    amplitude: f64,
    /// Seed of the random motions from which the design begins
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write the motion as a CSV file for `hexad move --trajectory` instead of playing it; `-` is standard output
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["hold", "engage"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    playback: PlaybackOptions,
}

/// Share of the largest amplitude.
fn amplitude(text: &str) -> Result<f64, String> {
    number_within(text, 0.001..=1.0, "")
}

impl ExciteArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let excitation = Trajectory::excitation(&config, self.periods, self.amplitude, self.seed)?;
        if !self.output.as_deref().is_some_and(is_standard) {
            print(summary(&config, &excitation))?;
        }
        match self.output {
            Some(path) => Ok(rows(&excitation).save(&path).map_err(Failure::before_start)?),
            None => self.playback.play(&config, &Trajectory::Excitation(Box::new(excitation))),
        }
    }
}

/// The motion as a table of t, X, X', X''.
fn rows(excitation: &Excitation) -> CsvWriter {
    let mut writer = CsvWriter::new(&trajectory_columns());
    let count = (excitation.duration() / ROW_S).round() as u32;
    for k in 0..=count {
        // Rounded to a hundredth.
        let t = f64::from(k) / (1.0 / ROW_S).round();
        let state = excitation.at(t);
        let numbers = [state.x, state.xd, state.xdd].into_iter().flat_map(<[f64; 6]>::from);
        writer.row([t].into_iter().chain(numbers));
    }
    writer
}

/// Duration, condition, and the predicted standard deviations.
fn summary(config: &Config, excitation: &Excitation) -> String {
    let machine = &config.machine;
    let noise_n = NOISE_RATIO * machine.actuator.max_force_n;
    let count = f64::from(excitation.periods()) * PERIOD_S * NOISE_RATE_HZ;
    let sensitivities = Sensitivities::new(machine, excitation.series());
    let deviations =
        sensitivities.as_ref().and_then(|all| all.deviations(&expected_deviations(machine), noise_n, count));
    let (Some(sensitivities), Some(deviations)) = (sensitivities, deviations) else {
        return "the motion does not show the parameters\n".into();
    };
    let table = text_table(
        2,
        &[("parameter", Left), ("unit", Left), ("value", Right), ("deviation", Right), ("relative", Right)],
        shown(machine, &deviations),
    );
    format!(
        "{}: {:.0} s, of them {} x {PERIOD_S:.0} s counted; condition {}\n\n{table}\nPredicted for forces with {} of \
         max_force_n of white noise at {NOISE_RATE_HZ:.0} Hz, without errors of the model\n",
        config.name,
        excitation.duration(),
        excitation.periods(),
        significant(sensitivities.condition),
        plain_percent(NOISE_RATIO)
    )
}

/// Rows of the main parameters, with the largest deviation of those that a row stands for.
fn shown(machine: &Machine, deviations: &[(usize, f64)]) -> impl Iterator<Item = [String; 5]> {
    let values = base_parameter_values(machine);
    let rows = [
        ("mass of platform and six rods", "kg", 0..1),
        ("first moment x, rods at their joints", "kg m", 1..2),
        ("first moment y", "kg m", 2..3),
        ("first moment z", "kg m", 3..4),
        ("reflected mass of a drive", "kg", REFLECTED..REFLECTED + 1),
        ("viscous friction of a leg (worst of six)", "N s/m", VISCOUS..VISCOUS + LEGS),
        ("Coulomb friction of a leg (worst of six)", "N", COULOMB..COULOMB + LEGS),
    ];
    rows.into_iter().filter_map(move |(name, unit, of)| {
        let worst = deviations.iter().filter(|(k, _)| of.contains(k)).max_by(|a, b| a.1.total_cmp(&b.1));
        let (k, deviation) = *worst?;
        let value = values.get(k).copied()?;
        let ratio = deviation / value.abs();
        let relative = if ratio < 1.0 { percent(ratio) } else { "-".into() };
        // Rounding leaves no zero where the points of the rods cancel.
        let value = if value.abs() < 1e-9 { 0.0 } else { value };
        Some([name.into(), unit.into(), significant(value), significant(deviation), relative])
    })
}
