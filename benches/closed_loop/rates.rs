//! Tracking error against compute time: mode, model, rate.

use hexad::control::law::ControlMode;
use hexad::model::fidelity::Fidelity;
use hexad::output::charts::Stroke;
use hexad::output::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width};
use hexad::plant::imperfections::Imperfections;

use super::run::{Outcome, Run};
use super::{Failure, MODES, cells, chart, play, write_csv};

const MACHINES: [&str; 2] = ["fried2008", "motion_base"];
const RATES_HZ: [f64; 7] = [250.0, 500.0, 1e3, 2e3, 4e3, 10e3, 20e3];
/// Passes over the scene to time a cycle.
const PASSES: usize = 15;

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

pub fn run(quick: bool) -> Result<(), Failure> {
    let rates = if quick { &RATES_HZ[2..5] } else { &RATES_HZ[..] };
    let mut charts = vec![];
    let mut rows = vec![];
    let titles = MACHINES.map(|machine| format!("{machine}, fast scene"));
    for (machine, title) in MACHINES.into_iter().zip(&titles) {
        let methods = methods();
        let at = |method: &Method, rate_hz: f64| Run {
            machine,
            mode: method.mode,
            fidelity: method.fidelity,
            rate_hz,
            observer_hz: 0.0,
            imperfections: Imperfections::default(),
        };
        let steps: Vec<_> =
            methods.iter().map(|method| at(method, 1e3).step_ns(if quick { 1 } else { PASSES })).collect();
        let runs: Vec<_> =
            methods.iter().flat_map(|method| rates.iter().map(move |rate| at(method, *rate))).collect();
        let outcomes = play(machine, &runs);
        for ((run, outcome), index) in runs.iter().zip(&outcomes).zip(0..) {
            let method = &methods[index / rates.len()];
            let step_ns = steps[index / rates.len()];
            let model = if method.modelled { run.fidelity.name() } else { "none" };
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
        charts.push(draw(title, &methods, &steps, rates, &outcomes));
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
    write_csv("closed_loop_rates.csv", &header, &rows)?;
    let mut legend: Vec<_> =
        MODES.iter().enumerate().map(|(k, name)| (Sample::Mark(Mark::Disc, k), *name)).collect();
    legend.push((Sample::Mark(Mark::Ring, 0), "cheaper models"));
    let title = "Control without disturbance: RMS error against compute time, 250 Hz to 20 kHz";
    Grid { title, legend, columns: 2, charts }.write_svg(&chart("closed_loop_rates.svg"))?;
    Ok(())
}

/// A line per method, from the lowest rate to the highest.
fn draw<'a>(
    title: &'a str,
    methods: &[Method],
    steps: &[f64],
    rates: &[f64],
    outcomes: &[Outcome],
) -> Scatter<'a> {
    let (mut points, mut lines) = (vec![], vec![]);
    for ((method, step_ns), outcomes) in methods.iter().zip(steps).zip(outcomes.chunks(rates.len())) {
        let color = method.mode as usize;
        let line: Vec<_> = rates
            .iter()
            .zip(outcomes)
            .map(|(rate, outcome)| (1e-6 * step_ns * rate, outcome.rms_um()))
            .filter(|(_, rms)| rms.is_finite())
            .collect();
        let best = method.fidelity == Fidelity::Exact;
        let mark = if best { Mark::Disc } else { Mark::Ring };
        points.extend(line.iter().map(|at| Point { at: *at, mark, color, label: Label::None }));
        let width = if best { Width::Curve } else { Width::Hair };
        lines.push(Line { points: line, style: Stroke::Solid, color, width });
    }
    Scatter {
        title,
        x_label: "compute time per second of control [ms]",
        y_label: "RMS position error [µm]",
        x: 0.1..50.0,
        y: 1e-3..2e4,
        points,
        lines,
        legend: vec![],
    }
}
