//! Straight path of a tool from rest to rest: its origin on a line, its rotation about a fixed axis, both in proportion.

use crate::model::rigid::{Acceleration, Motion, Pose, Twist, exp};
use crate::model::task::TaskState;

use super::frames::Frames;
use super::minimum_jerk::Profile;

/// Path between two poses of a platform, straight for a tool in a work frame.
///
/// ```
/// use hexad_core::model::rigid::Pose;
/// use hexad_core::motion::{frames::Frames, minimum_jerk::rise, tool_path::ToolPath};
/// use nalgebra::{Matrix3, Vector3};
/// let pose = |x| Pose { rotation: Matrix3::identity(), position: Vector3::new(x, 0.0, 1.0) };
/// let path = ToolPath::new(Frames::default(), &pose(0.0), &pose(0.2));
/// assert_eq!(path.at(&rise(1.0, 2.0)).pose, pose(0.1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolPath {
    frames: Frames,
    /// Pose of the tool at the beginning, and its displacement to the end, in the work frame.
    from: Pose,
    displacement: Twist,
}

impl ToolPath {
    /// Path between two poses of the platform.
    pub fn new(frames: Frames, from: &Pose, to: &Pose) -> Self {
        let from = frames.tool_pose(from);
        Self { frames, from, displacement: from.displacement_to(&frames.tool_pose(to)) }
    }

    /// Motion of the platform where the profile has its value: the tool is displaced by that share.
    pub fn at(&self, s: &Profile) -> Motion {
        let Twist { angular, linear } = self.displacement;
        self.frames.platform_motion(&Motion {
            pose: Pose {
                rotation: exp(&(angular * s.value_share)) * self.from.rotation,
                position: self.from.position + linear * s.value_share,
            },
            twist: Twist { angular: angular * s.rate_per_s, linear: linear * s.rate_per_s },
            acceleration: Acceleration { angular: angular * s.accel_per_s2, linear: linear * s.accel_per_s2 },
        })
    }

    /// The same in task coordinates near `near`; `None` where these have no rates, see [`TaskState::of_motion`].
    pub fn task_state(&self, s: &Profile, near: &[f64; 6]) -> Option<TaskState> {
        TaskState::of_motion(&self.at(s), near)
    }
}
