//! `hexad move --udp`: poses that a simulator or a game sends as datagrams.
//!
//! ```text
//! boarding pose -> hexad ride start -> blend to the stream -> follow it -> a pause: stand -> blend to it ...
//!       ^   hexad ride end, a long pause, another start of the game |
//!       '-----------------------------------------------------------'    Ctrl-C -> boarding pose, end
//! ```
//!
//! Only the operator begins a ride, never the stream: after a stop, a fault, or another start of the game or of this source, too.
//!
//! Datagrams are not authenticated: any program at an allowed address moves the platform, within the limits of the file.

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use tracing::info;

use self::datagram_format::FormatError;
use self::receiver::Receiver;
use self::status_feed::StatusFeed;
use self::survey::StreamSurvey;
use super::PlaybackOptions;
use crate::commands::failure::{CommandError, INTERRUPTED, default_exit_code};
use crate::commands::quantity::{angle, length, list};
use crate::output::svg::ChartError;
use hexad_client::messages::Bus;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::operator::requests::status;
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::realtime::pause_signals::PauseRequest;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::constants::Constants;
use hexad_core::control::parameters::ViolationPolicy;
use hexad_core::model::task::pose_of;
use hexad_core::motion::minimum_jerk::{rise, straight_move};
use hexad_daemon::constants;
use hexad_daemon::target_source::{TargetError, TargetSource, is_reached, other_source};
use hexad_machine::analysis::target_motion::{TargetRefusal, check_target};
use hexad_machine::config::Config;
use hexad_machine::text::files::FileError;
use hexad_machine::text::numbers::fixed;

mod datagram_format;
pub mod dry_run;
mod receiver;
mod rejection;
mod status_feed;
mod survey;

/// Duration of the blend from the pose at which the platform stands to the stream \[s\].
const BLEND_S: f64 = 3.0;

/// Share of the way from home to the lowest pose at which people board.
const COMFORTABLE_SHARE: f64 = 0.9;

/// Way below which nobody boards \[mm\].
const LOWEST_MM: u32 = 3000;

/// Pause after which the platform moves to the boarding pose \[s\].
const LONG_PAUSE_S: f64 = 10.0;

#[derive(Debug, Default, Args)]
pub struct StreamOptions {
    /// Format of the datagrams: x-plane, flypt-mover, simtools, or a file, see docs/motion_simulator.md
    #[arg(long, value_name = "NAME", requires = "udp")]
    format: Option<String>,
    /// Address from which datagrams are accepted; required unless --udp is of this host alone
    #[arg(long, value_name = "IP", requires = "udp")]
    from: Vec<IpAddr>,
    /// Pose at which people board, with units, as in 0,0,0,0,0,0.7m; without it, home, lowered to nine tenths of what the machine permits
    #[arg(long, value_name = "X", requires = "udp", value_parser = boarding, allow_hyphen_values = true)]
    boarding: Option<[f64; 6]>,
    /// Receive and examine the stream for --seconds; move nothing, and need no daemon
    #[arg(long, requires = "udp", conflicts_with_all = ["engage", "boarding"])]
    pub dry_run: bool,
    /// SVG file for the picture of the stream
    #[arg(long, value_name = "FILE", requires = "dry_run")]
    output: Option<PathBuf>,
}

fn boarding(text: &str) -> Result<[f64; 6], String> {
    list(text, [angle, angle, angle, length, length, length], "0,0,0,0,0,0.7m")
}

/// Reasons why no stream is followed.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    #[error("--udp: needs --format: x-plane, flypt-mover, simtools, or a file")]
    NoFormat,
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error("--udp {0}: must be the address of one interface")]
    AnyInterface(SocketAddr),
    #[error("--udp {0}: is open to other hosts: name those that may move the platform with --from")]
    NoSender(SocketAddr),
    #[error("--udp {0}: {1}")]
    Socket(SocketAddr, io::Error),
    #[error("--udp: poses alone need setpoint.on_violation = \"limit\" in the machine file (now \"stop\")")]
    Policy,
    #[error("signals of pause and resume: {0}")]
    Signals(io::Error),
    #[error("{0}")]
    Silence(String),
    #[error(transparent)]
    Picture(#[from] ChartError),
    #[error(transparent)]
    Output(#[from] FileError),
    #[error(transparent)]
    Target(#[from] TargetError),
    #[error("interrupted; the platform stands under control; hexad stop or park ends it")]
    Interrupted,
}

impl CommandError for StreamError {
    fn has_begun(&self) -> bool {
        match self {
            Self::Target(error) => error.has_begun(),
            Self::Silence(_) | Self::Picture(_) | Self::Output(_) => true,
            _ => false,
        }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted => INTERRUPTED,
            _ => default_exit_code(self),
        }
    }
}

/// Follows the datagrams to an address, each time that the operator begins a ride, until the first signal; then the platform moves to
/// the boarding pose and stands there.
pub fn follow(
    config: &Config,
    address: SocketAddr,
    options: &StreamOptions,
    playback: &PlaybackOptions,
    stop: &Stop,
) -> Result<(), StreamError> {
    if config.deployment.setpoint.on_violation != ViolationPolicy::Limit {
        return Err(StreamError::Policy);
    }
    let receiver = Receiver::open(config, address, options)?;
    let (constants, pause) = (constants(config), PauseRequest::on_signals().map_err(StreamError::Signals)?);
    let boarding = options.boarding.unwrap_or_else(|| lowest_comfortable(&constants, &config.machine.home));
    let checked = check_target(&constants, &pose_of(&boarding));
    checked.map_err(|bound| TargetError::from(TargetRefusal::Target(bound)))?;
    let bus = config.join().map_err(TargetError::from)?;
    let source = open_source(config, &bus, playback.engage_within(), stop)?;
    let [_, _, _, x, y, z] = boarding.map(|coordinate| fixed(1e3 * coordinate, 0));
    info!(%address, "moves to the boarding pose (x, y, z = {x}, {y}, {z} mm)");
    let survey = StreamSurvey::default();
    let mut ride = Ride { source, receiver, survey, boarding, constants: &constants, phase: Phase::Boarding };
    while !stop.is_repeated() && ride.step(pause.is_requested(), stop.is_requested())? {}
    info!("{}", ride.receiver.description());
    if stop.is_repeated() { Err(StreamError::Interrupted) } else { Ok(()) }
}

/// Home, lowered along gravity by nine tenths of the way that the workspace permits.
fn lowest_comfortable(constants: &Constants, home: &[f64; 6]) -> [f64; 6] {
    let down = constants.machine().gravity.try_normalize(0.0).unwrap_or_default();
    let lowered = |by: f64| -> [f64; 6] {
        let [alpha, beta, gamma, x, y, z] = *home;
        [alpha, beta, gamma, x + by * down.x, y + by * down.y, z + by * down.z]
    };
    let is_inside = |by: &f64| check_target(constants, &pose_of(&lowered(*by))).is_ok();
    let ways = (0..LOWEST_MM).map(|mm| 1e-3 * f64::from(mm)).take_while(is_inside);
    lowered(COMFORTABLE_SHARE * ways.last().unwrap_or_default())
}

/// A source with the datagrams that it follows.
struct Ride<'a> {
    source: TargetSource<'a, StatusFeed>,
    receiver: Receiver,
    survey: StreamSurvey,
    boarding: [f64; 6],
    constants: &'a Constants,
    phase: Phase,
}

impl Ride<'_> {
    /// Publishes the setpoint of one period. False at the end.
    fn step(&mut self, is_paused: bool, is_ending: bool) -> Result<bool, StreamError> {
        let (newest, now_ns) = (self.receiver.newest(), monotonic_ns());
        let order = self.describe(is_paused);
        if is_ending && !matches!(self.phase, Phase::Leaving) {
            info!("moves to the boarding pose; once more ends at once");
            self.phase = Phase::Leaving;
        }
        if order == Some(RideOrder::End) {
            self.board("the operator ends the ride");
        }
        match self.phase {
            Phase::Boarding | Phase::Leaving => {
                self.source.publish(self.boarding)?;
                let is_there = self.source.active_since_ns().is_some()
                    && is_reached(&self.source.present_x()?, &self.boarding);
                match self.phase {
                    Phase::Leaving if is_there => return Ok(false),
                    Phase::Boarding if is_there => {
                        info!("stands at the boarding pose; hexad ride start begins the ride");
                        self.phase = Phase::Ready;
                    }
                    _ => {}
                }
            }
            Phase::Ready => {
                self.source.publish(self.boarding)?;
                newest.iter().for_each(|it| self.survey.add(self.constants, it.arrival_ns, &it.x));
                let may_begin = self.receiver.is_alive(now_ns) && self.survey.is_long_enough();
                if order == Some(RideOrder::Start) && may_begin {
                    self.receiver.take_restart();
                    self.phase = Phase::following(self.boarding);
                }
            }
            Phase::Following { from, since_ns } => {
                // The last target is newer than datagrams that were late.
                let new = newest.filter(|it| it.time_ns > since_ns);
                self.source
                    .publish_sample(new.map(|it| (it.time_ns, blended(&from, &it.x, since_ns, now_ns))))?;
                if is_paused || self.receiver.silence_s(now_ns) > self.receiver.pause_s {
                    let x = self.source.resting_x(self.constants)?;
                    info!("a pause: the platform stands");
                    self.phase = Phase::Pause { x, since_ns: now_ns };
                }
                self.board_if_restarted();
            }
            Phase::Pause { x, since_ns } => {
                self.source.publish(x)?;
                if is_paused {
                    self.phase = Phase::Pause { x, since_ns: now_ns };
                } else if self.receiver.is_alive(now_ns) {
                    self.phase = Phase::following(x);
                } else if seconds(since_ns, now_ns) > LONG_PAUSE_S {
                    self.board("a long pause");
                }
                self.board_if_restarted();
            }
        }
        Ok(true)
    }

    /// Describes phase and stream to the operator. Returns what the operator, who has seen this phase, wants.
    fn describe(&self, is_paused: bool) -> Option<RideOrder> {
        let doubt = self.survey.doubt();
        let phase = self.phase.shown(is_paused, doubt.is_some());
        self.source.feed.describe(phase, || {
            let doubt = doubt.map_or_else(String::new, |doubt| format!("{doubt}; "));
            doubt + &self.receiver.description()
        })
    }

    fn board_if_restarted(&mut self) {
        if self.receiver.take_restart() {
            self.board("the program that sends has started again");
        }
    }

    /// Moves to the boarding pose: from there only the operator begins a ride.
    fn board(&mut self, reason: &str) {
        info!("{reason}: moves to the boarding pose");
        (self.phase, self.survey) = (Phase::Boarding, StreamSurvey::default());
    }
}

/// The source, if no other one runs. From now on this thread must be punctual.
fn open_source<'a>(
    config: &'a Config,
    bus: &Bus,
    within: Option<Duration>,
    stop: &Stop,
) -> Result<TargetSource<'a, StatusFeed>, TargetError> {
    let answer = status(&config.name)?;
    if let Some(other) = answer.status.as_deref().and_then(other_source) {
        return Err(TargetError::OtherSource(other));
    }
    let feed = StatusFeed::start(config, &answer, within, stop);
    let source = TargetSource::open(config, bus, feed, within.is_some())?;
    config.deployment.realtime.prepare_peer_thread();
    Ok(source)
}

/// What the platform does.
#[derive(Clone, Copy)]
enum Phase {
    /// Goes to the boarding pose.
    Boarding,
    /// Stands there, until the operator begins a ride.
    Ready,
    /// Follows the stream, at first blended with the pose at which it stood.
    Following { from: [f64; 6], since_ns: u64 },
    /// Stands where it came to rest.
    Pause { x: [f64; 6], since_ns: u64 },
    /// Goes to the boarding pose for good.
    Leaving,
}

impl Phase {
    /// The phase as the operator sees it.
    fn shown(&self, is_paused: bool, is_doubtful: bool) -> RidePhase {
        match self {
            Self::Boarding | Self::Leaving => RidePhase::Boarding,
            Self::Ready if is_paused => RidePhase::Paused,
            Self::Ready if is_doubtful => RidePhase::Doubtful,
            Self::Ready => RidePhase::Ready,
            Self::Following { .. } => RidePhase::Riding,
            Self::Pause { .. } => RidePhase::Paused,
        }
    }

    fn following(from: [f64; 6]) -> Self {
        info!("follows the stream, after a blend of {BLEND_S:.0} s");
        Self::Following { from, since_ns: monotonic_ns() }
    }
}

/// A pose of the stream, blended from the pose at which the platform stood.
fn blended(from: &[f64; 6], to: &[f64; 6], since_ns: u64, now_ns: u64) -> [f64; 6] {
    straight_move(&(*from).into(), &(*to).into(), &rise(seconds(since_ns, now_ns), BLEND_S)).x.into()
}

fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}
