//! Motions from and to messages of ROS 2, whose quantities are all in the frame `base`.

use hexad_bridge::rejection::Rejection;
use hexad_core::control::signals::inputs::SetpointKind;
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad_core::model::task::{TaskState, task_coordinates};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::ros_messages as ros;

/// Largest difference of a quaternion's norm from 1: many times the rounding of numbers in single precision.
const MAX_NORM_ERROR: f64 = 1e-3;

/// A sample of a motion: kind, X, and time after the stamp \[ns\]. `frame` is the name of the frame of all setpoints.
pub fn pose_setpoint(
    message: &ros::PoseStamped,
    frame: &str,
    near: &[f64; 6],
) -> Result<(SetpointKind, TaskState, i64), Rejection> {
    check_frame(&message.header, frame)?;
    Ok((SetpointKind::Pose, TaskState::at_rest(pose_x(&message.pose, near)?), 0))
}

/// A point of a trajectory, likewise.
pub fn trajectory_setpoint(
    message: &ros::MultiDofTrajectory,
    frame: &str,
    near: &[f64; 6],
) -> Result<(SetpointKind, TaskState, i64), Rejection> {
    check_frame(&message.header, frame)?;
    let (task, ahead_ns) = trajectory_point(message, near)?;
    Ok((SetpointKind::Motion, task, ahead_ns))
}

fn check_frame(header: &ros::Header, frame: &str) -> Result<(), Rejection> {
    if header.frame_id == frame {
        return Ok(());
    }
    Err(Rejection::Frame(header.frame_id.chars().take(64).collect(), frame.into()))
}

/// X of a pose, with the angles nearest to the angles of `near`.
fn pose_x(message: &ros::Pose, near: &[f64; 6]) -> Result<[f64; 6], Rejection> {
    let ros::Point { x, y, z } = message.position;
    Ok(task_coordinates(&pose(Vector3::new(x, y, z), &message.orientation)?, near))
}

/// X, X' and X'' of the only point of a trajectory, and its time after the stamp \[ns\].
fn trajectory_point(
    message: &ros::MultiDofTrajectory,
    near: &[f64; 6],
) -> Result<(TaskState, i64), Rejection> {
    let [point] = message.points.as_slice() else { return Err(Rejection::Points(message.points.len())) };
    let ([transform], [velocity], [acceleration]) =
        (point.transforms.as_slice(), point.velocities.as_slice(), point.accelerations.as_slice())
    else {
        return Err(Rejection::Derivatives);
    };
    let [angular, linear] = [&acceleration.angular, &acceleration.linear].map(vector);
    let motion = Motion {
        pose: pose(vector(&transform.translation), &transform.rotation)?,
        twist: Twist { angular: vector(&velocity.angular), linear: vector(&velocity.linear) },
        acceleration: Acceleration { angular, linear },
    };
    let task = TaskState::of_motion(&motion, near).ok_or(Rejection::AngleRates)?;
    Ok((task, point.time_from_start.nanoseconds()))
}

fn pose(position: Vector3<f64>, rotation: &ros::Quaternion) -> Result<Pose, Rejection> {
    let ros::Quaternion { x, y, z, w } = *rotation;
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if !(norm + position.sum()).is_finite() {
        return Err(Rejection::NotFinite);
    }
    if !((norm - 1.0).abs() <= MAX_NORM_ERROR) {
        return Err(Rejection::Norm(norm));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix();
    Ok(Pose { rotation: *rotation.matrix(), position })
}

fn vector(message: &ros::Vector3) -> Vector3<f64> {
    Vector3::new(message.x, message.y, message.z)
}

fn message(vector: &Vector3<f64>) -> ros::Vector3 {
    ros::Vector3 { x: vector.x, y: vector.y, z: vector.z }
}

fn quaternion(rotation: &Matrix3<f64>) -> ros::Quaternion {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    ros::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

pub fn pose_message(pose: &Pose) -> ros::Pose {
    let ros::Vector3 { x, y, z } = message(&pose.position);
    ros::Pose { position: ros::Point { x, y, z }, orientation: quaternion(&pose.rotation) }
}

pub fn transform_message(pose: &Pose) -> ros::Transform {
    ros::Transform { translation: message(&pose.position), rotation: quaternion(&pose.rotation) }
}

pub fn twist_message(twist: &Twist) -> ros::Twist {
    ros::Twist { linear: message(&twist.linear), angular: message(&twist.angular) }
}

pub fn accel_message(acceleration: &Acceleration) -> ros::Accel {
    ros::Accel { linear: message(&acceleration.linear), angular: message(&acceleration.angular) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: [f64; 6] = [0.1, -0.2, 0.3, 0.01, -0.02, 1.3];

    fn trajectory(state: &TaskState) -> ros::MultiDofTrajectory {
        let motion = state.motion();
        let ros::Accel { linear, angular } = accel_message(&motion.acceleration);
        let point = ros::MultiDofPoint {
            transforms: vec![transform_message(&motion.pose)],
            velocities: vec![twist_message(&motion.twist)],
            accelerations: vec![ros::Twist { linear, angular }],
            time_from_start: ros::Duration { sec: 1, nanosec: 5 },
        };
        ros::MultiDofTrajectory { points: vec![point], ..Default::default() }
    }

    #[test]
    fn a_motion_survives_both_ways() {
        let pose = pose_message(&TaskState::at_rest(X).motion().pose);
        let found = pose_x(&pose, &X).unwrap();
        assert!(found.iter().zip(X).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        let state = TaskState {
            xd: [0.4, 0.5, -0.6, 0.7, -0.8, 0.9].into(),
            xdd: [1.0, -2.0, 3.0, -4.0, 5.0, -6.0].into(),
            ..TaskState::at_rest(X)
        };
        let (found, after_ns) = trajectory_point(&trajectory(&state), &X).unwrap();
        assert_eq!(after_ns, 1_000_000_005);
        let error =
            (found.x - state.x).norm() + (found.xd - state.xd).norm() + (found.xdd - state.xdd).norm();
        assert!(error < 1e-11, "{error}");
    }

    #[test]
    fn what_is_no_motion_is_named() {
        let mut pose = pose_message(&TaskState::at_rest(X).motion().pose);
        pose.position.y = f64::NAN;
        assert!(matches!(pose_x(&pose, &X), Err(Rejection::NotFinite)));
        pose = ros::Pose::default();
        assert!(matches!(pose_x(&pose, &X), Err(Rejection::Norm(0.0))));
        let good = trajectory(&TaskState::at_rest(X));
        let mut bad = good.clone();
        bad.points.clear();
        assert!(matches!(trajectory_point(&bad, &X), Err(Rejection::Points(0))));
        bad = good.clone();
        bad.points[0].velocities.clear();
        assert!(matches!(trajectory_point(&bad, &X), Err(Rejection::Derivatives)));
        bad = good;
        bad.header.frame_id = "map".into();
        let other = Err(Rejection::Frame("map".into(), "base".into()));
        assert_eq!(trajectory_setpoint(&bad, "base", &X), other);
    }
}
