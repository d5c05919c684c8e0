//! Requests of a client that move the platform: `goto`, `hold` and `jog`, over one connection to the daemon for each of its sessions.
//!
//! A motion belongs to its connection. The connection ends with the session: when its token is gone, the platform comes to rest. Several
//! sessions may have one certificate, and a query has no identity of its session that Zenoh verifies. So each session declares a token of its
//! own, and names the session in each request.

use std::collections::BTreeMap;
use std::io;
use std::mem;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use hexad_client::operator::connection::Connection;
use hexad_client::operator::motion_fields::{GOTO, HOLD, JOG};
use hexad_client::operator::protocol::{AnswerLine, RequestLine, RequestResult, VERSION};
use hexad_client::operator::requests::connect;
use hexad_core::control::signals::state::Request;
use serde_json::{Map, Value};
use tracing::info;
use zenoh::query::Query;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use crate::access::{request_key, session_token};
use crate::network_file::Client;
use crate::requests::{Served, failure, reply};

/// Names of the requests.
pub const REQUESTS: [&str; 3] = [GOTO, HOLD, JOG];

/// Interval at which the thread looks for answers, and for the end of sessions.
const INTERVAL: Duration = Duration::from_millis(10);

/// Longest wait for an answer in a pass, for each connection.
const ANSWER_WAIT: Duration = Duration::from_millis(1);

/// Living sessions of one client, each with at most one of the 64 connections that the daemon accepts.
const MAX_SESSIONS: usize = 8;

/// Queries that may wait for the thread.
const MAX_WAITING: usize = 16;

/// Queries without an answer and their own `id`, by the numbers of their requests.
type Waiting = BTreeMap<u64, (Query, Option<u64>)>;

/// Tokens of the living sessions of a client, by the names of the sessions.
type Tokens = Arc<Mutex<BTreeMap<String, Arc<()>>>>;

/// Motions of one client.
struct Motions {
    machine: String,
    client: String,
    may_engage: bool,
    tokens: Tokens,
    links: Vec<Link>,
    /// Number of the last request.
    last_id: u64,
}

/// Connection of a session to the daemon, with the queries that the daemon has not answered yet.
struct Link {
    token: Weak<()>,
    connection: Connection,
    waiting: Waiting,
}

/// Serves the motions of a client in a thread of its own.
pub fn serve(
    session: &Session,
    served: &mut Served,
    machine: &str,
    name: &str,
    client: &Client,
) -> Result<(), String> {
    let tokens = Tokens::default();
    let observed = tokens.clone();
    let key = session_token(machine, name, "*");
    let subscriber = session.liveliness().declare_subscriber(key).history(true);
    let observe = move |sample: Sample| {
        let mut tokens = observed.lock().unwrap_or_else(PoisonError::into_inner);
        let name = sample.key_expr().rsplit('/').next().unwrap_or_default();
        if sample.kind() == SampleKind::Delete {
            tokens.remove(name);
        } else if tokens.len() < MAX_SESSIONS {
            tokens.entry(name.into()).or_default();
        }
    };
    subscriber.callback(observe).background().wait().map_err(|error| error.to_string())?;
    let (send, queries) = sync_channel(MAX_WAITING);
    for request in REQUESTS {
        let send = send.clone();
        let take = move |query| drop(send.try_send((request, query)));
        let queryable = session.declare_queryable(request_key(machine, name, request)).callback(take).wait();
        served.push(queryable.map_err(|error| error.to_string())?);
    }
    let may_engage = client.allowed_requests()?.contains(&Request::Engage);
    let motions = Motions {
        machine: machine.into(),
        client: name.into(),
        may_engage,
        tokens,
        links: vec![],
        last_id: 0,
    };
    thread::spawn(move || motions.run(&queries));
    Ok(())
}

impl Motions {
    fn run(mut self, queries: &Receiver<(&'static str, Query)>) {
        loop {
            match queries.recv_timeout(INTERVAL) {
                Ok((request, query)) => self.begin(request, query),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            // Connections wait in turn, so a pass may be longer than the interval of several queries.
            queries.try_iter().take(MAX_WAITING).for_each(|(request, query)| self.begin(request, query));
            self.links.retain_mut(|link| link.is_open(&self.client));
        }
    }

    fn begin(&mut self, request: &str, query: Query) {
        match self.line(request, &query) {
            Ok((token, line)) => self.send(token, line, query),
            Err(text) => {
                info!(remote = self.client, "{request}: {text}");
                reply(&query, &AnswerLine { request: request.into(), ..AnswerLine::invalid(text) });
            }
        }
    }

    /// The token of the session and the line of a request, from the fields of a query.
    fn line(&self, request: &str, query: &Query) -> Result<(Weak<()>, RequestLine), String> {
        let fields = query.payload().map(|it| it.to_bytes().into_owned()).unwrap_or_default();
        let (session, line) = request_line(request, &fields)?;
        let token = self.token(&session)?;
        if line.engage && !self.may_engage {
            return Err(format!("engage: must be among the requests of {} in the network file", self.client));
        }
        Ok((token, RequestLine { remote: Some(self.client.clone()), ..line }))
    }

    /// The token of a session, if it is alive.
    fn token(&self, session: &str) -> Result<Weak<()>, String> {
        let tokens = self.tokens.lock().unwrap_or_else(PoisonError::into_inner);
        tokens.get(session).map(Arc::downgrade).ok_or_else(|| {
            let token = session_token(&self.machine, &self.client, "SESSION");
            let full = match tokens.len() {
                MAX_SESSIONS => format!("; {MAX_SESSIONS} sessions have one already: end one of them first"),
                _ => String::new(),
            };
            format!(
                "declare the liveliness token {token}, and send the field \"session\": \"SESSION\", both with the Zenoh id of the \
                 session: the motion ends with the token{full}"
            )
        })
    }

    /// Sends a line over the connection of a session, which begins with its first motion.
    fn send(&mut self, token: Weak<()>, line: RequestLine, query: Query) {
        let present = self.links.iter().position(|link| link.token.ptr_eq(&token));
        let mut link = match present.map(|index| self.links.swap_remove(index)) {
            Some(link) => link,
            None => match connect(&self.machine) {
                Ok(connection) => {
                    let _ = connection.stream().set_read_timeout(Some(ANSWER_WAIT));
                    Link { token, connection, waiting: Waiting::new() }
                }
                Err(error) => return reply(&query, &failure(&line.request, &error)),
            },
        };
        self.last_id += 1;
        link.waiting.insert(self.last_id, (query, line.id));
        match link.connection.send(&RequestLine { id: Some(self.last_id), ..line }) {
            Ok(()) => self.links.push(link),
            Err(error) => link.fail(&error),
        }
    }
}

impl Link {
    /// Passes on answers; false if the session or the connection has ended.
    fn is_open(&mut self, client: &str) -> bool {
        if self.token.strong_count() == 0 {
            info!(remote = client, "a session has ended, and with it its motion");
            return false;
        }
        self.receive(client).inspect_err(|error| self.fail(error)).is_ok()
    }

    /// Passes on the answers that have arrived.
    fn receive(&mut self, client: &str) -> io::Result<()> {
        while let Some(answer) = self.connection.receive(Instant::now() + ANSWER_WAIT, || false)? {
            let Some((query, id)) = answer.id.and_then(|id| self.waiting.remove(&id)) else { continue };
            let answer = AnswerLine { id, ..answer };
            if answer.request != JOG {
                info!(remote = client, "{}: {}: {}", answer.request, answer.result.words(), answer.text);
            }
            reply(&query, &answer);
        }
        Ok(())
    }

    /// Answers the requests that will have no answer of the daemon: they have failed.
    fn fail(&mut self, error: &io::Error) {
        let text = format!("the daemon has ended the connection: {error}");
        for (query, id) in mem::take(&mut self.waiting).into_values() {
            let result = RequestResult::Unanswered;
            reply(&query, &AnswerLine { result, id, ..AnswerLine::invalid(text.clone()) });
        }
    }
}

/// The name of the session, empty without one, and the line of a request, with the fields of a JSON object.
fn request_line(request: &str, fields: &[u8]) -> Result<(String, RequestLine), String> {
    let mut fields: Map<String, Value> = match fields {
        [] => Map::new(),
        fields => serde_json::from_slice(fields).map_err(|error| format!("no request: {error}"))?,
    };
    let session = fields.remove("session").as_ref().and_then(Value::as_str).unwrap_or_default().into();
    fields.insert("version".into(), VERSION.into());
    fields.insert("request".into(), request.into());
    // A motion without an answer at its end would outlive its connection.
    fields.insert("wait".into(), (request != JOG).into());
    fields.insert("progress".into(), false.into());
    let line = serde_json::from_value(Value::Object(fields));
    Ok((session, line.map_err(|error| format!("no request: {error}"))?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_always_belongs_to_its_client() {
        let fields = br#"{"target": {"z_m": 1.3}, "wait": false, "request": "estop", "session": "a1"}"#;
        let (session, line) = request_line(GOTO, fields).unwrap();
        assert_eq!(session, "a1");
        assert!(line.wait && line.request == GOTO && line.target.unwrap().z_m == Some(1.3));
        assert!(!request_line(JOG, b"").unwrap().1.wait);
        let error = request_line(GOTO, br#"{"aim": 1}"#).unwrap_err();
        assert!(error.contains("unknown field `aim`"), "{error}");
    }
}
