//! Tracking error against compute time: mode, model, rate.

use hexad::control::law::ControlMode;
use hexad::model::fidelity::Fidelity;
use hexad::output::charts::LineStyle;
use hexad::plant::imperfections::Imperfections;
use serde::Deserialize;

use super::run::Run;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width, fit_ranges};
use super::{Charts, Failure, MODES, cells, play};

const FILE: &str = "closed_loop_rates.csv";

const MACHINES: [&str; 2] = ["fried2008", "motion_base"];
const RATES_HZ: [f64; 7] = [250.0, 500.0, 1e3, 2e3, 4e3, 10e3, 20e3];
/// Passes over the scene to time a cycle.
const PASSES: usize = 15;

/// In the place of the model of a mode that evaluates none.
const NO_MODEL: &str = "none";

/// A law with its model: a line of the chart.
struct Method {
    mode: ControlMode,
    fidelity: Fidelity,
    /// Whether the mode evaluates a fidelity at all.
    modelled: bool,
}

fn methods() -> Vec<Method> {
    let mut methods = vec![];
    for mode in ControlMode::ALL {
        let modelled = matches!(mode, ControlMode::ComputedTorque | ControlMode::FeedforwardJointPd);
        let fidelities = Fidelity::ALL.into_iter().rev().filter(|fidelity| fidelity.has_inertia());
        let fidelities = fidelities.take(if modelled { usize::MAX } else { 1 });
        methods.extend(fidelities.map(|fidelity| Method { mode, fidelity, modelled }));
    }
    methods
}

pub fn run(charts: &Charts, quick: bool) -> Result<(), Failure> {
    let (machines, rates, passes) =
        if quick { (&MACHINES[..1], &RATES_HZ[2..3], 1) } else { (&MACHINES[..], &RATES_HZ[..], PASSES) };
    let mut rows = vec![];
    for machine in machines {
        let methods = methods();
        let at = |method: &Method, rate_hz: f64| Run {
            machine,
            mode: method.mode,
            fidelity: method.fidelity,
            rate_hz,
            compensates: true,
            imperfections: Imperfections::default(),
        };
        let steps: Vec<_> = methods.iter().map(|method| at(method, 1e3).step_ns(passes)).collect();
        let runs: Vec<_> =
            methods.iter().flat_map(|method| rates.iter().map(move |rate| at(method, *rate))).collect();
        let outcomes = play(machine, &runs);
        for ((run, outcome), index) in runs.iter().zip(&outcomes).zip(0..) {
            let method = &methods[index / rates.len()];
            let step_ns = steps[index / rates.len()];
            let model = if method.modelled { run.fidelity.name() } else { NO_MODEL };
            let numbers = [
                format!("{:.0}", run.rate_hz),
                format!("{step_ns:.0}"),
                format!("{:.4}", outcome.rms_um()),
                format!("{:.4}", outcome.max_um()),
                format!("{:.4}", 1e6 * outcome.orientation.rms()),
                format!("{:.4}", 1e6 * outcome.orientation.max),
            ];
            let [rate, ns, rms, max, turn_rms, turn_max] = &numbers;
            rows.push(cells([&machine, &method.mode.name(), &model, rate, ns, rms, max, turn_rms, turn_max]));
            if run.rate_hz == 1e3 {
                println!(
                    "{machine:<12}{:<22}{model:<16}{ns:>7} ns  RMS {rms:>12} um  max {max:>12} um",
                    method.mode.name()
                );
            }
        }
    }
    let header = [
        "machine",
        "mode",
        "model",
        "rate_hz",
        "step_ns",
        "position_rms_um",
        "position_max_um",
        "orientation_rms_urad",
        "orientation_max_urad",
    ];
    charts.write_csv(FILE, &header, &rows)
}

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Figure {
    machine: String,
    mode: String,
    model: String,
    rate_hz: f64,
    step_ns: f64,
    position_rms_um: f64,
}

/// A line per method, from the lowest rate to the highest.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let machines: Vec<_> = figures.rows.chunk_by(|a, b| a.machine == b.machine).collect();
    let titles: Vec<_> = machines.iter().map(|rows| format!("{}, fast scene", rows[0].machine)).collect();
    let mut drawn: Vec<_> =
        machines.iter().zip(&titles).map(|(rows, title)| draw_machine(title, rows)).collect();
    fit_ranges(&mut drawn, true);
    let mut legend: Vec<_> =
        MODES.iter().enumerate().map(|(k, name)| (Sample::Mark(Mark::Disc, k), *name)).collect();
    legend.push((Sample::Mark(Mark::Ring, 0), "cheaper models"));
    let title = "Control without disturbance: RMS error against compute time, 250 Hz to 20 kHz";
    Grid { title: &figures.titled(title), legend, columns: 2, charts: drawn }
        .write_svg(&charts.path("closed_loop_rates.svg"))?;
    Ok(())
}

fn draw_machine<'a>(title: &'a str, rows: &[Figure]) -> Scatter<'a> {
    let (mut points, mut lines) = (vec![], vec![]);
    for method in rows.chunk_by(|a, b| (&a.mode, &a.model) == (&b.mode, &b.model)) {
        let color = ControlMode::ALL.iter().position(|mode| mode.name() == method[0].mode).unwrap();
        let at = |row: &Figure| (1e-6 * row.step_ns * row.rate_hz, row.position_rms_um);
        let line: Vec<_> = method.iter().map(at).filter(|(_, rms)| rms.is_finite()).collect();
        let best = [Fidelity::Exact.name(), NO_MODEL].contains(&&*method[0].model);
        let mark = if best { Mark::Disc } else { Mark::Ring };
        points.extend(line.iter().map(|at| Point { at: *at, mark, color, label: Label::None }));
        let width = if best { Width::Curve } else { Width::Hair };
        lines.push(Line { points: line, style: LineStyle::Solid, color, width });
    }
    Scatter {
        title,
        x_label: "compute time per second of control [ms]",
        y_label: "RMS position error [µm]",
        points,
        lines,
        ..Scatter::default()
    }
}
