//! Verdict of the examination: whether the model explains the recorded forces, and what it lacks otherwise.

use core::fmt;

use serde::Serialize;

use hexad_machine::analysis::identification::{Cause, Examination, Finding};
use hexad_machine::text::text_table::{Left, MAX_WIDTH, Right, paragraph, text_table};

/// Causes that are named.
const NAMED: usize = 3;

/// Verdict.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Verdict {
    /// Whether the model holds.
    pub holds: bool,
    /// What it would lack, the most likely first.
    causes: Vec<Row>,
}

#[derive(Clone, Debug, Serialize)]
struct Row {
    #[serde(flatten)]
    finding: Finding,
    text: String,
    remedy: &'static str,
}

/// What a cause means, and what to do.
const fn words(cause: Cause) -> (&'static str, &'static str) {
    match cause {
        Cause::Gravity => ("direction of gravity", "level the base, or correct gravity_m_s2"),
        Cause::Joints => ("places of the joints", "calibrate leg.base_m, leg.platform_m"),
        Cause::LengthSensor => ("zero or scale of a length sensor", "home and calibrate the length sensors"),
        Cause::Elasticity => {
            ("base or legs that yield", "stiffen the base, tighten its bolts, use a gentler motion")
        }
        Cause::Stiction => ("friction near standstill", "record a faster motion: raise --amplitude"),
        Cause::Play => ("play between leg and length sensor", "remove the play"),
        Cause::LoosePayload => ("body that moves on the platform", "fasten payload and cables"),
        Cause::Drift => ("friction that changes with time", "warm the drives up, record again"),
        Cause::Delays => ("delays that differ between drives", "set all drives alike"),
        Cause::Leg(_) => ("", "look at its residuals (--page)"),
        Cause::Correlation => ("residuals that last", "look at them over time (--page)"),
    }
}

impl Verdict {
    pub fn new(examination: &Examination) -> Self {
        let row = |finding: &Finding| {
            let (text, remedy) = words(finding.cause);
            let text = match finding.cause {
                Cause::Leg(leg) => format!("leg {leg}: its length, speed or time"),
                _ => text.into(),
            };
            Row { finding: *finding, text, remedy }
        };
        Self { holds: examination.holds(), causes: examination.findings.iter().map(row).collect() }
    }

    /// One sentence.
    pub fn sentence(&self) -> String {
        let named: Vec<_> = self.causes.iter().take(NAMED).map(|row| row.text.as_str()).collect();
        match (self.holds, named.is_empty()) {
            (true, true) => "The residuals are noise: the model holds.".into(),
            (true, false) => format!(
                "The model holds, but for little that the deviations contain; it may be, the most likely first: {}.",
                named.join("; ")
            ),
            (false, _) => format!(
                "The model does not hold: residuals show what it lacks, the most likely first: {}. The deviations contain what these change.",
                named.join("; ")
            ),
        }
    }

    /// The most likely cause, and what to do.
    pub fn first(&self) -> (String, &'static str) {
        self.causes.first().map(|row| (row.text.clone(), row.remedy)).unwrap_or_default()
    }

    /// Comment for the beginning of a file.
    pub fn comment(&self) -> String {
        let text =
            format!("WARNING (hexad identify --force): {} First: {}.", self.sentence(), self.first().1);
        paragraph("", &text, MAX_WIDTH - 2).lines().map(|line| format!("# {line}\n")).collect()
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", paragraph("", &self.sentence(), MAX_WIDTH))?;
        if self.causes.is_empty() {
            return Ok(());
        }
        let header = [("cause", Left), ("explains", Right), ("significance", Right), ("remedy", Left)];
        let cells = |row: &Row| {
            let Finding { explained, significance, .. } = row.finding;
            [
                row.text.clone(),
                format!("{:.1} %", 1e2 * explained),
                format!("{significance:.1}"),
                row.remedy.into(),
            ]
        };
        write!(f, "\n{}", text_table(2, &header, self.causes.iter().map(cells)))
    }
}
