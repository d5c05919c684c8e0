//! `hexad calibrate --plan`: poses that determine the joints best, as targets of `hexad goto --table`.

use std::path::Path;

use super::{CalibrateArguments, workspace};
use crate::commands::failure::Failure;
use hexad_core::control::constants::Constants;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::task_coordinates;
use hexad_daemon::constants;
use hexad_machine::analysis::calibration::plan::plan;
use hexad_machine::analysis::target_motion::target_motion;
use hexad_machine::config::Config;
use hexad_machine::text::csv_table::coordinates;
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::files::{is_standard, print};

/// Poses from which a plan chooses, their shares of the way to the edge of the workspace, and their seed.
const CANDIDATES: usize = 400;
const CANDIDATE_SHARES: [f64; 2] = [0.85, 0.97];
const CANDIDATE_SEED: u64 = 1;

impl CalibrateArguments {
    /// Writes the table of targets.
    pub(super) fn write_plan(&self, config: &Config, count: usize, path: &Path) -> Result<(), Failure> {
        let (constants, home) = (constants(config), config.machine.home_pose());
        let mut candidates = workspace(config, CANDIDATES, CANDIDATE_SHARES, CANDIDATE_SEED);
        let chosen = loop {
            let chosen = plan(&config.machine, &candidates, count, &self.noise(), self.tolerance);
            let chosen: Vec<_> = chosen.iter().filter_map(|index| candidates.get(*index).copied()).collect();
            let is_barred =
                |pose: &&Pose| !has_way(&constants, &home, pose) || !has_way(&constants, pose, &home);
            let barred: Vec<_> = chosen.iter().filter(is_barred).collect();
            if barred.is_empty() {
                break chosen;
            }
            candidates.retain(|pose| !barred.contains(&pose));
        };
        if chosen.len() < count {
            return Err(Failure::after_start(format_args!(
                "{} poses at the edge of the workspace have a direct way home, must be {count}; state fewer, or a larger [envelope]",
                chosen.len()
            )));
        }
        let (poses, via) = route(config, &constants, chosen);
        let mut table = CsvWriter::new(&coordinates(""));
        poses.iter().for_each(|pose| table.row(task_coordinates(pose, &config.machine.home)));
        table.save(path).map_err(Failure::before_start)?;
        if is_standard(path) {
            return Ok(());
        }
        let by_home = if via > 0 {
            format!(" and {via} at home, where the direct way is barred")
        } else {
            String::new()
        };
        Ok(print(format_args!(
            "{}: {count} poses{by_home}; next: hexad goto --config {} --table {} --output VISITED.csv --engage\n",
            path.display(),
            self.config.display(),
            path.display()
        ))?)
    }
}

/// The poses in an order with short ways, with home between those that have no direct way, and how often that is.
fn route(config: &Config, constants: &Constants, mut rest: Vec<Pose>) -> (Vec<Pose>, usize) {
    let (joints, home) = (&config.machine.joints, config.machine.home_pose());
    let (mut here, mut route, mut via) = (home, vec![], 0);
    while !rest.is_empty() {
        let distances = rest.iter().map(|pose| joints.distance(&here, pose)).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index);
        let next = rest.swap_remove(nearest);
        if joints.distance(&here, &next) > 0.0
            && target_motion(constants, &here, &next, 1.0, |_, _| true).is_err()
        {
            route.push(home);
            via += 1;
        }
        route.push(next);
        here = next;
    }
    (route, via)
}

/// Whether the reference goes directly from one pose to another.
fn has_way(constants: &Constants, from: &Pose, to: &Pose) -> bool {
    target_motion(constants, from, to, 1.0, |_, _| true).is_ok()
}
