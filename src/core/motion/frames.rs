//! Change of coordinates: the platform in the base frame to a tool in a work frame, and back.
//!
//! ```text
//! base --work--> work frame           fixed in the base:      R_w, p_w, its axes and origin in the base frame
//! platform --tool--> tool frame       fixed in the platform:  R_t, p_t, its axes and origin in the platform frame
//! ```
//!
//! | | tool in the work frame | platform in the base frame |
//! | --- | --- | --- |
//! | axes | `R_wt = R_w^T R R_t` | `R = R_w R_wt R_t^T` |
//! | origin | `p = R_w^T (C + r - p_w)` | `C = p_w + R_w p - r` |
//! | twist | `omega_w = R_w^T omega`, `p' = R_w^T (v + omega x r)` | `omega = R_w omega_w`, `v = R_w p' - omega x r` |
//! | acceleration | `p'' = R_w^T (v' + omega' x r + omega x (omega x r))` | `v' = R_w p'' - omega' x r - omega x (omega x r)` |
//!
//! `r = R p_t` is the tool's origin from C, in base axes. A rotation of the tool in the work frame is about the tool's
//! origin. Both directions are exact to rounding. Limits and the envelope bound the platform in the base frame: they are
//! not applied here.

use nalgebra::{Matrix3, Vector3};

use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// A tool frame and a work frame: coordinates in these frames describe the tool in the work frame. The default is the
/// platform in the base frame.
///
/// ```
/// use hexad_core::model::rigid::Pose;
/// use hexad_core::motion::frames::Frames;
/// use nalgebra::{Matrix3, Vector3};
/// // A mirror's vertex is the tool, 0.35 m above the platform's origin.
/// let vertex = Pose { rotation: Matrix3::identity(), position: Vector3::new(0.0, 0.0, 0.35) };
/// let frames = Frames { tool: vertex, ..Frames::default() };
/// // The mirror turns by 90 degrees about its vertex: the platform goes aside by the distance.
/// let turned = Pose { rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0), position: Vector3::z() };
/// let platform = frames.platform_pose(&turned);
/// assert_eq!(platform.position, Vector3::new(0.0, 0.35, 1.0));
/// assert_eq!(frames.tool_pose(&platform), turned);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames {
    /// The work frame in the base frame: `R_w`, `p_w`.
    pub work: Pose,
    /// The tool frame in the platform frame: `R_t`, `p_t`.
    pub tool: Pose,
}

impl Default for Frames {
    fn default() -> Self {
        let same = Pose { rotation: Matrix3::identity(), position: Vector3::zeros() };
        Self { work: same, tool: same }
    }
}

impl Frames {
    /// Pose of the tool in the work frame.
    pub fn tool_pose(&self, platform: &Pose) -> Pose {
        let to_work = self.work.rotation.transpose();
        let arm = platform.rotation * self.tool.position;
        Pose {
            rotation: to_work * (platform.rotation * self.tool.rotation),
            position: to_work * (platform.position + arm - self.work.position),
        }
    }

    /// Pose of the platform in the base frame; inverse of [`Self::tool_pose`].
    pub fn platform_pose(&self, tool: &Pose) -> Pose {
        let rotation = self.work.rotation * (tool.rotation * self.tool.rotation.transpose());
        let arm = rotation * self.tool.position;
        Pose { rotation, position: self.work.position + self.work.rotation * tool.position - arm }
    }

    /// Motion of the tool in the work frame, in work axes.
    pub fn tool_motion(&self, platform: &Motion) -> Motion {
        let to_work = self.work.rotation.transpose();
        let Motion { pose, twist, acceleration } = platform;
        let arm = ArmMotion::new(&(pose.rotation * self.tool.position), twist, acceleration);
        Motion {
            pose: self.tool_pose(pose),
            twist: Twist {
                angular: to_work * twist.angular,
                linear: to_work * (twist.linear + arm.velocity),
            },
            acceleration: Acceleration {
                angular: to_work * acceleration.angular,
                linear: to_work * (acceleration.linear + arm.acceleration),
            },
        }
    }

    /// Motion of the platform in the base frame, in base axes; inverse of [`Self::tool_motion`].
    pub fn platform_motion(&self, tool: &Motion) -> Motion {
        let to_base = &self.work.rotation;
        let pose = self.platform_pose(&tool.pose);
        let turned = |angular: &Vector3<f64>, linear: &Vector3<f64>| (to_base * angular, to_base * linear);
        let (angular, linear) = turned(&tool.twist.angular, &tool.twist.linear);
        let twist = Twist { angular, linear };
        let (angular, linear) = turned(&tool.acceleration.angular, &tool.acceleration.linear);
        let acceleration = Acceleration { angular, linear };
        let arm = ArmMotion::new(&(pose.rotation * self.tool.position), &twist, &acceleration);
        Motion {
            pose,
            twist: Twist { linear: twist.linear - arm.velocity, ..twist },
            acceleration: Acceleration { linear: acceleration.linear - arm.acceleration, ..acceleration },
        }
    }
}

/// Motion of the tool's origin relative to C, in base axes.
struct ArmMotion {
    /// `omega x r`
    velocity: Vector3<f64>,
    /// `omega' x r + omega x (omega x r)`
    acceleration: Vector3<f64>,
}

impl ArmMotion {
    /// Only the angular parts count.
    fn new(arm: &Vector3<f64>, twist: &Twist, acceleration: &Acceleration) -> Self {
        let velocity = twist.angular.cross(arm);
        Self { velocity, acceleration: acceleration.angular.cross(arm) + twist.angular.cross(&velocity) }
    }
}
