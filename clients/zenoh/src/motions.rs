//! Requests of a client that move the platform: `goto`, `hold` and `jog`, over one connection to the daemon.
//!
//! A motion belongs to its connection. The connection ends with the client: when its token is gone, the platform comes to rest.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use hexad::control::signals::state::Request;
use hexad::operator::connection::Connection;
use hexad::operator::motion_fields::{GOTO, HOLD, JOG};
use hexad::operator::protocol::{AnswerLine, RequestLine, RequestResult, VERSION};
use hexad::operator::requests::connect;
use serde_json::{Map, Value};
use tracing::info;
use zenoh::query::Query;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use crate::access::{client_token, request_key};
use crate::network_file::Client;
use crate::requests::{Served, failure, reply};

/// Names of the requests.
pub const REQUESTS: [&str; 3] = [GOTO, HOLD, JOG];

/// Interval at which the thread looks for answers, and for the end of the client.
const INTERVAL: Duration = Duration::from_millis(10);

/// Queries that may wait for the thread.
const MAX_WAITING: usize = 16;

/// Motions of one client.
struct Motions {
    machine: String,
    client: String,
    may_engage: bool,
    is_alive: Arc<AtomicBool>,
    /// Connection to the daemon, with the queries that it has not answered yet.
    link: Option<(Connection, VecDeque<Query>)>,
}

/// Serves the motions of a client in a thread of its own.
pub fn serve(
    session: &Session,
    served: &mut Served,
    machine: &str,
    name: &str,
    client: &Client,
) -> Result<(), String> {
    let is_alive = Arc::new(AtomicBool::new(false));
    let observed = is_alive.clone();
    let subscriber = session.liveliness().declare_subscriber(client_token(machine, name)).history(true);
    let observe = move |sample: Sample| {
        observed.store(sample.kind() == SampleKind::Put, Ordering::Relaxed);
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
    let motions = Motions { machine: machine.into(), client: name.into(), may_engage, is_alive, link: None };
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
            if self.link.is_some() && !self.is_alive.load(Ordering::Relaxed) {
                info!(remote = self.client, "has ended, and with it its motion");
                self.link = None;
            }
            if let Err(error) = self.receive() {
                let text = format!("the daemon has ended the connection: {error}");
                self.end(&text);
            }
        }
    }

    fn begin(&mut self, request: &str, query: Query) {
        match self.line(request, &query) {
            Ok(line) => self.send(&line, query),
            Err(text) => {
                info!(remote = self.client, "{request}: {text}");
                reply(&query, &AnswerLine { request: request.into(), ..AnswerLine::invalid(text) });
            }
        }
    }

    /// The line of a request, from the fields of a query.
    fn line(&self, request: &str, query: &Query) -> Result<RequestLine, String> {
        if !self.is_alive.load(Ordering::Relaxed) {
            let token = client_token(&self.machine, &self.client);
            return Err(format!("declare the liveliness token {token} first: the motion ends with it"));
        }
        let line =
            request_line(request, &query.payload().map(|it| it.to_bytes().into_owned()).unwrap_or_default())?;
        if line.engage && !self.may_engage {
            return Err(format!("engage: must be among the requests of {} in the network file", self.client));
        }
        Ok(RequestLine { remote: Some(self.client.clone()), ..line })
    }

    /// Sends a line over the connection, which begins with the first motion.
    fn send(&mut self, line: &RequestLine, query: Query) {
        let link = match &mut self.link {
            Some(link) => link,
            none => match connect(&self.machine) {
                Ok(connection) => none.insert((connection, VecDeque::new())),
                Err(error) => return reply(&query, &failure(&line.request, &error)),
            },
        };
        link.1.push_back(query);
        if let Err(error) = link.0.send(line) {
            self.end(&format!("the daemon has ended the connection: {error}"));
        }
    }

    /// Passes on an answer, if there is one. Answers come in the order of the requests.
    fn receive(&mut self) -> io::Result<()> {
        let Some((connection, waiting)) = &mut self.link else { return Ok(()) };
        if let Some(answer) = connection.receive(Instant::now() + Duration::from_millis(1), || false)?
            && let Some(query) = waiting.pop_front()
        {
            if answer.request != JOG {
                info!(remote = self.client, "{}: {}: {}", answer.request, answer.result.words(), answer.text);
            }
            reply(&query, &answer);
        }
        Ok(())
    }

    /// Ends the connection; requests without an answer have failed.
    fn end(&mut self, text: &str) {
        for query in self.link.take().into_iter().flat_map(|(_, waiting)| waiting) {
            reply(
                &query,
                &AnswerLine { result: RequestResult::Unanswered, ..AnswerLine::invalid(text.into()) },
            );
        }
    }
}

/// The line of a request with the fields of a JSON object.
fn request_line(request: &str, fields: &[u8]) -> Result<RequestLine, String> {
    let mut fields: Map<String, Value> = match fields {
        [] => Map::new(),
        fields => serde_json::from_slice(fields).map_err(|error| format!("no request: {error}"))?,
    };
    fields.insert("version".into(), VERSION.into());
    fields.insert("request".into(), request.into());
    // A motion without an answer at its end would outlive its connection.
    fields.insert("wait".into(), (request != JOG).into());
    fields.insert("progress".into(), false.into());
    serde_json::from_value(Value::Object(fields)).map_err(|error| format!("no request: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_always_belongs_to_its_client() {
        let fields = br#"{"target": {"z_m": 1.3}, "wait": false, "request": "estop"}"#;
        let line = request_line(GOTO, fields).unwrap();
        assert!(line.wait && line.request == GOTO && line.target.unwrap().z_m == Some(1.3));
        assert!(!request_line(JOG, b"").unwrap().wait);
        let error = request_line(GOTO, br#"{"aim": 1}"#).unwrap_err();
        assert!(error.contains("unknown field `aim`"), "{error}");
    }
}
