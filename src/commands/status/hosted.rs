//! `hexad status` without a machine file: all machines that run on this host.

use crate::commands::failure::Failure;
use crate::commands::operate::endpoint::Endpoint;
use crate::commands::operate::{Answer, status_of};
use crate::daemon::control_socket::protocol::{RequestResult, VERSION};
use crate::daemon::control_socket::status::StatusReport;
use crate::daemon::control_socket::user_name;
use crate::messages::claim::{RunningDaemon, all_running_daemons};
use crate::output::files::print;
use crate::output::numbers::significant;
use crate::output::text_table::{Left, Right, text_table};

/// Prints a line for each daemon, by name of its machine: a row of a table, or its answer as JSON.
pub fn show(is_json: bool) -> Result<(), Failure> {
    let daemons = all_running_daemons();
    if is_json {
        let lines: String = daemons.iter().map(|daemon| answer(daemon).to_line()).collect();
        return Ok(print(lines)?);
    }
    if daemons.is_empty() {
        return Ok(print("no daemon runs on this host\n")?);
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
    Ok(print(text_table(2, &columns, daemons.iter().map(row)))?)
}

/// The daemon's answer; one that says why there is none.
fn answer(daemon: &RunningDaemon) -> Answer {
    let RunningDaemon { machine, process_id, .. } = daemon;
    status_of(machine, &Endpoint::from(daemon.clone())).unwrap_or_else(|error| {
        let report =
            StatusReport { machine: machine.clone(), process_id: *process_id, ..StatusReport::default() };
        Answer {
            version: VERSION,
            result: RequestResult::Unanswered,
            request: "status".into(),
            status: Some(Box::new(report)),
            ..Answer::invalid(error.to_string())
        }
    })
}

fn row(daemon: &RunningDaemon) -> [String; 7] {
    let answer = answer(daemon);
    let has_answered = answer.result == RequestResult::Done;
    let rate_hz = answer.status.as_ref().map_or(0.0, |report| report.timing.rate_hz);
    let known = |text: String| if has_answered { text } else { "unknown".into() };
    let processors: Vec<_> = daemon.processors.iter().map(usize::to_string).collect();
    [
        daemon.machine.clone(),
        known(answer.state.clone()),
        known(answer.diagnostic.code.to_string()),
        known(format!("{} Hz", significant(rate_hz))),
        if processors.is_empty() { "any".into() } else { processors.join(", ") },
        daemon.process_id.to_string(),
        user_name(daemon.user_id),
    ]
}
