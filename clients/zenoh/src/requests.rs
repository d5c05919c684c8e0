//! Requests of a client: queries, whose answers are those of the control socket.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use hexad_bridge::requests::carry_out_for;
use hexad_client::operator::OperatorError;
use hexad_client::operator::protocol::{AnswerLine, RequestResult, is_stop};
use hexad_client::operator::requests::status;
use hexad_core::control::signals::state::Request;
use tracing::{info, warn};
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

use crate::access::request_key;

/// Queries that wait for one of the same name. Those beyond are not answered.
const MAX_WAITING: usize = 16;

/// Queryables, and with them the requests that are served.
pub type Served = Vec<Queryable<()>>;

/// Queries with the name of a request, in the order of their arrival.
pub fn queries(session: &Session, served: &mut Served, key: String) -> Result<Receiver<Query>, String> {
    let (send, queries) = sync_channel(MAX_WAITING);
    let take = move |query| drop(send.try_send(query));
    let queryable = session.declare_queryable(key).callback(take).wait();
    served.push(queryable.map_err(|error| error.to_string())?);
    Ok(queries)
}

/// Serves the requests of a client and its questions for the status, each kind in a thread of its own, so that none waits for
/// another.
pub fn serve(
    session: &Session,
    served: &mut Served,
    machine: &str,
    client: &str,
    allowed: Vec<Request>,
) -> Result<(), String> {
    for request in allowed {
        let queries = queries(session, served, request_key(machine, client, request.name()))?;
        let (machine, client) = (machine.to_owned(), client.to_owned());
        thread::spawn(move || {
            for query in &queries {
                let answer = answer(&machine, request, &client);
                info!(remote = client, "{}: {}", request.name(), conclusion(&answer));
                reply(&query, &answer);
                // Those that arrived meanwhile have the same answer: none of them begins control later. Stops are carried out one by one.
                if !is_stop(request) {
                    queries.try_iter().for_each(|query| reply(&query, &answer));
                }
            }
        });
    }
    let queries = queries(session, served, request_key(machine, client, "status"))?;
    let machine = machine.to_owned();
    thread::spawn(move || {
        for query in queries {
            reply(&query, &status(&machine).unwrap_or_else(|error| failure("status", &error)));
        }
    });
    Ok(())
}

fn answer(machine: &str, request: Request, client: &str) -> AnswerLine {
    match carry_out_for(machine, request, client) {
        Ok(state) => AnswerLine {
            result: RequestResult::Done,
            request: request.name().into(),
            text: state.clone(),
            state,
            ..AnswerLine::invalid(String::new())
        },
        Err(error) => failure(request.name(), &error),
    }
}

/// The answer with the reason why a request has failed.
pub fn failure(request: &str, error: &OperatorError) -> AnswerLine {
    let result = match error {
        OperatorError::Refused(..) => RequestResult::Refused,
        OperatorError::TimedOut(..) => RequestResult::TimedOut,
        OperatorError::Stale(..) => RequestResult::Stale,
        OperatorError::NotCompleted(..) => RequestResult::Failed,
        _ => RequestResult::Unanswered,
    };
    AnswerLine { result, request: request.into(), ..AnswerLine::invalid(error.to_string()) }
}

/// Result and reason of an answer, for the log.
fn conclusion(answer: &AnswerLine) -> String {
    format!("{}: {}", answer.result.words(), answer.text)
}

/// Sends the answer to a query.
pub fn reply(query: &Query, answer: &AnswerLine) {
    if let Err(error) = query.reply(query.key_expr().clone(), answer.to_line()).wait() {
        warn!("no answer to {}: {error}", query.key_expr());
    }
}
