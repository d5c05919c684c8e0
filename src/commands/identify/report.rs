//! Result of the identification: one struct for the text and for `--json`.

use core::fmt;

use serde::Serialize;

use super::quantities::{BODY_QUANTITIES, LEG_QUANTITIES, PAYLOAD, Quantity, base_parameter};
use super::verdict::Verdict;
use crate::commands::report::summary::Fact;
use hexad_core::model::LEGS;
use hexad_core::model::machine::{Machine, Platform};
use hexad_machine::analysis::drive_delay::DriveDelay;
use hexad_machine::analysis::identification::{
    Estimated, Identification, Load, Run, prediction_errors, repeated_and_changing_errors,
};
use hexad_machine::config::Config;
use hexad_machine::text::numbers::significant;
use hexad_machine::text::text_table::{Left, MAX_WIDTH, Right, paragraph, text_table};

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
const SCHEMA: u32 = 1;

/// Columns of [`LEG_QUANTITIES`] in the text.
const LEG_COLUMNS: [&str; 4] =
    ["viscous friction [N s/m]", "Coulomb friction [N]", "load friction", "force scale"];

/// Largest share of the deviation that was expected before which a quantity may have that the motion shows.
const SHOWN_RATIO: f64 = 0.5;

/// Delay of the drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Delay {
    /// The one that the identification used \[s\].
    pub used_s: f64,
    /// Its standard deviation \[s\].
    pub deviation_s: f64,
    /// From the motion, if that shows it.
    pub shown: Option<DriveDelay>,
    /// Of the file.
    pub lag_s: f64,
    pub file_s: Option<f64>,
}

impl Delay {
    /// A larger deviation.
    pub fn widen(&mut self, deviation_s: f64) {
        self.deviation_s = deviation_s;
        if let Some(shown) = &mut self.shown {
            shown.mean.deviation_s = deviation_s;
        }
    }
}

/// Result of `hexad identify`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct IdentificationReport {
    schema: u32,
    pub machine: String,
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
    /// RMS and largest force that is not explained, with the file and with the result; NaN for a leg that nearly stands.
    before: [[f64; 2]; LEGS],
    after: [[f64; 2]; LEGS],
    /// Whether these are of a motion that the identification did not use.
    is_validated: bool,
    /// RMS of what is not explained with the result, the same in each period and different from one to the next; `None` if the
    /// motion has no two periods.
    after_by_period: Option<[[f64; 2]; LEGS]>,
    /// Correlation of successive residuals.
    pub correlation: [f64; LEGS],
    /// Whether the residuals are noise.
    pub verdict: Verdict,
    /// Least squares of the equations alone, before any prior.
    base_parameters: Option<Vec<BaseParameter>>,
    /// Delay that the motion shows.
    delay_us: Option<f64>,
    deviation_us: Option<f64>,
    leg_delay_us: Option<[f64; LEGS]>,
    #[serde(skip)]
    delay: Delay,
}

/// Runs whose forces are predicted: runs of the other motion, or the identified runs. The payload is not a part of the machine.
pub(super) fn predicted(runs: &[Run], validation: &[Run]) -> Vec<Run> {
    let predicted = if validation.is_empty() { runs } else { validation };
    predicted.iter().filter(|run| run.load != Load::Payload).cloned().collect()
}

/// Combination of parameters that has an effect of its own.
#[derive(Clone, Debug, Serialize)]
struct BaseParameter {
    name: String,
    value: f64,
}

/// A quantity.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    name: &'static str,
    unit: &'static str,
    value: f64,
    deviation: f64,
    file: f64,
    /// Deviation that was expected of the file.
    expected: f64,
    /// Whether the motion shows it, or it is as far as it was known before.
    pub is_shown: bool,
}

impl Row {
    fn new(name: &'static str, unit: &'static str, estimated: &Estimated) -> Self {
        let Estimated { value, deviation, before, expected } = *estimated;
        let is_shown = deviation < SHOWN_RATIO * expected;
        Self { name, unit, value, deviation, file: before, expected, is_shown }
    }

    /// Change from the file, and its deviation, both over the deviation that was expected of the file.
    pub fn change(&self) -> [f64; 2] {
        [self.value - self.file, self.deviation].map(|number| number / self.expected)
    }

    fn label(&self) -> String {
        format!("{} [{}]", self.name, self.unit)
    }

    /// Values of file and result, deviation, and what shows it.
    pub fn cells(&self) -> [String; 4] {
        let shown = if self.is_shown { "the motion" } else { "the file" };
        [
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
        verdict: Verdict,
    ) -> Self {
        let has_payload = runs.iter().any(|run| run.load == Load::Payload);
        let holds_machine = runs.iter().all(|run| run.load == Load::Payload);
        let row =
            |quantity: &Quantity| Row::new(quantity.name, quantity.unit, &found.estimate(quantity.value));
        let mut quantities: Vec<_> =
            if holds_machine { vec![] } else { BODY_QUANTITIES.iter().map(row).collect() };
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
        let after_by_period = repeated_and_changing_errors(&found.machine, &predicted(runs, &[]));
        let predicted = predicted(runs, validation);
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
            after_by_period,
            is_validated: !validation.is_empty(),
            correlation: found.correlation,
            verdict,
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
        writeln!(f, "{}: {}", self.machine, self.extent_text())?;
        for words in [self.shown_text()].iter().map(String::as_str).chain(self.scale_text()) {
            write!(f, "{}", paragraph("", words, MAX_WIDTH))?;
        }
        let header =
            [("parameter", Left), ("file", Right), ("identified", Right), ("", Left), ("shown by", Left)];
        let rows = self.quantities.iter().map(|row| [vec![row.label()], row.cells().into()].concat());
        writeln!(f, "\n{}", text_table(2, &header, rows))?;
        if !self.legs.iter().all(Vec::is_empty) {
            self.fmt_legs(f)?;
        }
        // Of a payload alone no run is predicted.
        if self.before.iter().flatten().any(|force| force.is_finite()) {
            self.fmt_prediction(f)?;
        }
        writeln!(f, "{}", self.verdict)?;
        writeln!(f, "{}{}", self.delay_text(), self.delay_lines())
    }
}

impl IdentificationReport {
    /// Facts for the head of a page.
    pub fn facts(&self) -> Vec<Fact> {
        let fact = |name, text| Fact { name, text, is_bad: false };
        let scales = self.scale_text().map(|text| fact("Force scales", text.into()));
        let delay = fact("Delay", self.delay_text());
        let mut facts =
            vec![fact("Recordings", self.extent_text()), fact("Parameters", self.shown_text()), delay];
        facts.extend(scales);
        facts.push(Fact { name: "Model", text: self.verdict.sentence(), is_bad: !self.verdict.holds });
        facts
    }

    /// Name of each quantity with its row, in the order of the text.
    pub fn rows(&self) -> impl Iterator<Item = (String, &Row)> {
        let of_legs = LEG_COLUMNS.iter().enumerate().flat_map(|(quantity, name)| {
            let rows = self.legs.iter().zip(1..);
            rows.filter_map(move |(rows, leg)| Some((format!("leg {leg}: {name}"), rows.get(quantity)?)))
        });
        self.quantities.iter().map(|row| (row.label(), row)).chain(of_legs)
    }

    /// Motion whose forces are predicted.
    pub fn predicted_motion(&self) -> &'static str {
        if self.is_validated { "of the other motion" } else { "of these motions" }
    }

    /// Number of each leg, RMS and largest force that is not explained, with the file and with the result.
    pub fn residual_cells(&self) -> Vec<[String; 5]> {
        let cells = |(leg, (before, after)): (usize, (&[f64; 2], &[f64; 2]))| {
            let text = |force: f64| if force.is_nan() { "stands".into() } else { significant(force) };
            let [a, b, c, d] = [before[0], before[1], after[0], after[1]].map(text);
            [format!("{}", leg + 1), a, b, c, d]
        };
        self.before.iter().zip(&self.after).enumerate().map(cells).collect()
    }

    fn extent_text(&self) -> String {
        format!("{:.0} s of motion under control, {} equations", self.duration_s, self.equations)
    }

    fn shown_text(&self) -> String {
        let (shown, all) = (self.shown, self.shown + self.unknown);
        format!(
            "The motion shows {shown} of {all} combinations of the parameters; the others stay as the file has them."
        )
    }

    fn scale_text(&self) -> Option<&'static str> {
        let text = "No recording has a known weight (--loaded): the mean of the force scales stays as it is, and masses and friction \
                    are times the true mean.";
        (!self.is_scale_known).then_some(text)
    }

    fn fmt_legs(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let header: Vec<_> =
            core::iter::once("leg").chain(LEG_COLUMNS).map(|column| (column, Right)).collect();
        let cells = |(index, leg): (usize, &Vec<Row>)| {
            let number = |row: &Row| {
                format!("{} +- {}", with_deviation(row.value, row.deviation), two_digits(row.deviation))
            };
            core::iter::once(format!("{}", index + 1)).chain(leg.iter().map(number)).collect::<Vec<_>>()
        };
        writeln!(f, "{}", text_table(2, &header, self.legs.iter().enumerate().map(cells)))
    }

    fn fmt_prediction(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "force [N] {} that is not explained, RMS and largest:\n", self.predicted_motion())?;
        let header = [("leg", Right), ("file", Right), ("", Right), ("identified", Right), ("", Right)];
        writeln!(f, "{}", text_table(2, &header, self.residual_cells()))?;
        let Some(by_period) = self.after_by_period else { return Ok(()) };
        writeln!(
            f,
            "the same with the identified values in the motions of excite: RMS of what each period repeats, and of what differs:\n"
        )?;
        let header = [("leg", Right), ("repeats", Right), ("differs", Right)];
        let rows = by_period
            .iter()
            .zip(1..)
            .map(|([same, different], leg)| [format!("{leg}"), significant(*same), significant(*different)]);
        writeln!(f, "{}", text_table(2, &header, rows))
    }

    fn delay_text(&self) -> String {
        let Some(DriveDelay { mean, .. }) = self.delay.shown else {
            let used_ms = 1e3 * self.delay.used_s;
            return format!(
                "delay of the drives: not shown by this motion; {used_ms:.2} ms was used ([drive] delay_us, lag_us)"
            );
        };
        let [delay_ms, deviation_ms] = [mean.delay_s, mean.deviation_s].map(|seconds| 1e3 * seconds);
        format!("delay of the drives, from release to force: {delay_ms:.3} ms +- {deviation_ms:.3} ms")
    }

    /// Lines of the machine file, if the motion shows the delay.
    fn delay_lines(&self) -> String {
        let Delay { shown: Some(DriveDelay { mean, .. }), lag_s, file_s, .. } = &self.delay else {
            return String::new();
        };
        let was = file_s.map_or("was not given".into(), |delay_s| format!("was {:.0}", 1e6 * delay_s));
        let lag = if *lag_s > 0.0 { ", less lag_us" } else { "" };
        let delay_us = (1e6 * (mean.delay_s - lag_s)).max(0.0);
        format!("\n\n[drive]\ndelay_us = {delay_us:.0}   # {was}{lag}")
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
