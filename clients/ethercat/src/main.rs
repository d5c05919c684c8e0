//! The command `hexad-ethercat`; see `hexad-ethercat --help`.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use hexad::commands::log::{self, LogFormat};
use hexad::realtime::allocation::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    let command = commands::CommandLine::parse();
    log::install(LogFormat::Text);
    match command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::report_failure(&failure.message);
            ExitCode::from(failure.exit_code)
        }
    }
}
