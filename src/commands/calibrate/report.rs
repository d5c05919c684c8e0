//! Result of a calibration: one struct for the text and for `--json`.

use core::fmt;

use nalgebra::{DVector, Vector6};
use serde::Serialize;

use crate::commands::report::summary::Fact;
use hexad_core::model::LEGS;
use hexad_machine::analysis::calibration::examination::{PoseErrors, RowResult};
use hexad_machine::analysis::calibration::model::{Geometry, JOINT_VALUES, Seen};
use hexad_machine::analysis::calibration::{Calibration, Task};
use hexad_machine::config::Config;
use hexad_machine::text::numbers::{readable, significant};
use hexad_machine::text::text_table::{Left, MAX_WIDTH, Right, paragraph, text_table};
use hexad_machine::text::units::{ANGLES, LENGTHS};

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
const SCHEMA: u32 = 1;
/// Deviation from which a value stays as drawn, as a share of the tolerance.
const DRAWN_RATIO: f64 = 0.5;
/// Difference of the costs of two starts that is rounding.
const SAME_COST: f64 = 1e-6;
/// Residuals over the stated noise, from which they need attention.
const LARGE_NOISE_FACTOR: f64 = 3.0;

/// Result of `hexad calibrate`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct CalibrationReport {
    schema: u32,
    pub machine: String,
    rows: usize,
    has_reflectors: bool,
    tolerance_m: f64,
    /// Joints, or offset, of each leg.
    pub legs: [LegValues; LEGS],
    /// Errors of poses over the workspace: of the drawing, and as expected of the result.
    before: Errors,
    after: Errors,
    /// Poses by the lengths against those by the tracker, over the rows.
    rows_before: Errors,
    rows_after: Errors,
    /// With the result of all other rows.
    rows_left_out: Errors,
    /// Each row.
    pub poses: Vec<RowReport>,
    /// Lines of the table with measurements that contradict the others.
    pub suspected_lines: Vec<u64>,
    /// Combinations of joints and offsets that the poses determine, that stay as drawn, and their condition.
    determined: usize,
    weak: usize,
    condition: f64,
    /// Standard deviations by the residuals, and over the stated ones.
    length_noise_m: f64,
    tracker_noise_m: f64,
    tracker_angle_rad: f64,
    noise_factor: f64,
    /// Sum of the losses and of the prior, and the difference from another start over it.
    cost: f64,
    second_start_difference: f64,
}

/// Values of a leg \[m\].
#[derive(Clone, Debug, Serialize)]
pub(super) struct LegValues {
    pub base_m: [f64; 3],
    pub base_change_m: [f64; 3],
    base_deviation_m: [f64; 3],
    pub platform_m: [f64; 3],
    pub platform_change_m: [f64; 3],
    platform_deviation_m: [f64; 3],
    offset_m: f64,
    offset_deviation_m: f64,
}

/// Errors of poses.
#[derive(Clone, Copy, Debug, Serialize)]
struct Errors {
    position_rms_m: f64,
    position_worst_m: f64,
    angle_rms_rad: f64,
    angle_worst_rad: f64,
}

/// A row of the table.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RowReport {
    line: u64,
    /// Length by the tracker less measured length, with the drawing and with the result.
    pub legs_before_m: [f64; LEGS],
    pub legs_m: [f64; LEGS],
    pub is_suspected: bool,
}

impl From<PoseErrors> for Errors {
    fn from(errors: PoseErrors) -> Self {
        let PoseErrors { position_rms_m, position_worst_m, angle_rms_rad, angle_worst_rad } = errors;
        Self { position_rms_m, position_worst_m, angle_rms_rad, angle_worst_rad }
    }
}

impl Errors {
    fn cells(&self, name: &str) -> [String; 5] {
        let [rms, worst] = [self.position_rms_m, self.position_worst_m].map(|x| readable(x, LENGTHS));
        let [angle, worst_angle] = [self.angle_rms_rad, self.angle_worst_rad].map(|x| readable(x, ANGLES));
        [name.into(), rms, worst, angle, worst_angle]
    }
}

impl CalibrationReport {
    pub fn new(config: &Config, task: &Task, found: &Calibration, lines: &[u64]) -> Self {
        let over = |of: fn(&RowResult) -> &Option<Vector6<f64>>| {
            Errors::from(PoseErrors::of(
                found.rows.iter().filter(|row| !row.is_outlier).filter_map(|row| of(row).as_ref()),
            ))
        };
        let row = |(row, line): (&RowResult, &u64)| RowReport {
            line: *line,
            legs_before_m: row.legs_before_m,
            legs_m: row.legs_m,
            is_suspected: row.is_outlier,
        };
        let poses: Vec<_> = found.rows.iter().zip(lines).map(row).collect();
        Self {
            schema: SCHEMA,
            machine: config.name.clone(),
            rows: poses.len(),
            has_reflectors: task.rows.iter().any(|row| matches!(row.seen, Seen::Reflectors(_))),
            tolerance_m: task.tolerance_m,
            legs: leg_values(&Geometry::of(task.machine), found),
            before: found.before.into(),
            after: found.after.into(),
            rows_before: over(|row| &row.displacement_before),
            rows_after: over(|row| &row.displacement_after),
            rows_left_out: over(|row| &row.displacement_left_out),
            suspected_lines: poses.iter().filter(|row| row.is_suspected).map(|row| row.line).collect(),
            poses,
            determined: found.directions.determined,
            weak: found.directions.weak,
            condition: found.directions.condition,
            length_noise_m: found.noise.length_m,
            tracker_noise_m: found.noise.position_m,
            tracker_angle_rad: found.noise.angle_rad,
            noise_factor: found.noise_factor,
            cost: found.cost,
            second_start_difference: found.second_start_difference_ratio,
        }
    }

    /// Facts for the head of a page.
    pub fn facts(&self) -> Vec<Fact> {
        let fact = |name, (text, is_bad)| Fact { name, text, is_bad };
        let errors = |errors: &Errors| {
            let [_, rms, worst, ..] = errors.cells("");
            format!("{rms} RMS, {worst} at worst")
        };
        vec![
            fact("Poses", (self.extent_text(), false)),
            fact("Position over the workspace, drawing", (errors(&self.before), false)),
            fact("Position over the workspace, calibrated", (errors(&self.after), false)),
            fact("Row that is left out", (errors(&self.rows_left_out), false)),
            fact("Combinations", (self.directions_text(), false)),
            fact("Noise", self.noise_text()),
            fact("Suspected rows", (self.suspected_text(), !self.suspected_lines.is_empty())),
            fact("Second start", self.start_text()),
        ]
    }

    fn extent_text(&self) -> String {
        let seen = if self.has_reflectors { "reflectors" } else { "a probe" };
        format!("{} with six lengths and {seen} in the tracker's frame", self.rows)
    }

    fn directions_text(&self) -> String {
        format!(
            "{} of {} of joints and offsets are determined, condition {}; others stay as drawn, and so do the places of base and platform in \
             their frames",
            self.determined,
            self.determined + self.weak,
            significant(self.condition)
        )
    }

    fn noise_text(&self) -> (String, bool) {
        let is_large = self.noise_factor > LARGE_NOISE_FACTOR;
        let cause = if is_large {
            ": the model lacks something, as play, sag or heat, or the stated noise is wrong"
        } else {
            ""
        };
        let factor = significant(self.noise_factor);
        (format!("the residuals are {factor} times the stated noise{cause}"), is_large)
    }

    fn suspected_text(&self) -> String {
        let lines: Vec<_> = self.suspected_lines.iter().map(u64::to_string).collect();
        if lines.is_empty() {
            "none".into()
        } else {
            format!("line {} (they count little)", lines.join(", "))
        }
    }

    fn start_text(&self) -> (String, bool) {
        let is_same = self.second_start_difference < SAME_COST;
        let text = if is_same {
            "finds the same minimum"
        } else {
            "finds another minimum: record more poses, or state the true --tolerance"
        };
        (text.into(), !is_same)
    }
}

fn leg_values(nominal: &Geometry, found: &Calibration) -> [LegValues; LEGS] {
    let (values, change) = (found.geometry.values(), found.geometry.values() - nominal.values());
    let one = |of: &DVector<f64>, index: usize| of.get(index).copied().unwrap_or_default();
    let three = |of: &DVector<f64>, first: usize| [0, 1, 2].map(|axis| one(of, first + axis));
    let deviations = &found.deviations_m;
    core::array::from_fn(|leg| {
        let [base, platform, offset] = [3 * leg, JOINT_VALUES / 2 + 3 * leg, JOINT_VALUES + leg];
        LegValues {
            base_m: three(&values, base),
            base_change_m: three(&change, base),
            base_deviation_m: three(deviations, base),
            platform_m: three(&values, platform),
            platform_change_m: three(&change, platform),
            platform_deviation_m: three(deviations, platform),
            offset_m: one(&values, offset),
            offset_deviation_m: one(deviations, offset),
        }
    })
}

impl fmt::Display for CalibrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.machine, self.extent_text())?;
        for text in [self.directions_text(), self.noise_text().0] {
            write!(f, "{}", paragraph("", &text, MAX_WIDTH))?;
        }
        write!(f, "second start: {}\nsuspected rows: {}\n", self.start_text().0, self.suspected_text())?;
        let header = [
            ("errors of poses", Left),
            ("position RMS", Right),
            ("worst", Right),
            ("angle RMS", Right),
            ("worst", Right),
        ];
        let rows = [
            self.before.cells("over the workspace, drawing"),
            self.after.cells("over the workspace, calibrated (expected)"),
            self.rows_before.cells("lengths against tracker, drawing"),
            self.rows_after.cells("lengths against tracker, calibrated"),
            self.rows_left_out.cells("the same by the other rows"),
        ];
        writeln!(f, "\n{}", text_table(2, &header, rows))?;
        writeln!(
            f,
            "changes of the joints [mm], each with its standard deviation; (drawn): not determined better than half of --tolerance\n"
        )?;
        let header = ["joint", "x", "y", "z"].map(|name| (name, if name == "joint" { Left } else { Right }));
        let rows = self.legs.iter().zip(1..).flat_map(|(leg, number)| {
            let row = |name: String, change: &[f64; 3], deviation: &[f64; 3]| {
                let mut cells = vec![name];
                cells.extend(
                    change.iter().zip(deviation).map(|(change, deviation)| self.cell(*change, *deviation)),
                );
                cells
            };
            [
                row(format!("leg[{number}].base_m"), &leg.base_change_m, &leg.base_deviation_m),
                row(format!("leg[{number}].platform_m"), &leg.platform_change_m, &leg.platform_deviation_m),
            ]
        });
        writeln!(f, "{}", text_table(2, &header, rows))?;
        let [offset, deviation] = [|leg: &LegValues| leg.offset_m, |leg: &LegValues| leg.offset_deviation_m]
            .map(|of| self.legs.each_ref().map(of));
        write!(f, "{}", offset_text(&offset, Some(&deviation)))
    }
}

impl CalibrationReport {
    /// A change with its deviation \[mm\].
    fn cell(&self, change_m: f64, deviation_m: f64) -> String {
        let drawn = if deviation_m > DRAWN_RATIO * self.tolerance_m { " (drawn)" } else { "" };
        format!("{:+.4} +- {:.4}{drawn}", 1e3 * change_m, 1e3 * deviation_m)
    }
}

/// Offsets of the lengths as a table, and where they belong.
pub(super) fn offset_text(offset_m: &[f64; LEGS], deviation_m: Option<&[f64; LEGS]>) -> String {
    let row = |leg: usize| {
        let of = |numbers: &[f64; LEGS]| numbers.get(leg).map_or(f64::NAN, |x| 1e3 * x);
        let deviation = deviation_m.map_or("unknown".into(), |all| format!("{:.4}", of(all)));
        [format!("{}", leg + 1), format!("{:+.4}", of(offset_m)), deviation]
    };
    let header = [("leg", Right), ("offset [mm]", Right), ("deviation [mm]", Right)];
    format!(
        "{}\noffset: true less measured length; add it to the position that each drive takes at its home switch. The machine file has no \
         offsets: with other joints and these offsets missing, poses are wrong\n",
        text_table(2, &header, (0..LEGS).map(row))
    )
}
