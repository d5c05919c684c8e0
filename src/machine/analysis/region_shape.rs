//! Shapes of growing regions of poses around home, and cells of their parameters.
//!
//! The six parameters of a pose are three angles, one after the other about the axes that the ones before left, and three
//! displacements. Here is no machine but its home: which poses are free is decided in [`super::clearance`].

use nalgebra::{Matrix3, Vector3};

use hexad_core::model::rigid::{Pose, exp, log};
use hexad_core::model::task::{TaskState, task_coordinates};

/// Shape of a family of growing regions around home, and the meaning of its six parameters, angular parameters first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RegionShape {
    /// Positions within a radius \[m\], the size; any turn from home's orientation about any axis up to `turn_rad` \[rad\], at
    /// most a quarter. The angles turn home's platform.
    Ball {
        /// \[rad\]
        turn_rad: f64,
    },
    /// Offsets of X from home within ranges (low at most 0, high at least 0) times the size.
    Box {
        /// At size 1.
        low: [f64; 6],
        /// At size 1.
        high: [f64; 6],
    },
}

/// Cell of poses: a box of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCell {
    /// Parameters of the middle.
    pub middle: [f64; 6],
    /// Half of the width of each.
    pub half: [f64; 6],
}

impl RegionShape {
    /// The cell that contains the region of a size.
    pub fn cell(&self, size: f64) -> PoseCell {
        let (low, high) = match *self {
            Self::Ball { turn_rad: t } => ([-t, -t, -t, -size, -size, -size], [t, t, t, size, size, size]),
            Self::Box { low, high } => (low.map(|x| size * x), high.map(|x| size * x)),
        };
        let mut cell = PoseCell { middle: [0.0; 6], half: [0.0; 6] };
        for ((middle, half), (low, high)) in
            cell.middle.iter_mut().zip(&mut cell.half).zip(low.into_iter().zip(high))
        {
            (*middle, *half) = (0.5 * (low + high), 0.5 * (high - low));
        }
        cell
    }

    /// The smallest size at which the region may contain poses of this cell; `None` if no region does.
    pub fn size(&self, cell: &PoseCell) -> Option<f64> {
        let nearest = cell.nearest();
        match self {
            Self::Ball { turn_rad } => {
                let [a, b, c, ..] = cell.middle;
                let middle = log(&turned([a, b, c])).norm();
                // 1e-12 for rounding, so that a cell on the edge is not left out.
                let within = middle - cell.turn() <= turn_rad * (1.0 + 1e-12);
                let [.., x, y, z] = nearest;
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

    /// Parameters on the edge of the region of size 1, angles included, from six numbers in \[-1, 1\].
    pub fn edge(&self, numbers: &[f64; 6]) -> [f64; 6] {
        match self {
            Self::Ball { turn_rad } => {
                let [a, b, c, x, y, z] = *numbers;
                let unit = |v: Vector3<f64>| v.try_normalize(0.0).unwrap_or_else(Vector3::x);
                let rotation = exp(&(unit(Vector3::new(a, b, c)) * *turn_rad));
                let position = unit(Vector3::new(x, y, z));
                task_coordinates(&Pose { rotation, position }, &[0.0; 6])
            }
            Self::Box { low, high } => {
                let most = numbers.iter().fold(f64::MIN_POSITIVE, |most, x| f64::max(most, x.abs()));
                let mut edge = *numbers;
                for (x, (low, high)) in edge.iter_mut().zip(low.iter().zip(high)) {
                    *x *= if *x < 0.0 { -low } else { *high } / most;
                }
                edge
            }
        }
    }

    /// The point of another size on the ray to a point of the edge.
    pub fn towards(&self, edge: &[f64; 6], size: f64) -> PoseCell {
        let [a, b, c, x, y, z] = edge.map(|x| size * x);
        let middle = match (self, edge) {
            (Self::Ball { .. }, [a, b, c, ..]) => [*a, *b, *c, x, y, z],
            (Self::Box { .. }, _) => [a, b, c, x, y, z],
        };
        PoseCell { middle, half: [0.0; 6] }
    }
}

/// Rotation by Bryan angles.
pub(super) fn turned([a, b, c]: [f64; 3]) -> Matrix3<f64> {
    TaskState::at_rest([a, b, c, 0.0, 0.0, 0.0]).motion().pose.rotation
}

impl PoseCell {
    /// The parameters of this cell that are nearest to home.
    fn nearest(&self) -> [f64; 6] {
        let mut nearest = self.middle;
        for (x, half) in nearest.iter_mut().zip(self.half) {
            *x = if x.abs() <= half { 0.0 } else { *x - half.copysign(*x) };
        }
        nearest
    }

    /// Largest rotation from the middle: the first and the third axis may come to lie on one line, the second is
    /// perpendicular to both.
    pub(super) fn turn(&self) -> f64 {
        let [a, b, c, ..] = self.half;
        (a + c).hypot(b)
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
