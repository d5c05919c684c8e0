//! `hexad move --pause | --resume`: request to the running player.
//!
//! The player is the process that publishes setpoints, as the daemon's status reports it. The request is a
//! signal. Only the player's user and root may send it.

use core::fmt::Display;
use std::fs::read;
use std::thread::sleep;
use std::time::{Duration, Instant};

use nix::sys::signal::kill;
use nix::unistd::Pid;
use tracing::info;

use crate::commands::failure::Failure;
use hexad_client::operator::protocol::AnswerLine as Answer;
use hexad_client::operator::requests::status;
use hexad_client::realtime::pause_signals::{handles_pause, pause_signal};
use hexad_daemon::process_names::{is_stopped, named};
use hexad_machine::config::Config;

/// Time for which the setpoint must not change to count as at rest.
const REST_TIME: Duration = Duration::from_millis(300);
/// Longest slowdown, with a reserve.
const REST_LIMIT: Duration = Duration::from_secs(60);
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Sends the request. After a pause request, waits until the setpoints are at rest.
pub fn request(config: &Config, pauses: bool) -> Result<(), Failure> {
    let player = player(&status(&config.name)?)?;
    kill(Pid::from_raw(player as i32), pause_signal(pauses))
        .map_err(|error| no_player(format_args!("{} cannot be signalled: {error}", named(player))))?;
    if !pauses {
        info!("{} goes on", named(player));
        return Ok(());
    }
    let (began, mut last, mut since) = (Instant::now(), None, Instant::now());
    while since.elapsed() < REST_TIME {
        if began.elapsed() > REST_LIMIT {
            return Err(no_player(format_args!("{} does not come to rest", named(player))));
        }
        sleep(POLL_INTERVAL);
        let setpoint = status(&config.name)?.status.and_then(|report| report.setpoint);
        if setpoint != last {
            (last, since) = (setpoint, Instant::now());
        }
    }
    info!("{} is paused; hexad move --resume goes on", named(player));
    Ok(())
}

fn no_player(reason: impl Display) -> Failure {
    Failure::after_start(format_args!("no player to pause or resume: {reason}"))
}

/// The process that plays a motion.
fn player(answer: &Answer) -> Result<u32, Failure> {
    let report = answer.status.as_deref();
    let sources = report.into_iter().flat_map(|report| &report.sources);
    let processes = sources.filter(|source| source.topic == "setpoint").flat_map(|source| &source.processes);
    let mut alive = processes.filter(|process| !process.command.is_empty());
    let Some(process) = alive.find(|process| !process.is_ignored) else {
        return Err(no_player("no process publishes setpoints"));
    };
    if is_stopped(process.process_id) {
        return Err(no_player(named(process.process_id)));
    }
    // Without a handler the signal would end the process.
    if is_player(process.process_id) && handles_pause(process.process_id) {
        return Ok(process.process_id);
    }
    let reason = format!("{} publishes setpoints and is no hexad move", named(process.process_id));
    Err(no_player(reason))
}

/// Whether the first argument of a process is `move`.
fn is_player(process_id: u32) -> bool {
    let line = read(format!("/proc/{process_id}/cmdline")).unwrap_or_default();
    line.split(|byte| *byte == 0).nth(1) == Some(b"move")
}
