//! `hexad workspace`: where the machine can go and what it can do there, as maps; and the largest regions around
//! home in which nothing is in its way, as numbers.

use core::fmt;
use std::fs::create_dir_all;
use std::path::{Path, PathBuf};

use self::map::Maps;
use self::slice::{Plane, Slice};
use super::offline::progress;
use crate::analysis::clearance::{Clearance, RegionShape, WorkspaceLimit};
use crate::analysis::envelope::EnvelopeBounds;
use crate::analysis::pose_quality::{AccelerationDemand, PoseEvaluator, PoseQuality};
use crate::analysis::reachable_envelope;
use crate::analysis::region_search::{MAX_CELLS, RegionBounds, largest_region};
use crate::config::Config;
use crate::model::machine::Machine;
use crate::model::task::TaskState;
use crate::output::files::FileError;
use crate::output::numbers::significant;
use crate::output::svg::ChartError;

mod bands;
mod contour;
mod map;

pub mod slice;

/// What is asked for.
#[derive(Clone, Debug)]
pub struct Wish {
    /// Empty for the usual three.
    pub planes: Vec<Plane>,
    /// X of the pose that all slices go through; home if none is given.
    pub through: Option<[f64; 6]>,
    /// Poses along each axis of a slice.
    pub resolution: usize,
    /// Accelerations for the forces; those of `[limits]` if none are given.
    pub acceleration_m_s2: Option<f64>,
    pub angular_acceleration_rad_s2: Option<f64>,
    /// Of the ball in which the platform may turn \[deg\].
    pub turn_deg: f64,
    /// Folder for maps and tables.
    pub output: PathBuf,
}

/// Why there are no maps.
#[derive(Debug, thiserror::Error)]
pub enum WorkspaceError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Chart(#[from] ChartError),
    #[error("--through {}: {reason}", words(x))]
    Through { x: [f64; 6], reason: String },
}

/// What was found.
pub struct Survey {
    name: String,
    effort: AccelerationDemand,
    largest_condition: f64,
    max_force: f64,
    slices: Vec<Slice>,
    turn_deg: f64,
    /// Positions at home's orientation, positions with any turn, the box.
    regions: [RegionBounds; 3],
    shape: EnvelopeBounds,
    /// The box is that of `[envelope]`.
    configured: bool,
    written: Vec<PathBuf>,
}

impl Survey {
    /// Judges the slices, searches the regions, writes the files.
    pub fn new(config: &Config, wish: &Wish) -> Result<Self, WorkspaceError> {
        let Config { name, machine, deployment } = config;
        let largest_condition = deployment.limits.condition;
        let clearance = Clearance::new(machine, largest_condition);
        let through = wish.through.unwrap_or(machine.home);
        if let Some(obstacle) = clearance.violation_at(&TaskState::at_rest(through).motion().pose) {
            let reason =
                format!("must be a pose the platform can take: {}", Reason(obstacle, largest_condition));
            return Err(WorkspaceError::Through { x: through, reason });
        }
        let limits = &deployment.limits.reference;
        let effort = AccelerationDemand {
            linear: wish.acceleration_m_s2.unwrap_or(limits.position.acceleration),
            angular: wish.angular_acceleration_rad_s2.unwrap_or(limits.orientation.acceleration),
        };
        let slices = slices(machine, effort, wish, through);
        let configured = deployment.envelope.filter(has_extent);
        let shape = configured.unwrap_or_else(|| reachable_envelope::nominal_bounds(machine));
        let regions = regions(machine, &clearance, wish.turn_deg.to_radians(), &shape);
        let [ball, ..] = &regions;
        let maps = Maps { name, machine, largest_condition, ball: ball.guaranteed };
        let written = write(&maps, &slices, &wish.output)?;
        Ok(Self {
            name: name.clone(),
            effort,
            largest_condition,
            max_force: machine.actuator.max_force,
            slices,
            turn_deg: wish.turn_deg,
            regions,
            shape,
            configured: configured.is_some(),
            written,
        })
    }
}

fn slices(machine: &Machine, effort: AccelerationDemand, wish: &Wish, through: [f64; 6]) -> Vec<Slice> {
    let workspace = PoseEvaluator::new(machine, effort);
    let usual = Plane::usual(&machine.gravity);
    let planes = if wish.planes.is_empty() { &usual[..] } else { &wish.planes };
    let bar = progress(planes.len() * wish.resolution * wish.resolution, "poses");
    let slice = |plane: &Plane| Slice::new(&workspace, machine, *plane, through, wish.resolution, &bar);
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
    let bar = progress(5 * MAX_CELLS as usize, "cells");
    let regions = shapes.map(|shape| largest_region(machine, clearance, &shape, &bar));
    bar.finish_and_clear();
    regions
}

fn write(maps: &Maps, slices: &[Slice], folder: &Path) -> Result<Vec<PathBuf>, WorkspaceError> {
    create_dir_all(folder).map_err(FileError::on(folder))?;
    let mut written = vec![];
    for slice in slices {
        let [csv, svg] = ["csv", "svg"].map(|extension| folder.join(slice.file(extension)));
        slice.save(&csv)?;
        maps.write_svg(&svg, slice)?;
        written.extend([csv, svg]);
    }
    Ok(written)
}

fn has_extent(limits: &EnvelopeBounds) -> bool {
    limits.pose_min.iter().chain(&limits.pose_max).any(|x| *x != 0.0)
}

fn words(x: &[f64; 6]) -> String {
    x.map(|x| format!("{x}")).join(",")
}

/// What is in the way, in words, with the limit of the condition.
struct Reason(WorkspaceLimit, f64);

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            WorkspaceLimit::LegTooShort(leg) => write!(f, "leg {} is too short", leg + 1),
            WorkspaceLimit::LegTooLong(leg) => write!(f, "leg {} is too long", leg + 1),
            WorkspaceLimit::Singular => write!(f, "it is across a singular pose"),
            WorkspaceLimit::Condition => write!(f, "the condition is beyond {}", significant(self.1)),
        }
    }
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, effort, largest_condition, .. } = self;
        let [linear, angular] = [effort.linear, effort.angular].map(significant);
        writeln!(
            f,
            "{name}: forces from rest under {linear} m/s2 and {angular} rad/s2, each in any direction\n"
        )?;
        writeln!(
            f,
            "{:<12}{:>9}{:>10}{:>9}{:>13}{:>16}{:>18}{:>15}",
            "slice",
            "poses",
            "in reach",
            "usable",
            "margin [mm]",
            "condition",
            "worst force [N]",
            "payload [kg]"
        )?;
        for slice in &self.slices {
            self.fmt_slice(f, slice)?;
        }
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
        self.written.iter().try_for_each(|path| writeln!(f, "written: {}", path.display()))
    }
}

impl Survey {
    fn fmt_slice(&self, f: &mut fmt::Formatter<'_>, slice: &Slice) -> fmt::Result {
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
        writeln!(
            f,
            "{:<12}{:>9}{:>10}{:>9}{:>13}{:>16}{:>18}{:>15}",
            slice.plane.to_string(),
            slice.qualities.len(),
            in_reach.clone().count(),
            usable.clone().count(),
            format!("up to {}", significant(1e3 * ends(|quality| quality.stroke_margin).1)),
            range(|quality| quality.condition),
            range(|quality| quality.worst_force),
            range(|quality| quality.payload),
        )
    }

    fn fmt_regions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let turned = format!("ball, turned up to {} deg about any axis", significant(self.turn_deg));
        let origin = if self.configured { "box, times [envelope]" } else { "box, times the one below" };
        let names = ["ball at home's orientation", &turned, origin];
        for (k, (name, found)) in names.into_iter().zip(self.regions).enumerate() {
            let size = |size: f64| {
                if k < 2 { format!("{} mm", significant(1e3 * size)) } else { significant(size) }
            };
            write!(f, "{name:<45}{:>10}", size(found.guaranteed))?;
            match found.violation {
                Some((at, obstacle)) if at <= 0.0 => {
                    writeln!(f, "; without going anywhere {}", Reason(obstacle, self.largest_condition))?;
                }
                Some((at, obstacle)) => {
                    writeln!(f, "; at {} {}", size(at), Reason(obstacle, self.largest_condition))?;
                }
                None => writeln!(f, "; nothing met further out")?,
            }
        }
        let [.., found] = self.regions;
        let names = ["alpha", "beta", "gamma", "x", "y", "z"];
        for (axis, (name, (low, high))) in
            names.into_iter().zip(self.shape.pose_min.iter().zip(&self.shape.pose_max)).enumerate()
        {
            let (scale, unit) = if axis < 3 { (1.0_f64.to_degrees(), "deg") } else { (1e3, "mm") };
            let [low, high] = [low, high].map(|x| significant(found.guaranteed * scale * x));
            writeln!(f, "    {name:<6}{low:>8} to {high:>7} {unit}")?;
        }
        Ok(())
    }
}
