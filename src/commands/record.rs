//! `hexad record`: the last seconds of a running daemon, as a recording.

use std::fs::File;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;

use super::arguments::{MachineFile, duration};
use super::failure::Failure;
use hexad_client::operator::OperatorError;
use hexad_client::operator::connection::Connection;
use hexad_client::operator::protocol::{RequestLine, RequestResult};
use hexad_client::operator::requests::query_first_trusted;
use hexad_client::realtime::file_passing;
use hexad_machine::text::files::{print, write_whole_with};

/// Longest wait for a recording of the last seconds: 160 MB on a slow disk.
const RECORD_LIMIT: Duration = Duration::from_secs(60);

#[derive(Debug, Args)]
pub struct RecordArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Length of the recording [s]; the daemon keeps 30 s, less above 4 kHz
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true)]
    last: f64,
    /// File to write
    #[arg(long, short, value_name = "FILE", default_value = "last.mcap")]
    output: PathBuf,
}

impl RecordArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let mut written = String::new();
        write_whole_with(&self.output, |file| -> Result<(), Failure> {
            written = record(&config.name, self.last, file)?;
            Ok(())
        })?;
        Ok(print(format_args!("{}: {written}\n", self.output.display()))?)
    }
}

/// Requests the recording of the last seconds into a file. Returns the daemon's answer as text.
fn record(machine: &str, last_s: f64, file: &File) -> Result<String, OperatorError> {
    let line = RequestLine { last_s: Some(last_s), ..RequestLine::new("record") };
    let answer = query_first_trusted(machine, |connection: &mut Connection| {
        let text = line.to_line()?;
        let count = file_passing::send(connection.stream(), text.as_bytes(), file)?;
        connection.stream().write_all(text.as_bytes().get(count..).unwrap_or_default())?;
        connection.receive(Instant::now() + RECORD_LIMIT, || false)
    })?;
    match answer.result {
        RequestResult::Done => Ok(answer.text),
        _ => Err(OperatorError::NotRecorded(answer.text)),
    }
}
