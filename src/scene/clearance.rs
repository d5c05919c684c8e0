//! Sets of poses in which nothing is in the way: every leg within its stroke, on home's side of singular poses,
//! no condition beyond a limit. Proved for a whole cell of poses at once, not looked for at points of it: a singular
//! surface has no thickness, and passes between any samples.
//!
//! From the pose in the middle of a cell every other one is at most `h` away along the axes (`d = |h|`), and turned by at
//! most `t`. With arms `b` from C, `a = |b|`, and `e = d + a t` the largest displacement of a joint:
//!
//! ```text
//! L - L0  <=   |n| . h + |b x n| t + (e^2 / (L0 - e) + a t^2) / 2            Taylor, L'' <= e^2 / L + a t^2
//! L - L0  >= -(|n| . h + |b x n| t + a t^2 / 2)
//! |n - n0| <= q = e / sqrt(L0 (L0 - e))
//! |N - N0|^2 <= D^2 = sum of q^2 + (a' / r)^2 (t + q)^2                      arms a' from the mean of the joints
//! |N^-1| <= B / (1 - B D),  B = |N0^-1|                                      where B D < 1: no pose is singular
//! condition = |N| |N^-1| <= min(|N0| + D, sqrt 12) B / (1 - B D)             Frobenius norms throughout
//! ```
//!
//! Cells that cover a region around home and all pass have the sign of home's determinant everywhere.
//!
//! To rounding: 1e-15 of the lengths is not accounted for.

use nalgebra::Vector3;

use crate::model::inverse_jacobian::{leg_wrenches, scaled_wrenches};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist};
use crate::model::stance::Stance;
use crate::model::task::TaskState;

/// Frobenius norm of N, no arm shorter than its moment: six directions, and six arms whose mean square is 1.
const LARGEST_WRENCHES: f64 = 3.464_101_615_137_755;

/// A family of growing regions around home, and what its six parameters mean. Angular parameters first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Positions within a radius \[m\], the size; any turn from home's orientation up to `turn` \[rad\]. The parameters
    /// are the rotation vector and the displacement.
    Ball { turn: f64 },
    /// Offsets of X from home within ranges (low at most 0, high at least 0) times the size.
    Box { low: [f64; 6], high: [f64; 6] },
}

/// A box of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    pub middle: [f64; 6],
    pub half: [f64; 6],
}

/// What is in the way at a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// A leg, counted from 0, shorter or longer than it can be.
    Short(usize),
    Long(usize),
    /// Beyond a singular pose.
    Singular,
    /// Beyond the limit of the condition.
    Condition,
}

/// The machine among its obstacles.
#[derive(Clone, Debug)]
pub struct Clearance<'a> {
    machine: &'a Machine,
    home: Pose,
    home_determinant: f64,
    largest_condition: f64,
    /// Of the joints on the platform: from C, and from their mean in radii.
    arms: [(f64, f64); LEGS],
}

impl Shape {
    /// The whole family up to a size.
    pub fn cell(&self, size: f64) -> Cell {
        let (low, high) = match *self {
            Self::Ball { turn: t } => ([-t, -t, -t, -size, -size, -size], [t, t, t, size, size, size]),
            Self::Box { low, high } => (low.map(|x| size * x), high.map(|x| size * x)),
        };
        let mut cell = Cell { middle: [0.0; 6], half: [0.0; 6] };
        for ((middle, half), (low, high)) in
            cell.middle.iter_mut().zip(&mut cell.half).zip(low.into_iter().zip(high))
        {
            (*middle, *half) = (0.5 * (low + high), 0.5 * (high - low));
        }
        cell
    }

    /// The size from which on the family has poses of this cell; none if it never has.
    pub fn size(&self, cell: &Cell) -> Option<f64> {
        let nearest = cell.nearest();
        match self {
            Self::Ball { turn } => {
                let [a, b, c, x, y, z] = nearest;
                // A hair for rounding, so that a cell on the edge is not lost.
                let within = Vector3::new(a, b, c).norm() <= turn * (1.0 + 1e-12);
                within.then(|| Vector3::new(x, y, z).norm())
            }
            Self::Box { low, high } => Some(
                nearest
                    .iter()
                    .zip(low.iter().zip(high))
                    .filter(|(x, _)| **x != 0.0)
                    .map(|(x, (low, high))| if *x < 0.0 { x / low } else { x / high })
                    .fold(0.0, f64::max),
            ),
        }
    }

    /// The parameters of a pose of the family, those given or near to them.
    fn admitted(&self, parameters: &[f64; 6]) -> [f64; 6] {
        let Self::Ball { turn } = self else { return *parameters };
        let [a, b, c, x, y, z] = *parameters;
        let angle = Vector3::new(a, b, c).norm();
        let share = if angle > *turn { turn / angle } else { 1.0 };
        [share * a, share * b, share * c, x, y, z]
    }

    /// The pose of parameters.
    fn pose(&self, home: &[f64; 6], parameters: &[f64; 6]) -> Pose {
        match self {
            Self::Ball { .. } => {
                TaskState::at_rest(*home).motion().pose.displaced(&Twist::from_vector(&(*parameters).into()))
            }
            Self::Box { .. } => {
                let mut x = *home;
                x.iter_mut().zip(parameters).for_each(|(x, offset)| *x += offset);
                TaskState::at_rest(x).motion().pose
            }
        }
    }

    /// Largest rotation from the middle of a cell: rotation vectors are never further apart than what they stand for
    /// is, and Bryan angles turn one after the other.
    fn turn(&self, cell: &Cell) -> f64 {
        let [a, b, c, ..] = cell.half;
        match self {
            Self::Ball { .. } => Vector3::new(a, b, c).norm(),
            Self::Box { .. } => a + b + c,
        }
    }
}

impl Cell {
    /// The parameters of this cell that are nearest to home.
    fn nearest(&self) -> [f64; 6] {
        let mut nearest = self.middle;
        for (x, half) in nearest.iter_mut().zip(self.half) {
            *x = if x.abs() <= half { 0.0 } else { *x - half.copysign(*x) };
        }
        nearest
    }

    /// Two halves, cut where the cell is longest, angles taken at an arm.
    pub fn halves(&self, arm: f64) -> [Self; 2] {
        let scales = [arm, arm, arm, 1.0, 1.0, 1.0];
        let lengths = self.half.iter().zip(scales).map(|(half, scale)| half * scale);
        let longest = lengths.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(axis, _)| axis);
        let mut halves = [*self; 2];
        for (cell, side) in halves.iter_mut().zip([-0.5, 0.5]) {
            if let (Some(middle), Some(half)) = (cell.middle.get_mut(longest), cell.half.get_mut(longest)) {
                *middle += side * *half;
                *half *= 0.5;
            }
        }
        halves
    }
}

impl<'a> Clearance<'a> {
    /// Around home, with the largest condition that is allowed.
    pub fn new(machine: &'a Machine, largest_condition: f64) -> Self {
        let home = TaskState::at_rest(machine.home).motion().pose;
        let joints = &machine.joints;
        let platform = joints.triples.unpack_vectors(&joints.platform);
        let mean = platform.iter().sum::<Vector3<f64>>() / LEGS as f64;
        let home_determinant = Stance::new(machine, home).sensitivity().determinant;
        let arms = platform.map(|arm| (arm.norm(), (arm - mean).norm() / joints.radius));
        Self { machine, home, home_determinant, largest_condition, arms }
    }

    /// How far C can go from home in the direction of the leg that is nearest to an end of its stroke, and that end:
    /// no ball is larger.
    pub fn home_margin(&self) -> (f64, Obstacle) {
        let actuator = &self.machine.actuator;
        let ends = |(leg, length): (usize, f64)| {
            [
                (length - actuator.min_length, Obstacle::Short(leg)),
                (actuator.max_length - length, Obstacle::Long(leg)),
            ]
        };
        let lengths = Stance::new(self.machine, self.home).lengths(self.machine);
        let nearer = |a: (f64, Obstacle), b: (f64, Obstacle)| if b.0 < a.0 { b } else { a };
        lengths.into_iter().enumerate().flat_map(ends).fold((f64::INFINITY, Obstacle::Condition), nearer)
    }

    /// What is in the way at the middle of a cell, or next to it within the shape, with the size there.
    pub fn obstacle(&self, shape: &Shape, cell: &Cell) -> Option<(f64, Obstacle)> {
        let parameters = shape.admitted(&cell.middle);
        let size = shape.size(&Cell { middle: parameters, half: [0.0; 6] })?;
        self.obstacle_at(&shape.pose(&self.machine.home, &parameters)).map(|obstacle| (size, obstacle))
    }

    /// What is in the way at a pose.
    pub fn obstacle_at(&self, pose: &Pose) -> Option<Obstacle> {
        let stance = Stance::new(self.machine, *pose);
        let actuator = &self.machine.actuator;
        for (leg, length) in stance.lengths(self.machine).into_iter().enumerate() {
            if !(length >= actuator.min_length) {
                return Some(Obstacle::Short(leg));
            }
            if !(length <= actuator.max_length) {
                return Some(Obstacle::Long(leg));
            }
        }
        let sensitivity = stance.sensitivity();
        if !(sensitivity.determinant * self.home_determinant > 0.0) {
            return Some(Obstacle::Singular);
        }
        (!(sensitivity.condition <= self.largest_condition)).then_some(Obstacle::Condition)
    }

    /// Whether it is proved that nothing is in the way anywhere in a cell.
    pub fn is_clear(&self, shape: &Shape, cell: &Cell) -> bool {
        let stance = Stance::new(self.machine, shape.pose(&self.machine.home, &cell.middle));
        let [_, _, _, hx, hy, hz] = cell.half;
        self.is_clear_around(&stance, &Vector3::new(hx, hy, hz), shape.turn(cell))
    }

    /// The same around a pose: `half` of each axis \[m\], `turn` about any \[rad\].
    fn is_clear_around(&self, stance: &Stance, half: &Vector3<f64>, turn: f64) -> bool {
        let actuator = &self.machine.actuator;
        let wrenches = leg_wrenches(self.machine, stance.pose());
        let shift = half.norm();
        let mut change = 0.0;
        for ((length, (arm, arm_share)), wrench) in
            stance.lengths(self.machine).into_iter().zip(self.arms).zip(wrenches.column_iter())
        {
            let moved = shift + arm * turn;
            let shortest = length - moved;
            let linear = wrench.fixed_rows::<3>(3).abs().dot(half) + wrench.fixed_rows::<3>(0).norm() * turn;
            let bent = 0.5 * arm * turn * turn;
            let longest = length + linear + 0.5 * moved * moved / shortest + bent;
            // Before anything is divided by it, the shortest leg has a length.
            if !(shortest > 0.0
                && length - linear - bent >= actuator.min_length
                && longest <= actuator.max_length)
            {
                return false;
            }
            let turned = moved / (length * shortest).sqrt();
            change += turned * turned + (arm_share * (turn + turned)).powi(2);
        }
        let change = change.sqrt();
        let norm = scaled_wrenches(self.machine, stance.pose()).norm();
        let inverse = stance.sensitivity().condition / norm;
        let left = 1.0 - inverse * change;
        left > 0.0 && (norm + change).min(LARGEST_WRENCHES) * inverse <= self.largest_condition * left
    }
}
