//! What was measured: as a file, and as a table of ratios.

use super::peers::{Errors, PEERS};
use super::scenes::Pace;
use super::support::Failure;
use super::support::charts::Charts;
use super::timing::Samples;

pub const FILE: &str = "speed_accuracy.csv";

/// The dense form's name.
pub const PAPER: &str = "paper-dense";

/// One method on one scene.
pub struct Row {
    pub method: &'static str,
    pub isa: &'static str,
    pub scene: String,
    pub pace: Pace,
    pub samples: Samples,
    pub errors: Errors,
}

impl Row {
    /// hexad with every term.
    pub fn is_exact(&self) -> bool {
        self.method == "exact"
    }
}

/// `method, isa, scene, ns_median, ns_latency, error_max_rel, error_rms_rel`
pub fn write_csv(charts: &Charts, rows: &[Row]) -> Result<(), Failure> {
    let header = ["method", "isa", "scene", "ns_median", "ns_latency", "error_max_rel", "error_rms_rel"];
    let records = rows.iter().map(|row| {
        let Errors { max, rms } = row.errors;
        let [method, isa, scene] = [row.method, row.isa, &row.scene].map(String::from);
        let times = [row.samples.throughput(), row.samples.latency()].map(|ns| format!("{ns:.1}"));
        let errors = [max, rms].map(|error| format!("{error:.2e}"));
        [method, isa, scene].into_iter().chain(times).chain(errors)
    });
    charts.write_csv(FILE, &header, records)
}

/// How many times longer the peers take than the exact model on the same inputs.
pub fn print_ratios(rows: &[Row]) {
    let mut at_peers = rows.iter().filter(|row| row.pace == Pace::Peers);
    // The best instruction set comes first.
    let Some(exact) = at_peers.find(|row| row.is_exact()) else { return };
    println!("\nThe peers' machine and inputs, exact model; hexad on {}:", exact.isa);
    println!(
        "{:<26}{:>10}{:>9}{:>10}{:>9}{:>8}{:>12}",
        "", "ns", "ratio", "fenced", "ratio", "goal", "max error"
    );
    let others = |row: &&Row| PEERS.iter().any(|peer| peer.name == row.method) || row.is_exact();
    for row in rows.iter().filter(|row| row.pace == Pace::Peers).filter(others) {
        let name = if row.is_exact() { format!("hexad {}", row.isa) } else { row.method.into() };
        let goal = PEERS.iter().find(|peer| peer.name == row.method).and_then(|peer| peer.goal);
        let (ns, fenced) = (row.samples.throughput(), row.samples.latency());
        println!(
            "{name:<26}{ns:>10.1}{:>9.2}{fenced:>10.1}{:>9.2}{:>8}{:>12.1e}",
            ns / exact.samples.throughput(),
            fenced / exact.samples.latency(),
            goal.map_or(String::new(), |goal| format!("{goal:.1}")),
            row.errors.max,
        );
    }
}
