//! Tracking error against what the model does not know: payload, friction, noise, dead time.

use hexad::control::law::ControlMode;
use hexad::model::fidelity::Fidelity;
use hexad::output::charts::LineStyle;
use hexad::plant::imperfections::Imperfections;
use serde::Deserialize;

use super::run::Run;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width, fit_ranges};
use super::{Charts, Failure, MODES, cells, play};

const FILE: &str = "closed_loop_disturbances.csv";
/// What a disturbance observer of 10 Hz, which the estimator has replaced, did for computed torque; measured rates, and setpoints
/// continued without jerk. Its code is gone: this file is not written again.
const OBSERVER_FILE: &str = "closed_loop_observer.csv";

const MACHINE: &str = "motion_base";
const RATE_HZ: f64 = 1e3;
/// Noise of a rate that comes from lengths with the noise of 1 m: of a filter at 100 Hz or so \[1/s\].
const RATE_NOISE: f64 = 300.0;

/// What grows along an axis.
struct Sweep {
    name: &'static str,
    x_label: &'static str,
    levels: &'static [f64],
    imperfect: fn(f64) -> Imperfections,
}

const SWEEPS: [Sweep; 4] = [
    Sweep {
        name: "payload_percent",
        x_label: "platform heavier than modelled [%]",
        levels: &[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 50.0],
        imperfect: payload,
    },
    Sweep {
        name: "friction_n",
        x_label: "Coulomb friction of a leg [N]",
        levels: &[0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0],
        imperfect: friction,
    },
    Sweep {
        name: "noise_um",
        x_label: "noise of the measured lengths [µm]",
        levels: &[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
        imperfect: noise,
    },
    Sweep {
        name: "dead_time_ms",
        x_label: "dead time of the drives [ms]",
        levels: &[0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0],
        imperfect: dead_time,
    },
];

fn payload(percent: f64) -> Imperfections {
    let body = hexad_support::deployed(MACHINE).machine.platform;
    let mut imperfections = Imperfections::default();
    imperfections.build.payload_kg = 0.01 * percent * body.mass_kg;
    imperfections.build.payload_at_m = body.center_of_mass_m;
    imperfections
}

fn friction(newtons: f64) -> Imperfections {
    let mut imperfections = Imperfections::default();
    imperfections.friction.coulomb_n = newtons;
    imperfections
}

fn noise(micrometres: f64) -> Imperfections {
    let mut imperfections = Imperfections { seed: 1, ..Imperfections::default() };
    imperfections.sensor.length_noise_m = 1e-6 * micrometres;
    imperfections.sensor.rate_noise_m_s = 1e-6 * micrometres * RATE_NOISE;
    imperfections
}

fn dead_time(milliseconds: f64) -> Imperfections {
    let mut imperfections = Imperfections::default();
    imperfections.drive.dead_time_ns = (1e6 * milliseconds) as u64;
    imperfections
}

/// Mode of each line, and whether disturbances are compensated.
fn variants() -> Vec<(ControlMode, bool)> {
    [false, true].into_iter().flat_map(|is| ControlMode::ALL.map(|mode| (mode, is))).collect()
}

pub fn run(charts: &Charts, quick: bool) -> Result<(), Failure> {
    let variants: Vec<_> = variants().into_iter().step_by(if quick { 3 } else { 1 }).collect();
    let mut rows = vec![];
    for sweep in &SWEEPS {
        let levels = if quick { &sweep.levels[..1] } else { sweep.levels };
        let run = |(mode, compensates): &(ControlMode, bool), level: f64| Run {
            machine: MACHINE,
            mode: *mode,
            fidelity: Fidelity::Exact,
            rate_hz: RATE_HZ,
            compensates: *compensates,
            imperfections: (sweep.imperfect)(level),
        };
        let runs: Vec<_> = variants
            .iter()
            .flat_map(|variant| levels.iter().map(move |level| run(variant, *level)))
            .collect();
        let outcomes = play(sweep.name, &runs);
        for ((run, outcome), level) in runs.iter().zip(&outcomes).zip(levels.iter().cycle()) {
            let lost = if outcome.rms_um().is_finite() { "" } else { outcome.lost.name() };
            let [rms, max] = [outcome.rms_um(), outcome.max_um()].map(|error| format!("{error:.4}"));
            rows.push(cells([&sweep.name, level, &run.mode.name(), &run.compensates, &rms, &max, &lost]));
        }
    }
    let header = ["what", "level", "mode", "compensates", "position_rms_um", "position_max_um", "lost"];
    charts.write_csv(FILE, &header, &rows)
}

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Figure {
    what: String,
    level: f64,
    mode: String,
    #[serde(default)]
    compensates: bool,
    position_rms_um: f64,
}

impl Figure {
    fn at(&self) -> (f64, f64) {
        (self.level, self.position_rms_um)
    }
}

pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(FILE)?;
    let observer = Charts::published().read::<Figure>(OBSERVER_FILE)?.rows;
    let sweeps = figures.rows.chunk_by(|a, b| a.what == b.what);
    let mut drawn: Vec<_> = sweeps.map(|rows| draw_sweep(rows, &observer)).collect();
    fit_ranges(&mut drawn, false);
    let mut legend: Vec<_> =
        MODES.iter().enumerate().map(|(k, name)| (Sample::Mark(Mark::Disc, k), *name)).collect();
    legend.push((Sample::Mark(Mark::Ring, 0), "disturbances compensated"));
    legend.push((Sample::Line(LineStyle::Dashed, Width::Curve, 0), "observer of 10 Hz, replaced"));
    let title = figures.titled("What control a scene needs: motion base, fast scene, 1 kHz");
    Grid { title: &title, legend, columns: 2, charts: drawn }
        .write_svg(&charts.path("closed_loop_disturbances.svg"))?;
    Ok(())
}

/// A line per mode, with and without compensation, and that of the observer; where control is lost, it ends.
fn draw_sweep(rows: &[Figure], observer: &[Figure]) -> Scatter<'static> {
    let (mut points, mut lines) = (vec![], vec![]);
    for variant in rows.chunk_by(|a, b| (&a.mode, a.compensates) == (&b.mode, b.compensates)) {
        let color = ControlMode::ALL.iter().position(|mode| mode.name() == variant[0].mode).unwrap();
        let line: Vec<_> = variant.iter().map(Figure::at).take_while(|(_, rms)| rms.is_finite()).collect();
        let observed = variant[0].compensates;
        let mark = if observed { Mark::Ring } else { Mark::Disc };
        points.extend(line.iter().map(|at| Point { at: *at, mark, color, label: Label::None }));
        let width = if observed { Width::Hair } else { Width::Curve };
        lines.push(Line { points: line, style: LineStyle::Solid, color, width });
    }
    let before = observer.iter().filter(|row| row.what == rows[0].what).map(Figure::at);
    lines.push(Line {
        points: before.take_while(|(_, rms)| rms.is_finite()).collect(),
        style: LineStyle::Dashed,
        color: 0,
        width: Width::Curve,
    });
    let sweep = SWEEPS.iter().find(|sweep| sweep.name == rows[0].what).unwrap();
    Scatter {
        x_label: sweep.x_label,
        y_label: "RMS position error [µm]",
        points,
        lines,
        ..Scatter::default()
    }
}
