//! The figure of the latencies: for each rate, idle and loaded, the share of wake-ups that came later than a
//! time, ours against cyclictest's. A curve further left and lower is better.

use std::path::Path;

use hexad::output::charts::Stroke;
use hexad::output::scatter::{Grid, Line, Sample, Scatter, Width};

use super::Failure;
use super::contest::Contestant;
use super::distribution::us;
use super::results::Row;
use super::rig::Release;

/// Of the time axis \[us\]: one look at the clock, which is what `hybrid` spins with, to a pause of the host.
const TIMES_US: std::ops::Range<f64> = 0.01..20e3;
/// One of all wake-ups, in the longest of usual runs.
const SHARES: std::ops::Range<f64> = 1e-6..1.0;

fn color(contestant: Contestant) -> usize {
    match contestant {
        Contestant::Cyclictest => 3,
        Contestant::Hexad(Release::Sleep) => 0,
        Contestant::Hexad(Release::Hybrid) => 2,
    }
}

/// Idle on the left, loaded on the right, a line for each rate.
pub fn write(path: &Path, rows: &[Row]) -> Result<(), Failure> {
    let groups: Vec<_> =
        rows.chunk_by(Row::compares_with).filter(|group| group.iter().all(|row| !row.seen)).collect();
    let titles: Vec<_> = groups.iter().map(|group| title(group)).collect();
    let last = groups.len().saturating_sub(2);
    let charts = groups.iter().zip(&titles).enumerate().map(|(index, (group, title))| Scatter {
        title,
        x_label: if index >= last { "wake-up latency [µs]" } else { "" },
        y_label: if index % 2 == 0 { "share of wake-ups later" } else { "" },
        x: TIMES_US,
        y: SHARES,
        points: vec![],
        lines: lines(group),
        legend: vec![],
    });
    let title = "Wake-up latency of the loop and of cyclictest, same processor, same run";
    Grid { title, legend: legend(), columns: 2, charts: charts.collect() }.write_svg(path)?;
    Ok(())
}

fn title(group: &[Row]) -> String {
    let Some(row) = group.first() else { return String::new() };
    let load = if row.loaded { "under stress-ng" } else { "idle" };
    match row.rate_hz {
        rate_hz if rate_hz < 1000 => format!("{rate_hz} Hz, {load}"),
        rate_hz => format!("{} kHz, {load}", rate_hz / 1000),
    }
}

fn lines(group: &[Row]) -> Vec<Line> {
    let limit = group.first().map(|row| us(row.late_ns()));
    let limit = limit.map(|limit| vec![(limit, SHARES.start), (limit, SHARES.end)]).unwrap_or_default();
    let mut lines = vec![Line { points: limit, style: Stroke::Dashed, color: 0, width: Width::Curve }];
    for row in group {
        let curve = row.pooled(|round| &round.wakeup).curve().into_iter();
        let points = curve.map(|(us, share)| (us.clamp(TIMES_US.start, TIMES_US.end), share)).collect();
        let color = color(row.contestant);
        lines.push(Line { points, style: Stroke::Solid, color, width: Width::Curve });
    }
    lines
}

fn legend() -> Vec<(Sample, &'static str)> {
    let curve = |contestant| Sample::Line(Stroke::Solid, Width::Curve, color(contestant));
    let contestants = Contestant::ALL.map(|contestant| (curve(contestant), contestant.name()));
    let limit = (Sample::Line(Stroke::Dashed, Width::Curve, 0), "late beyond this");
    contestants.into_iter().chain([limit]).collect()
}
