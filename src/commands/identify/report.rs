//! Result of the identification: one struct for the text and for `--json`.

use core::fmt;

use serde::Serialize;

use super::quantities::{BODIES, LEG_QUANTITIES, PAYLOAD, Quantity, base_parameter};
use crate::analysis::drive_delay::DriveDelay;
use crate::analysis::identification::{Estimated, Identification, Load, Run, prediction_errors};
use crate::config::Config;
use crate::model::LEGS;
use crate::model::machine::{Machine, Platform};
use crate::output::numbers::significant;
use crate::output::text_table::{Left, MAX_WIDTH, Right, paragraph, text_table};

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
const SCHEMA: u32 = 1;

/// Largest share of the deviation that was expected before which a quantity may have that the motion shows.
const SHOWN_RATIO: f64 = 0.5;

/// Delay of the drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Delay {
    /// The one that the identification used \[s\].
    pub used_s: f64,
    /// From the motion, if that shows it.
    pub shown: Option<DriveDelay>,
    /// Of the file.
    pub lag_s: f64,
    pub file_s: Option<f64>,
}

/// Result of `hexad identify`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct IdentificationReport {
    schema: u32,
    machine: String,
    /// Duration of the samples, and number of equations.
    duration_s: f64,
    equations: usize,
    /// Combinations of parameters that the motion shows, and that stay as they were.
    shown: usize,
    unknown: usize,
    /// Whether a known weight shows the mean of the force scales.
    is_scale_known: bool,
    quantities: Vec<Row>,
    legs: [Vec<Row>; LEGS],
    /// RMS and largest force that is not explained, with the file and with the result.
    before: [[f64; 2]; LEGS],
    after: [[f64; 2]; LEGS],
    /// Whether these are of a motion that the identification did not use.
    is_validated: bool,
    /// Correlation of successive residuals.
    correlation: [f64; LEGS],
    /// Least squares of the equations alone, before any prior.
    base_parameters: Option<Vec<BaseParameter>>,
    /// Delay that the motion shows.
    delay_us: Option<f64>,
    deviation_us: Option<f64>,
    leg_delay_us: Option<[f64; LEGS]>,
    #[serde(skip)]
    delay: Delay,
}

/// Combination of parameters that has an effect of its own.
#[derive(Clone, Debug, Serialize)]
struct BaseParameter {
    name: String,
    value: f64,
}

/// A quantity.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    unit: &'static str,
    value: f64,
    deviation: f64,
    file: f64,
    /// Whether the motion shows it, or it is as far as it was known before.
    is_shown: bool,
}

impl Row {
    fn new(name: &'static str, unit: &'static str, estimated: &Estimated) -> Self {
        let Estimated { value, deviation, before, expected } = *estimated;
        Self { name, unit, value, deviation, file: before, is_shown: deviation < SHOWN_RATIO * expected }
    }

    fn cells(&self) -> [String; 5] {
        let shown = if self.is_shown { "the motion" } else { "the file" };
        [
            format!("{} [{}]", self.name, self.unit),
            significant(self.file),
            with_deviation(self.value, self.deviation),
            format!("+- {}", two_digits(self.deviation)),
            shown.into(),
        ]
    }
}

impl IdentificationReport {
    /// Report of an identification; predictions of `validation`, or of the runs themselves.
    pub fn new(
        config: &Config,
        found: &Identification,
        runs: &[Run],
        validation: &[Run],
        delay: Delay,
    ) -> Self {
        let has_payload = runs.iter().any(|run| run.load == Load::Payload);
        let holds_machine = runs.iter().all(|run| run.load == Load::Payload);
        let row =
            |quantity: &Quantity| Row::new(quantity.name, quantity.unit, &found.estimate(quantity.value));
        let mut quantities: Vec<_> = if holds_machine { vec![] } else { BODIES.iter().map(row).collect() };
        if has_payload {
            quantities.extend(PAYLOAD.iter().map(row));
        }
        let leg = |leg: usize| {
            let of_leg = |of: fn(&Machine) -> &[f64; LEGS]| {
                found.estimate(|machine: &Machine, _: &Platform| {
                    of(machine).get(leg).copied().unwrap_or_default()
                })
            };
            LEG_QUANTITIES.iter().map(|(name, unit, of)| Row::new(name, unit, &of_leg(*of))).collect()
        };
        let predicted = if validation.is_empty() { runs } else { validation };
        let predicted: Vec<_> = predicted.iter().filter(|run| run.load != Load::Payload).cloned().collect();
        Self {
            schema: SCHEMA,
            machine: config.name.clone(),
            duration_s: runs.iter().map(Run::duration_s).sum(),
            equations: found.equations,
            shown: found.shown,
            unknown: found.unknown,
            is_scale_known: holds_machine || runs.iter().any(|run| matches!(run.load, Load::Known { .. })),
            quantities,
            legs: if holds_machine { Default::default() } else { core::array::from_fn(leg) },
            before: prediction_errors(&config.machine, &predicted),
            after: prediction_errors(&found.machine, &predicted),
            is_validated: !validation.is_empty(),
            correlation: found.correlation,
            base_parameters: found.base_parameters.as_ref().map(|all| {
                all.iter()
                    .map(|(k, value)| BaseParameter { name: base_parameter(*k), value: *value })
                    .collect()
            }),
            delay_us: delay.shown.map(|found| 1e6 * found.mean.delay_s),
            deviation_us: delay.shown.map(|found| 1e6 * found.mean.deviation_s),
            leg_delay_us: delay.shown.map(|found| found.legs.map(|leg| 1e6 * leg.delay_s)),
            delay,
        }
    }
}

impl fmt::Display for IdentificationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, duration_s, equations, shown, unknown, .. } = self;
        writeln!(f, "{machine}: {duration_s:.0} s of motion under control, {equations} equations")?;
        let all = shown + unknown;
        let words = format!(
            "The motion shows {shown} of {all} combinations of the parameters; the others stay as the file has them."
        );
        write!(f, "{}", paragraph("", &words, MAX_WIDTH))?;
        if !self.is_scale_known {
            let words = "No recording has a known weight (--loaded): the mean of the force scales stays as it is, and masses and \
                         friction are times the true mean.";
            write!(f, "{}", paragraph("", words, MAX_WIDTH))?;
        }
        let header =
            [("parameter", Left), ("file", Right), ("identified", Right), ("", Left), ("shown by", Left)];
        writeln!(f, "\n{}", text_table(2, &header, self.quantities.iter().map(Row::cells)))?;
        if !self.legs.iter().all(Vec::is_empty) {
            self.fmt_legs(f)?;
        }
        self.fmt_prediction(f)?;
        self.fmt_delay(f)
    }
}

impl IdentificationReport {
    fn fmt_legs(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let header = [
            ("leg", Right),
            ("viscous friction [N s/m]", Right),
            ("Coulomb friction [N]", Right),
            ("load friction", Right),
            ("force scale", Right),
        ];
        let cells = |(index, leg): (usize, &Vec<Row>)| {
            let number = |row: &Row| {
                format!("{} +- {}", with_deviation(row.value, row.deviation), two_digits(row.deviation))
            };
            core::iter::once(format!("{}", index + 1)).chain(leg.iter().map(number)).collect::<Vec<_>>()
        };
        writeln!(f, "{}", text_table(2, &header, self.legs.iter().enumerate().map(cells)))
    }

    fn fmt_prediction(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = if self.is_validated { "of the other motion" } else { "of these motions" };
        writeln!(f, "force [N] {of} that is not explained, RMS and largest:\n")?;
        let header = [("leg", Right), ("file", Right), ("", Right), ("identified", Right), ("", Right)];
        let rows = self.before.iter().zip(&self.after).enumerate().map(|(leg, (before, after))| {
            let [a, b, c, d] = [before[0], before[1], after[0], after[1]].map(significant);
            [format!("{}", leg + 1), a, b, c, d]
        });
        writeln!(f, "{}", text_table(2, &header, rows))
    }

    fn fmt_delay(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Delay { used_s, shown, lag_s, file_s } = &self.delay;
        let Some(DriveDelay { mean, .. }) = shown else {
            return writeln!(
                f,
                "delay of the drives: not shown by this motion; {:.2} ms was used ([drive] delay_us, lag_us)",
                1e3 * used_s
            );
        };
        let was = file_s.map_or("was not given".into(), |delay_s| format!("was {:.0}", 1e6 * delay_s));
        let lag = if *lag_s > 0.0 { ", less lag_us" } else { "" };
        writeln!(
            f,
            "delay of the drives, from release to force: {:.3} ms +- {:.3} ms\n\n[drive]\ndelay_us = {:.0}   # {was}{lag}",
            1e3 * mean.delay_s,
            1e3 * mean.deviation_s,
            (1e6 * (mean.delay_s - lag_s)).max(0.0)
        )
    }
}

/// A number with the digits that its deviation justifies.
fn with_deviation(value: f64, deviation: f64) -> String {
    if !(deviation > 0.0 && deviation.is_finite()) {
        return significant(value);
    }
    let decimals = (1.0 - deviation.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

fn two_digits(deviation: f64) -> String {
    with_deviation(deviation, deviation)
}
