//! The figure of the latencies: for each rate, idle and loaded, the share of wake-ups that came later than a
//! time, ours against cyclictest's. A curve further left and lower is better.

use hexad::output::charts::LineStyle;
use serde::Deserialize;

use super::contest::Contestant;
use super::distribution::us;
use super::results::{DISTRIBUTIONS, late_ns};
use super::rig::Release;
use super::support::Failure;
use super::support::charts::Charts;
use super::support::scatter::{Grid, Line, Sample, Scatter, Width, fit_ranges};

/// One look at the clock, which is what `hybrid` spins with: shorter times are drawn as this one \[us\].
const SHORTEST_US: f64 = 0.01;

/// A point of a curve.
#[derive(Deserialize)]
struct Figure {
    rate_hz: u32,
    load: String,
    contestant: String,
    latency_us: f64,
    share_later: f64,
}

fn color(contestant: Contestant) -> usize {
    match contestant {
        Contestant::Cyclictest => 3,
        Contestant::Hexad(Release::Sleep) => 0,
        Contestant::Hexad(Release::Hybrid) => 2,
    }
}

/// Idle on the left, loaded on the right, a line for each rate.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Figure>(DISTRIBUTIONS)?;
    let groups = figures.rows.chunk_by(|a, b| (a.rate_hz, &a.load) == (b.rate_hz, &b.load));
    let groups: Vec<_> = groups.collect();
    let titles: Vec<_> = groups.iter().map(|group| title(group)).collect();
    let last = groups.len().saturating_sub(2);
    let drawn = groups.iter().zip(&titles).enumerate().map(|(index, (group, title))| Scatter {
        title,
        x_label: if index >= last { "wake-up latency [µs]" } else { "" },
        y_label: if index % 2 == 0 { "share of wake-ups later" } else { "" },
        lines: curves(group),
        ..Scatter::default()
    });
    let mut drawn: Vec<_> = drawn.collect();
    fit_ranges(&mut drawn, true);
    let is_measured =
        |contestant: &Contestant| figures.rows.iter().any(|row| row.contestant == contestant.name());
    let measured: Vec<_> = Contestant::ALL.into_iter().filter(is_measured).collect();
    let title = figures.titled(if measured.contains(&Contestant::Cyclictest) {
        "Wake-up latency of the loop and of cyclictest, same processor, same run"
    } else {
        "Wake-up latency of the loop; cyclictest was not measured"
    });
    Grid { title: &title, legend: legend(&measured), columns: 2, charts: drawn }
        .write_svg(&charts.path("loop_latency.svg"))?;
    Ok(())
}

fn title(group: &[Figure]) -> String {
    let Some(row) = group.first() else { return String::new() };
    let load = if row.load == "idle" { "idle" } else { "under stress-ng" };
    match row.rate_hz {
        rate_hz if rate_hz < 1000 => format!("{rate_hz} Hz, {load}"),
        rate_hz => format!("{} kHz, {load}", rate_hz / 1000),
    }
}

fn curves(group: &[Figure]) -> Vec<Line> {
    let smallest = group.iter().map(|row| row.share_later).fold(1.0, f64::min);
    let limit = group.first().map(|row| us(late_ns(row.rate_hz)));
    let limit = limit.map(|limit| vec![(limit, smallest), (limit, 1.0)]).unwrap_or_default();
    let mut lines = vec![Line { points: limit, style: LineStyle::Dashed, color: 0, width: Width::Curve }];
    for contestant in Contestant::ALL {
        let rows = group.iter().filter(|row| row.contestant == contestant.name());
        let points = rows.map(|row| (row.latency_us.max(SHORTEST_US), row.share_later)).collect();
        lines.push(Line { points, style: LineStyle::Solid, color: color(contestant), width: Width::Curve });
    }
    lines
}

fn legend(contestants: &[Contestant]) -> Vec<(Sample, &'static str)> {
    let curve = |contestant| Sample::Line(LineStyle::Solid, Width::Curve, color(contestant));
    let curves = contestants.iter().map(|contestant| (curve(*contestant), contestant.name()));
    let limit = (Sample::Line(LineStyle::Dashed, Width::Curve, 0), "late beyond this");
    curves.chain([limit]).collect()
}
