//! Page of a calibration: residuals of each row, errors over the workspace, shifts of the joints.

use serde::Serialize;

use super::report::{CalibrationReport, RowReport};
use crate::commands::report::head::json;
use crate::commands::report::summary::{Fact, plain_text};
use crate::output::page::{PageKind, page};
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::{pose_of, task_coordinates};
use hexad_daemon::constants;
use hexad_machine::analysis::calibration::Calibration;
use hexad_machine::analysis::calibration::examination::{PoseErrors, pose_change};
use hexad_machine::analysis::calibration::model::Geometry;
use hexad_machine::analysis::target_motion::check_target;
use hexad_machine::config::Config;
use hexad_machine::text::numbers::AXES;

/// Cells along each side of a map.
const CELLS: usize = 25;
/// Planes of the maps through home, by axes of X.
const PLANES: [[usize; 2]; 3] = [[3, 4], [3, 5], [0, 1]];

/// Head of a page.
#[derive(Serialize)]
struct Head<'a> {
    name: &'a str,
    facts: Vec<Fact>,
    rows: &'a [RowReport],
    /// Places of the joints and their changes \[m\], on base and platform.
    joints: [Vec<[[f64; 3]; 2]>; 2],
    maps: Vec<Map>,
    // What all pages have: no samples.
    levels: [f64; 0],
    period_s: f64,
    length_s: f64,
}

/// Errors of positions over a plane through home.
#[derive(Serialize)]
struct Map {
    axes: [&'static str; 2],
    /// Lowest and highest coordinate of each axis.
    ranges: [[f64; 2]; 2],
    /// Row by row, the first axis first: of the drawing, and three deviations of the result \[m\]; none outside of the workspace.
    cells: Vec<Option<[f64; 2]>>,
}

/// Text of a page.
pub(super) fn text(
    config: &Config,
    report: &CalibrationReport,
    found: &Calibration,
    workspace: &[Pose],
) -> String {
    let legs = &report.legs;
    let facts = report.facts();
    let title = format!("{}: calibration", report.machine);
    let summary = plain_text(&title, &facts);
    let head = json(&Head {
        name: &report.machine,
        facts,
        rows: &report.poses,
        joints: [
            legs.iter().map(|leg| [leg.base_m, leg.base_change_m]).collect(),
            legs.iter().map(|leg| [leg.platform_m, leg.platform_change_m]).collect(),
        ],
        maps: PLANES.map(|plane| map(config, found, workspace, plane)).into(),
        levels: [],
        period_s: 1.0,
        length_s: 0.0,
    });
    page(PageKind::Calibration, &title, &summary, &head, &[])
}

/// Errors over a plane, as far as the workspace goes.
fn map(config: &Config, found: &Calibration, workspace: &[Pose], plane: [usize; 2]) -> Map {
    let (constants, nominal) = (constants(config), Geometry::of(&config.machine));
    let home = config.machine.home;
    let ranges = plane.map(|axis| {
        let at = |pose: &Pose| task_coordinates(pose, &home).get(axis).copied().unwrap_or_default();
        let (low, high) = workspace
            .iter()
            .map(at)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        [low, high]
    });
    let error = |index: usize| {
        let mut x = home;
        for ((axis, [low, high]), cell) in plane.into_iter().zip(ranges).zip([index % CELLS, index / CELLS]) {
            *x.get_mut(axis)? = low + (high - low) * (cell as f64 + 0.5) / CELLS as f64;
        }
        let pose = pose_of(&x);
        check_target(&constants, &pose).ok()?;
        let before = pose_change(&found.geometry, &nominal, &pose)?.fixed_rows::<3>(3).norm();
        let after = PoseErrors::expected(&found.geometry, &found.covariance, &[pose]);
        Some([before, after.position_worst_m])
    };
    Map {
        axes: plane.map(|axis| AXES.get(axis).copied().unwrap_or_default()),
        ranges,
        cells: (0..CELLS * CELLS).map(error).collect(),
    }
}
