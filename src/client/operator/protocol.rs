//! Lines of the control socket: one JSON object per line, in both directions. `docs/operator.md` describes them.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::motion_fields::{FrameField, GOTO, HOLD, JOG, RateFields, TargetFields};
use super::ride::RidePhase;
use super::status_report::{StatusReport, StopNumber};
use hexad_core::control::signals::state::Request;

/// Whether a request ends control or force. Such a request is never withdrawn.
pub fn is_stop(request: Request) -> bool {
    matches!(request, Request::Stop | Request::Off | Request::Estop)
}

/// Version of the protocol. It is raised only if an older client would misinterpret it.
pub const VERSION: u32 = 1;

/// Largest age of a request that may begin control \[ns\]. The sender of an older one has long stopped
/// waiting.
pub const MAX_REQUEST_AGE_NS: u64 = 1_000_000_000;

/// Longest waiting time if the request gives none \[s\].
const DEFAULT_WITHIN_S: f64 = 30.0;

/// Name of the request that keeps which legs were seen to move.
pub const CONFIRM_LEGS: &str = "confirm_legs";

/// Requests of each field that not all have.
const OWN_FIELDS: [(&str, &[&str]); 17] = [
    ("pose", &["engage"]),
    ("last_s", &["record"]),
    ("input", &["status"]),
    ("ride", &["status"]),
    ("yes", &["ride_start"]),
    ("engage", &[GOTO, HOLD]),
    ("tool", &[GOTO, JOG]),
    ("work", &[GOTO, JOG]),
    ("rotation", &[GOTO, JOG]),
    ("target", &[GOTO]),
    ("relative", &[GOTO]),
    ("home", &[GOTO]),
    ("speed", &[GOTO]),
    ("tolerance_m", &[GOTO]),
    ("rate", &[JOG]),
    ("geometry_sha1", &[CONFIRM_LEGS]),
    ("legs", &[CONFIRM_LEGS]),
];

/// Line of a client.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RequestLine {
    /// Version of the protocol.
    pub version: u32,
    /// `engage`, `stop`, `park`, `clear`, `off`, `estop`, `reload`, `status`, `record`, `goto`, `hold`, `jog`, `confirm_legs`,
    /// `ride_start` or `ride_end`.
    pub request: String,
    /// Number by which the client knows the answer: each line about this request repeats it.
    pub id: Option<u64>,
    /// The number of stops when the person asked; `None` for when the line arrives. If a stop came after it, the request is
    /// superseded. A stop needs none.
    pub stops: Option<StopNumber>,
    /// Whether the answer comes only when the request has ended: its state is reached, or cannot be.
    #[serde(default)]
    pub wait: bool,
    /// Whether to wait after a refusal whose reason may disappear by itself (no measurement, no setpoint).
    #[serde(default)]
    pub until_ready: bool,
    /// Whether lines with result `accepted` and `waiting` come before the answer.
    #[serde(default)]
    pub progress: bool,
    /// Number of the pose that `engage` selects from the list of a refusal.
    pub pose: Option<u32>,
    /// Longest time to wait \[s\].
    #[serde(default = "default_within_s")]
    pub within_s: f64,
    /// Instant of the cycle before which a request to the controller is not obeyed, in simulated time \[ns\]; `None` for the next
    /// cycle. A line with result `waiting` then says that it is posted: the setpoint of that cycle may be published. A stop does not
    /// wait for its cycle.
    pub cycle_ns: Option<u64>,
    /// Length of a recording \[s\]; `None` for all cycles that are kept.
    pub last_s: Option<f64>,
    /// Remote side for which a bridge sends the request: its own words, which nobody has verified.
    pub remote: Option<String>,
    /// With `status`: what the client, if it publishes setpoints, says of its own input. Reports repeat it.
    pub input: Option<String>,
    /// The same of its ride.
    pub ride: Option<RidePhase>,
    /// With `ride_start`: whether a stream that looks wrong is followed all the same.
    #[serde(default)]
    pub yes: bool,
    /// Whether a motion takes control, if the platform is not under control. `within_s` bounds the wait for it.
    #[serde(default)]
    pub engage: bool,
    /// Tool that the coordinates describe; `None` for the platform.
    pub tool: Option<FrameField>,
    /// Frame of the coordinates; `None` for the base frame.
    pub work: Option<FrameField>,
    /// Order of the rotations by the angles; `None` for `xyz`.
    pub rotation: Option<String>,
    /// Coordinates of `goto`.
    pub target: Option<TargetFields>,
    /// Whether the coordinates are added to the target that is held, or to the pose of the platform if none is.
    #[serde(default)]
    pub relative: bool,
    /// Whether the missing coordinates are taken from the home pose.
    #[serde(default)]
    pub home: bool,
    /// Share of the limits of autonomous motions; `None` for 1.
    pub speed: Option<f64>,
    /// Distance from the target at which the platform is in position \[m\], the angle in proportion; `None` for
    /// `in_position.tolerance_m`.
    pub tolerance_m: Option<f64>,
    /// With `confirm_legs`: SHA-1 of the name and the joints of the machine file; must be that of the daemon.
    pub geometry_sha1: Option<String>,
    /// With `confirm_legs`: the leg that was seen to move, for each number, from 1. `None` only compares the geometry.
    pub legs: Option<[u32; 6]>,
    /// Rates of `jog`.
    pub rate: Option<RateFields>,
}

fn default_within_s() -> f64 {
    DEFAULT_WITHIN_S
}

impl RequestLine {
    /// A request with an immediate answer.
    pub fn new(request: &str) -> Self {
        Self { version: VERSION, request: request.into(), within_s: DEFAULT_WITHIN_S, ..Self::default() }
    }

    /// The line with its end, without what is not given.
    pub fn to_line(&self) -> serde_json::Result<String> {
        let mut line = serde_json::to_value(self)?;
        keep_given(&mut line);
        Ok(line.to_string() + "\n")
    }

    /// Reads a line. A stop is obeyed in any version of the line, whatever else is in it. The error comes with the number for its answer.
    pub fn parse(line: &str) -> Result<Self, (Option<u64>, String)> {
        let parsed = serde_json::from_str(line).map_err(|error| format!("no request: {error}"));
        let parsed = parsed.and_then(|it: Self| match (it.version, foreign_field(line, &it.request)) {
            (VERSION, None) => Ok(it),
            (VERSION, Some(field)) => Err(format!("{field}: is no field of {}; leave it out", it.request)),
            (other, _) => Err(format!("version {other} of the protocol; this daemon has version {VERSION}")),
        });
        parsed.or_else(|reason| {
            let Known { request, id } = serde_json::from_str(line).unwrap_or_default();
            let stop = Self { id, ..Self::new(&request) };
            if stop.is_stop() { Ok(stop) } else { Err((id, reason)) }
        })
    }

    /// The request to the controller; `None` if it is not for the controller, or unknown.
    pub fn controller_request(&self) -> Option<Request> {
        Request::by_name(&self.request)
    }

    /// Whether it ends control or force.
    pub fn is_stop(&self) -> bool {
        self.controller_request().is_some_and(is_stop)
    }
}

fn is_given(value: &Value) -> bool {
    !matches!(value, Value::Null | Value::Bool(false))
}

fn keep_given(value: &mut Value) {
    if let Value::Object(fields) = value {
        fields.retain(|_, value| is_given(value));
        fields.values_mut().for_each(keep_given);
    }
}

/// A field that the request of a line does not use, although its sender expects an effect.
fn foreign_field(line: &str, request: &str) -> Option<&'static str> {
    let given: Map<String, Value> = serde_json::from_str(line).unwrap_or_default();
    OWN_FIELDS
        .iter()
        .find(|(field, owners)| !owners.contains(&request) && given.get(*field).is_some_and(is_given))
        .map(|(field, _)| *field)
}

/// Part of a line of another version, or with mistakes.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Known {
    request: String,
    id: Option<u64>,
}

/// Why a request that was asked for before a stop, or before the daemon began, is not carried out.
pub const STOPPED: &str =
    "a stop came after it was asked for, or the daemon began anew; ask again if it is still wanted";

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RequestResult {
    /// The controller has accepted it. The answer, or progress if the request waits.
    Accepted,
    /// Progress: the reason why it waits.
    Waiting,
    /// Its state is reached, or the status is in the answer.
    Done,
    /// The controller has refused it.
    Refused,
    /// It was accepted, but control ended otherwise.
    Failed,
    /// It was not completed in its time.
    TimedOut,
    /// A later request, or one of higher precedence, has replaced it.
    Superseded,
    /// The control loop has run no cycle. A stop remains posted, everything else is withdrawn.
    Unanswered,
    /// The daemon was held, and a request that may begin control may be from before: send it again.
    Stale,
    /// The line was not understood.
    Invalid,
}

impl RequestResult {
    /// Text of the result.
    pub fn words(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Waiting => "waiting",
            Self::Done => "done",
            Self::Refused => "refused",
            Self::Failed => "failed",
            Self::TimedOut => "timed out",
            Self::Superseded => "superseded",
            Self::Unanswered => "unanswered",
            Self::Stale => "stale",
            Self::Invalid => "not understood",
        }
    }
}

/// Diagnostic with its number, value, bound and sentence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticReport {
    /// Number of the code; 0 for none.
    pub code: u32,
    /// Name of the code.
    pub name: String,
    /// Value in the unit of the code; `None` if it is not finite.
    pub value: Option<f64>,
    /// Bound of the value.
    pub bound: Option<f64>,
    /// Leg or axis, from 1; 0 if it concerns neither.
    pub index: u32,
    /// Sentence with unit and remedy.
    pub text: String,
}

/// Line of the daemon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnswerLine {
    /// Version of the protocol.
    pub version: u32,
    /// Result of the request.
    pub result: RequestResult,
    /// The request; empty if the line was not understood.
    pub request: String,
    /// `id` of the request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u64>,
    /// Name of the present state.
    pub state: String,
    /// Diagnostic of the refusal, else of the state.
    pub diagnostic: DiagnosticReport,
    /// The answer as a sentence.
    pub text: String,
    /// Answer to `status`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub status: Option<Box<StatusReport>>,
}

impl AnswerLine {
    /// Answer to a line that was not understood.
    pub fn invalid(text: String) -> Self {
        Self {
            version: VERSION,
            result: RequestResult::Invalid,
            request: String::new(),
            id: None,
            state: String::new(),
            diagnostic: DiagnosticReport::default(),
            text,
            status: None,
        }
    }

    /// The line with its end. It has only finite numbers, so it cannot fail.
    pub fn to_line(&self) -> String {
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}
