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

use std::net::SocketAddr;
use std::time::Duration;

use tracing::{info, warn};

use self::receiver::{Arrived, Receiver};
use self::status_feed::StatusFeed;
use self::stream::{BLEND_S, StreamOptions};
use self::survey::StreamSurvey;
use super::{PlaybackOptions, no_signals};
use crate::commands::failure::Failure;
use crate::commands::motion_client::MotionError;
use hexad_client::messages::Bus;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::operator::requests::status;
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::realtime::pause_signals::PauseRequest;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::constants::Constants;
use hexad_core::control::parameters::ViolationPolicy;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::task::pose_of;
use hexad_daemon::constants;
use hexad_daemon::target_source::{TargetError, TargetSource, is_reached, other_source};
use hexad_machine::analysis::target_motion::{TargetRefusal, check_target};
use hexad_machine::config::Config;
use hexad_machine::text::numbers::fixed;

mod datagram_format;
pub mod dry_run;
mod receiver;
mod rejection;
mod status_feed;
pub mod stream;
mod survey;

/// Why a ride ends when the program that sends begins anew.
const RESTARTED: &str = "the program that sends has started again";

/// Share of the way from home to the lowest pose at which people board.
const COMFORTABLE_SHARE: f64 = 0.9;

/// Messages with the last target: one may be lost.
const LAST_TARGETS: usize = 3;

/// Way below which nobody boards \[mm\].
const LOWEST_MM: u32 = 3000;

/// Time whose poses decide whether a stream is doubtful \[s\].
const SURVEY_S: f64 = 5.0;

/// Pause after which the platform moves to the boarding pose \[s\].
const LONG_PAUSE_S: f64 = 10.0;

/// Follows the datagrams to an address, each time that the operator begins a ride, until the first signal; then the platform moves to
/// the boarding pose and stands there.
pub fn follow(
    config: &Config,
    address: SocketAddr,
    options: &StreamOptions,
    playback: &PlaybackOptions,
    stop: &Stop,
) -> Result<(), Failure> {
    if config.deployment.setpoint.on_violation != ViolationPolicy::Limit {
        return Err(Failure::before_start(
            "--udp: poses alone need setpoint.on_violation = \"limit\" in the machine file (now \"stop\")",
        ));
    }
    let receiver = Receiver::open(config, address, options)?;
    let (constants, pause) = (constants(config), PauseRequest::on_signals().map_err(no_signals)?);
    let boarding = options.boarding.unwrap_or_else(|| lowest_comfortable(&constants, &config.machine.home));
    let checked = check_target(&constants, &pose_of(&boarding));
    checked.map_err(|bound| TargetError::from(TargetRefusal::Target(bound)))?;
    let bus = config.join().map_err(TargetError::from)?;
    let source = open_source(config, &bus, playback.engage_within(), stop)?;
    let [_, _, _, x, y, z] = boarding.map(|coordinate| fixed(1e3 * coordinate, 0));
    info!(%address, "moves to the boarding pose (x, y, z = {x}, {y}, {z} mm)");
    let survey = StreamSurvey::over(SURVEY_S);
    let (phase, is_leaving) = (Phase::Boarding, false);
    let mut ride = Ride { source, receiver, survey, boarding, constants: &constants, phase, is_leaving };
    while !stop.is_repeated() && ride.step(pause.is_requested(), stop.is_requested())? {}
    info!("{}", ride.receiver.description());
    if !stop.is_repeated() {
        return Ok(());
    }
    // The daemon goes on to the last target.
    let rest = ride.source.resting_or_present_x(&constants)?;
    (0..LAST_TARGETS).try_for_each(|_| ride.source.publish(rest))?;
    Err(MotionError::Interrupted.into())
}

/// Home, lowered along gravity by nine tenths of the way that the workspace permits.
fn lowest_comfortable(constants: &Constants, home: &[f64; 6]) -> [f64; 6] {
    let down = constants.machine().gravity_m_s2.try_normalize(0.0).unwrap_or_default();
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
    /// Whether a signal has come.
    is_leaving: bool,
}

impl Ride<'_> {
    /// Publishes the setpoint of one period. False at the end.
    fn step(&mut self, is_paused: bool, is_ending: bool) -> Result<bool, Failure> {
        let (newest, now_ns) = (self.receiver.newest(), monotonic_ns());
        newest.iter().for_each(|it| self.survey(it));
        let order = self.describe(is_paused);
        self.leave(is_paused, is_ending);
        match self.phase {
            Phase::Leaving if is_paused => self.pause(false, now_ns)?,
            Phase::Leaving => {
                self.source.publish(self.boarding)?;
                return Ok(!self.has_boarded()?);
            }
            Phase::Boarding => {
                self.source.publish(self.boarding)?;
                if self.has_boarded()? {
                    info!("stands at the boarding pose; hexad ride start begins the ride");
                    self.phase = Phase::Ready;
                } else if is_paused {
                    self.pause(false, now_ns)?;
                }
            }
            Phase::Ready => {
                self.source.publish(self.boarding)?;
                if self.receiver.take_restart() {
                    self.survey = StreamSurvey::over(SURVEY_S);
                }
                let may_begin = self.receiver.is_alive(now_ns) && self.survey.is_long_enough();
                if order == Some(RideOrder::Start) && may_begin {
                    self.phase = Phase::following(self.boarding);
                }
            }
            Phase::Following { from, since_ns } => {
                self.source.publish_sample(newest.and_then(|it| it.blended(&from, since_ns, now_ns)))?;
                if order == Some(RideOrder::End) {
                    self.board("the operator ends the ride");
                } else if is_paused || self.receiver.silence_s(now_ns) > self.receiver.pause_s {
                    self.pause(true, now_ns)?;
                } else if self.receiver.take_restart() {
                    self.board(RESTARTED);
                }
            }
            Phase::Pause { x, since_ns, rides } => {
                self.source.publish(x)?;
                if is_paused {
                    self.phase = Phase::Pause { x, since_ns: now_ns, rides };
                } else if order == Some(RideOrder::End) {
                    self.board("the operator ends the ride");
                } else if !rides {
                    self.board("the pause has ended");
                } else if self.receiver.take_restart() {
                    self.board(RESTARTED);
                } else if self.receiver.is_alive(now_ns) {
                    self.phase = Phase::following(x);
                } else if seconds_since_or_0(since_ns, now_ns) > LONG_PAUSE_S {
                    self.board("a long pause");
                }
            }
        }
        Ok(true)
    }

    /// After a signal moves to the boarding pose for good, but not while it is paused.
    fn leave(&mut self, is_paused: bool, is_ending: bool) {
        if is_ending && !core::mem::replace(&mut self.is_leaving, is_ending) {
            let paused = if is_paused { ", after hexad move --resume" } else { "" };
            info!("moves to the boarding pose{paused}; once more ends at once");
        }
        if is_ending && !is_paused {
            self.phase = Phase::Leaving;
        }
    }

    /// Examines a pose of the stream.
    fn survey(&mut self, Arrived { arrival_ns, x, .. }: &Arrived) {
        let has_warned = self.survey.warning().is_some();
        self.survey.add(self.constants, *arrival_ns, x);
        if let Some(warning) = self.survey.warning().filter(|_| !has_warned) {
            warn!("{warning}");
        }
    }

    /// Whether the platform is under control at the boarding pose.
    fn has_boarded(&mut self) -> Result<bool, TargetError> {
        Ok(self.source.active_since_ns().is_some() && is_reached(&self.source.present_x()?, &self.boarding))
    }

    /// Comes to rest, on the way to the boarding pose or in a ride.
    fn pause(&mut self, rides: bool, now_ns: u64) -> Result<(), TargetError> {
        info!("a pause: the platform comes to rest");
        let x = self.source.resting_or_present_x(self.constants)?;
        self.phase = Phase::Pause { x, since_ns: now_ns, rides };
        Ok(())
    }

    /// Describes phase and stream to the operator. Returns what the operator, who has seen this phase, wants.
    fn describe(&self, is_paused: bool) -> Option<RideOrder> {
        let warning = self.survey.warning();
        let phase = self.phase.shown(is_paused, warning.is_some());
        self.source.feed.describe(phase, || {
            let warning = warning.map_or_else(String::new, |warning| format!("{warning}; "));
            warning + &self.receiver.description()
        })
    }

    /// Moves to the boarding pose: from there only the operator begins a ride.
    fn board(&mut self, reason: &str) {
        info!("{reason}: moves to the boarding pose");
        self.phase = Phase::Boarding;
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
    /// Stands where it came to rest, in a ride or on the way to the boarding pose.
    Pause { x: [f64; 6], since_ns: u64, rides: bool },
    /// Goes to the boarding pose for good.
    Leaving,
}

impl Phase {
    /// The phase as the operator sees it.
    fn shown(&self, is_paused: bool, is_doubtful: bool) -> RidePhase {
        match self {
            _ if is_paused => RidePhase::PausedByOperator,
            Self::Boarding | Self::Leaving => RidePhase::Boarding,
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
