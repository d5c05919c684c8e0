//! Qualities of poses in slices, and regions without obstacle: one struct for the text and for `--json`.

use core::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::ObstacleText;
use super::slice::Slice;
use hexad_core::control::constants::MAX_HOLDING_SHARE;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::machine::Machine;
use hexad_core::model::sensitivity::CONDITION_MEANING;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::clearance::Clearance;
use hexad_machine::analysis::drive_capability::DriveCapability;
use hexad_machine::analysis::envelope::EnvelopeBounds;
use hexad_machine::analysis::gravity_cone::{ConeHolding, GravityCone};
use hexad_machine::analysis::other_pose_search::OtherPoseSearch;
use hexad_machine::analysis::pose_quality::PoseQuality;
use hexad_machine::analysis::region_search::RegionBounds;
use hexad_machine::text::numbers::{AXES, axis_unit, significant};
use hexad_machine::text::text_table::{Left, Right, paragraph, text_table};

/// Schema of the JSON. It is raised when a field is removed or changes its meaning.
pub const SCHEMA: u32 = 1;
/// Width of the hint and of the tables \[characters\].
const HINT_WIDTH: usize = 100;

/// Result of `hexad workspace`. Infinite numbers are null in JSON.
#[derive(Clone, Debug, Serialize)]
pub struct WorkspaceReport {
    pub schema: u32,
    pub machine: String,
    /// Accelerations for the forces, in any direction.
    pub acceleration_m_s2: f64,
    pub angular_acceleration_rad_s2: f64,
    /// `limits.condition`; 6 is best, infinite is singular.
    pub condition_limit: f64,
    /// Force that every leg can get: `actuator.max_force_n`, less what scale and load friction take.
    pub max_force_n: f64,
    /// Forces under gravity in any direction of `--gravity-cone`: at home, and over the usable poses of the slices.
    pub gravity_cone: Option<ConeHolding>,
    pub slices: Vec<SliceReport>,
    /// The ball at home's orientation, the ball with any turn, and the box.
    pub regions: Vec<RegionReport>,
    /// Ranges of the largest guaranteed box.
    pub largest_box: Vec<BoxRange>,
    /// Other permitted poses of rest poses of the usable region.
    pub other_pose_search: OtherPoseSearch,
    /// Reason why there is no payload.
    pub hint: Option<String>,
    /// Maps and their tables.
    pub files: Vec<PathBuf>,
}

/// Poses of a slice. Each range of numbers is over the usable poses.
#[derive(Clone, Debug, Serialize)]
pub struct SliceReport {
    pub plane: String,
    pub poses: usize,
    pub in_reach: usize,
    pub usable: usize,
    /// Usable poses that were searched for other permitted poses, and those with one.
    pub searched: usize,
    pub ambiguous: usize,
    pub largest_margin_m: f64,
    pub condition: [f64; 2],
    pub worst_force_n: [f64; 2],
    pub payload_kg: [f64; 2],
}

/// Region around home that is proved usable.
#[derive(Clone, Debug, Serialize)]
pub struct RegionReport {
    pub region: String,
    /// Radius \[m\], or a multiple of the box.
    pub guaranteed: f64,
    /// `m`, or empty for a multiple.
    pub unit: &'static str,
    /// Size of the nearest violation found, and the violated limit.
    pub limited_at: Option<f64>,
    pub limited_by: Option<String>,
}

/// Range of a coordinate, as offsets from home \[rad\], \[m\].
#[derive(Clone, Debug, Serialize)]
pub struct BoxRange {
    pub axis: &'static str,
    pub low: f64,
    pub high: f64,
}

impl SliceReport {
    pub fn new(slice: &Slice, clearance: &Clearance) -> Self {
        let in_reach = slice.poses().filter(|(_, quality)| quality.within_reach());
        let usable: Vec<&PoseQuality> = usable(slice, clearance).map(|(_, quality)| quality).collect();
        let ends = |value: fn(&PoseQuality) -> f64| {
            let values = usable.iter().copied().map(value);
            values.fold([f64::INFINITY, 0.0], |[low, high], v| [f64::min(low, v), f64::max(high, v)])
        };
        let [_, largest_margin_m] = ends(|quality| quality.stroke_margin_m);
        Self {
            plane: slice.plane.to_string(),
            poses: slice.qualities.len(),
            in_reach: in_reach.count(),
            usable: usable.len(),
            searched: slice.searched.len(),
            ambiguous: slice.ambiguous().count(),
            largest_margin_m,
            condition: ends(|quality| quality.condition),
            worst_force_n: ends(|quality| quality.worst_force_n),
            payload_kg: ends(|quality| quality.payload_kg),
        }
    }

    fn cells(&self) -> [String; 9] {
        let range = |[low, high]: [f64; 2]| format!("{} to {}", significant(low), significant(high));
        [
            self.plane.clone(),
            self.poses.to_string(),
            self.in_reach.to_string(),
            self.usable.to_string(),
            format!("{} of {}", self.ambiguous, self.searched),
            format!("up to {}", significant(1e3 * self.largest_margin_m)),
            range(self.condition),
            range(self.worst_force_n),
            range(self.payload_kg),
        ]
    }
}

/// Poses of a slice that the reference goes to.
fn usable<'a>(
    slice: &'a Slice,
    clearance: &'a Clearance<'a>,
) -> impl Iterator<Item = ([f64; 6], &'a PoseQuality)> {
    let in_reach = slice.poses().filter(|(_, quality)| quality.within_reach());
    in_reach.filter(|(x, _)| clearance.violation_at(&TaskState::at_rest(*x).motion().pose).is_none())
}

/// Forces under gravity in any direction of a cone, at home and over the usable poses of the slices.
pub fn cone_holding(
    machine: &Machine,
    clearance: &Clearance,
    half_angle_rad: f64,
    slices: &[Slice],
) -> ConeHolding {
    let cone = GravityCone::new(machine.gravity_m_s2, half_angle_rad);
    let poses = slices.iter().flat_map(|slice| usable(slice, clearance)).map(|(x, _)| x);
    let at_home = cone.worst_holding(machine, [machine.home]);
    ConeHolding { half_angle_rad, at_home, hardest: cone.worst_holding(machine, poses) }
}

/// Reports of both balls and the box.
pub fn region_reports(
    regions: [RegionBounds; 3],
    turn_deg: f64,
    has_envelope: bool,
    largest_condition: f64,
) -> Vec<RegionReport> {
    let turned = format!("ball, turned up to {} deg about any axis", significant(turn_deg));
    let origin = if has_envelope { "box, times [envelope]" } else { "box, times the one below" };
    let names = ["ball at home's orientation".into(), turned, origin.into()];
    let report = |((region, unit), found): ((String, _), RegionBounds)| RegionReport {
        region,
        guaranteed: found.guaranteed,
        unit,
        limited_at: found.violation.map(|(size, _)| size),
        limited_by: found
            .violation
            .map(|(_, obstacle)| ObstacleText { obstacle, largest_condition }.to_string()),
    };
    names.into_iter().zip(["m", "m", ""]).zip(regions).map(report).collect()
}

impl RegionReport {
    fn cells(&self) -> [String; 3] {
        let size = |size: f64| {
            if self.unit == "m" { format!("{} mm", significant(1e3 * size)) } else { significant(size) }
        };
        let limit = match (self.limited_at, &self.limited_by) {
            (Some(at), Some(text)) if at <= 0.0 => format!("without going anywhere {text}"),
            (Some(at), Some(text)) => format!("at {} {text}", size(at)),
            _ => "nothing met further out".into(),
        };
        [self.region.clone(), size(self.guaranteed), limit]
    }
}

impl BoxRange {
    /// Ranges of a shape at a size.
    pub fn all(shape: &EnvelopeBounds, size: f64) -> Vec<Self> {
        let ranges = shape.pose_min.iter().zip(&shape.pose_max);
        let range =
            |(axis, (low, high)): (_, (&f64, &f64))| Self { axis, low: size * low, high: size * high };
        AXES.into_iter().zip(ranges).map(range).collect()
    }
}

impl WorkspaceReport {
    /// Reason why no usable pose carries a payload, with the limit that requires most of the force.
    pub fn no_payload_reason(&self, machine: &Machine) -> Option<String> {
        let has_none = |slice: &SliceReport| slice.usable > 0 && slice.payload_kg == [0.0; 2];
        if !self.slices.iter().any(has_none) {
            return None;
        }
        let cone_rad = self.gravity_cone.map_or(0.0, |cone| cone.half_angle_rad);
        let cone = GravityCone::new(machine.gravity_m_s2, cone_rad);
        let drives = DriveCapability::in_cone(&InverseDynamics::new(machine), &machine.home_pose(), &cone)?;
        let (linear, angular) = (self.acceleration_m_s2, self.angular_acceleration_rad_s2);
        let forces = drives.largest_forces(linear, angular);
        let [holding, of_linear, of_angular] = forces.map(|force| 100.0 * force / self.max_force_n);
        let (key, option) = if of_angular > of_linear {
            ("limits.acceleration_rad_s2", "--angular-acceleration-rad-s2")
        } else {
            ("limits.acceleration_m_s2", "--acceleration-m-s2")
        };
        Some(format!(
            "payload 0: at home a leg needs {holding:.0} % of {} N (actuator.max_force_n) to hold the platform, {of_linear:.0} % for \
             {} m/s2 and {of_angular:.0} % for {} rad/s2; lower {key}, or see what less takes with {option}",
            significant(self.max_force_n),
            significant(linear),
            significant(angular)
        ))
    }
}

impl fmt::Display for WorkspaceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [linear, angular] = [self.acceleration_m_s2, self.angular_acceleration_rad_s2].map(significant);
        writeln!(
            f,
            "{}: forces from rest under {linear} m/s2 and {angular} rad/s2, each in any direction\n",
            self.machine
        )?;
        if let Some(cone) = &self.gravity_cone {
            writeln!(f, "{cone}\n")?;
        }
        let [name, numbers @ ..] = [
            "slice",
            "poses",
            "in reach",
            "usable",
            "ambiguous",
            "margin [mm]",
            "condition",
            "worst force [N]",
            "payload [kg]",
        ];
        let columns: Vec<_> = [(name, Left)].into_iter().chain(numbers.map(|name| (name, Right))).collect();
        write!(f, "{}", text_table(2, &columns, self.slices.iter().map(SliceReport::cells)))?;
        writeln!(
            f,
            "\nin reach: within the stroke, on home's side of singular poses; usable: the reference goes there, the condition\n\
             is up to {} ({CONDITION_MEANING}), no leg is near the first axis of its\n\
             universal joint, and holding takes at most {:.0} % of the force. ambiguous: with another permitted pose for the same\n\
             lengths, of the usable poses that were searched. Numbers are of usable poses; the actuators' limit is {} N.\n",
            significant(self.condition_limit),
            100.0 * MAX_HOLDING_SHARE,
            significant(self.max_force_n)
        )?;
        if let Some(hint) = &self.hint {
            writeln!(f, "{}", paragraph("", hint, HINT_WIDTH))?;
        }
        writeln!(
            f,
            "Guaranteed around home, by bounds on every pose in between: all usable, none singular:"
        )?;
        let columns = [("region", Left), ("size", Right), ("limited by", Left)];
        write!(f, "{}", text_table(2, &columns, self.regions.iter().map(RegionReport::cells)))?;
        let rows = self.largest_box.iter().enumerate().map(|(axis, range)| {
            let (scale, unit) = axis_unit(axis);
            let [low, high] = [range.low, range.high].map(|x| significant(scale * x));
            [format!("  {}", range.axis), format!("{low} to {high} {unit}")]
        });
        write!(f, "\n{}", text_table(2, &[("box", Left), ("offset from home", Right)], rows))?;
        let search = self.other_pose_search.to_string();
        writeln!(f, "\n{}", paragraph("other permitted poses: ", &search, HINT_WIDTH))?;
        self.files.iter().try_for_each(|path| writeln!(f, "written: {}", path.display()))
    }
}
