//! Measured lengths, pose, twist and acceleration as messages of ROS 2.

use hexad_client::messages::{MeasuredMessage, StatusMessage};
use hexad_core::control::signals::inputs::Measurement;
use hexad_core::model::inverse_geometry::{leg_lengths_and_rates, universal_joint_angles};
use hexad_core::model::rigid::{Acceleration, Pose, Twist};
use hexad_core::model::task::TaskState;
use hexad_machine::config::Config;
use nalgebra::Vector6;

use crate::conversion::{accel_message, pose_message, transform_message, twist_message};
use crate::ros_messages as ros;

/// Time before and after an instant from which the rates of angles follow \[s\].
const DIFFERENCE_S: f64 = 1e-4;

/// Motion of the platform at one instant.
#[derive(Clone, Copy, Debug)]
pub struct PlatformMotion {
    time_ns: u64,
    pose: Pose,
    twist: Twist,
}

impl PlatformMotion {
    /// Motion of a status; `None` if the pose is unknown.
    pub fn of_status(status: &StatusMessage) -> Option<Self> {
        (status.pose_valid == 1).then(|| Self {
            time_ns: status.header.time_ns,
            pose: TaskState::at_rest(status.x).motion().pose,
            twist: Twist::from_vector(&Vector6::from(status.twist)),
        })
    }

    /// Mean acceleration since an earlier motion; `None` if it is not earlier.
    pub fn acceleration_since(&self, before: &Self) -> Option<Acceleration> {
        let seconds = self.time_ns.checked_sub(before.time_ns)? as f64 * 1e-9;
        let change = self.twist.vector() - before.twist.vector();
        (seconds > 0.0).then(|| Acceleration::from_vector(&(change / seconds)))
    }
}

/// Names of frames, and the difference of the clocks.
pub struct Telemetry<'a> {
    /// Machine of the legs.
    pub config: &'a Config,
    /// Name of the base frame.
    pub base: String,
    /// Name of the platform frame.
    pub platform: String,
    /// Time since 1970 minus CLOCK_MONOTONIC \[ns\].
    pub clock_offset_ns: i64,
}

impl Telemetry<'_> {
    fn header(&self, time_ns: u64) -> ros::Header {
        let stamp = ros::Time::from_nanoseconds(time_ns as i64 + self.clock_offset_ns);
        ros::Header { stamp, frame_id: self.base.clone() }
    }

    /// One sample of all joints, with their names of `hexad export --format urdf`, as readers may keep one message alone: lengths of the
    /// legs, rates and forces if they are known; then the universal joints, on which nothing acts, if the motion is known.
    pub fn joint_state(
        &self,
        measured: &MeasuredMessage,
        motion: Option<&PlatformMotion>,
    ) -> ros::JointState {
        let measurement = Measurement::from(measured);
        let machine = &self.config.machine;
        let estimated = motion.map(|motion| leg_lengths_and_rates(machine, &motion.pose, &motion.twist).1);
        let mut joints = ros::JointState {
            header: self.header(measurement.time_ns),
            name: (1..).zip(measurement.length_m).map(|(leg, _)| format!("prismatic_{leg}")).collect(),
            position: measurement.length_m.into(),
            velocity: measurement.rate_m_s.or(estimated).map(Into::into).unwrap_or_default(),
            effort: measurement.drives.force_n.map(Into::into).unwrap_or_default(),
        };
        let Some(motion) = motion else { return joints };
        let seconds = (measurement.time_ns as i64 - motion.time_ns as i64) as f64 * 1e-9;
        let [before, now, after] = [-DIFFERENCE_S, 0.0, DIFFERENCE_S].map(|difference| {
            let displacement = Twist::from_vector(&(motion.twist.vector() * (seconds + difference)));
            universal_joint_angles(machine, &motion.pose.extrapolated(&displacement))
        });
        let names =
            (1..=now.len()).flat_map(|leg| ["first", "second"].map(|axis| format!("universal_{axis}_{leg}")));
        joints.name.extend(names);
        joints.position.extend(now.as_flattened());
        let changes = after.as_flattened().iter().zip(before.as_flattened());
        joints.velocity.extend(changes.map(|(after, before)| (after - before) / (2.0 * DIFFERENCE_S)));
        if !joints.effort.is_empty() {
            joints.effort.resize(joints.name.len(), 0.0);
        }
        joints
    }

    pub fn pose(&self, motion: &PlatformMotion) -> ros::PoseStamped {
        ros::PoseStamped { header: self.header(motion.time_ns), pose: pose_message(&motion.pose) }
    }

    pub fn twist(&self, motion: &PlatformMotion) -> ros::TwistStamped {
        ros::TwistStamped { header: self.header(motion.time_ns), twist: twist_message(&motion.twist) }
    }

    pub fn accel(&self, motion: &PlatformMotion, acceleration: &Acceleration) -> ros::AccelStamped {
        ros::AccelStamped { header: self.header(motion.time_ns), accel: accel_message(acceleration) }
    }

    pub fn transform(&self, motion: &PlatformMotion) -> ros::TfMessage {
        let transform = ros::TransformStamped {
            header: self.header(motion.time_ns),
            child_frame_id: self.platform.clone(),
            transform: transform_message(&motion.pose),
        };
        ros::TfMessage { transforms: vec![transform] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_of_the_pose_and_the_acceleration_is_a_mean() {
        let config = Config::parse(include_str!("../../../config/motion_base.toml"), "a test").unwrap();
        let motion = |time_ns, velocity| PlatformMotion {
            time_ns,
            pose: config.machine.home_pose(),
            twist: Twist::from_vector(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, velocity)),
        };
        let [before, now] = [motion(1_000_000, 0.1), motion(11_000_000, 0.3)];
        let acceleration = now.acceleration_since(&before).unwrap().vector();
        assert!((acceleration - Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 20.0)).norm() < 1e-9);
        assert!(before.acceleration_since(&now).is_none());

        let telemetry = Telemetry {
            config: &config,
            base: "base".into(),
            platform: "platform".into(),
            clock_offset_ns: 2,
        };
        let mut measured = MeasuredMessage { length_m: [1.5; 6], ..Default::default() };
        measured.header.time_ns = 3_000_000_001;
        let joints = telemetry.joint_state(&measured, Some(&now));
        assert_eq!(joints.header.stamp, ros::Time { sec: 3, nanosec: 3 });
        assert_eq!(
            (joints.name[5].as_str(), joints.position[5], joints.effort.len()),
            ("prismatic_6", 1.5, 0)
        );
        // All legs lengthen when the platform rises.
        assert!(joints.velocity[..6].iter().all(|rate| (0.05..0.3).contains(rate)));
        // The universal joints are at 0 at home, and move on from there with their rates until the measurement.
        assert_eq!((joints.name.len(), joints.name[17].as_str()), (18, "universal_second_6"));
        measured.header.time_ns = 12_000_000;
        let later = telemetry.joint_state(&measured, Some(&now));
        for (angle, rate) in later.position[6..].iter().zip(&later.velocity[6..]) {
            assert!((angle - 1e-3 * rate).abs() < 1e-6 && rate.abs() < 0.3, "{angle} rad at {rate} rad/s");
        }
        assert!(later.velocity[6..].iter().any(|rate| rate.abs() > 0.01));
        measured.rates_valid = 1;
        assert_eq!(telemetry.joint_state(&measured, Some(&now)).velocity[..6], [0.0; 6]);
        assert!(telemetry.joint_state(&MeasuredMessage::default(), None).velocity.is_empty());
    }
}
