//! The socket with the stream: its poses with their instants, what is rejected, pauses, and restarts of the program that sends.

use std::net::{IpAddr, SocketAddr, UdpSocket};

use tracing::warn;

use super::datagram_format::{Datagram, DatagramFormat, MAX_BYTES};
use super::rejection::{Rejection, RejectionCounts};
use super::stream::{StreamOptions, blended};
use crate::commands::failure::Failure;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::source_clock::SourceClock;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::task::pose_of;
use hexad_machine::config::Config;

/// Longest time without datagrams before the platform comes to rest \[s\], if `timeouts.setpoint_ms` does not bound it.
const PAUSE_S: f64 = 0.25;

/// Share of `timeouts.setpoint_ms` after which a pause begins, so that the daemon never loses its source.
const PAUSE_SHARE: f64 = 0.8;

/// Datagrams without a pause that make a stream.
const LIVELY: u32 = 10;

/// Time without any datagram after which the possible causes are named \[s\].
const SILENCE_S: f64 = 10.0;

/// Most datagrams that are read in one period.
const DATAGRAMS: usize = 64;

/// A pose of the stream.
#[derive(Clone, Copy, Debug)]
pub struct Arrived {
    /// On the clock of this host \[ns\].
    pub arrival_ns: u64,
    /// Instant of the pose \[ns\].
    pub time_ns: u64,
    /// X.
    pub x: [f64; 6],
}

impl Arrived {
    /// Instant and X, blended from the pose at which the platform stood; `None` of a pose that was late, as the last target is newer.
    pub fn blended(&self, from: &[f64; 6], since_ns: u64, now_ns: u64) -> Option<(u64, [f64; 6])> {
        (self.time_ns > since_ns).then(|| (self.time_ns, blended(from, &self.x, since_ns, now_ns)))
    }
}

/// Why nothing arrives, the most likely first.
pub const SILENCE_CAUSES: &str = "the program does not send, or to another address or port; it sends broadcasts, which arrive only if --udp is the broadcast \
     address; a firewall is between";

/// Socket with the stream.
pub struct Receiver {
    socket: UdpSocket,
    format: DatagramFormat,
    from: Vec<IpAddr>,
    home: [f64; 6],
    clock: SourceClock,
    /// Silence that is a pause \[s\].
    pub pause_s: f64,
    /// Arrival of the last datagram \[ns\].
    last_ns: u64,
    /// The program whose datagrams count, by its address, and their number.
    sender: Option<(SocketAddr, u64)>,
    /// Its last datagram, followed or not \[ns\].
    heard_ns: u64,
    /// Whether the program that sends has begun anew.
    has_restarted: bool,
    /// Datagrams since the last pause.
    lively: u32,
    accepted: u64,
    rejected: RejectionCounts,
    /// Instant at which the causes of silence are named \[ns\], until one datagram arrived.
    silence_ends_ns: Option<u64>,
}

impl Receiver {
    pub fn open(config: &Config, address: SocketAddr, options: &StreamOptions) -> Result<Self, Failure> {
        let refused = |text: &str| Failure::before_start(format_args!("--udp {address}: {text}"));
        let no_format =
            || Failure::before_start("--udp: needs --format: x-plane, flypt-mover, simtools, or a file");
        let format = DatagramFormat::load(options.format.as_deref().ok_or_else(no_format)?)?;
        if address.ip().is_unspecified() {
            return Err(refused("must be the address of one interface"));
        }
        if !address.ip().is_loopback() && options.from.is_empty() {
            return Err(refused("is open to other hosts: name those that may move the platform with --from"));
        }
        let socket = UdpSocket::bind(address).and_then(|socket| {
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        let timeout_s = config.deployment.timeouts.setpoint_s;
        Ok(Self {
            socket: socket.map_err(|error| refused(&error.to_string()))?,
            format,
            from: options.from.clone(),
            home: config.machine.home,
            clock: SourceClock::new(config.deployment.setpoint.clock, (timeout_s * 1e9) as i64, true),
            pause_s: PAUSE_S.min(PAUSE_SHARE * timeout_s),
            last_ns: 0,
            sender: None,
            heard_ns: 0,
            has_restarted: false,
            lively: 0,
            accepted: 0,
            rejected: RejectionCounts::default(),
            silence_ends_ns: Some(monotonic_ns() + (SILENCE_S * 1e9) as u64),
        })
    }

    /// The newest pose that arrived since the last call.
    pub fn newest(&mut self) -> Option<Arrived> {
        let newest = (0..DATAGRAMS).map_while(|_| self.read()).flatten().last();
        if self.silence_ends_ns.take_if(|end_ns| *end_ns < monotonic_ns()).is_some() {
            warn!("no datagram has arrived for {SILENCE_S:.0} s: {SILENCE_CAUSES}");
        }
        newest
    }

    /// Reads a datagram, if there is one: its pose, unless it is rejected.
    pub fn read(&mut self) -> Option<Option<Arrived>> {
        // One more: what is longer is not cut to the longest.
        let mut bytes = [0; MAX_BYTES + 1];
        let (size, sender) = self.socket.recv_from(&mut bytes).ok()?;
        let arrival_ns = monotonic_ns();
        self.silence_ends_ns = None;
        let sample = self.sample(bytes.get(..size).unwrap_or_default(), sender, arrival_ns);
        if let Err(rejection) = &sample
            && self.rejected.add(rejection)
        {
            warn!(%sender, "a datagram is rejected: {rejection}");
        }
        Some(sample.ok())
    }

    /// Whether no datagram has arrived.
    pub fn is_silent(&self) -> bool {
        self.accepted == 0 && self.rejected == RejectionCounts::default()
    }

    /// What arrived, for the operator.
    pub fn description(&self) -> String {
        if self.is_silent() {
            return "no datagram has arrived".into();
        }
        let rate = self.clock.rate().filter(|rate| *rate != 1.0);
        let clock =
            rate.map_or_else(String::new, |rate| format!("; their clock runs at {rate:.3} of real time"));
        format!("{} datagrams accepted{clock}{}", self.accepted, self.rejected)
    }

    fn sample(&mut self, bytes: &[u8], sender: SocketAddr, arrival_ns: u64) -> Result<Arrived, Rejection> {
        if !self.from.is_empty() && !self.from.contains(&sender.ip()) {
            return Err(Rejection::Sender);
        }
        let datagram = self.format.read(bytes, &pose_of(&self.home), &self.home);
        let Datagram { stamp_s, x } = datagram?;
        // A program that is started again has another port. Some have another for each datagram.
        let (before, count) = self.sender.unwrap_or((sender, 0));
        let is_restart = before != sender && count > 1;
        if is_restart && seconds_since_or_0(self.heard_ns, arrival_ns) <= self.pause_s {
            return Err(Rejection::Second(sender, before));
        }
        self.sender = Some((sender, if before == sender { count.saturating_add(1) } else { 1 }));
        (self.heard_ns, self.has_restarted) = (arrival_ns, self.has_restarted || is_restart);
        let lives = self.clock.lives();
        let time_ns = match stamp_s {
            Some(stamp_s) => self.clock.instant((stamp_s * 1e9) as i64, arrival_ns as i64)?.time_ns,
            None => arrival_ns as i64,
        };
        let is_pause = self.silence_s(arrival_ns) > self.pause_s;
        self.has_restarted |= self.clock.lives() != lives;
        self.lively = if is_pause { 0 } else { self.lively.saturating_add(1) };
        (self.last_ns, self.accepted) = (arrival_ns, self.accepted + 1);
        Ok(Arrived { arrival_ns, time_ns: time_ns as u64, x })
    }

    /// Whether the program that sends has begun anew since the last call.
    pub fn take_restart(&mut self) -> bool {
        core::mem::take(&mut self.has_restarted)
    }

    pub fn silence_s(&self, now_ns: u64) -> f64 {
        seconds_since_or_0(self.last_ns, now_ns)
    }

    pub fn is_alive(&self, now_ns: u64) -> bool {
        self.lively >= LIVELY && self.silence_s(now_ns) < self.pause_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;

    /// A receiver of this host, and what sends to it from a port of its own.
    fn receiver() -> (Receiver, impl Fn(&UdpSocket)) {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let options = StreamOptions { format: Some("flypt-mover".into()), ..StreamOptions::default() };
        let receiver = Receiver::open(&config, "127.0.0.1:0".parse().unwrap(), &options).unwrap();
        let to = receiver.socket.local_addr().unwrap();
        (receiver, move |socket| assert_eq!(socket.send_to(b"1,2,3,0,0,0", to).unwrap(), 11))
    }

    #[test]
    fn a_second_program_counts_only_when_the_first_is_silent_and_has_begun_anew_then() {
        let (mut receiver, send) = receiver();
        let [first, second] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        // However long this host pauses.
        receiver.pause_s = 60.0;
        (0..3).for_each(|_| send(&first));
        assert!(receiver.newest().is_some());
        send(&second);
        assert!(
            receiver.newest().is_none() && receiver.description().contains("end one of the two programs")
        );
        send(&first);
        assert!(receiver.newest().is_some() && !receiver.take_restart());
        receiver.pause_s = 0.0;
        send(&second);
        assert!(receiver.newest().is_some() && receiver.take_restart() && !receiver.take_restart());
    }

    #[test]
    fn a_program_may_send_each_datagram_from_another_port() {
        let (mut receiver, send) = receiver();
        for _ in 0..20 {
            send(&UdpSocket::bind("127.0.0.1:0").unwrap());
            assert!(receiver.newest().is_some() && !receiver.take_restart(), "{}", receiver.description());
        }
    }

    #[test]
    fn broadcasts_arrive_at_the_broadcast_address_and_what_is_rejected_is_counted() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let options = StreamOptions {
            format: Some("flypt-mover".into()),
            from: vec![],
            boarding: None,
            ..StreamOptions::default()
        };
        let mut receiver = Receiver::open(&config, "127.255.255.255:0".parse().unwrap(), &options).unwrap();
        assert_eq!(receiver.description(), "no datagram has arrived");
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_broadcast(true).unwrap();
        for text in ["1,2,3,0,0,0", "1,2,3"] {
            socket.send_to(text.as_bytes(), receiver.socket.local_addr().unwrap()).unwrap();
        }
        let x = receiver.newest().unwrap().x;
        assert!((x[3] - config.machine.home[3] - 1e-3).abs() < 1e-12);
        let text = receiver.description();
        assert!(text.starts_with("1 datagrams accepted; 1 rejected: it has 3 fields"), "{text}");
    }
}
