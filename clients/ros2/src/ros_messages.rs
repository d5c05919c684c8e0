//! Messages of ROS 2, field by field as in their definitions.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

/// Message of a topic or service.
pub trait RosMessage: Message {
    /// Name of the type, as in `sensor_msgs/msg/JointState`.
    const NAME: &'static str;
}

macro_rules! ros_messages {
    ($($name:literal $type:ident { $($field:ident: $kind:ty),+ })+) => {$(
        #[doc = concat!("`", $name, "`.")]
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(rename = $name)]
        pub struct $type { $(pub $field: $kind),+ }

        impl Message for $type {}

        impl RosMessage for $type {
            const NAME: &'static str = $name;
        }
    )+};
}

ros_messages! {
    "builtin_interfaces/msg/Time" Time { sec: i32, nanosec: u32 }
    "builtin_interfaces/msg/Duration" Duration { sec: i32, nanosec: u32 }
    "std_msgs/msg/Header" Header { stamp: Time, frame_id: String }
    "geometry_msgs/msg/Point" Point { x: f64, y: f64, z: f64 }
    "geometry_msgs/msg/Vector3" Vector3 { x: f64, y: f64, z: f64 }
    "geometry_msgs/msg/Quaternion" Quaternion { x: f64, y: f64, z: f64, w: f64 }
    "geometry_msgs/msg/Pose" Pose { position: Point, orientation: Quaternion }
    "geometry_msgs/msg/PoseStamped" PoseStamped { header: Header, pose: Pose }
    "geometry_msgs/msg/Twist" Twist { linear: Vector3, angular: Vector3 }
    "geometry_msgs/msg/TwistStamped" TwistStamped { header: Header, twist: Twist }
    "geometry_msgs/msg/Accel" Accel { linear: Vector3, angular: Vector3 }
    "geometry_msgs/msg/AccelStamped" AccelStamped { header: Header, accel: Accel }
    "geometry_msgs/msg/Transform" Transform { translation: Vector3, rotation: Quaternion }
    "geometry_msgs/msg/TransformStamped" TransformStamped { header: Header, child_frame_id: String, transform: Transform }
    "tf2_msgs/msg/TFMessage" TfMessage { transforms: Vec<TransformStamped> }
    "sensor_msgs/msg/JointState" JointState {
        header: Header, name: Vec<String>, position: Vec<f64>, velocity: Vec<f64>, effort: Vec<f64>
    }
    "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint" MultiDofPoint {
        transforms: Vec<Transform>, velocities: Vec<Twist>, accelerations: Vec<Twist>, time_from_start: Duration
    }
    "trajectory_msgs/msg/MultiDOFJointTrajectory" MultiDofTrajectory {
        header: Header, joint_names: Vec<String>, points: Vec<MultiDofPoint>
    }
    "std_srvs/srv/Trigger_Request" TriggerRequest { structure_needs_at_least_one_member: u8 }
    "std_srvs/srv/Trigger_Response" TriggerResponse { success: bool, message: String }
}

impl Time {
    /// Time since 1970 \[ns\].
    pub fn nanoseconds(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    pub fn from_nanoseconds(time_ns: i64) -> Self {
        let (sec, nanosec) = (time_ns.div_euclid(1_000_000_000), time_ns.rem_euclid(1_000_000_000));
        Self { sec: sec as i32, nanosec: nanosec as u32 }
    }
}

impl Duration {
    pub fn nanoseconds(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}
