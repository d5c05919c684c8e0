//! State of the machine as messages of Zenoh: CDR, as in recordings.

use std::time::{SystemTime, UNIX_EPOCH};

use hexad_client::messages::cdr::CdrWriter;
use hexad_client::messages::layout::Declared;
use hexad_client::messages::{
    Bus, ForceMessage, MeasuredMessage, Message, StatisticsMessage, StatusMessage, Subscriber,
};
use hexad_core::model::task::TaskState;
use nalgebra::{Rotation3, UnitQuaternion};
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Session, Wait};

use crate::network_file::ZenohSection;

/// Messages of the machine that are kept until the next pass of the loop.
const BUFFER: usize = 64;

/// Rate that no message of the machine has: all of them are published \[Hz\].
const EVERY_HZ: f64 = 1e6;

/// Publishers of one machine.
pub struct Telemetry {
    statuses: Subscriber<StatusMessage>,
    status: Output,
    pose: Output,
    statistics: Topic<StatisticsMessage>,
    measured: Topic<MeasuredMessage>,
    force: Topic<ForceMessage>,
}

/// A topic of the machine that is published as it is.
struct Topic<M: Message> {
    subscriber: Subscriber<M>,
    output: Output,
}

/// Publisher with a largest rate.
struct Output {
    publisher: Publisher<'static>,
    /// `None` if nothing is published.
    period_ns: Option<u64>,
    due_ns: u64,
}

impl Telemetry {
    /// Telemetry of the machine of `bus`, whose keys begin with `hexad/machine`.
    pub fn new(bus: &Bus, session: &Session, machine: &str, section: &ZenohSection) -> Result<Self, String> {
        let output = |name: &str, schema: &str, rate_hz| Output::new(session, machine, name, schema, rate_hz);
        Ok(Self {
            statuses: bus.subscriber(BUFFER).map_err(|error| error.to_string())?,
            status: output(StatusMessage::TOPIC, StatusMessage::LAYOUT.type_name, section.status_hz)?,
            pose: output("pose", "geometry_msgs/msg/PoseStamped", section.pose_hz)?,
            statistics: Topic::new(
                bus,
                output(StatisticsMessage::TOPIC, StatisticsMessage::LAYOUT.type_name, EVERY_HZ)?,
            )?,
            measured: Topic::new(
                bus,
                output(MeasuredMessage::TOPIC, MeasuredMessage::LAYOUT.type_name, section.measured_hz)?,
            )?,
            force: Topic::new(
                bus,
                output(ForceMessage::TOPIC, ForceMessage::LAYOUT.type_name, section.force_hz)?,
            )?,
        })
    }

    /// Publishes what is due.
    pub fn publish(&mut self, now_ns: u64) {
        if let Some(status) = self.statuses.receive_latest() {
            self.status.put(now_ns, || message_bytes(&status));
            if status.pose_valid == 1 {
                self.pose.put(now_ns, || pose_bytes(&status, now_ns));
            }
        }
        self.statistics.publish(now_ns);
        self.measured.publish(now_ns);
        self.force.publish(now_ns);
    }
}

impl<M: Message + Declared> Topic<M> {
    fn new(bus: &Bus, output: Output) -> Result<Self, String> {
        Ok(Self { subscriber: bus.subscriber(BUFFER).map_err(|error| error.to_string())?, output })
    }

    fn publish(&mut self, now_ns: u64) {
        if let Some(message) = self.subscriber.receive_latest() {
            self.output.put(now_ns, || message_bytes(&message));
        }
    }
}

impl Output {
    fn new(session: &Session, machine: &str, name: &str, schema: &str, rate_hz: f64) -> Result<Self, String> {
        // A sample that is lost or held up is replaced by the next one.
        let publisher = session
            .declare_publisher(format!("hexad/{machine}/{name}"))
            .encoding(Encoding::APPLICATION_CDR.with_schema(schema))
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::InteractiveLow)
            .reliability(Reliability::BestEffort)
            .express(true)
            .wait()
            .map_err(|error| error.to_string())?;
        Ok(Self { publisher, period_ns: (rate_hz > 0.0).then(|| (1e9 / rate_hz) as u64), due_ns: 0 })
    }

    fn put(&mut self, now_ns: u64, content: impl FnOnce() -> Vec<u8>) {
        let Some(period_ns) = self.period_ns.filter(|_| now_ns >= self.due_ns) else { return };
        self.due_ns = (self.due_ns + period_ns).max(now_ns);
        // An error is that the session is closed, and then the bridge ends.
        let _ = self.publisher.put(content()).wait();
    }
}

/// A message of the machine as CDR.
fn message_bytes(message: &impl Declared) -> Vec<u8> {
    CdrWriter::new(vec![]).bytes(message.bytes()).finish()
}

/// The measured pose as `geometry_msgs/PoseStamped`, with its instant since 1970.
fn pose_bytes(status: &StatusMessage, now_ns: u64) -> Vec<u8> {
    let unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
    let pose = TaskState::at_rest(status.x).motion().pose;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    let mut message = CdrWriter::new(vec![]);
    message.time(unix_ns.saturating_sub(now_ns.saturating_sub(status.header.time_ns)));
    message.text("base");
    message.floats(pose.position.as_slice());
    // x, y, z, w.
    message.floats(rotation.coords.as_slice());
    message.finish()
}
