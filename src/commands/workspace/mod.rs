//! `hexad workspace`: maps of the reachable poses and their quality, and the largest regions around home
//! without obstacle.

use core::fmt;
use std::fs::create_dir_all;
use std::path::{Path, PathBuf};

use clap::Args;

use self::map::MapDrawing;
use self::report::{BoxRange, SCHEMA, SliceReport, WorkspaceReport, region_reports};
use self::slice::{Plane, Slice};
use super::arguments::{CONE_HELP, MachineFile, cone, number_within};
use super::failure::{CommandError, Failure};
use super::progress::item_bar;
use super::quantity::{angle, angle_within, length, list};
use crate::output::svg::ChartError;
use hexad_core::control::constants::{MAX_HOLDING_SHARE, max_reference_condition};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::clearance::{Clearance, WorkspaceLimit};
use hexad_machine::analysis::envelope::EnvelopeBounds;
use hexad_machine::analysis::other_pose_search::OtherPoseSearch;
use hexad_machine::analysis::pose_quality::{AccelerationDemand, PoseEvaluator};
use hexad_machine::analysis::reachable_envelope;
use hexad_machine::analysis::region_search::{MAX_CELLS, RegionBounds, largest_region};
use hexad_machine::analysis::region_shape::RegionShape;
use hexad_machine::config::Config;
use hexad_machine::text::files::{FileError, print, print_json};
use hexad_machine::text::numbers::significant;

mod bands;
mod contour;
mod map;
mod map_content;
mod report;
pub mod slice;

/// Rest poses that are searched for other permitted poses: about a second.
const SEARCHED_POSES: usize = 1000;

#[derive(Debug, Args)]
pub struct WorkspaceArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    query: WorkspaceQuery,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub struct WorkspaceQuery {
    /// Two of alpha, beta, gamma, x, y, z, as in x-z; may be given more than once [default: horizontal, vertical, tilt]
    #[arg(long = "plane", value_name = "PLANE")]
    planes: Vec<Plane>,
    /// The pose all slices go through, alpha,beta,gamma,x,y,z with their units, as in 0,0,5deg,0,0,1.25m [default: home]
    #[arg(long, value_name = "POSE", value_parser = pose, allow_hyphen_values = true)]
    through: Option<[f64; 6]>,
    /// Poses along each axis of a slice
    #[arg(long, value_name = "POSES", default_value_t = 121, value_parser = resolution, allow_negative_numbers = true)]
    resolution: usize,
    /// Acceleration for the forces, in any direction [default: that of [limits]]
    #[arg(long, value_name = "A", value_parser = acceleration, allow_negative_numbers = true)]
    acceleration_m_s2: Option<f64>,
    /// Angular acceleration for the forces, about any axis [default: that of [limits]]
    #[arg(long, value_name = "A", value_parser = acceleration, allow_negative_numbers = true)]
    angular_acceleration_rad_s2: Option<f64>,
    /// Turn about any axis that the second ball allows, with its unit
    #[arg(long, value_name = "ANGLE", default_value = "10deg", value_parser = turn, allow_hyphen_values = true)]
    turn: f64,
    #[arg(long, help = CONE_HELP, value_name = "ANGLE", value_parser = cone, allow_hyphen_values = true)]
    gravity_cone: Option<f64>,
    /// Folder for the maps and their tables
    #[arg(long, value_name = "FOLDER", default_value = "hexad-workspace")]
    output: PathBuf,
}

impl WorkspaceArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let report = WorkspaceReport::new(&self.machine.load()?, &self.query)?;
        if self.json {
            print_json(&report)?
        } else {
            print(report)?
        }
        Ok(())
    }
}

/// Acceleration \[m/s^2\] or \[rad/s^2\].
fn acceleration(text: &str) -> Result<f64, String> {
    number_within(text, 0.0..=1e6, "")
}

/// Turn of a platform that remains upright \[rad\].
fn turn(text: &str) -> Result<f64, String> {
    angle_within(text, ["0deg", "90deg"])
}

/// Number of poses along an axis: enough for a picture, few enough for memory.
fn resolution(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (11..=1001).contains(&count) => Ok(count),
        _ => Err("must be an integer in [11, 1001]".into()),
    }
}

/// X of a pose.
fn pose(text: &str) -> Result<[f64; 6], String> {
    list(text, [angle, angle, angle, length, length, length], "0,0,5deg,0,0,1.25m")
}

/// Error that prevents the maps.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Chart(#[from] ChartError),
    #[error("--through {x:?} [rad, m]: must be a pose the platform can take: {obstacle}")]
    Through { x: [f64; 6], obstacle: ObstacleText },
}

impl CommandError for WorkspaceError {}

impl WorkspaceReport {
    /// Evaluates the slices, searches the regions, writes the files.
    pub fn new(config: &Config, query: &WorkspaceQuery) -> Result<Self, WorkspaceError> {
        let Config { name, machine, deployment, .. } = config;
        let reachable = machine.with_stroke_margin(deployment.limits.stroke_margin_m);
        let home = KinematicState::new(machine, machine.home_pose());
        let largest_condition = max_reference_condition(&home, deployment.limits.condition);
        let clearance =
            Clearance::new(&reachable, largest_condition).in_cone(query.gravity_cone.unwrap_or(0.0));
        let through = query.through.unwrap_or(machine.home);
        if let Some(obstacle) = clearance.violation_at(&TaskState::at_rest(through).motion().pose) {
            let obstacle = ObstacleText { obstacle, largest_condition };
            return Err(WorkspaceError::Through { x: through, obstacle });
        }
        let limits = &deployment.limits.reference;
        let effort = AccelerationDemand {
            linear_m_s2: query.acceleration_m_s2.unwrap_or(limits.position.acceleration),
            angular_rad_s2: query.angular_acceleration_rad_s2.unwrap_or(limits.orientation.acceleration),
        };
        let slices = slices(machine, &clearance, effort, query, through);
        let envelope = deployment.envelope.filter(has_extent);
        let shape = envelope.unwrap_or_else(|| reachable_envelope::nominal_bounds(machine));
        let regions = regions(&reachable, &clearance, query.turn, &shape);
        let [ball, ..] = &regions;
        let drawing = MapDrawing { name, machine, largest_condition, ball: ball.guaranteed };
        let gravity_cone =
            query.gravity_cone.map(|angle| report::cone_holding(machine, &clearance, angle, &slices));
        let files = write(&drawing, &slices, &query.output)?;
        let slices = slices.iter().map(|slice| SliceReport::new(slice, &clearance)).collect();
        let report = Self {
            schema: SCHEMA,
            machine: name.clone(),
            acceleration_m_s2: effort.linear_m_s2,
            angular_acceleration_rad_s2: effort.angular_rad_s2,
            condition_limit: largest_condition,
            max_force_n: machine.actuator.weakest_available_force_n(),
            gravity_cone,
            slices,
            regions: region_reports(regions, query.turn.to_degrees(), envelope.is_some(), largest_condition),
            largest_box: BoxRange::all(&shape, regions[2].guaranteed),
            other_pose_search: OtherPoseSearch::new(machine, &clearance, SEARCHED_POSES),
            hint: None,
            files,
        };
        Ok(Self { hint: report.no_payload_reason(machine), ..report })
    }
}

fn slices(
    machine: &Machine,
    clearance: &Clearance,
    effort: AccelerationDemand,
    query: &WorkspaceQuery,
    through: [f64; 6],
) -> Vec<Slice> {
    let workspace = PoseEvaluator::new(machine, effort).in_cone(query.gravity_cone.unwrap_or(0.0));
    let default = Plane::default_three(&machine.gravity_m_s2);
    let planes = if query.planes.is_empty() { &default[..] } else { &query.planes };
    let bar = item_bar(planes.len() * query.resolution * query.resolution, "poses");
    let slice = |plane: &Plane| {
        let slice = Slice::new(&workspace, machine, *plane, through, query.resolution, &bar);
        slice.with_other_poses(machine, clearance)
    };
    let slices = planes.iter().map(slice).collect();
    bar.finish_and_clear();
    slices
}

fn regions(
    machine: &Machine,
    clearance: &Clearance,
    turn_rad: f64,
    shape: &EnvelopeBounds,
) -> [RegionBounds; 3] {
    let shapes = [
        RegionShape::Ball { turn_rad: 0.0 },
        RegionShape::Ball { turn_rad },
        RegionShape::Box { low: shape.pose_min, high: shape.pose_max },
    ];
    // Each ball takes two searches, the box one.
    let bar = item_bar(5 * MAX_CELLS as usize, "cells");
    let regions = shapes.map(|shape| largest_region(machine, clearance, &shape, &bar));
    bar.finish_and_clear();
    regions
}

fn write(drawing: &MapDrawing, slices: &[Slice], folder: &Path) -> Result<Vec<PathBuf>, WorkspaceError> {
    create_dir_all(folder).map_err(FileError::on(folder))?;
    let mut written = vec![];
    for slice in slices {
        let [csv, svg] = ["csv", "svg"].map(|extension| folder.join(slice.file_name(extension)));
        slice.save(&csv)?;
        drawing.write_svg(&svg, slice)?;
        written.extend([csv, svg]);
    }
    Ok(written)
}

fn has_extent(limits: &EnvelopeBounds) -> bool {
    limits.pose_min.iter().chain(&limits.pose_max).any(|x| *x != 0.0)
}

/// Text of a workspace limit, with the largest condition number.
#[derive(Debug)]
pub struct ObstacleText {
    obstacle: WorkspaceLimit,
    largest_condition: f64,
}

impl fmt::Display for ObstacleText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.obstacle {
            WorkspaceLimit::LegTooShort(leg) => write!(f, "leg {} is too short", leg + 1),
            WorkspaceLimit::LegTooLong(leg) => write!(f, "leg {} is too long", leg + 1),
            WorkspaceLimit::Singular => write!(f, "it is across a singular pose"),
            WorkspaceLimit::UniversalJoint => {
                write!(f, "a leg is too near to the first axis of its universal joint")
            }
            WorkspaceLimit::HoldingForce(leg) => write!(
                f,
                "leg {} needs more than {:.0} % of actuator.max_force_n to hold the platform",
                leg + 1,
                100.0 * MAX_HOLDING_SHARE
            ),
            WorkspaceLimit::Condition => {
                write!(f, "the condition is beyond {}", significant(self.largest_condition))
            }
        }
    }
}
