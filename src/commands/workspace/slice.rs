//! Slice of the workspace: a grid of poses along two coordinates through one pose.

use core::f64::consts::FRAC_PI_2;
use core::fmt;
use core::str::FromStr;
use std::path::Path;

use indicatif::ProgressBar;
use nalgebra::Vector3;
use rayon::prelude::*;

use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::clearance::Clearance;
use hexad_machine::analysis::other_pose_search::{nearest_permitted, relative_search_density};
use hexad_machine::analysis::pose_quality::{PoseEvaluator, PoseQuality};
use hexad_machine::text::csv_table::coordinates;
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::files::FileError;

/// Poses along each axis during the search for the range.
const COARSE_POSES: usize = 41;
/// Poses along each axis, at most, that are searched for other permitted poses.
const MAX_SEARCHED_POSES: f64 = 41.0;
/// First range to both sides: in strokes, and \[rad\].
const FIRST_RANGE_STROKES: f64 = 0.1;
const FIRST_RANGE_RAD: f64 = 0.1;
/// Growth factor of the range while the reach extends beyond it.
const RANGE_GROWTH: f64 = 1.5;
/// Largest number of growths of a range, enough for a thousand times the first range.
const MAX_RANGE_GROWTHS: usize = 20;

/// Plane of two task coordinates, given by their indices in X: to the right, and up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane(pub [usize; 2]);

impl Plane {
    /// The horizontal plane, the vertical one, and tilt about both horizontal axes. Gravity defines the
    /// vertical.
    pub fn default_three(gravity: &Vector3<f64>) -> [Self; 3] {
        let up = if gravity.norm() > 0.0 { gravity.iamax() } else { 2 };
        let (first, second) = match up {
            0 => (1, 2),
            1 => (2, 0),
            _ => (0, 1),
        };
        [Self([3 + first, 3 + second]), Self([3 + first, 3 + up]), Self([first, second])]
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = coordinates("");
        let name = |axis: usize| names.get(axis).map_or("", |name| name.as_str());
        let [right, up] = self.0.map(name);
        write!(f, "{right}-{up}")
    }
}

impl FromStr for Plane {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = coordinates("");
        let axis = |name: &str| names.iter().position(|axis| axis == name);
        let axes = text.split_once('-').and_then(|(right, up)| Some([axis(right)?, axis(up)?]));
        let bound = "must be two different ones of alpha, beta, gamma, x, y, z, as in x-z";
        axes.filter(|[right, up]| right != up).map(Self).ok_or_else(|| bound.into())
    }
}

/// Grid of poses in a plane with the quality of each, row by row.
#[derive(Clone, Debug)]
pub struct Slice {
    pub plane: Plane,
    /// X of the pose in the slice.
    pub through: [f64; 6],
    /// Ranges of the coordinates along both axes.
    pub ranges: [(f64, f64); 2],
    /// Poses along each axis.
    pub count: usize,
    pub qualities: Vec<PoseQuality>,
    /// Steps between poses that are searched for other permitted poses; their indices, and whether there is one.
    pub search_step: usize,
    pub searched: Vec<([usize; 2], bool)>,
}

impl Slice {
    /// Part of a plane that contains all poses in reach around a pose. The bar advances by poses.
    pub fn new(
        workspace: &PoseEvaluator,
        machine: &Machine,
        plane: Plane,
        through: [f64; 6],
        count: usize,
        bar: &ProgressBar,
    ) -> Self {
        let mut slice = Self {
            plane,
            through,
            ranges: [(0.0, 0.0); 2],
            count: COARSE_POSES,
            qualities: vec![],
            search_step: 1,
            searched: vec![],
        };
        slice.ranges = slice.range_of_reach(workspace, machine);
        slice.count = count;
        slice.evaluate(workspace, bar);
        slice
    }

    /// The same with a search of its usable poses for other permitted poses with the same lengths.
    pub fn with_other_poses(mut self, machine: &Machine, clearance: &Clearance) -> Self {
        let most = MAX_SEARCHED_POSES * relative_search_density(machine);
        self.search_step = (self.count as f64 / most).ceil() as usize;
        let indices = || (0..self.count).step_by(self.search_step);
        let pose = |places: &[usize; 2]| TaskState::at_rest(self.x(*places)).motion().pose;
        let all = indices().flat_map(|up| indices().map(move |right| [right, up]));
        let usable: Vec<_> = all.filter(|places| clearance.violation_at(&pose(places)).is_none()).collect();
        let search = |places: [usize; 2]| (places, nearest_permitted(machine, &pose(&places)).is_some());
        self.searched = usable.into_par_iter().map(search).collect();
        self
    }

    /// Indices of the searched poses with another permitted pose.
    pub fn ambiguous(&self) -> impl Iterator<Item = [usize; 2]> {
        self.searched.iter().filter(|(_, has_other)| *has_other).map(|(places, _)| *places)
    }

    /// X of a pose by its indices along both axes.
    pub fn x(&self, places: [usize; 2]) -> [f64; 6] {
        let mut x = self.through;
        for ((axis, place), (low, high)) in self.plane.0.into_iter().zip(places).zip(self.ranges) {
            let share = place as f64 / (self.count - 1) as f64;
            if let Some(x) = x.get_mut(axis) {
                // This form is exact at both ends.
                *x = low * (1.0 - share) + high * share;
            }
        }
        x
    }

    /// X and quality of every pose.
    pub fn poses(&self) -> impl Iterator<Item = ([f64; 6], &PoseQuality)> + Clone {
        let x = |k| self.x([k % self.count, k / self.count]);
        self.qualities.iter().enumerate().map(move |(k, quality)| (x(k), quality))
    }

    /// Quality of a pose by its indices along both axes; `None` outside the slice.
    pub fn at(&self, [right, up]: [usize; 2]) -> Option<&PoseQuality> {
        if right < self.count { self.qualities.get(up * self.count + right) } else { None }
    }

    fn evaluate(&mut self, workspace: &PoseEvaluator, bar: &ProgressBar) {
        let row = |up: usize| {
            let quality = |right| workspace.quality(&TaskState::at_rest(self.x([right, up])).motion().pose);
            let row: Vec<_> = (0..self.count).map(quality).collect();
            bar.inc(self.count as u64);
            row
        };
        let rows: Vec<_> = (0..self.count).into_par_iter().map(row).collect();
        self.qualities = rows.concat();
    }

    /// Ranges around the pose, grown until the reach ends within them, then reduced to the reach.
    fn range_of_reach(&mut self, workspace: &PoseEvaluator, machine: &Machine) -> [(f64, f64); 2] {
        let stroke = machine.actuator.stroke();
        let middles = self.plane.0.map(|axis| self.through.get(axis).copied().unwrap_or_default());
        let firsts =
            self.plane.0.map(|axis| if axis < 3 { FIRST_RANGE_RAD } else { FIRST_RANGE_STROKES * stroke });
        // Angles beyond a quarter turn are not tilt, and Bryan angles repeat orientations there.
        let most = self.plane.0.map(|axis| if axis < 3 { FRAC_PI_2 } else { f64::INFINITY });
        let mut sides = firsts.map(|first| [first; 2]);
        for _ in 0..MAX_RANGE_GROWTHS {
            self.ranges = around(middles, sides);
            self.evaluate(workspace, &ProgressBar::hidden());
            let ends = self.ends_of_reach();
            let last = COARSE_POSES - 1;
            let mut grows = false;
            for ((sides, most), (low, high)) in sides.iter_mut().zip(most).zip(ends) {
                for (side, touches) in sides.iter_mut().zip([low == 0, high == last]) {
                    if touches && *side < most {
                        *side = (RANGE_GROWTH * *side).min(most);
                        grows = true;
                    }
                }
            }
            if !grows {
                break;
            }
        }
        // One more step on each side, where the coarse grid has no pose in reach.
        let mut ranges = self.ranges;
        for ((low, high), (first, last)) in ranges.iter_mut().zip(self.ends_of_reach()) {
            let (start, step) = (*low, (*high - *low) / (COARSE_POSES - 1) as f64);
            *low = start + step * (first as f64 - 1.5).max(0.0);
            *high = start + step * (last as f64 + 1.5).min((COARSE_POSES - 1) as f64);
        }
        ranges
    }

    /// First and last index along both axes with a pose in reach; the middle index if there is none.
    fn ends_of_reach(&self) -> [(usize, usize); 2] {
        let mut ends = [(self.count / 2, self.count / 2); 2];
        for (k, _) in self.qualities.iter().enumerate().filter(|(_, quality)| quality.within_reach()) {
            for ((first, last), place) in ends.iter_mut().zip([k % self.count, k / self.count]) {
                (*first, *last) = ((*first).min(place), (*last).max(place));
            }
        }
        ends
    }

    /// Writes a row per pose, in SI units and radians.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let mut columns = coordinates("");
        columns.extend(
            ["in_reach", "stroke_margin", "determinant", "condition", "worst_force", "payload"]
                .map(String::from),
        );
        let mut writer = CsvWriter::new(&columns);
        for (x, quality) in self.poses() {
            let PoseQuality { stroke_margin_m, determinant, condition, worst_force_n, payload_kg } = *quality;
            let in_reach = f64::from(u8::from(quality.within_reach()));
            let values = [in_reach, stroke_margin_m, determinant, condition, worst_force_n, payload_kg];
            writer.row(x.into_iter().chain(values));
        }
        writer.save(path)
    }

    /// Name of a file of the slice, such as `x-z.svg`.
    pub fn file_name(&self, extension: &str) -> String {
        format!("{}.{extension}", self.plane)
    }
}

fn around(middles: [f64; 2], sides: [[f64; 2]; 2]) -> [(f64, f64); 2] {
    let [first, second] = middles;
    let [[left, right], [down, up]] = sides;
    [(first - left, first + right), (second - down, second + up)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_two_different_coordinates() {
        assert_eq!("x-z".parse(), Ok(Plane([3, 5])));
        assert_eq!("beta-alpha".parse::<Plane>().unwrap().to_string(), "beta-alpha");
        for wrong in ["", "x", "xz", "x-x", "x-w", "x-y-z", "X-Y"] {
            assert!(wrong.parse::<Plane>().unwrap_err().starts_with("must be two different"), "{wrong}");
        }
    }

    #[test]
    fn the_default_planes_follow_gravity() {
        let names = |x, y, z| Plane::default_three(&Vector3::new(x, y, z)).map(|plane| plane.to_string());
        assert_eq!(names(0.0, 0.0, -9.81), ["x-y", "x-z", "alpha-beta"]);
        assert_eq!(names(-9.81, 0.0, 0.1), ["y-z", "y-x", "beta-gamma"]);
        assert_eq!(names(0.0, 9.81, 0.1), ["z-x", "z-y", "gamma-alpha"]);
        assert_eq!(names(0.0, 0.0, 0.0), ["x-y", "x-z", "alpha-beta"]);
    }
}
