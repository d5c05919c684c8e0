//! `hexad move --udp`: poses that a simulator or a game sends as datagrams.
//!
//! ```text
//! boarding pose -> the stream is alive -> blend to it -> follow it -> a pause: stand -> blend to it ...
//!                                                        Ctrl-C, or a long pause -> boarding pose
//! ```
//!
//! Datagrams are not authenticated: any program at an allowed address moves the platform, within the limits of the file.

use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::Duration;

use clap::Args;
use tracing::{info, warn};

use self::datagram_format::{Datagram, DatagramFormat, FormatError, MAX_BYTES};
use self::rejection::{Rejection, RejectionCounts};
use self::status_feed::StatusFeed;
use super::PlaybackOptions;
use crate::commands::failure::{CommandError, INTERRUPTED, default_exit_code};
use crate::commands::quantity::{angle, length, list};
use hexad_client::messages::Bus;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::source_clock::SourceClock;
use hexad_client::operator::requests::status;
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::parameters::ViolationPolicy;
use hexad_core::model::task::pose_of;
use hexad_core::motion::minimum_jerk::{rise, straight_move};
use hexad_daemon::constants;
use hexad_daemon::target_source::{TargetError, TargetSource, is_reached, other_source};
use hexad_machine::analysis::target_motion::{TargetRefusal, check_target};
use hexad_machine::config::Config;

mod datagram_format;
mod rejection;
mod status_feed;

/// Longest time without datagrams before the platform comes to rest \[s\], if `timeouts.setpoint_ms` does not bound it.
const PAUSE_S: f64 = 0.25;

/// Share of `timeouts.setpoint_ms` after which a pause begins, so that the daemon never loses its source.
const PAUSE_SHARE: f64 = 0.8;

/// Datagrams without a pause that make a stream.
const LIVELY: u32 = 10;

/// Duration of the blend from the pose at which the platform stands to the stream \[s\].
const BLEND_S: f64 = 3.0;

/// Pause after which the platform moves to the boarding pose \[s\].
const LONG_PAUSE_S: f64 = 10.0;

/// Time without any datagram after which the possible causes are named \[s\].
const SILENCE_S: f64 = 10.0;

/// Most datagrams that are read in one period.
const DATAGRAMS: usize = 64;

#[derive(Debug, Args)]
pub struct StreamOptions {
    /// Format of the datagrams: x-plane, flypt-mover, simtools, or a file, see docs/motion_simulator.md
    #[arg(long, value_name = "NAME", requires = "udp")]
    format: Option<String>,
    /// Address from which datagrams are accepted; required unless --udp is of this host alone
    #[arg(long, value_name = "IP", requires = "udp")]
    from: Vec<IpAddr>,
    /// Pose at which people board, with units, as in 0,0,0,0,0,0.7m; without it, home
    #[arg(long, value_name = "X", requires = "udp", value_parser = boarding, allow_hyphen_values = true)]
    boarding: Option<[f64; 6]>,
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
    #[error(transparent)]
    Target(#[from] TargetError),
    #[error("interrupted; the platform stands under control; hexad stop or park ends it")]
    Interrupted,
}

impl CommandError for StreamError {
    fn has_begun(&self) -> bool {
        matches!(self, Self::Target(error) if error.has_begun())
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Target(error) => default_exit_code(error),
            Self::Interrupted => INTERRUPTED,
            _ => 2,
        }
    }
}

/// Follows the datagrams to an address until the first signal; then the platform moves to the boarding pose and stands there.
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
    let mut receiver = Receiver::open(config, address, options)?;
    let boarding = options.boarding.unwrap_or(config.machine.home);
    let constants = constants(config);
    let checked = check_target(&constants, &pose_of(&boarding));
    checked.map_err(|bound| TargetError::from(TargetRefusal::Target(bound)))?;
    let bus = config.join().map_err(TargetError::from)?;
    let mut source = open_source(config, &bus, playback.engage_within(), stop)?;
    info!(%address, "moves to the boarding pose, then waits for datagrams");
    let mut phase = Phase::Boarding;
    while !stop.is_repeated() {
        let newest = receiver.newest();
        source.feed.describe_input(|| receiver.description());
        if stop.is_requested() && !matches!(phase, Phase::Leaving) {
            info!("moves to the boarding pose; once more ends at once");
            phase = Phase::Leaving;
        }
        let now_ns = monotonic_ns();
        match phase {
            Phase::Boarding | Phase::Leaving => {
                source.publish(boarding)?;
                let is_there =
                    source.active_since_ns().is_some() && is_reached(&source.present_x()?, &boarding);
                match phase {
                    Phase::Leaving if is_there => break,
                    Phase::Boarding if is_there && receiver.is_alive(now_ns) => {
                        phase = Phase::following(boarding);
                    }
                    _ => {}
                }
            }
            Phase::Following { from, since_ns } => {
                // The last target is newer than datagrams that were late.
                let sample = newest.filter(|(time_ns, _)| *time_ns > since_ns).map(|(time_ns, x)| {
                    let blend = rise(seconds(since_ns, now_ns), BLEND_S);
                    (time_ns, straight_move(&from.into(), &x.into(), &blend).x.into())
                });
                source.publish_sample(sample)?;
                if receiver.silence_s(now_ns) > receiver.pause_s {
                    let x = source.resting_x(&constants)?;
                    info!("a pause: the platform stands");
                    phase = Phase::Pause { x, since_ns: now_ns };
                }
            }
            Phase::Pause { x, since_ns } => {
                source.publish(x)?;
                if receiver.is_alive(now_ns) {
                    phase = Phase::following(x);
                } else if seconds(since_ns, now_ns) > LONG_PAUSE_S {
                    info!("a long pause: moves to the boarding pose");
                    phase = Phase::Boarding;
                }
            }
        }
    }
    info!("{}", receiver.description());
    if stop.is_repeated() { Err(StreamError::Interrupted) } else { Ok(()) }
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
    /// Goes to the boarding pose and waits for the stream there.
    Boarding,
    /// Follows the stream, at first blended with the pose at which it stood.
    Following { from: [f64; 6], since_ns: u64 },
    /// Stands where it came to rest.
    Pause { x: [f64; 6], since_ns: u64 },
    /// Goes to the boarding pose for good.
    Leaving,
}

impl Phase {
    fn following(from: [f64; 6]) -> Self {
        info!("follows the stream, after a blend of {BLEND_S:.0} s");
        Self::Following { from, since_ns: monotonic_ns() }
    }
}

/// Socket with the stream.
struct Receiver {
    socket: UdpSocket,
    format: DatagramFormat,
    from: Vec<IpAddr>,
    home: [f64; 6],
    clock: SourceClock,
    pause_s: f64,
    /// Arrival of the last datagram \[ns\].
    last_ns: u64,
    /// Datagrams since the last pause.
    lively: u32,
    accepted: u64,
    rejected: RejectionCounts,
    /// Instant at which the causes of silence are named \[ns\], until one datagram arrived.
    silence_ends_ns: Option<u64>,
}

impl Receiver {
    fn open(config: &Config, address: SocketAddr, options: &StreamOptions) -> Result<Self, StreamError> {
        let format = DatagramFormat::load(options.format.as_deref().ok_or(StreamError::NoFormat)?)?;
        if address.ip().is_unspecified() {
            return Err(StreamError::AnyInterface(address));
        }
        if !address.ip().is_loopback() && options.from.is_empty() {
            return Err(StreamError::NoSender(address));
        }
        let socket = UdpSocket::bind(address).and_then(|socket| {
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        let timeout_s = config.deployment.timeouts.setpoint_s;
        Ok(Self {
            socket: socket.map_err(|error| StreamError::Socket(address, error))?,
            format,
            from: options.from.clone(),
            home: config.machine.home,
            clock: SourceClock::new(config.deployment.setpoint.clock, (timeout_s * 1e9) as i64, true),
            pause_s: PAUSE_S.min(PAUSE_SHARE * timeout_s),
            last_ns: 0,
            lively: 0,
            accepted: 0,
            rejected: RejectionCounts::default(),
            silence_ends_ns: Some(monotonic_ns() + (SILENCE_S * 1e9) as u64),
        })
    }

    /// Instant and X of the newest datagram that arrived since the last call.
    fn newest(&mut self) -> Option<(u64, [f64; 6])> {
        let mut newest = None;
        // One more: what is longer is not cut to the longest.
        let mut bytes = [0; MAX_BYTES + 1];
        for _ in 0..DATAGRAMS {
            let Ok((size, sender)) = self.socket.recv_from(&mut bytes) else { break };
            let arrival_ns = monotonic_ns();
            self.silence_ends_ns = None;
            match self.sample(bytes.get(..size).unwrap_or_default(), sender.ip(), arrival_ns) {
                Ok(sample) => newest = Some(sample),
                Err(rejection) if self.rejected.add(&rejection) => {
                    warn!(%sender, "a datagram is rejected: {rejection}");
                }
                Err(_) => {}
            }
        }
        if self.silence_ends_ns.take_if(|end_ns| *end_ns < monotonic_ns()).is_some() {
            warn!(
                "no datagram has arrived for {SILENCE_S:.0} s: the program does not send, or to another address or port; \
                 it sends broadcasts, which arrive only if --udp is the broadcast address; a firewall is between"
            );
        }
        newest
    }

    /// What arrived, for the operator.
    fn description(&self) -> String {
        match (self.accepted, &self.rejected) {
            (0, none) if *none == RejectionCounts::default() => "no datagram has arrived".into(),
            (accepted, rejected) => {
                let rate = self.clock.rate().filter(|rate| *rate != 1.0);
                let clock = rate
                    .map_or_else(String::new, |rate| format!("; their clock runs at {rate:.3} of real time"));
                format!("{accepted} datagrams accepted{clock}{rejected}")
            }
        }
    }

    fn sample(
        &mut self,
        bytes: &[u8],
        sender: IpAddr,
        arrival_ns: u64,
    ) -> Result<(u64, [f64; 6]), Rejection> {
        if !self.from.is_empty() && !self.from.contains(&sender) {
            return Err(Rejection::Sender);
        }
        let datagram = self.format.read(bytes, &pose_of(&self.home), &self.home);
        let Datagram { stamp_s, x } = datagram?;
        let time_ns = match stamp_s {
            Some(stamp_s) => self.clock.instant((stamp_s * 1e9) as i64, arrival_ns as i64)?.time_ns,
            None => arrival_ns as i64,
        };
        let is_pause = self.silence_s(arrival_ns) > self.pause_s;
        self.lively = if is_pause { 0 } else { self.lively.saturating_add(1) };
        (self.last_ns, self.accepted) = (arrival_ns, self.accepted + 1);
        Ok((time_ns as u64, x))
    }

    fn silence_s(&self, now_ns: u64) -> f64 {
        seconds(self.last_ns, now_ns)
    }

    fn is_alive(&self, now_ns: u64) -> bool {
        self.lively >= LIVELY && self.silence_s(now_ns) < self.pause_s
    }
}

fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;

    #[test]
    fn broadcasts_arrive_at_the_broadcast_address_and_what_is_rejected_is_counted() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let options = StreamOptions { format: Some("flypt-mover".into()), from: vec![], boarding: None };
        let mut receiver = Receiver::open(&config, "127.255.255.255:0".parse().unwrap(), &options).unwrap();
        assert_eq!(receiver.description(), "no datagram has arrived");
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_broadcast(true).unwrap();
        for text in ["1,2,3,0,0,0", "1,2,3"] {
            socket.send_to(text.as_bytes(), receiver.socket.local_addr().unwrap()).unwrap();
        }
        let (_, x) = receiver.newest().unwrap();
        assert!((x[3] - config.machine.home[3] - 1e-3).abs() < 1e-12);
        let text = receiver.description();
        assert!(text.starts_with("1 datagrams accepted; 1 rejected: it has 3 fields"), "{text}");
    }
}
