//! The figure: time of one evaluation against its largest error.
//!
//! One point per method: the mean time over the scenes and the worst error of the three machines, a disc for
//! the fast scenes and a ring for the slow ones, joined where they differ. The peers have their own scene.

use std::collections::BTreeMap;

use hexad::model::fidelity::Fidelity;
use hexad::output::charts::LineStyle;
use serde::Deserialize;

use super::methods::BASELINE;
use super::results::{FILE, PAPER};
use super::support::Failure;
use super::support::charts::Charts;
use super::support::log_axis::log_range;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width, pareto_front};

const HEXAD: usize = 0;
const DENSE: usize = 2;
const PEER: usize = 3;

/// A front goes down by at least this factor: one rounding error is as good as another.
const BETTER: f64 = 0.5;

/// Factors by which the time axis goes beyond the points: room for the names on both sides.
const NAMES_LEFT: f64 = 4.0;
const NAMES_RIGHT: f64 = 2.5;

/// What the chart needs of a row.
#[derive(Deserialize)]
struct Row {
    method: String,
    isa: String,
    scene: String,
    ns_median: f64,
    error_max_rel: f64,
}

/// What is drawn of one method.
struct Item {
    name: String,
    ns: f64,
    /// Largest errors.
    fast: f64,
    slow: Option<f64>,
    color: usize,
    side: Side,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Flag,
}

pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Row>(FILE)?;
    let rows = &figures.rows;
    let items = items(rows);
    let (mut points, mut lines) = (vec![], vec![]);
    let fast = pareto_front(items.iter().map(|item| (item.ns, item.fast)), BETTER);
    let slow = pareto_front(items.iter().filter_map(|item| Some((item.ns, item.slow?))), BETTER);
    lines.push(Line { points: fast, style: LineStyle::Solid, color: HEXAD, width: Width::Band });
    lines.push(Line { points: slow, style: LineStyle::Dashed, color: HEXAD, width: Width::Band });
    for item in &items {
        let label = match item.side {
            Side::Left => Label::Left(&item.name),
            Side::Flag => Label::Flag(&item.name),
        };
        let color = item.color;
        points.push(Point { at: (item.ns, item.fast), mark: Mark::Disc, color, label });
        // A ring on top of its disc says nothing.
        if let Some(slow) = item.slow.filter(|slow| *slow < 0.5 * item.fast) {
            points.push(Point { at: (item.ns, slow), mark: Mark::Ring, color, label: Label::None });
            let points = vec![(item.ns, item.fast), (item.ns, slow)];
            lines.push(Line { points, style: LineStyle::Solid, color, width: Width::Hair });
        }
    }
    let hexad_fast = format!("hexad on {}, fast scenes", written(best_isa(rows)));
    let legend = vec![
        (Sample::Mark(Mark::Disc, HEXAD), &*hexad_fast),
        (Sample::Mark(Mark::Ring, HEXAD), "slow scenes"),
        (Sample::Mark(Mark::Disc, PEER), "others, exact"),
        (Sample::Mark(Mark::Disc, DENSE), "the paper's dense matrices"),
        (Sample::Line(LineStyle::Solid, Width::Band, HEXAD), "Pareto front, fast"),
        (Sample::Line(LineStyle::Dashed, Width::Band, HEXAD), "Pareto front, slow"),
    ];
    let times = log_range(points.iter().map(|point| point.at.0));
    let errors = log_range(points.iter().map(|point| point.at.1));
    let drawn = vec![Scatter {
        title: "",
        x_label: "time of one evaluation, one core [ns]",
        y_label: "largest error of a force / largest force",
        x: times.start / NAMES_LEFT..times.end * NAMES_RIGHT,
        y: errors,
        points,
        lines,
    }];
    let title = figures.titled("Inverse dynamics of a hexapod: time and error of one evaluation");
    Grid { title: &title, legend, columns: 1, charts: drawn }
        .write_svg(&charts.path("speed_accuracy.svg"))?;
    Ok(())
}

/// Of hexad every fidelity on the best instruction set, and the exact model on all of them.
fn items(rows_of_all: &[Row]) -> Vec<Item> {
    let mut methods: BTreeMap<_, Vec<&Row>> = BTreeMap::new();
    for row in rows_of_all {
        methods.entry((&*row.method, &*row.isa)).or_default().push(row);
    }
    let mut items = vec![];
    for ((method, isa), rows) in methods {
        let fidelity = Fidelity::by_name(method).is_some();
        let exact = method == "exact";
        let best = best_isa(rows_of_all);
        if fidelity && isa != best && !exact {
            continue;
        }
        let peer = !fidelity && method != PAPER;
        // A peer has no machine but its own; hexad has errors on the other three.
        let worst = |scenes: &str| {
            let errors = rows.iter().filter(|row| row.scene.ends_with(scenes)).map(|row| row.error_max_rel);
            errors.reduce(f64::max)
        };
        let times = rows.iter().map(|row| row.ns_median);
        let (color, side) = match fidelity {
            true => {
                (HEXAD, if exact && [BASELINE, "sse4_2"].contains(&isa) { Side::Flag } else { Side::Left })
            }
            false => (if peer { PEER } else { DENSE }, Side::Flag),
        };
        let name = if exact { format!("exact, {}", written(isa)) } else { written(method) };
        items.push(Item {
            name,
            ns: times.sum::<f64>() / rows.len() as f64,
            fast: worst(if peer { "peers" } else { "_fast" }).unwrap_or(f64::NAN),
            slow: if peer { None } else { worst("_slow") },
            color,
            side,
        });
    }
    items
}

/// The best instruction set: the rows begin with it.
fn best_isa(rows: &[Row]) -> &str {
    rows.first().map_or("", |row| &row.isa)
}

/// As people write it.
pub fn written(name: &str) -> String {
    let known = [
        ("avx512", "AVX-512"),
        ("avx2", "AVX2"),
        ("sse4_2", "SSE4.2"),
        ("sse2", "SSE2"),
        ("neon", "NEON"),
        ("hand-lanes", "C++ by hand, lanes"),
        ("hand-scalar", "C++ by hand, scalar"),
        ("casadi-lu", "CasADi, fixed LU"),
        ("casadi-qr", "CasADi, QR"),
        ("pinocchio-typed", "Pinocchio, typed"),
        ("pinocchio-rnea", "Pinocchio, rnea"),
        ("mujoco-lean", "MuJoCo, lean"),
        ("mujoco-inverse", "MuJoCo, mj_inverse"),
        (PAPER, "dense form"),
    ];
    let found = known.iter().find(|(known, _)| *known == name);
    found.map_or_else(|| name.replace('-', " "), |(_, written)| (*written).into())
}
