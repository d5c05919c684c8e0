//! `hexad move`: a setpoint source, in real time or in lock-step.
//!
//! It starts where the platform stands (the daemon's status contains the pose), moves the platform gently to the start
//! of the trajectory, plays it and ends at rest. If the daemon gives up control on the way, it starts over from
//! wherever the platform stands then.

use std::path::PathBuf;

use clap::Args;
use tracing::info;

use self::playback::{Playback, PlaybackStep};
use self::precheck::Refusal;
use self::trajectory::{MIN_AMPLITUDE_SHARE, Trajectory};
use super::arguments::{MachineFile, duration};
use super::failure::{CommandError, Failure};
use super::operate::Operator;
use super::plant::prepare_thread;
use crate::config::Config;
use crate::daemon::nanoseconds;
use crate::messages::clock::monotonic_ns;
use crate::messages::lockstep::poll_until;
use crate::messages::{MeasuredMessage, SetpointMessage};
use crate::messages::{PortError, Publisher, Subscriber};
use crate::model::task::TaskState;
use crate::motion::built_in::BuiltInMotion;
use crate::output::csv_table::TableError;
use crate::output::numbers::percent;
use crate::realtime::clock::{Grid, sleep_until};
use crate::realtime::stop_request::Stop;

mod playback;
mod precheck;
pub mod trajectory;

#[derive(Debug, Args)]
pub struct MoveArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    source: TrajectorySource,
    /// Length of the motion [s]
    #[arg(long, default_value_t = 8.0, value_parser = duration, allow_negative_numbers = true, conflicts_with = "trajectory")]
    seconds: f64,
    /// Also request control, once, as soon as the daemon can give it
    #[arg(long)]
    engage: bool,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct TrajectorySource {
    /// A built-in motion
    #[arg(long, value_enum)]
    motion: Option<BuiltInMotion>,
    /// A CSV file with t, X, X', X''
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
}

impl MoveArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let trajectory = match (&self.source.trajectory, self.source.motion) {
            (Some(path), _) => Trajectory::from_file(&config, path)?,
            (None, motion) => {
                Trajectory::built_in(&config, motion.unwrap_or(BuiltInMotion::Settle), self.seconds)?
            }
        };
        Ok(run(&config, &trajectory, self.engage, &Stop::on_signals()?)?)
    }
}

/// Error that prevents setpoints.
#[derive(Debug, thiserror::Error)]
pub enum SetpointError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    Table(#[from] TableError),
    #[error("{name} of {seconds} s would be refused even with {share} of its usual amplitude: {refusal}", name = .motion.name(), share = percent(MIN_AMPLITUDE_SHARE))]
    TooSmall { motion: BuiltInMotion, seconds: f64, refusal: Refusal },
}

impl CommandError for SetpointError {}

/// Plays the trajectory once, or until `stop`. With `engage` it also requests control, once.
fn run(config: &Config, trajectory: &Trajectory, engage: bool, stop: &Stop) -> Result<(), SetpointError> {
    let bus = config.join()?;
    let setpoints = bus.publisher()?;
    let playback = Playback::new(config, trajectory, Operator::new(&bus)?, engage);
    info!(name = %config.name, seconds = trajectory.duration(), "waiting until the daemon knows the pose of the platform");
    match bus.is_simulated() {
        false => run_in_real_time(config, playback, setpoints, stop)?,
        true => run_in_lockstep(config, bus.subscriber(8)?, playback, setpoints, stop)?,
    }
    Ok(())
}

fn run_in_real_time(
    config: &Config,
    mut playback: Playback,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), PortError> {
    prepare_thread(config);
    let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    while !stop.is_requested() {
        sleep_until(tick_ns);
        match playback.step(tick_ns)? {
            PlaybackStep::Silent => {}
            PlaybackStep::Setpoint(state) => setpoints.publish(tick_ns, SetpointMessage::from(&state))?,
            PlaybackStep::Finished => break,
        }
        tick_ns = grid.next_after(tick_ns.max(monotonic_ns()));
    }
    Ok(())
}

/// Publishes a setpoint for each measurement, as the daemon waits for it; home, where the playback has none yet.
fn run_in_lockstep(
    config: &Config,
    mut measured: Subscriber<MeasuredMessage>,
    mut playback: Playback,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), PortError> {
    let mut last = None;
    while let Some(measurement) = poll_until(|| stop.is_requested(), || measured.receive()) {
        let time_ns = measurement.header.time_ns;
        let setpoint = match last {
            Some((last_ns, setpoint)) if last_ns == time_ns => setpoint,
            _ => match playback.step(time_ns)? {
                PlaybackStep::Silent => SetpointMessage::from(&TaskState::at_rest(config.machine.home)),
                PlaybackStep::Setpoint(state) => SetpointMessage::from(&state),
                PlaybackStep::Finished => break,
            },
        };
        setpoints.publish(time_ns, setpoint)?;
        last = Some((time_ns, setpoint));
    }
    Ok(())
}
