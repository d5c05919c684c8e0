//! `hexad workspace`: maps of the poses that the machine can reach and of their quality, and the largest regions
//! around home without obstacle.

use core::fmt;
use std::fs::create_dir_all;
use std::path::{Path, PathBuf};

use clap::Args;

use self::map::MapDrawing;
use self::slice::{Plane, Slice};
use super::arguments::{MachineFile, number_within};
use super::failure::{CommandError, Failure};
use super::progress::item_bar;
use crate::analysis::clearance::{Clearance, WorkspaceLimit};
use crate::analysis::envelope::EnvelopeBounds;
use crate::analysis::pose_quality::{AccelerationDemand, PoseEvaluator, PoseQuality};
use crate::analysis::reachable_envelope;
use crate::analysis::region_search::{MAX_CELLS, RegionBounds, largest_region};
use crate::analysis::region_shape::RegionShape;
use crate::config::Config;
use crate::model::machine::Machine;
use crate::model::task::TaskState;
use crate::output::files::{FileError, print};
use crate::output::numbers::{AXES, MAX_MAGNITUDE, axis_unit, significant};
use crate::output::svg::ChartError;
use crate::output::text_table::{Left, Right, text_table};

mod bands;
mod contour;
mod map;
mod map_content;
pub mod slice;

#[derive(Debug, Args)]
pub struct WorkspaceArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    query: WorkspaceQuery,
}

#[derive(Debug, Args)]
pub struct WorkspaceQuery {
    /// Two of alpha, beta, gamma, x, y, z, as in x-z; may be given more than once [default: horizontal, vertical, tilt]
    #[arg(long = "plane", value_name = "PLANE")]
    planes: Vec<Plane>,
    /// The pose all slices go through, alpha,beta,gamma,x,y,z [rad, m] [default: home]
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
    /// Turn about any axis that the second ball allows [deg]
    #[arg(long, value_name = "DEG", default_value_t = 10.0, value_parser = turn_deg, allow_negative_numbers = true)]
    turn_deg: f64,
    /// Folder for the maps and their tables
    #[arg(long, value_name = "FOLDER", default_value = "hexad-workspace")]
    output: PathBuf,
}

impl WorkspaceArguments {
    pub fn execute(self) -> Result<(), Failure> {
        Ok(print(WorkspaceMap::new(&self.machine.load()?, &self.query)?)?)
    }
}

/// Acceleration \[m/s^2\] or \[rad/s^2\].
fn acceleration(text: &str) -> Result<f64, String> {
    number_within(text, 0.0..=1e6, "")
}

/// Turn of a platform that is still the right way up \[deg\].
fn turn_deg(text: &str) -> Result<f64, String> {
    number_within(text, 0.0..=90.0, " deg")
}

/// Poses along an axis: enough for a picture, few enough for memory.
fn resolution(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if (11..=1001).contains(&count) => Ok(count),
        _ => Err("must be an integer in [11, 1001]".into()),
    }
}

/// X of a pose.
fn pose(text: &str) -> Result<[f64; 6], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let six = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    let is_bounded = |x: &[f64; 6]| x.iter().all(|x| x.abs() <= MAX_MAGNITUDE);
    six.filter(is_bounded)
        .ok_or_else(|| "must be six numbers, as in 0,0,0,0,0,1.25, at most 1e12 in magnitude".into())
}

/// Error that prevents the maps.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Chart(#[from] ChartError),
    #[error("--through {}: must be a pose the platform can take: {obstacle}", x.map(|x| x.to_string()).join(","))]
    Through { x: [f64; 6], obstacle: ObstacleText },
}

impl CommandError for WorkspaceError {}

/// PoseQuality of the poses of some slices, and regions without obstacle; displays as tables.
pub struct WorkspaceMap {
    name: String,
    effort: AccelerationDemand,
    largest_condition: f64,
    max_force: f64,
    slices: Vec<Slice>,
    turn_deg: f64,
    /// The ball at home's orientation, the ball with any turn, the box.
    regions: [RegionBounds; 3],
    /// RegionShape of the box.
    shape: EnvelopeBounds,
    /// Whether the shape of the box is that of `[envelope]`.
    has_envelope: bool,
    /// Files with the maps and their tables.
    files: Vec<PathBuf>,
}

impl WorkspaceMap {
    /// Evaluates the slices, searches the regions, writes the files.
    pub fn new(config: &Config, query: &WorkspaceQuery) -> Result<Self, WorkspaceError> {
        let Config { name, machine, deployment, .. } = config;
        let largest_condition = deployment.limits.condition;
        let clearance = Clearance::new(machine, largest_condition);
        let through = query.through.unwrap_or(machine.home);
        if let Some(obstacle) = clearance.violation_at(&TaskState::at_rest(through).motion().pose) {
            let obstacle = ObstacleText { obstacle, largest_condition };
            return Err(WorkspaceError::Through { x: through, obstacle });
        }
        let limits = &deployment.limits.reference;
        let effort = AccelerationDemand {
            linear: query.acceleration_m_s2.unwrap_or(limits.position.acceleration),
            angular: query.angular_acceleration_rad_s2.unwrap_or(limits.orientation.acceleration),
        };
        let slices = slices(machine, effort, query, through);
        let envelope = deployment.envelope.filter(has_extent);
        let shape = envelope.unwrap_or_else(|| reachable_envelope::nominal_bounds(machine));
        let regions = regions(machine, &clearance, query.turn_deg.to_radians(), &shape);
        let [ball, ..] = &regions;
        let drawing = MapDrawing { name, machine, largest_condition, ball: ball.guaranteed };
        let files = write(&drawing, &slices, &query.output)?;
        Ok(Self {
            name: name.clone(),
            effort,
            largest_condition,
            max_force: machine.actuator.max_force,
            slices,
            turn_deg: query.turn_deg,
            regions,
            shape,
            has_envelope: envelope.is_some(),
            files,
        })
    }
}

fn slices(
    machine: &Machine,
    effort: AccelerationDemand,
    query: &WorkspaceQuery,
    through: [f64; 6],
) -> Vec<Slice> {
    let workspace = PoseEvaluator::new(machine, effort);
    let default = Plane::default_three(&machine.gravity);
    let planes = if query.planes.is_empty() { &default[..] } else { &query.planes };
    let bar = item_bar(planes.len() * query.resolution * query.resolution, "poses");
    let slice = |plane: &Plane| Slice::new(&workspace, machine, *plane, through, query.resolution, &bar);
    let slices = planes.iter().map(slice).collect();
    bar.finish_and_clear();
    slices
}

fn regions(machine: &Machine, clearance: &Clearance, turn: f64, shape: &EnvelopeBounds) -> [RegionBounds; 3] {
    let shapes = [
        RegionShape::Ball { turn: 0.0 },
        RegionShape::Ball { turn },
        RegionShape::Box { low: shape.pose_min, high: shape.pose_max },
    ];
    // Two searches for a ball, one for a box.
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

/// WorkspaceLimit in words, with the limit of the condition.
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
            WorkspaceLimit::Condition => {
                write!(f, "the condition is beyond {}", significant(self.largest_condition))
            }
        }
    }
}

impl fmt::Display for WorkspaceMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, effort, largest_condition, .. } = self;
        let [linear, angular] = [effort.linear, effort.angular].map(significant);
        writeln!(
            f,
            "{name}: forces from rest under {linear} m/s2 and {angular} rad/s2, each in any direction\n"
        )?;
        let [name, numbers @ ..] = [
            "slice",
            "poses",
            "in reach",
            "usable",
            "margin [mm]",
            "condition",
            "worst force [N]",
            "payload [kg]",
        ];
        let columns: Vec<_> = [(name, Left)].into_iter().chain(numbers.map(|name| (name, Right))).collect();
        write!(f, "{}", text_table(2, &columns, self.slices.iter().map(|slice| self.slice_cells(slice))))?;
        writeln!(
            f,
            "\nin reach: within the stroke, on home's side of singular poses; usable: and the condition is up to {}.\n\
             Numbers are of usable poses; the actuators' limit is {} N.\n",
            significant(*largest_condition),
            significant(self.max_force)
        )?;
        writeln!(
            f,
            "Guaranteed around home, by bounds on every pose in between: all usable, none singular:"
        )?;
        self.fmt_regions(f)?;
        writeln!(f)?;
        self.files.iter().try_for_each(|path| writeln!(f, "written: {}", path.display()))
    }
}

impl WorkspaceMap {
    fn slice_cells(&self, slice: &Slice) -> [String; 8] {
        let in_reach = slice.qualities.iter().filter(|quality| quality.within_reach());
        let usable = in_reach.clone().filter(|quality| quality.condition <= self.largest_condition);
        let ends = |value: fn(&PoseQuality) -> f64| {
            let values = usable.clone().map(value);
            values.fold((f64::INFINITY, 0.0), |(low, high), v| (f64::min(low, v), f64::max(high, v)))
        };
        let range = |value: fn(&PoseQuality) -> f64| {
            let (low, high) = ends(value);
            format!("{} to {}", significant(low), significant(high))
        };
        [
            slice.plane.to_string(),
            slice.qualities.len().to_string(),
            in_reach.clone().count().to_string(),
            usable.clone().count().to_string(),
            format!("up to {}", significant(1e3 * ends(|quality| quality.stroke_margin).1)),
            range(|quality| quality.condition),
            range(|quality| quality.worst_force),
            range(|quality| quality.payload),
        ]
    }

    fn fmt_regions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let turned = format!("ball, turned up to {} deg about any axis", significant(self.turn_deg));
        let origin = if self.has_envelope { "box, times [envelope]" } else { "box, times the one below" };
        let names = ["ball at home's orientation", &turned, origin];
        let rows = names.into_iter().zip(self.regions).enumerate().map(|(k, (name, found))| {
            let size = |size: f64| {
                if k < 2 { format!("{} mm", significant(1e3 * size)) } else { significant(size) }
            };
            let text =
                |obstacle| ObstacleText { obstacle, largest_condition: self.largest_condition }.to_string();
            let limit = match found.violation {
                Some((at, obstacle)) if at <= 0.0 => format!("without going anywhere {}", text(obstacle)),
                Some((at, obstacle)) => format!("at {} {}", size(at), text(obstacle)),
                None => "nothing met further out".into(),
            };
            [name.into(), size(found.guaranteed), limit]
        });
        write!(f, "{}", text_table(2, &[("region", Left), ("size", Right), ("limited by", Left)], rows))?;
        let [.., found] = self.regions;
        let ranges = self.shape.pose_min.iter().zip(&self.shape.pose_max);
        let rows = AXES.into_iter().zip(ranges).enumerate().map(|(axis, (name, (low, high)))| {
            let (scale, unit) = axis_unit(axis);
            let [low, high] = [low, high].map(|x| significant(found.guaranteed * scale * x));
            [format!("  {name}"), format!("{low} to {high} {unit}")]
        });
        write!(f, "\n{}", text_table(2, &[("box", Left), ("offset from home", Right)], rows))
    }
}
