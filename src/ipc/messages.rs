//! Messages on the topics `hexad/<name>/...`: `#[repr(C)]`, plain numbers, SI units and radians.
//!
//! Each begins with a [`Header`]. iceoryx2 compares only name, size and alignment of a type, so the header
//! carries a schema version; a reader ignores messages of another one.
//!
//! # In other languages
//!
//! Declare the same structs: fields in this order with the alignment of C, which leaves no gaps (numbers of 4 bytes
//! come in pairs). `tests/clients/hexad.py` does, and is tested against this file.
//!
//! | | |
//! | --- | --- |
//! | iceoryx2 | 0.9.3 exactly, publish-subscribe, IPC service, no user header |
//! | topic | `hexad/<name>/<last part>`: `setpoint`, `measured`, `command`, `force`, `status` |
//! | type name | `hexad_<last part>`, as each struct says |
//! | settings | open or create with `max_publishers` 4, `max_subscribers` 16, `max_nodes` 32, `subscriber_max_buffer_size` 256, safe overflow, `history_size` 0: whoever comes first sets them for all |
//! | size in bytes | setpoint 176, measured 232, command 40, force 112, status 1360 |
//! | places | iceoryx2's defaults. Where its root path is another user's: that path and `-<user ID>`, and the prefix `iox2_<user ID>_` |
//! | user | all participants of a machine are of one |
//! | signals | the daemon's node leaves them alone (`SignalHandlingMode::Disabled`), so may yours |
//!
//! Who publishes fills in the header and counts from 1. Who subscribes takes what is of this schema, whole and further
//! in order of (epoch, sequence) than all before: after a source died, its last message may still come.
//!
//! # In simulated time
//!
//! With `realtime.release = "lockstep"` the topics are `hexad-simulated/<name>/...`. All times are then those of the
//! plant, which begins where it likes; the epoch of `force` is the time of its first message. Each step goes like this:
//! the plant publishes `measured` of an instant; the setpoint source answers with `setpoint` of that `time_ns`, before it
//! with a `command` if it wants; the daemon publishes `status`, then `force`, with that instant as `time_ns` and
//! `release_ns`; the plant lets a period pass. A plant without answer says the same again, a source then answers the
//! same again: at first somebody may not be there. When the source has left, the daemon goes on without.

use iceoryx2::prelude::ZeroCopySend;

use super::statistics::Statistics;

/// Version of every struct in this file. Any change of layout or meaning raises it.
pub const SCHEMA: u32 = 4;

/// First field of every message.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_header")]
#[repr(C)]
pub struct Header {
    /// [`SCHEMA`]
    pub schema: u32,
    /// Zero.
    pub reserved: u32,
    /// Identifies one life of the source: its CLOCK_MONOTONIC start time \[ns\]. The newest life wins; one that has
    /// not begun is ignored.
    pub epoch: u64,
    /// Counts the messages of this life, from 1.
    pub sequence: u64,
    /// CLOCK_MONOTONIC instant at which the content holds \[ns\].
    pub time_ns: u64,
}

/// What carries a [`Header`] and the name of its topic.
pub trait Message: Copy + core::fmt::Debug + ZeroCopySend + 'static {
    /// Last part of the topic name.
    const TOPIC: &'static str;
    fn header(&self) -> &Header;
    fn header_mut(&mut self) -> &mut Header;
    /// Fills in what depends on everything else, last of all.
    fn seal(&mut self) {}
    /// Whether it is what was sealed.
    fn is_whole(&self) -> bool {
        true
    }
}

/// Where the platform shall be: X = alpha, beta, gamma \[rad\], x, y, z \[m\], and derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_setpoint")]
#[repr(C)]
pub struct SetpointMessage {
    pub header: Header,
    pub x: [f64; 6],
    pub x_rate: [f64; 6],
    pub x_accel: [f64; 6],
}

/// What the drives measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_measured")]
#[repr(C)]
pub struct MeasuredMessage {
    pub header: Header,
    /// L \[m\].
    pub length_m: [f64; 6],
    /// L' \[m/s\].
    pub length_rate_m_s: [f64; 6],
    /// 1 if `x` and `twist` are filled in (a simulator, an external tracker), else 0. The control loop
    /// does not use them.
    pub pose_valid: u32,
    /// Zero.
    pub reserved: u32,
    /// X.
    pub x: [f64; 6],
    /// omega \[rad/s\], then v \[m/s\], base axes.
    pub twist: [f64; 6],
}

/// What the actuators shall push with. A driver brakes at a message that is not `valid`, and when its own
/// watchdog has seen none that counts for too long. A message counts only if schema and checksum are right,
/// the sequence goes forward and `time_ns` is past, and not long: `src/host/plant` is an example.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_force")]
#[repr(C)]
pub struct ForceMessage {
    pub header: Header,
    /// Gamma \[N\]; positive pushes the platform away from the base. Zero unless valid.
    pub force_n: [f64; 6],
    /// 1 if the forces may be applied, else 0.
    pub valid: u32,
    /// Number of [`crate::control::state::State`].
    pub state: u32,
    /// Number of [`crate::control::diagnostic::DiagnosticCode`].
    pub fault: u32,
    /// Bits of the [`crate::control::limits::Limit`]s that this cycle is at.
    pub limiting: u32,
    /// Instant for which the forces were computed \[ns\]: the cycle's release, or with external release the
    /// time of the measurement that released it.
    pub release_ns: u64,
    /// CRC-32 (of zlib, PNG, Ethernet) of the bytes before it.
    pub checksum: u32,
    /// Zero.
    pub reserved: u32,
}

impl ForceMessage {
    /// Whether a driver may apply it, if it is young and newer than the one before.
    pub fn may_be_applied(&self) -> bool {
        self.header.schema == SCHEMA
            && self.checksum == self.computed_checksum()
            && self.valid == 1
            && self.force_n.iter().all(|force| force.is_finite())
    }

    /// What `checksum` must be.
    pub fn computed_checksum(&self) -> u32 {
        let Self { header, force_n, valid, state, fault, limiting, release_ns, .. } = self;
        let Header { schema, reserved, epoch, sequence, time_ns } = header;
        let mut crc = crc32fast::Hasher::new();
        [schema, reserved].iter().for_each(|field| crc.update(&field.to_ne_bytes()));
        [epoch, sequence, time_ns].iter().for_each(|field| crc.update(&field.to_ne_bytes()));
        force_n.iter().for_each(|force| crc.update(&force.to_ne_bytes()));
        [valid, state, fault, limiting].iter().for_each(|field| crc.update(&field.to_ne_bytes()));
        crc.update(&release_ns.to_ne_bytes());
        crc.finalize()
    }
}

/// What an operator asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_command")]
#[repr(C)]
pub struct CommandMessage {
    pub header: Header,
    /// Number of [`crate::control::state::Request`].
    pub request: u32,
    /// Zero.
    pub reserved: u32,
}

/// How the daemon is doing; published every cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("hexad_status")]
#[repr(C)]
pub struct StatusMessage {
    pub header: Header,
    /// Number of [`crate::control::state::State`].
    pub state: u32,
    /// Number of [`crate::control::diagnostic::DiagnosticCode`].
    pub fault: u32,
    /// Number of the [`crate::control::diagnostic::DiagnosticCode`] why the request `answered_*` was refused; 0 if it was
    /// not.
    pub refused: u32,
    /// Bits of the [`crate::control::limits::Limit`]s that this cycle is at.
    pub limiting: u32,
    /// The number behind `fault` and its bound, in the unit of [`crate::control::diagnostic::DiagnosticCode::comparison`].
    pub fault_value: f64,
    pub fault_bound: f64,
    /// Leg or axis of the fault, from 1; 0 if it is of neither.
    pub fault_index: u32,
    /// Zero.
    pub reserved: u32,
    /// Epoch and sequence number of the last command message that was carried out or refused.
    pub answered_epoch: u64,
    pub answered_sequence: u64,
    /// 1 if `x` and `twist` are known.
    pub pose_valid: u32,
    /// 1 if `position_error_m` and `orientation_error_rad` are known.
    pub error_valid: u32,
    /// Measured pose as X, by forward kinematics.
    pub x: [f64; 6],
    /// Measured omega \[rad/s\], then v \[m/s\], base axes.
    pub twist: [f64; 6],
    /// Condition of that pose.
    pub condition: f64,
    /// Until a singular pose, if the platform goes on as it does; infinite if that leads to none.
    pub singular_in_s: f64,
    /// C_d - C \[m\].
    pub position_error_m: [f64; 3],
    /// log(R_d R^T) \[rad\].
    pub orientation_error_rad: [f64; 3],
    /// Torque about C \[N m\], then force \[N\], base axes, that the platform gets more than was asked for: zero
    /// unless forces are limited.
    pub wrench_error: [f64; 6],
    /// Cycles since start.
    pub cycles: u64,
    /// Cycles that woke later than the configured threshold.
    pub late_wakeups: u64,
    /// Cycles still computing at their next release.
    pub overruns: u64,
    /// Grid points left out because the thread was not ready for them.
    pub skipped: u64,
    /// Cycles run at once because their release had passed.
    pub caught_up: u64,
    /// Calls of the real-time thread to the allocator since its first cycle: zero.
    pub allocations: u64,
    /// The same of the io thread: they come with peers that come and go.
    pub io_allocations: u64,
    /// Cycles under control that had no new measurement, or setpoint, to believe.
    pub without_measurement: u64,
    pub without_setpoint: u64,
    /// Messages passed over: of another schema.
    pub rejected_schema: u64,
    /// Messages passed over: of an older source, that goes on beside a newer one or left them behind.
    pub rejected_older_source: u64,
    /// Messages passed over: seen before, or unreadable.
    pub rejected_repeated: u64,
    pub statistics: Statistics,
}

macro_rules! message {
    ($type:ty, $topic:literal $(, $checksum:ident = $compute:ident)?) => {
        impl Message for $type {
            const TOPIC: &'static str = $topic;
            fn header(&self) -> &Header {
                &self.header
            }
            fn header_mut(&mut self) -> &mut Header {
                &mut self.header
            }
            $(fn seal(&mut self) {
                self.$checksum = self.$compute();
            }
            fn is_whole(&self) -> bool {
                self.$checksum == self.$compute()
            })?
        }
    };
}

message!(SetpointMessage, "setpoint");
message!(MeasuredMessage, "measured");
message!(ForceMessage, "force", checksum = computed_checksum);
message!(StatusMessage, "status");
message!(CommandMessage, "command");
