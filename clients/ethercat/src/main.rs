//! The command `hexad-ethercat`; see `hexad-ethercat --help`.
#![deny(clippy::print_stdout, clippy::print_stderr)] // They panic where a pipe is closed.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use hexad_client::realtime::allocation::CountingAllocator;
use hexad_machine::log::{self, LogFormat};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    let command = commands::CommandLine::parse();
    let _log = log::install(LogFormat::Text);
    match command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::report_failure(&failure.message);
            ExitCode::from(failure.exit_code)
        }
    }
}
