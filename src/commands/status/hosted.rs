//! `hexad status` without a machine file: all machines that run on this host.

use crate::commands::failure::Failure;
use hexad_client::operator::OperatorError;
use hexad_client::operator::endpoint::{Endpoint, endpoints};
use hexad_client::operator::protocol::{AnswerLine, RequestResult, VERSION};
use hexad_client::operator::requests::request_status_from;
use hexad_client::operator::status_report::StatusReport;
use hexad_client::operator::users::user_name;
use hexad_machine::text::files::print;
use hexad_machine::text::numbers::significant;
use hexad_machine::text::text_table::{Left, Right, text_table};

/// Prints a line per daemon, ordered by the machine's name: a row of a table, or the answer as JSON.
pub fn show(is_json: bool) -> Result<(), Failure> {
    let mut found = endpoints(None);
    found.sort_by(|a, b| a.machine.cmp(&b.machine));
    let answers: Vec<_> = found.iter().filter_map(|endpoint| Some((endpoint, answer(endpoint)?))).collect();
    if answers.is_empty() {
        return Err(Failure::before_start("no daemon runs on this host"));
    }
    if is_json {
        let lines: String = answers.iter().map(|(_, answer)| answer.to_line()).collect();
        return Ok(print(lines)?);
    }
    let columns = [
        ("machine", Left),
        ("state", Left),
        ("code", Right),
        ("rate", Right),
        ("processors", Right),
        ("process", Right),
        ("user", Left),
    ];
    Ok(print(text_table(2, &columns, answers.iter().map(row)))?)
}

/// The daemon's answer, or an answer with the reason why there is none. `None` if no process listens.
fn answer(endpoint: &Endpoint) -> Option<AnswerLine> {
    let error = match request_status_from(endpoint) {
        Ok(answer) => return Some(answer),
        Err(OperatorError::NoDaemon(_)) => return None,
        Err(error) => error,
    };
    let process_id = endpoint.daemon.as_ref().map_or(0, |daemon| daemon.process_id);
    let report = StatusReport { machine: endpoint.machine.clone(), process_id, ..StatusReport::default() };
    Some(AnswerLine {
        version: VERSION,
        result: RequestResult::Unanswered,
        request: "status".into(),
        status: Some(Box::new(report)),
        ..AnswerLine::invalid(error.to_string())
    })
}

fn row((endpoint, answer): &(&Endpoint, AnswerLine)) -> [String; 7] {
    let has_answered = answer.result == RequestResult::Done;
    let known = |text: String| if has_answered { text } else { "unknown".into() };
    let (rate_hz, process_id) =
        answer.status.as_ref().map_or((0.0, 0), |report| (report.timing.rate_hz, report.process_id));
    let processors = endpoint.daemon.as_ref().map(|daemon| match daemon.processors.as_slice() {
        [] => "any".into(),
        some => some.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
    });
    let unknown = || "unknown".into();
    [
        endpoint.machine.clone(),
        known(answer.state.clone()),
        known(answer.diagnostic.code.to_string()),
        known(format!("{} Hz", significant(rate_hz))),
        processors.unwrap_or_else(unknown),
        if process_id == 0 { unknown() } else { process_id.to_string() },
        user_name(endpoint.owner),
    ]
}
