//! `hexad move`: a setpoint source, in real time or in lock-step.
//!
//! The source begins at the pose of the platform, which the daemon's status contains. It moves the platform
//! gently to the start of the trajectory, plays it and ends at rest. A platform that is held for a source that
//! has ended is taken over. When an operator ends control, it ends
//! too. After a fault or a restart of the daemon it starts again from the present pose, unless it has taken control itself: then
//! it ends. A signal slows the platform down along its path, to rest under control; the exit code is then 130. `--pause` and `--resume`
//! send requests to the running player.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use clap::builder::PossibleValuesParser;
use tracing::info;

use self::engagement::Engagement;
use self::playback::{Playback, PlaybackStep};
use self::trajectory::Trajectory;
use self::udp::stream::StreamOptions;
use super::arguments::{GROUP_HELP, MachineFile, built_in_motion, duration};
use super::failure::Failure;
use super::frame_options::FrameOptions;
use super::orientation::{OrientationFormat, ROTATION_HELP};
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::lockstep::poll_until;
use hexad_client::messages::{MeasuredMessage, Publisher, SetpointMessage, Subscriber};
use hexad_client::realtime::clock::{Grid, sleep_until};
use hexad_client::realtime::pause_signals::PauseRequest;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::model::task::TaskState;
use hexad_core::motion::built_in::BuiltInMotion;
use hexad_daemon::nanoseconds;
use hexad_machine::config::Config;
use hexad_machine::text::csv_table::GROUPS;

mod approach;
mod engagement;
mod path;
mod pause;
mod playback;
pub mod trajectory;
mod udp;

/// Time between two questions whether a source may join in lock-step.
const JOIN_INTERVAL: Duration = Duration::from_millis(20);

#[derive(Debug, Args)]
pub struct MoveArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    source: TrajectorySource,
    #[arg(long, help = ROTATION_HELP, value_name = "ORDER", default_value = "xyz")]
    #[arg(value_parser = OrientationFormat::by_name(), conflicts_with_all = ["motion", "udp", "pause", "resume"])]
    rotation: OrientationFormat,
    #[arg(long, help = GROUP_HELP, value_name = "GROUP", value_parser = PossibleValuesParser::new(GROUPS))]
    #[arg(conflicts_with_all = ["motion", "udp", "pause", "resume"])]
    group: Option<String>,
    #[command(flatten)]
    frames: FrameOptions,
    /// Length of the motion, or of --dry-run [s]
    #[arg(long, default_value_t = 8.0, value_parser = duration, allow_negative_numbers = true, conflicts_with = "trajectory")]
    seconds: f64,
    #[command(flatten)]
    playback: PlaybackOptions,
    #[command(flatten)]
    stream: StreamOptions,
}

/// Options of commands that play a trajectory.
#[derive(Debug, Args)]
pub struct PlaybackOptions {
    /// At the end of the motion, leave the platform standing under control at the last pose
    #[arg(long)]
    hold: bool,
    /// Also request control, once, as soon as the setpoints hold the pose of the platform
    #[arg(long)]
    engage: bool,
    /// Longest to wait for control [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true, requires = "engage")]
    within: f64,
}

impl PlaybackOptions {
    /// Plays the trajectory once.
    pub fn play(&self, config: &Config, trajectory: &Trajectory) -> Result<(), Failure> {
        run(config, trajectory, self.hold, self.engage_within(), &Stop::on_signals()?)
    }

    fn engage_within(&self) -> Option<Duration> {
        self.engage.then(|| Duration::from_secs_f64(self.within))
    }
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct TrajectorySource {
    /// A built-in motion
    #[arg(long, value_parser = built_in_motion())]
    motion: Option<BuiltInMotion>,
    /// A CSV file with t and X, or t, X, X', X''; `-` is standard input
    ///
    /// Columns t, alpha, beta, gamma, x, y, z, and alpha_rate ... z_rate, alpha_accel ... z_accel or none of these, in s, rad and m, or
    /// with a unit at the end of the name, or below it: t_ms, x_mm, x [mm], alpha_deg, x_rate_mm_s, alpha_accel_deg_s2. Commas,
    /// semicolons, tabs or bars separate fields; without commas a number may have a decimal comma.
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Poses that a simulator or a game sends to this address, see docs/motion_simulator.md
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "hold")]
    udp: Option<SocketAddr>,
    /// Let the player that runs slow down along its path, to rest under control
    #[arg(long, conflicts_with = "hold")]
    pause: bool,
    /// Let a paused player go on along its path
    #[arg(long, conflicts_with = "hold")]
    resume: bool,
}

impl MoveArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        if self.source.pause || self.source.resume {
            return pause::request(&config, self.source.pause);
        }
        if self.source.trajectory.is_none() && !self.frames.is_empty() {
            return Err(Failure::before_start(
                "--tool, --work: must go with --trajectory; other motions are about home of the platform",
            ));
        }
        if let Some(address) = self.source.udp {
            let stop = Stop::on_signals()?;
            if self.stream.dry_run {
                config.examine().into_result(&config)?;
                return udp::dry_run::run(&config, address, &self.stream, self.seconds, &stop);
            }
            return udp::follow(&config, address, &self.stream, &self.playback, &stop);
        }
        let coordinates = self.frames.coordinates(&config)?;
        let trajectory = match (&self.source.trajectory, self.source.motion) {
            (Some(path), _) => {
                Trajectory::from_file(&config, &coordinates, path, self.group.as_deref(), self.rotation)?
            }
            (None, motion) => {
                Trajectory::built_in(&config, motion.unwrap_or(BuiltInMotion::Settle), self.seconds)?
            }
        };
        self.playback.play(&config, &trajectory)
    }
}

/// Why a motion was not begun in its time.
fn not_engaged(within: Duration, reason: &str) -> Failure {
    Failure::after_start(format_args!("not engaged within {} s: {reason}", within.as_secs_f64()))
}

/// Why pauses and resumptions cannot be signalled.
fn no_signals(error: io::Error) -> Failure {
    Failure::before_start(format_args!("signals of pause and resume: {error}"))
}

/// Plays the trajectory once. After the first signal of `stop` the platform comes to rest along its path;
/// after the second the function returns at once. With `is_to_hold` the platform stands under control at the end. With
/// `engage_within` the function also requests control.
fn run(
    config: &Config,
    trajectory: &Trajectory,
    is_to_hold: bool,
    engage_within: Option<Duration>,
    stop: &Stop,
) -> Result<(), Failure> {
    let bus = config.join()?;
    let engagement = match engage_within {
        None => Engagement::None,
        Some(within) if bus.is_simulated() => Engagement::in_step(config, within),
        Some(within) => Engagement::over_socket(config, within, stop),
    };
    info!(name = %config.name, seconds = trajectory.duration(), "setpoint source");
    // Every status is needed, because a state may last one cycle.
    let mut playback = Playback::new(config, trajectory, is_to_hold, bus.subscriber(usize::MAX)?, engagement);
    if bus.is_simulated() {
        let began = Instant::now();
        while let Err(reason) = playback.may_join() {
            if stop.is_requested() {
                return Err(Failure::interrupted("interrupted"));
            }
            if let Some(within) = engage_within.filter(|within| began.elapsed() > *within) {
                return Err(not_engaged(within, &reason));
            }
            thread::sleep(JOIN_INTERVAL);
        }
        run_in_lockstep(config, bus.subscriber(8)?, playback, bus.publisher()?, stop)?;
    } else {
        run_in_real_time(config, playback, bus.publisher()?, stop)?;
    }
    if stop.is_requested() { Err(Failure::interrupted("interrupted")) } else { Ok(()) }
}

fn run_in_real_time(
    config: &Config,
    mut playback: Playback,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), Failure> {
    let pause = PauseRequest::on_signals().map_err(no_signals)?;
    config.deployment.realtime.prepare_peer_thread();
    let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    let mut has_begun = false;
    while !stop.is_repeated() {
        sleep_until(tick_ns);
        if stop.is_requested() && playback.slow_down(tick_ns) {
            break;
        }
        playback.set_paused(tick_ns, pause.is_requested());
        match playback.step(tick_ns)? {
            PlaybackStep::Silent => {}
            PlaybackStep::Setpoint(setpoint) => {
                if !core::mem::replace(&mut has_begun, true) {
                    setpoints.begin_epoch();
                }
                setpoints.publish(tick_ns, (&setpoint).into())?;
            }
            PlaybackStep::Finished => break,
        }
        tick_ns = grid.next_after(tick_ns.max(monotonic_ns()));
    }
    Ok(())
}

/// Publishes a setpoint for each measurement, because the daemon waits for it: home, while the playback has
/// none.
fn run_in_lockstep(
    config: &Config,
    mut measured: Subscriber<MeasuredMessage>,
    mut playback: Playback,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), Failure> {
    let mut last = None;
    // Without measurements, simulated time does not advance, so nothing can be slowed down.
    while let Some(measurement) = poll_until(|| stop.is_requested(), || measured.receive()) {
        let time_ns = measurement.header.time_ns;
        let setpoint = match last {
            Some((last_ns, setpoint)) if last_ns == time_ns => {
                // A plant without a response repeats its message. The daemon may have ended.
                playback.receive(time_ns)?;
                setpoint
            }
            _ => match playback.step(time_ns)? {
                PlaybackStep::Silent => SetpointMessage::from(&TaskState::at_rest(config.machine.home)),
                PlaybackStep::Setpoint(setpoint) => (&setpoint).into(),
                PlaybackStep::Finished => break,
            },
        };
        setpoints.publish(time_ns, setpoint)?;
        last = Some((time_ns, setpoint));
    }
    Ok(())
}
