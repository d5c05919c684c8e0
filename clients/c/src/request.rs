//! Requests over the control socket, by the lines of `docs/operator.md`; an emergency stop else by signal.

use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use hexad::control::state::{Request, State};
use hexad::messages::claim::{RunningDaemon, running_daemons};
use hexad::messages::location::{SYSTEM_FOLDER, user_id};
use serde_json::{Value, json};
use socket2::{Domain, SockAddr, Socket, Type};

use crate::outcome::hexad_result::{
    self, HEXAD_FORBIDDEN, HEXAD_INTERNAL, HEXAD_INVALID, HEXAD_NO_DAEMON, HEXAD_NOT_COMPLETED, HEXAD_OK,
    HEXAD_REFUSED, HEXAD_TIMED_OUT,
};
use crate::outcome::{Failure, Outcome};
use crate::signal::emergency_stop;

/// Version of the lines.
const PROTOCOL_VERSION: u32 = 1;

/// Time beyond that of the request in which the daemon must have answered.
const ANSWER_GRACE: Duration = Duration::from_secs(2);

/// Longest wait for the answer to an emergency stop, which needs one cycle; then it goes by signal.
const EMERGENCY_LIMIT: Duration = Duration::from_millis(500);

/// Longest wait for one status.
const STATUS_LIMIT: Duration = Duration::from_millis(100);

/// Longest time that the daemon accepts \[s\].
const MAX_WITHIN_S: f64 = 86_400.0;

/// Longest answer \[bytes\].
const MAX_ANSWER_BYTES: u64 = 1 << 16;

/// Sends a request to the daemon of a machine and waits for its outcome.
pub fn send(machine: &str, request: u32, until_ready: bool, within_s: f64) -> Outcome {
    let found = Request::from_number(request);
    let request = found.ok_or_else(|| Failure::new(HEXAD_INVALID, format!("no request is {request}")))?;
    if !(0.0..=MAX_WITHIN_S).contains(&within_s) {
        let text = format!("within_s = {within_s} s is not between 0 and {MAX_WITHIN_S} s");
        return Err(Failure::new(HEXAD_INVALID, text));
    }
    // Both disable the forces, and there is one signal for it.
    let is_emergency = matches!(request, Request::Estop | Request::Off);
    let limit = if is_emergency { EMERGENCY_LIMIT } else { Duration::from_secs_f64(within_s) + ANSWER_GRACE };
    let line = json!({
        "version": PROTOCOL_VERSION,
        "request": request.name(),
        "wait": true,
        "until_ready": until_ready,
        "within_s": within_s,
    });
    let answer = connect(machine, limit).and_then(|socket| {
        exchange(&socket, &line).map_err(|error| {
            let text = format!("{} is not confirmed: the daemon does not answer: {error}", request.name());
            Failure::new(HEXAD_TIMED_OUT, text)
        })
    });
    match answer {
        Ok(answer) => conclude(&answer),
        Err(failure) if is_emergency => emergency_stop(&daemons(machine), failure),
        Err(failure) => Err(failure),
    }
}

/// State that a daemon reports over its socket.
pub fn state_of(socket: &Path) -> Option<State> {
    let line = json!({ "version": PROTOCOL_VERSION, "request": "status" });
    let answer = open(socket, STATUS_LIMIT).and_then(|socket| exchange(&socket, &line)).ok()?;
    let name = answer.get("state")?.as_str()?;
    State::ALL.into_iter().find(|state| state.name() == name)
}

/// Connects to the first daemon of the machine that admits this user: that of the service, of this user, of others.
fn connect(machine: &str, limit: Duration) -> Result<Socket, Failure> {
    let mut forbidden = None;
    for path in sockets(machine) {
        match open(&path, limit) {
            Ok(socket) => return Ok(socket),
            Err(error) if error.kind() == ErrorKind::PermissionDenied => forbidden = Some(path),
            Err(_) => {}
        }
    }
    Err(match forbidden {
        Some(path) => {
            let text = format!("this user may not send requests for {machine} ({})", path.display());
            Failure::new(HEXAD_FORBIDDEN, text)
        }
        None => Failure::new(HEXAD_NO_DAEMON, format!("no daemon runs for {machine}")),
    })
}

fn sockets(machine: &str) -> Vec<PathBuf> {
    let system = system_socket(machine);
    let others = daemons(machine).into_iter().map(|daemon| daemon.socket).filter(|path| *path != system);
    [system.clone()].into_iter().chain(others).collect()
}

fn system_socket(machine: &str) -> PathBuf {
    Path::new(SYSTEM_FOLDER).join(format!("{machine}.sock"))
}

/// Daemons of a machine: that of the service, of this user, of others.
fn daemons(machine: &str) -> Vec<RunningDaemon> {
    let system = system_socket(machine);
    let mut found = running_daemons(machine);
    found.sort_by_key(|daemon| (daemon.socket != system, daemon.user_id != user_id(), daemon.user_id));
    found
}

fn open(path: &Path, limit: Duration) -> io::Result<Socket> {
    let socket = Socket::new(Domain::UNIX, Type::STREAM, None)?;
    // Also limits the attempt to connect.
    socket.set_write_timeout(Some(limit))?;
    socket.set_read_timeout(Some(limit))?;
    socket.connect(&SockAddr::unix(path)?)?;
    Ok(socket)
}

fn exchange(mut socket: &Socket, line: &Value) -> io::Result<Value> {
    socket.write_all(format!("{line}\n").as_bytes())?;
    let mut answer = String::new();
    BufReader::new(socket.take(MAX_ANSWER_BYTES)).read_line(&mut answer)?;
    if answer.is_empty() {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    Ok(serde_json::from_str(&answer)?)
}

fn conclude(answer: &Value) -> Outcome {
    let word = |key: &str| answer.get(key).and_then(Value::as_str).unwrap_or_default();
    match result(word("result")) {
        HEXAD_OK => Ok(HEXAD_OK),
        failed => Err(Failure::new(failed, word("text"))),
    }
}

/// What a result of the protocol means here.
fn result(word: &str) -> hexad_result {
    match word {
        "done" => HEXAD_OK,
        "refused" | "stale" | "invalid" => HEXAD_REFUSED,
        "failed" | "superseded" => HEXAD_NOT_COMPLETED,
        "timed_out" | "unanswered" => HEXAD_TIMED_OUT,
        _ => HEXAD_INTERNAL,
    }
}
