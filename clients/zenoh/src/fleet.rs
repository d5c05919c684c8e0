//! All machines of a file, each over a session of its own: their status, and stops.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use hexad_client::operator::protocol::{AnswerLine, RequestResult};
use hexad_core::control::signals::state::Request;
use hexad_machine::text::excerpt::toml_error;
use hexad_machine::text::files::{print, remark};
use hexad_machine::text::numbers::significant;
use hexad_machine::text::text_table::{Left, Right, text_table};
use serde::Deserialize;
use zenoh::Wait;

use crate::access::{client_config, request_key};
use crate::network_file::{Identity, check_endpoint, check_name};

/// Longest wait for a connection.
const CONNECTION_LIMIT: Duration = Duration::from_secs(2);

/// Time between two attempts.
const RETRY_INTERVAL: Duration = Duration::from_millis(5);

/// Longest wait for a status: longer than the bridge waits for the daemon.
const STATUS_LIMIT: Duration = Duration::from_secs(4);

/// Longest wait for the end of a stop.
const STOP_LIMIT: Duration = Duration::from_secs(32);

/// File of an operator: who he is, and the machines.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetFile {
    /// Common name of the certificate.
    name: String,
    identity: Identity,
    /// Endpoints of the bridges, by the names of the machines.
    machine: BTreeMap<String, String>,
}

/// Outcome of a request at one machine: the answer, or why there is none.
type Outcome<'a> = (&'a String, Result<AnswerLine, String>);

impl FleetFile {
    /// Reads and checks a file.
    pub fn load(place: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(place).map_err(|error| format!("{}: {error}", place.display()))?;
        let name = place.display();
        let mut file: Self =
            toml::from_str(&text).map_err(|error| format!("{name}: {}", toml_error(&text, &error)))?;
        file.identity.resolve(place).map_err(|error| format!("{name}: {error}"))?;
        check_name(&file.name).map_err(|error| format!("{name}: name = {error}"))?;
        for (machine, endpoint) in &file.machine {
            check_name(machine).map_err(|error| format!("{name}: machine.{error}"))?;
            check_endpoint(endpoint).map_err(|error| format!("{name}: machine.{machine}: {error}"))?;
        }
        Ok(file)
    }

    /// Prints a line for each machine that answers, and on standard error one for each other. An error if none answers.
    pub fn print_status(&self, is_json: bool) -> Result<(), String> {
        let outcomes = self.ask(&self.machine, "status", STATUS_LIMIT);
        report_failures(&outcomes);
        let answers: Vec<_> =
            outcomes.iter().filter_map(|(name, it)| Some((*name, it.as_ref().ok()?))).collect();
        let text = if is_json {
            answers.iter().map(|(_, answer)| answer.to_line()).collect()
        } else {
            let columns =
                [("machine", Left), ("state", Left), ("code", Right), ("rate", Right), ("endpoint", Left)];
            text_table(2, &columns, answers.iter().map(|(name, answer)| self.row(name, answer)))
        };
        if answers.is_empty() {
            return Err("no machine answers".into());
        }
        print(text).map_err(|error| error.to_string())
    }

    fn row(&self, name: &str, answer: &AnswerLine) -> [String; 5] {
        let rate_hz = answer.status.as_ref().map_or(0.0, |report| report.timing.rate_hz);
        let endpoint = self.machine.get(name).cloned().unwrap_or_default();
        let code = answer.diagnostic.code.to_string();
        [name.into(), answer.state.clone(), code, format!("{} Hz", significant(rate_hz)), endpoint]
    }

    /// Stops a machine, or all, at the same time. An error if any stop is not confirmed.
    pub fn stop(&self, request: Request, machine: Option<&str>) -> Result<(), String> {
        let mut machines = self.machine.clone();
        if let Some(machine) = machine {
            machines.retain(|name, _| name == machine);
        }
        if machines.is_empty() {
            return Err("no such machine in the file".into());
        }
        let outcomes = self.ask(&machines, request.name(), STOP_LIMIT);
        for (name, outcome) in &outcomes {
            if let Ok(answer) = outcome {
                print(format_args!("{name}: {}\n", answer.state)).map_err(|error| error.to_string())?;
            }
        }
        match report_failures(&outcomes) {
            0 => Ok(()),
            count => Err(format!(
                "{} is not confirmed by {count} of {} machines: use the emergency-stop circuit",
                request.name(),
                outcomes.len()
            )),
        }
    }

    /// Sends a request to machines, all at the same time.
    fn ask<'a>(
        &self,
        machines: &'a BTreeMap<String, String>,
        request: &str,
        limit: Duration,
    ) -> Vec<Outcome<'a>> {
        thread::scope(|scope| {
            let begun: Vec<_> = machines
                .iter()
                .map(|(name, endpoint)| (name, scope.spawn(|| self.ask_one(name, endpoint, request, limit))))
                .collect();
            let end = "its thread has ended";
            begun
                .into_iter()
                .map(|(name, it)| (name, it.join().unwrap_or_else(|_| Err(end.into()))))
                .collect()
        })
    }

    fn ask_one(
        &self,
        machine: &str,
        endpoint: &str,
        request: &str,
        limit: Duration,
    ) -> Result<AnswerLine, String> {
        let config = client_config(endpoint, &self.identity, CONNECTION_LIMIT.as_millis() as u64)?;
        let session =
            zenoh::open(config).wait().map_err(|error| format!("no connection to {endpoint}: {error}"))?;
        let key = request_key(machine, &self.name, request);
        let silent =
            || format!("{endpoint} does not answer: does its network file name a client \"{}\"?", self.name);
        let connected = Instant::now();
        let reply = loop {
            let answers = session.get(&key).timeout(limit).wait().map_err(|error| error.to_string())?;
            match answers.recv() {
                Ok(reply) => break reply,
                // Just after the connection the request may precede what the bridge has declared.
                Err(_) if connected.elapsed() < CONNECTION_LIMIT => thread::sleep(RETRY_INTERVAL),
                Err(_) => return Err(silent()),
            }
        };
        let sample = reply.into_result().map_err(|_| silent())?;
        let answer: AnswerLine =
            serde_json::from_slice(&sample.payload().to_bytes()).map_err(|error| error.to_string())?;
        let _ = session.close().wait();
        if answer.result == RequestResult::Done { Ok(answer) } else { Err(answer.text) }
    }
}

/// Prints the failures; returns their number.
fn report_failures(outcomes: &[Outcome<'_>]) -> usize {
    let failures = outcomes.iter().filter_map(|(name, outcome)| Some((name, outcome.as_ref().err()?)));
    failures.inspect(|(name, error)| remark(format_args!("{name}: {error}"))).count()
}
