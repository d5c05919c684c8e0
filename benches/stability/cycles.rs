//! What it costs to make one step of Newton's method per cycle, from the pose of the cycle before.

use hexad::model::inverse_geometry::leg_lengths;
use hexad::motion::built_in::{BuiltInMotion, fit};
use hexad::output::charts::{LineStyle, Panel, Series, write_svg};

use super::speed::newton;
use super::support::provenance;
use super::{Charts, Failure, MACHINES, cells};

const RATES_HZ: [f64; 2] = [1000.0, 250.0];
/// Length of the motion \[s\].
const SECONDS: f64 = 4.0;

pub fn run(charts: &Charts) -> Result<(), Failure> {
    let (mut rows, mut lines) = (vec![], vec![]);
    for name in MACHINES {
        let machine = hexad_support::machine(name);
        let scene = fit(&machine, BuiltInMotion::Sines, SECONDS);
        for rate_hz in RATES_HZ {
            let mut estimate = scene.at(0.0).motion().pose;
            let (mut worst, mut squares, mut points) = (0.0_f64, 0.0, vec![]);
            let cycles = (SECONDS * rate_hz) as u32;
            for k in 1..=cycles {
                let t = f64::from(k) / rate_hz;
                let there = scene.at(t).motion().pose;
                estimate = newton(&machine, &estimate, &leg_lengths(&machine, &there), 1);
                let error = (estimate.position - there.position).norm();
                worst = worst.max(error);
                squares += error * error;
                points.push((t, 1e6 * error));
            }
            let rms = (squares / f64::from(cycles)).sqrt();
            println!("{name}, one step per cycle at {rate_hz} Hz: {rms:.1e} m RMS, {worst:.1e} m at most");
            rows.push(cells([&name, &rate_hz, &format!("{rms:.3e}"), &format!("{worst:.3e}")]));
            lines.push(points);
        }
    }
    let header = ["machine", "rate_hz", "position_rms_m", "position_max_m"];
    charts.write_csv("stability_one_step.csv", &header, &rows)?;
    let labels = RATES_HZ.map(|rate_hz| format!("{rate_hz} Hz"));
    let y_labels = MACHINES.map(|name| format!("{name} [µm]"));
    let panels = lines.chunks(RATES_HZ.len()).zip(&y_labels).map(|(of_machine, y_label)| Panel {
        y_label,
        series: of_machine
            .iter()
            .zip(&labels)
            .enumerate()
            .map(|(color, (points, label))| Series { label, points, style: LineStyle::Solid, color })
            .collect(),
    });
    let title = "Position error of one step of Newton's method per cycle, built-in sines";
    let title = format!("{title}\n{}", provenance());
    write_svg(&charts.path("stability_one_step.svg"), &title, "time [s]", &panels.collect::<Vec<_>>())?;
    Ok(())
}
