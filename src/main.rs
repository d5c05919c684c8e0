//! The `hexad` command; see `hexad --help`.

use std::env;
use std::io::{self, IsTerminal};
use std::process::ExitCode;

use clap::Parser;
use hexad::commands::CommandLine;
use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::realtime::allocation::CountingAllocator;
use hexad::realtime::process::stop_with_parent;
use tracing::level_filters::LevelFilter;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    let level = env::var("HEXAD_LOG").ok().and_then(|level| level.parse().ok()).unwrap_or(LevelFilter::INFO);
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_target(false)
        .with_ansi(io::stderr().is_terminal())
        .with_writer(io::stderr)
        .init();
    let parent = env::var(PARENT_VARIABLE).ok().and_then(|number| number.parse().ok());
    if parent.is_some_and(|parent| !stop_with_parent(parent)) {
        return ExitCode::SUCCESS;
    }
    match CommandLine::parse().execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("hexad: {}", failure.message);
            ExitCode::from(failure.exit_code)
        }
    }
}
