//! The bridge of one machine: setpoints from ROS 2 to the daemon, measured motion from the daemon to ROS 2.

use std::thread::sleep;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use hexad_bridge::machine::join;
use hexad_bridge::rejection::{Rejection, RejectionLog};
use hexad_bridge::setpoint_relay::SetpointRelay;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{MeasuredMessage, StatusMessage, Subscriber};
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::Config;
use ros2_client::{Gid, Publisher, Subscription};
use tracing::info;

use crate::conversion::{pose_setpoint, trajectory_setpoint};
use crate::network_file::{NetworkFile, SetpointTopic};
use crate::node::{BUFFER, BridgeNode, NodeNames};
use crate::requests::serve;
use crate::ros_messages as ros;
use crate::telemetry::{PlatformMotion, Telemetry};

/// Period of the loop.
const PERIOD: Duration = Duration::from_millis(1);

/// Bridge of one machine.
pub struct Bridge<'a> {
    relay: SetpointRelay<'a, Gid>,
    telemetry: Telemetry<'a>,
    poses: Option<Subscription<ros::PoseStamped>>,
    trajectories: Option<Subscription<ros::MultiDofTrajectory>>,
    output: Output,
    rejections: RejectionLog,
    node: BridgeNode,
}

/// Publishers of the machine's motion in ROS 2.
struct Output {
    measured: Subscriber<MeasuredMessage>,
    statuses: Subscriber<StatusMessage>,
    joint_states: Publisher<ros::JointState>,
    transforms: Publisher<ros::TfMessage>,
    poses: Publisher<ros::PoseStamped>,
    twists: Publisher<ros::TwistStamped>,
    accels: Publisher<ros::AccelStamped>,
    before: Option<PlatformMotion>,
    period_ns: u64,
    due_ns: u64,
}

impl<'a> Bridge<'a> {
    /// Joins the machine and ROS 2. An error says what prevents it.
    pub fn open(file: &NetworkFile, config: &'a Config) -> Result<Self, String> {
        let section = &file.ros2;
        let bus = join(&file.name, config)?;
        let mut node = BridgeNode::join(section, section.addresses()?)?;
        let accepts = |topic| section.setpoints.contains(&topic);
        let poses = accepts(SetpointTopic::Pose).then(|| node.subscription("setpoint_pose"));
        let trajectories =
            accepts(SetpointTopic::Trajectory).then(|| node.subscription("setpoint_trajectory"));
        let [base, platform] = ["base", "platform"].map(|frame| format!("{}{frame}", section.frame_prefix));
        let output = Output {
            measured: bus.subscriber(BUFFER).map_err(|error| error.to_string())?,
            statuses: bus.subscriber(BUFFER).map_err(|error| error.to_string())?,
            joint_states: node.publisher("joint_states")?,
            transforms: node.publisher("/tf")?,
            poses: node.publisher("pose")?,
            twists: node.publisher("twist")?,
            accels: node.publisher("acceleration")?,
            before: None,
            period_ns: (1e9 / section.rate_hz) as u64,
            due_ns: 0,
        };
        for request in section.allowed_requests()? {
            serve(config.name.clone(), request, node.trigger(request.name())?, node.names.clone());
        }
        Ok(Self {
            relay: SetpointRelay::new(config),
            telemetry: Telemetry { config, base, platform, clock_offset_ns: 0 },
            poses: poses.transpose()?,
            trajectories: trajectories.transpose()?,
            output,
            rejections: RejectionLog::default(),
            node,
        })
    }

    /// Relays until a signal.
    pub fn run(&mut self, stop: &Stop) {
        self.telemetry.config.deployment.realtime.prepare_peer_thread();
        info!("the bridge is open");
        while !stop.is_requested() {
            sleep(PERIOD);
            self.receive();
            let now_ns = monotonic_ns();
            if let Err(error) = self.relay.publish(now_ns) {
                self.rejections
                    .add(&Rejection::Port(error.to_string()), || self.telemetry.config.name.clone());
            }
            if now_ns >= self.output.due_ns {
                let unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
                self.telemetry.clock_offset_ns = unix_ns as i64 - now_ns as i64;
                self.output.publish(&self.telemetry, now_ns);
            }
        }
    }

    fn receive(&mut self) {
        let Self { relay, telemetry, poses, trajectories, rejections, node, .. } = self;
        let (names, home, base) = (&node.names, &telemetry.config.machine.home, telemetry.base.as_str());
        drain(poses, rejections, names, |message, id, arrival_ns| {
            let stamp_ns = message.header.stamp.nanoseconds();
            relay.add(&id, stamp_ns, arrival_ns, || pose_setpoint(message, base, home))
        });
        drain(trajectories, rejections, names, |message, id, arrival_ns| {
            let stamp_ns = message.header.stamp.nanoseconds();
            relay.add(&id, stamp_ns, arrival_ns, || trajectory_setpoint(message, base, home))
        });
    }
}

/// Adds the messages that have arrived, and logs the rejected ones.
fn drain<M: ros::RosMessage + 'static>(
    subscription: &Option<Subscription<M>>,
    rejections: &mut RejectionLog,
    names: &NodeNames,
    mut add: impl FnMut(&M, Gid, u64) -> Result<(), Rejection>,
) {
    let Some(subscription) = subscription else { return };
    for _ in 0..BUFFER {
        let (outcome, id) = match subscription.take() {
            Ok(Some((message, info))) => {
                let id = info.publisher_gid();
                (add(&message, id, monotonic_ns()), id)
            }
            Ok(None) => return,
            Err(error) => (Err(Rejection::Format(error.to_string())), Gid::ZERO),
        };
        if let Err(rejection) = outcome {
            rejections.add(&rejection, || names.of(&id));
        }
    }
}

impl Output {
    fn publish(&mut self, telemetry: &Telemetry, now_ns: u64) {
        self.due_ns = (self.due_ns + self.period_ns).max(now_ns);
        let status = self.statuses.receive_latest();
        let motion = status.as_ref().and_then(PlatformMotion::of_status);
        if let Some(measured) = self.measured.receive_latest() {
            // At the rate of the cycles some samples come without a status: then the motion is that of the sample before.
            let newest = if status.is_some() { motion } else { self.before };
            let _ = self.joint_states.publish(telemetry.joint_state(&measured, newest.as_ref()));
        }
        let before = std::mem::replace(&mut self.before, motion);
        let Some(motion) = &motion else { return };
        let _ = self.transforms.publish(telemetry.transform(motion));
        let _ = self.poses.publish(telemetry.pose(motion));
        let _ = self.twists.publish(telemetry.twist(motion));
        if let Some(acceleration) = before.and_then(|before| motion.acceleration_since(&before)) {
            let _ = self.accels.publish(telemetry.accel(motion, &acceleration));
        }
    }
}
