//! `--rotation`: how a table states the orientation of the platform, and its rows in X.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use hexad_core::model::rigid::Pose;
use hexad_core::model::task::{TaskState, task_coordinates};
use hexad_core::motion::rotation_order::{RotationOrder, quaternion_of, rotation_of};
use hexad_machine::text::csv_table::{pose_columns, six};

/// Help text of the option.
pub const ROTATION_HELP: &str = "Orientations in the table: an order of the rotations, as zyx for R = Rz(gamma) \
     Ry(beta) Rx(alpha), or quaternion, in columns qw, qx, qy, qz";

/// Name of the format with quaternions.
const QUATERNION: &str = "quaternion";

/// Largest deviation of a quaternion's norm from 1: many times the rounding error of three digits.
const MAX_NORM_DEVIATION: f64 = 0.01;

/// Format of the orientations of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrientationFormat {
    /// Columns `alpha`, `beta`, `gamma`.
    Angles(RotationOrder),
    /// Columns `qw`, `qx`, `qy`, `qz`.
    Quaternion,
}

impl OrientationFormat {
    /// Format of X.
    pub const OF_X: Self = Self::Angles(RotationOrder::Xyz);

    /// Reader of the name of a format: of an order of rotations, or `quaternion`.
    pub fn by_name() -> impl TypedValueParser<Value = Self> {
        PossibleValuesParser::new(RotationOrder::ALL.map(RotationOrder::name).into_iter().chain([QUATERNION]))
            .map(|name| RotationOrder::by_name(&name).map_or(Self::Quaternion, Self::Angles))
    }

    /// Names of the columns of poses.
    pub fn pose_columns(self) -> Vec<String> {
        match self {
            Self::Angles(_) => pose_columns(),
            Self::Quaternion => ["t", "qw", "qx", "qy", "qz", "x", "y", "z"].map(String::from).into(),
        }
    }

    /// X of a row, with X' and X'' if it has these, with the triple of Bryan angles nearest to `near`.
    pub fn state(self, row: &[f64], has_derivatives: bool, near: &[f64; 6]) -> Result<TaskState, String> {
        let at_rest = |pose: &Pose| TaskState::at_rest(task_coordinates(pose, near));
        match self {
            Self::Angles(order) => {
                let motion = order.motion(&TaskState {
                    x: six(row, 1).into(),
                    xd: six(row, 7).into(),
                    xdd: six(row, 13).into(),
                });
                if !has_derivatives {
                    return Ok(at_rest(&motion.pose));
                }
                TaskState::of_motion(&motion, near).ok_or_else(|| {
                    "alpha and gamma of X have no rates at beta = +-90 deg: leave rates and accelerations out"
                        .into()
                })
            }
            Self::Quaternion if has_derivatives => {
                Err("rates and accelerations beside a quaternion: leave them out, \
                 they are computed from the poses"
                    .into())
            }
            Self::Quaternion => {
                let [w, x, y, z, px, py] = six(row, 1);
                let pz = row.last().copied().unwrap_or_default();
                let norm = [w, x, y, z].iter().map(|q| q * q).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > MAX_NORM_DEVIATION {
                    return Err(format!("norm of qw, qx, qy, qz = {norm:.3}: must be 1"));
                }
                Ok(at_rest(&Pose { rotation: rotation_of([w, x, y, z]), position: [px, py, pz].into() }))
            }
        }
    }

    /// Numbers of a pose in this format before the first row of a table.
    pub fn before_first(self, home: &[f64; 6]) -> Vec<f64> {
        match self {
            Self::Angles(_) => home.to_vec(),
            Self::Quaternion => vec![1.0, 0.0, 0.0, 0.0],
        }
    }

    /// Numbers of a pose in this format; of equivalent ones, the nearest to the row before.
    pub fn numbers(self, pose: &Pose, near: &[f64]) -> Vec<f64> {
        match self {
            Self::Angles(order) => order.coordinates(pose, &six(near, 0)).into(),
            Self::Quaternion => {
                let near = near.first_chunk().copied().unwrap_or_default();
                quaternion_of(&pose.rotation, &near).iter().chain(&pose.position).copied().collect()
            }
        }
    }
}
