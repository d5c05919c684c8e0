//! Stop requests. They are sent to every possible daemon, and evaluated afterwards.
//!
//! A stop goes to all sockets of a machine at the same time, each with its own timeout, independent of the
//! listening process. So the service is stopped even if another user's daemon answers first. The result is
//! the answer of a daemon that counts: of the service if it runs, else of this user, else of root. Answers of
//! others become remarks.

use std::thread::{self, ScopedJoinHandle, sleep};
use std::time::{Duration, Instant};

use super::connection::{Attempt, Connection};
use super::endpoint::{Endpoint, endpoints};
use super::exchange::converse;
use super::signal::{self, Process, Signalled};
use super::users::user_name;
use super::{ATTEMPTS, OperatorError, Order, RETRY_INTERVAL, UntrustedDaemon};

/// Longest wait for a connection and the first line of the daemon. After it the stop is sent by signal.
const FIRST_LINE_LIMIT: Duration = Duration::from_millis(500);

/// Machines to stop.
#[derive(Clone, Copy, Debug)]
pub enum Target<'a> {
    /// The machine of this name.
    Named(&'a str),
    /// The only running machine.
    Only,
    /// All machines of this host.
    All,
}

/// Result of a stop of one machine.
#[derive(Debug)]
pub struct Stopped {
    /// Name of the machine.
    pub machine: String,
    /// Name of the resulting state, from the daemon of highest trust.
    pub result: Result<String, OperatorError>,
    /// The way of confirmation, if not over the socket, and the answers of other daemons of the machine.
    pub remarks: Vec<String>,
}

/// Result at one endpoint.
enum Verdict {
    /// No process listens.
    Absent,
    Forbidden,
    /// The daemon does not count.
    NotTrusted(UntrustedDaemon),
    Ended(Result<String, OperatorError>),
    /// Done by signal, and the way of confirmation.
    BySignal(String, String),
}

/// Stops machines. Returns the results by name. `interrupted` ends the wait, not the request.
pub fn stop(
    target: Target<'_>,
    order: &Order,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Stopped>, OperatorError> {
    let mut found = endpoints(if let Target::Named(name) = target { Some(name) } else { None });
    if let Target::Only = target {
        let name = only_machine(&found)?;
        found.retain(|it| it.machine == name);
    }
    let verdicts = verdicts(&found, order, interrupted);
    let mut machines: Vec<_> = found.iter().map(|it| it.machine.clone()).collect();
    machines.sort();
    machines.dedup();
    let mut rest: Vec<_> = found.iter().zip(verdicts).collect();
    let mut stopped = vec![];
    for machine in machines {
        let (of_machine, others) = rest.into_iter().partition(|(endpoint, _)| endpoint.machine == machine);
        rest = others;
        stopped.extend(judge(machine, order, of_machine));
    }
    match (stopped.is_empty(), target) {
        (false, _) => Ok(stopped),
        (true, Target::Named(name)) => Err(OperatorError::NoDaemon(name.into())),
        (true, _) => Err(OperatorError::NoMachine),
    }
}

/// Stops a machine by name. Returns the name of the resulting state.
pub fn stop_machine(
    machine: &str,
    order: &Order,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<String, OperatorError> {
    let stopped = stop(Target::Named(machine), order, interrupted)?.pop();
    stopped.map_or_else(|| Err(OperatorError::NoDaemon(machine.into())), |stopped| stopped.result)
}

/// Sends the request to all endpoints at once and waits for each.
fn verdicts(endpoints: &[Endpoint], order: &Order, interrupted: &(dyn Fn() -> bool + Sync)) -> Vec<Verdict> {
    thread::scope(|scope| {
        let begin = |endpoint| {
            let here = move || stop_at(endpoint, order, interrupted);
            // If the system has no more threads, the request is sent in this one, after the threads have
            // begun.
            thread::Builder::new().spawn_scoped(scope, here).map_err(|_| here)
        };
        let begun: Vec<_> = endpoints.iter().map(begin).collect();
        let end = |thread: ScopedJoinHandle<'_, Verdict>| thread.join().unwrap_or(Verdict::Absent);
        begun.into_iter().map(|begun| begun.map_or_else(|here| here(), end)).collect()
    })
}

/// Name of the only machine whose daemon counts and admits this user.
fn only_machine(endpoints: &[Endpoint]) -> Result<String, OperatorError> {
    let mut forbidden = None;
    let mut running: Vec<&str> = vec![];
    for endpoint in endpoints.iter().filter(|it| it.is_trusted) {
        match endpoint.connect() {
            Ok(Attempt::Connected(connection)) if endpoint.counts(&connection) => {
                running.push(&endpoint.machine)
            }
            Ok(Attempt::Full) => running.push(&endpoint.machine),
            Ok(Attempt::Forbidden) => forbidden = forbidden.or(Some(endpoint)),
            _ if endpoint.daemon.is_some() => running.push(&endpoint.machine),
            _ => {}
        }
    }
    running.sort_unstable();
    running.dedup();
    match *running {
        [] => Err(forbidden.map_or(OperatorError::NoMachine, OperatorError::forbidden_at)),
        [machine] => Ok(machine.into()),
        _ => Err(OperatorError::Several(running.join(", "))),
    }
}

/// Sends a stop to the process that listens at an endpoint. Uses a signal if a daemon that counts does not
/// answer.
fn stop_at(endpoint: &Endpoint, order: &Order, interrupted: &(dyn Fn() -> bool + Sync)) -> Verdict {
    let until = Instant::now() + FIRST_LINE_LIMIT;
    let (mut last, mut closed) = (None, 0);
    while Instant::now() < until && closed < ATTEMPTS {
        let mut connection = match endpoint.connect() {
            Ok(Attempt::Connected(connection)) => connection,
            Ok(Attempt::Full) => {
                sleep(RETRY_INTERVAL);
                continue;
            }
            Ok(Attempt::Forbidden) => return Verdict::Forbidden,
            Ok(Attempt::Absent) | Err(_) => break,
        };
        if !endpoint.counts(&connection) {
            return not_trusted(endpoint, order, &mut connection, until);
        }
        match converse(&mut connection, &order.line(), until, order.timeout, interrupted, |_| ()) {
            Ok(Some(answer)) => return Verdict::Ended(order.conclude(answer)),
            Ok(None) if interrupted() => return Verdict::Ended(Err(OperatorError::Interrupted)),
            Ok(None) => {
                last = Some(connection);
                break;
            }
            // The daemon has closed it, as it does if too many clients connect.
            Err(_) => (last, closed) = (Some(connection), closed + 1),
        }
    }
    if !endpoint.is_trusted {
        return Verdict::Absent;
    }
    match Process::of(endpoint, last.as_ref()) {
        Some(process) => match signal::send(order.request, endpoint, &process, order.timeout) {
            Signalled::Confirmed { state, way } => Verdict::BySignal(state, way),
            Signalled::Unconfirmed(reason) => {
                Verdict::Ended(Err(OperatorError::NotConfirmed(order.request, reason)))
            }
        },
        None if last.is_some() => {
            let reason =
                format!("{} does not answer: use the emergency-stop circuit", endpoint.socket.display());
            Verdict::Ended(Err(OperatorError::NotConfirmed(order.request, reason)))
        }
        None => Verdict::Absent,
    }
}

/// Sends the request to a daemon that does not count.
fn not_trusted(endpoint: &Endpoint, order: &Order, connection: &mut Connection, until: Instant) -> Verdict {
    let answer = connection.send(&order.line()).and_then(|()| connection.receive(until, || false));
    let said = match answer {
        Ok(Some(answer)) => format!("it says {:?}", answer.result.words()),
        _ => "it does not answer".into(),
    };
    Verdict::NotTrusted(UntrustedDaemon::at(endpoint, connection, &said))
}

/// Result of the stop of a machine, from the verdicts of its endpoints in their order; `None` if no process
/// listens.
fn judge(machine: String, order: &Order, verdicts: Vec<(&Endpoint, Verdict)>) -> Option<Stopped> {
    let (mut decisive, mut lesser, mut remarks) = (None, None, vec![]);
    for (endpoint, verdict) in verdicts {
        let result = match verdict {
            Verdict::Absent => continue,
            Verdict::Forbidden if !endpoint.is_trusted => {
                lesser = lesser.or(Some(OperatorError::forbidden_at(endpoint)));
                continue;
            }
            Verdict::NotTrusted(stranger) => {
                remarks.push(stranger.to_string());
                lesser = Some(stranger.error(order.request.name()));
                continue;
            }
            Verdict::Forbidden => Err(OperatorError::forbidden_at(endpoint)),
            Verdict::Ended(result) => result,
            Verdict::BySignal(state, way) => {
                remarks.push(way);
                Ok(state)
            }
        };
        if decisive.is_none() {
            decisive = Some(result);
            continue;
        }
        let said = result.unwrap_or_else(|error| error.to_string());
        remarks.push(format!(
            "the daemon of {} at {}: {said}",
            user_name(endpoint.owner),
            endpoint.socket.display()
        ));
    }
    if decisive.is_none() {
        // The error already says it.
        remarks.clear();
    }
    let result = decisive.or(lesser.map(Err))?;
    Some(Stopped { machine, result, remarks })
}
