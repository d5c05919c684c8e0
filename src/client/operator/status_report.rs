//! Answer of a daemon to `status`, in the units of the messages.

use serde::{Deserialize, Deserializer, Serialize};

use super::ride::{RideOrder, RidePhase};

/// State of the daemon, its machine and its topics, in SI units and radians.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatusReport {
    /// Version, commit and build profile of the daemon.
    pub version: String,
    /// Name of the machine.
    pub machine: String,
    /// Process of the daemon.
    pub process_id: u32,
    /// Stops so far, for requests that may lead to control; `None` if the daemon has not answered.
    pub stops: Option<StopNumber>,
    /// Problems of the host, each with its remedy.
    pub warnings: Vec<String>,
    /// The configuration in force.
    pub configuration: ConfigurationReport,
    /// Age of the described cycle \[s\]; `None` before the first.
    pub age_s: Option<f64>,
    /// `limits.scale`.
    pub limits_scale: f64,
    /// Names of the limits that the cycle has reached or nearly reached.
    pub active_limits: Vec<String>,
    /// Rate and missed deadlines.
    pub timing: TimingReport,
    /// Measured X; `None` if the pose is unknown.
    pub pose: Option<[f64; 6]>,
    /// X of the newest setpoint; `None` if none ever arrived, or if it is not finite.
    pub setpoint: Option<[f64; 6]>,
    /// X of the target that is followed or held; `None` if the newest setpoint is no target, or without control.
    pub target: Option<[f64; 6]>,
    /// Whether the platform is in position.
    pub in_position: bool,
    /// Distance \[m\] and angle \[rad\] from the pose to the newest setpoint; `None` if one of them is unknown.
    pub setpoint_distance: Option<[f64; 2]>,
    /// Reference minus measured under control, else setpoint minus measured \[m\].
    pub position_error_m: Option<[f64; 3]>,
    /// The same of the orientation \[rad\].
    pub orientation_error_rad: Option<[f64; 3]>,
    /// Condition of the pose; `None` if the pose is unknown.
    pub condition: Option<f64>,
    /// `limits.condition`.
    pub condition_limit: f64,
    /// Time until a singular pose if the motion continues \[s\]; `None` if none is ahead.
    pub time_to_singularity_s: Option<f64>,
    /// Measured legs; empty before the first measurement.
    pub legs: Vec<LegReport>,
    /// `actuator.min_length_m` and `actuator.max_length_m`.
    pub stroke_m: [f64; 2],
    /// Smallest length and angle that are worth showing \[m\], \[rad\]; from the noise of the lengths and the size of the machine.
    pub resolution: [f64; 2],
    /// `actuator.max_force_n`.
    pub max_force_n: f64,
    /// Senders of the inputs.
    pub sources: Vec<SourceReport>,
}

/// How many stops a daemon has been asked for: `stop`, `off`, `estop` and `park`, by any way. Who asks for control sends the number
/// that he has seen; after a stop it is another one, and so it is after a new start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopNumber {
    /// Unix time at which the daemon began \[us\].
    pub daemon: u64,
    /// Stops since then, modulo 2^32.
    pub count: u32,
}

/// Machine file in force.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConfigurationReport {
    /// The file as the daemon was started with it.
    pub file: String,
    /// SHA-1 of the file as it was read, as `sha1sum` prints it.
    pub sha1: String,
    /// Unix time at which it was read \[s\].
    pub loaded_unix_s: u64,
    /// Number of reloads that were carried out since start.
    pub reloads: u64,
}

/// Cycles and missed deadlines since start, and times of the last second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimingReport {
    /// Configured rate \[Hz\].
    pub rate_hz: f64,
    /// Cycles run.
    pub cycles: u64,
    /// Cycles that woke late.
    pub late_wakeups: u64,
    /// Cycles still computing at their next release.
    pub overruns: u64,
    /// Releases for which no cycle was run.
    pub skipped: u64,
    /// Release to the first instruction, 99th percentile and largest \[ns\].
    pub wakeup_ns: [u64; 2],
    /// First instruction to output, 99th percentile and largest \[ns\].
    pub compute_ns: [u64; 2],
}

/// One leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LegReport {
    /// Measured length \[m\]; null in JSON if the driver sent no number.
    #[serde(deserialize_with = "number_or_nan")]
    pub length_m: f64,
    /// Measured rate \[m/s\]; null if the driver sends none.
    pub rate_m_s: Option<f64>,
    /// Commanded force \[N\]; 0 without control.
    pub force_n: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_false(value: &bool) -> bool {
    !value
}

/// JSON has no NaN.
fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Option::deserialize(deserializer).map(|number| number.unwrap_or(f64::NAN))
}

/// Sender of an input.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceReport {
    /// `setpoint` or `measured`.
    pub topic: String,
    /// Age of the newest message \[s\]; `None` if none ever arrived.
    pub age_s: Option<f64>,
    /// Processes that publish now.
    pub processes: Vec<ProcessReport>,
    /// Reasons why messages were rejected independently of their content, with the remedy.
    pub rejected: Option<String>,
}

/// A process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProcessReport {
    /// Number of the process.
    pub process_id: u32,
    /// Command of the process, empty if it has ended.
    pub command: String,
    /// User of the process, empty if it has ended.
    pub user: String,
    /// Whether its messages are ignored, because another process is used.
    pub is_ignored: bool,
    /// Whether it lives and runs no more, by SIGSTOP or a debugger: it obeys neither SIGINT nor SIGTERM.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_stopped: bool,
    /// What it says of its own input, as of datagrams that it did not follow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<String>,
    /// What it does, if persons ride.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ride: Option<RidePhase>,
    /// What the operator wants of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ride_order: Option<RideOrder>,
}
