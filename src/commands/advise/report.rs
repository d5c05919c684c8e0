//! Errors and times of all fidelities over a set of motions: one struct for the text and for `--json`.

use core::fmt;

use serde::Serialize;

use hexad_core::model::fidelity::Fidelity;
use hexad_machine::analysis::fidelity_choice::FidelityForceErrors;
use hexad_machine::text::numbers::{percent, plain_percent, significant};
use hexad_machine::text::text_table::{Left, Right, text_table};

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
pub const SCHEMA: u32 = 1;

/// Result of `hexad advise`.
#[derive(Clone, Debug, Serialize)]
pub struct AdviceReport {
    pub schema: u32,
    pub machine: String,
    /// The set of motions, in lines of text.
    pub scene: String,
    /// Numbers of evaluated motions, and of skipped ones.
    pub evaluated: u64,
    pub outside_stroke: u64,
    pub singular: u64,
    /// Largest force of a leg over all motions, and over the motions inside.
    pub peak_force_n: f64,
    pub peak_inside_n: f64,
    /// Force that every leg can get: `actuator.max_force_n`, less what scale and load friction take.
    pub max_force_n: f64,
    /// `control.fidelity_tolerance`.
    pub tolerance: f64,
    pub fidelities: Vec<FidelityRow>,
    pub recommended: &'static str,
}

/// Errors of the force of a leg, absolute and as ratios of the peak force, and the shortest time of an evaluation. The
/// largest error is the largest found by a search, not a bound.
#[derive(Clone, Debug, Serialize)]
pub struct FidelityRow {
    #[serde(serialize_with = "by_name")]
    pub fidelity: Fidelity,
    pub leaves_out: &'static str,
    pub mean_n: f64,
    pub rms_n: f64,
    pub max_n: f64,
    pub mean_ratio: f64,
    pub rms_ratio: f64,
    pub max_ratio: f64,
    pub time_ns: f64,
    pub is_within_tolerance: bool,
}

fn by_name<S: serde::Serializer>(fidelity: &Fidelity, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(fidelity.name())
}

impl FidelityRow {
    /// Row of a fidelity. `peak` is the largest force of the motions inside.
    pub fn new(error: &FidelityForceErrors, time_ns: f64, peak: f64, is_within_tolerance: bool) -> Self {
        let ratio = |error: f64| if error == 0.0 { 0.0 } else { error / peak };
        Self {
            fidelity: error.fidelity,
            leaves_out: error.fidelity.left_out_terms(),
            mean_n: error.mean_n,
            rms_n: error.rms_n,
            max_n: error.max_n,
            mean_ratio: ratio(error.mean_n),
            rms_ratio: ratio(error.rms_n),
            max_ratio: error.share,
            time_ns,
            is_within_tolerance,
        }
    }

    fn cells(&self) -> [String; 9] {
        let [mean, rms, max] = [self.mean_n, self.rms_n, self.max_n].map(significant);
        let ratios = [self.mean_ratio, self.rms_ratio, self.max_ratio];
        let [mean_share, rms_share, max_share] = ratios.map(|ratio| significant(100.0 * ratio));
        let (name, time) = (self.fidelity.name().into(), format!("{:.0}", self.time_ns));
        [name, mean, rms, max, mean_share, rms_share, max_share, time, self.leaves_out.into()]
    }
}

impl fmt::Display for AdviceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} over {}", self.machine, self.scene)?;
        let passed =
            [(self.outside_stroke, "outside the actuators' stroke"), (self.singular, "at singular poses")];
        for (count, what) in passed.into_iter().filter(|(count, _)| *count > 0) {
            writeln!(f, "passed over: {count} motions {what}")?;
        }
        write!(f, "peak force {} N", significant(self.peak_force_n))?;
        if self.peak_force_n > self.max_force_n {
            write!(f, ", {} times the actuators' limit", significant(self.peak_force_n / self.max_force_n))?;
        }
        if self.peak_inside_n < self.peak_force_n {
            write!(f, "; {} N among the motions inside", significant(self.peak_inside_n))?;
        }
        let header = ["mean", "RMS", "max", "mean %", "RMS %", "max %", "ns"];
        let [mean, rms, max, mean_share, rms_share, max_share, ns] = header.map(|name| (name, Right));
        let columns =
            [("fidelity", Left), mean, rms, max, mean_share, rms_share, max_share, ns, ("leaves out", Left)];
        writeln!(
            f,
            "\n\nerror of a leg's force [N], and as a share of the peak force [%]; max is the largest found:"
        )?;
        write!(f, "{}", text_table(1, &columns, self.fidelities.iter().map(FidelityRow::cells)))?;
        self.fmt_recommendation(f)
    }
}

impl AdviceReport {
    fn fmt_recommendation(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, tolerance) = (self.recommended, plain_percent(self.tolerance));
        writeln!(f, "\nrecommended: fidelity = \"{name}\", at a tolerance of {tolerance}")?;
        let is_chosen = |row: &&FidelityRow| row.fidelity.name() == name;
        if let Some(row) =
            self.fidelities.iter().find(is_chosen).filter(|row| row.fidelity != Fidelity::Exact)
        {
            let (what, max, share) = (row.leaves_out, significant(row.max_n), percent(row.max_ratio));
            writeln!(f, "  leaving out {what} costs {max} N, {share}: the largest found, not a bound")?;
        }
        let kept = self.fidelities.iter().filter(|row| !is_chosen(row) && !row.is_within_tolerance);
        for row in kept.rev() {
            writeln!(f, "  leaving out {} would cost {}", row.leaves_out, percent(row.max_ratio))?;
        }
        let is_gravity = |row: &FidelityRow| row.fidelity == Fidelity::Gravity && row.is_within_tolerance;
        if self.fidelities.iter().any(is_gravity) {
            writeln!(
                f,
                "  gravity alone is within the tolerance too, but a loop without inertia has no feedback"
            )?;
        }
        Ok(())
    }
}
