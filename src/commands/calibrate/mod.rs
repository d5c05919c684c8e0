//! `hexad calibrate`: joints and zeros of the lengths from poses that a tracker has measured, and a new machine file with them.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector6;

use self::report::CalibrationReport;
use self::table::{poses_in_base, read_rows};
use super::failure::Failure;
use super::machine_file::{Estimate, NewNumbers, NewValue, changed_margins, difference, edited, write_new};
use super::orientation::{OrientationFormat, ROTATION_HELP};
use super::quantity::{angle_within, length_within};
use hexad_core::model::LEGS;
use hexad_core::model::rigid::Pose;
use hexad_daemon::constants;
use hexad_machine::analysis::calibration::model::{JOINT_VALUES, Noise};
use hexad_machine::analysis::calibration::plan::spread_poses;
use hexad_machine::analysis::calibration::{Calibration, Task, offsets};
use hexad_machine::analysis::target_motion::check_target;
use hexad_machine::config::Config;
use hexad_machine::text::csv_table::legs;
use hexad_machine::text::files::{print, print_json, write_whole};

mod page;
mod plan;
mod refusal;
mod report;
mod table;

/// Poses over which errors are predicted, their shares of the way to the edge of the workspace, and their seed.
const WORKSPACE_POSES: usize = 400;
const WORKSPACE_SHARES: [f64; 2] = [0.0, 0.95];
const WORKSPACE_SEED: u64 = 2;

#[derive(Debug, Args)]
pub struct CalibrateArguments {
    /// Machine file with the joints of the drawing (TOML)
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// CSV with a row for each pose at rest: length_1 ... length_6, and what the tracker has measured
    ///
    /// Of a probe on the platform x, y, z and alpha, beta, gamma (or qw, qx, qy, qz, see --rotation), or of three or more reflectors point_1_x,
    /// point_1_y, point_1_z, point_2_x and so on, empty where one was not seen; in the tracker's own frame. Units as in
    /// `hexad move --trajectory`: x_mm, point_1_x_mm. Other columns are ignored, so the output of `hexad goto --table` fits.
    #[arg(value_name = "POSES", required_unless_present = "plan")]
    poses: Option<PathBuf>,
    /// CSV with the columns of the tracker, row by row as in POSES
    #[arg(long, value_name = "FILE", requires = "poses")]
    tracker: Option<PathBuf>,
    #[arg(long, help = ROTATION_HELP, value_name = "ORDER", default_value = "xyz", value_parser = OrientationFormat::by_name())]
    rotation: OrientationFormat,
    /// Write so many poses that determine the joints best, as targets for `hexad goto --table`, to --output
    #[arg(long, value_name = "POSES", value_parser = clap::value_parser!(u16).range(7..=1000), requires = "output")]
    #[arg(conflicts_with_all = ["poses", "offsets_only", "page", "json"])]
    plan: Option<u16>,
    /// Find the offsets alone; x, y, z and the orientation are of the platform in the base frame
    #[arg(long, conflicts_with_all = ["output", "page", "tracker"])]
    offsets_only: bool,
    /// Standard deviation of each coordinate of a joint and of each offset by the drawing, with its unit
    #[arg(long, value_name = "LENGTH", default_value = "1mm", value_parser = deviation)]
    tolerance: f64,
    /// Standard deviation of a measured length
    #[arg(long, value_name = "LENGTH", default_value = "2um", value_parser = deviation)]
    length_noise: f64,
    /// Standard deviation of each coordinate of a place by the tracker
    #[arg(long, value_name = "LENGTH", default_value = "20um", value_parser = deviation)]
    tracker_noise: f64,
    /// Standard deviation of an orientation by the tracker, about each axis
    #[arg(long, value_name = "ANGLE", default_value = "20urad", value_parser = angle_deviation)]
    tracker_angle: f64,
    /// New machine file with the joints; with --plan the table of targets
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Page with charts: residuals of each row, errors over the workspace, shifts of the joints (HTML)
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

fn deviation(text: &str) -> Result<f64, String> {
    length_within(text, ["1nm", "100mm"])
}

fn angle_deviation(text: &str) -> Result<f64, String> {
    angle_within(text, ["0.001urad", "100mrad"])
}

impl CalibrateArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = Config::load(&self.config)?;
        match (&self.poses, self.plan, &self.output) {
            (None, Some(count), Some(path)) => self.write_plan(&config, usize::from(count), path),
            (Some(poses), ..) if self.offsets_only => self.find_offsets(&config, poses),
            (Some(poses), ..) => self.calibrate(&config, poses),
            _ => Err(Failure::before_start("no table of poses: give POSES, or --plan and --output")),
        }
    }

    fn noise(&self) -> Noise {
        Noise { length_m: self.length_noise, position_m: self.tracker_noise, angle_rad: self.tracker_angle }
    }

    fn calibrate(&self, config: &Config, poses: &Path) -> Result<(), Failure> {
        let (rows, lines) = read_rows(poses, self.tracker.as_deref(), self.rotation)?;
        let workspace = workspace(config, WORKSPACE_POSES, WORKSPACE_SHARES, WORKSPACE_SEED);
        let (machine, tolerance_m) = (&config.machine, self.tolerance);
        let task = Task { machine, rows: &rows, noise: self.noise(), tolerance_m, workspace: &workspace };
        let found = task.calibrate().map_err(|refused| refusal::failure(&refused, rows.len(), &task))?;
        let report = CalibrationReport::new(config, &task, &found, &lines);
        match self.json {
            true => print_json(&report)?,
            false => print(&report)?,
        }
        if let Some(path) = &self.page {
            write_whole(path, page::text(config, &report, &found, &workspace).as_bytes())?;
            if !self.json {
                print(format_args!("\npage with charts: {}\n", path.display()))?;
            }
        }
        let Some(path) = &self.output else { return Ok(()) };
        let new = edited(&config.text, &new_joints(&found))?;
        let changed = Config::parse(&new, "the new machine file")?;
        write_new(path, &new)?;
        if !self.json {
            let (lines, margins) =
                (difference(&config.text, &new), changed_margins(config, &changed).join("\n"));
            print(format_args!(
                "\n{lines}\nhexad check, before and after:\n\n{margins}\n\n{}: written; X of home stays, its lengths are new\n",
                path.display()
            ))?;
        }
        Ok(())
    }

    /// Offsets by poses in the base frame.
    fn find_offsets(&self, config: &Config, poses: &Path) -> Result<(), Failure> {
        let (rows, _) = read_rows(poses, None, self.rotation)?;
        let (offset_m, deviation_m) = offsets(&config.machine, &poses_in_base(&rows)?);
        if self.json {
            let value = serde_json::json!({ "offset_m": offset_m, "deviation_m": deviation_m });
            return Ok(print_json(&value)?);
        }
        Ok(print(report::offset_text(&offset_m, deviation_m.as_ref()))?)
    }
}

/// Poses within what the daemon permits.
fn workspace(config: &Config, count: usize, shares: [f64; 2], seed: u64) -> Vec<Pose> {
    let constants = constants(config);
    spread_poses(&config.machine, count, shares, seed, |pose| check_target(&constants, pose).is_ok())
}

/// The joints as values of a machine file.
fn new_joints(found: &Calibration) -> Vec<NewValue> {
    let deviations = &found.deviations_m;
    let joint = |key: &str, leg: usize, first: usize, place: nalgebra::Vector3<f64>| {
        let of_joint = place.iter().zip(deviations.iter().skip(first + 3 * leg));
        let estimate = |(value, deviation): (&f64, &f64)| Estimate { value: *value, deviation: *deviation };
        let value = NewNumbers::Array(of_joint.map(estimate).collect());
        NewValue { key: format!("leg[{}].{key}", leg + 1), value }
    };
    let geometry = &found.geometry;
    (0..LEGS)
        .flat_map(|leg| {
            [
                joint("base_m", leg, 0, geometry.base.column(leg).into()),
                joint("platform_m", leg, JOINT_VALUES / 2, geometry.platform.column(leg).into()),
            ]
        })
        .collect()
}

/// Names of the columns with lengths.
fn length_columns() -> Vec<String> {
    legs("length")
}

/// Six numbers as a vector.
fn vector(numbers: &[f64]) -> Vector6<f64> {
    Vector6::from_iterator(numbers.iter().copied().chain([0.0; LEGS]).take(LEGS))
}
