//! The `hexad` command; see `hexad --help`.

use std::env;
use std::process::ExitCode;

use hexad::commands::CommandLine;
use hexad::commands::demo::children::PARENT_VARIABLE;
use hexad::log;
use hexad::realtime::allocation::CountingAllocator;
use hexad::realtime::process::stop_with_parent;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    let parent = env::var(PARENT_VARIABLE).ok().and_then(|number| number.parse().ok());
    if parent.is_some_and(|parent| !stop_with_parent(parent)) {
        return ExitCode::SUCCESS;
    }
    let command = CommandLine::from_arguments();
    let _log = log::install(command.log_format);
    match command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::report_failure(&failure.message);
            ExitCode::from(failure.exit_code)
        }
    }
}
