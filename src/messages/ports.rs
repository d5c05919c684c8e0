//! iceoryx2 ports. One function defines the service of a topic for every process: quality-of-service
//! values are set by whoever creates a service and stay until the last node leaves.
//!
//! A peer that comes or goes is handled inside the next send or receive here: allocations, system calls,
//! up to 0.1 ms. No real-time thread may own a port.

use core::marker::PhantomData;
use core::time::Duration;
use std::fs::{File, TryLockError, create_dir_all, metadata};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::{publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use tracing::info;

use super::structs::{Header, Message, SCHEMA};
use crate::messages::clock::monotonic_ns;

/// One life of a publisher is meant; one more may be stopped (SIGSTOP) or dying, two are reserve.
const MAX_PUBLISHERS: usize = 4;
/// Daemon, plant, recorder, monitors.
const MAX_SUBSCRIBERS: usize = 16;
const MAX_NODES: usize = 32;
/// What a slow reader (a recorder) may fall behind: 256 messages are 12.8 ms at 20 kHz, 0.25 s at 1 kHz.
const BUFFER: usize = 256;
/// A port that cannot be opened (another user's) must not block the io thread for the default second.
const CREATION_TIMEOUT: Duration = Duration::from_millis(5);

/// Something about the shared memory did not work: what, and iceoryx2's own words.
#[derive(Debug, thiserror::Error)]
#[error("shared memory: {what}: {cause}")]
pub struct PortError {
    what: String,
    cause: String,
}

fn failed<E: core::fmt::Debug>(what: String) -> impl FnOnce(E) -> PortError {
    move |cause| PortError { what, cause: format!("{cause:?}") }
}

/// Where the shared memory lives: iceoryx2's usual places, or, where these belong to another user, places
/// of this user's own, and a word about it. Another user's could not be opened, and root and others may well
/// use one host.
fn places() -> Result<(Config, Option<String>), SemanticStringError> {
    let mut config = Config::default();
    config.global.creation_timeout = CREATION_TIMEOUT;
    let usual = config.global.root_path().to_string();
    let owner = |path: &str| metadata(path).map(|found| found.uid()).ok();
    if let (Some(owner), Some(user)) = (owner(&usual), owner("/proc/self"))
        && owner != user
    {
        let own = format!("{}-{user}", usual.trim_end_matches('/'));
        config.global.set_root_path(&Path::new(own.as_bytes())?);
        config.global.prefix = FileName::new(format!("iox2_{user}_").as_bytes())?;
        let moved = format!("{usual} belongs to user {owner}: using {own} and the prefix iox2_{user}_");
        return Ok((config, Some(moved)));
    }
    Ok((config, None))
}

fn domain() -> Result<Config, SemanticStringError> {
    let (config, moved) = places()?;
    if let Some(moved) = moved {
        info!("{moved}");
    }
    Ok(config)
}

/// Which time the participants of a machine live in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Time {
    /// CLOCK_MONOTONIC. Topics `hexad/<name>/...`.
    #[default]
    Real,
    /// That of the measured messages, while everybody waits for everybody: `release = "lockstep"`. Topics
    /// `hexad-simulated/<name>/...`, so that no hardware ever listens to it.
    Simulated,
}

impl Time {
    fn topics(self) -> &'static str {
        match self {
            Self::Real => "hexad",
            Self::Simulated => "hexad-simulated",
        }
    }
}

/// Participation of this process in the topics of one machine.
pub struct Bus {
    node: Node<ipc::Service>,
    machine: String,
    time: Time,
    epoch: u64,
}

impl Bus {
    /// Joins. `machine` is the configured name; the epoch of everything published is now.
    pub fn join(machine: &str) -> Result<Self, PortError> {
        Self::join_in(machine, Time::Real)
    }

    /// The same in a time.
    pub fn join_in(machine: &str, time: Time) -> Result<Self, PortError> {
        // Its log goes to `tracing`; what it warns about (dead nodes cleaned up) is routine here.
        set_log_level(LogLevel::Error);
        let config = domain().map_err(failed("cannot name the shared memory".into()))?;
        let node = NodeBuilder::new()
            // Signals belong to the command line, not to a library's wait loop.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&config)
            .create::<ipc::Service>()
            .map_err(failed(format!(
                "cannot create a node; {} and the files iox2_* in /dev/shm must belong to this user: all \
                 participants of a machine run as one user",
                config.global.root_path()
            )))?;
        Ok(Self { node, machine: machine.into(), time, epoch: monotonic_ns() })
    }

    /// Which time its participants live in.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Why and where this user's shared memory is not in the usual places, if so.
    pub fn places_of_its_own() -> Option<String> {
        places().ok()?.1
    }

    /// Makes this process the only one that controls a machine, until the result is dropped or the process
    /// dies, however it dies.
    ///
    /// Topics alone would let a second daemon take over, and leave the first one's forces ignored for good.
    pub fn claim(machine: &str) -> Result<File, PortError> {
        let config = domain().map_err(failed("cannot name the shared memory".into()))?;
        let folder = config.global.root_path().to_string();
        let path = PathBuf::from(&folder).join(format!("hexad-{machine}.lock"));
        let file = create_dir_all(&folder).and_then(|()| File::create(&path));
        let file = file.map_err(failed(format!("cannot open {}", path.display())))?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(PortError {
                what: format!("cannot control {machine}"),
                cause: format!("another daemon does ({} is locked)", path.display()),
            }),
            Err(error) => Err(failed(format!("cannot lock {}", path.display()))(error)),
        }
    }

    fn service<T: Message>(&self) -> Result<PortFactory<ipc::Service, T, ()>, PortError> {
        let name = format!("{}/{}/{}", self.time.topics(), self.machine, T::TOPIC);
        let service_name = name.as_str().try_into().map_err(failed(format!("bad topic {name}")))?;
        self.node
            .service_builder(&service_name)
            .publish_subscribe::<T>()
            .max_publishers(MAX_PUBLISHERS)
            .max_subscribers(MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(BUFFER)
            .enable_safe_overflow(true)
            .history_size(0)
            .open_or_create()
            .map_err(failed(format!("cannot open topic {name}")))
    }

    /// A publisher of `T`.
    pub fn source<T: Message>(&self) -> Result<Source<T>, PortError> {
        let publisher = self
            .service::<T>()?
            .publisher_builder()
            .create()
            .map_err(failed(format!("cannot publish {}", T::TOPIC)))?;
        Ok(Source { publisher, epoch: Some(self.epoch), sequence: 0 })
    }

    /// A subscriber to `T` that keeps up to `depth` messages.
    pub fn sink<T: Message>(&self, depth: usize) -> Result<Sink<T>, PortError> {
        let service = self.service::<T>()?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(depth.min(BUFFER))
            .create()
            .map_err(failed(format!("cannot subscribe to {}", T::TOPIC)))?;
        Ok(Sink {
            service,
            subscriber,
            time: self.time,
            epoch: 0,
            sequence: 0,
            came: 0,
            rejected: Rejected::default(),
            topic: PhantomData,
        })
    }
}

/// Publishes one topic and numbers what it publishes.
pub struct Source<T: Message> {
    publisher: Publisher<ipc::Service, T, ()>,
    epoch: Option<u64>,
    sequence: u64,
}

impl<T: Message> Source<T> {
    /// The same, with the time of its first message as the epoch: in simulated time all that it says is then the same
    /// in each run.
    pub fn reproducible(self) -> Self {
        Self { epoch: None, ..self }
    }

    /// Epoch and sequence number that the next message will have.
    pub fn next_message(&self) -> (u64, u64) {
        (self.epoch.unwrap_or_default(), self.sequence + 1)
    }

    /// Fills in the header and sends. `time_ns` is the instant at which the content holds.
    pub fn publish(&mut self, time_ns: u64, mut message: T) -> Result<(), PortError> {
        self.sequence += 1;
        let epoch = *self.epoch.get_or_insert(time_ns);
        *message.header_mut() =
            Header { schema: SCHEMA, reserved: 0, epoch, sequence: self.sequence, time_ns };
        message.seal();
        let sample = self
            .publisher
            .loan_uninit()
            .map_err(|cause| failed(format!("cannot loan {}", T::TOPIC))(cause))?;
        sample
            .write_payload(message)
            .send()
            .map(|_| ())
            .map_err(|cause| failed(format!("cannot send {}", T::TOPIC))(cause))
    }
}

/// Messages passed over, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Of another schema.
    pub schema: u64,
    /// Of an older life of the source: its last ones, or two sources at once.
    pub older_source: u64,
    /// Seen before, or unreadable.
    pub repeated: u64,
    /// With a wrong checksum, or of a source that begins in the future.
    pub damaged: u64,
}

impl core::ops::Add for Rejected {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            schema: self.schema + other.schema,
            older_source: self.older_source + other.older_source,
            repeated: self.repeated + other.repeated,
            damaged: self.damaged + other.damaged,
        }
    }
}

/// Receives one topic, newest life of the source first.
pub struct Sink<T: Message> {
    service: PortFactory<ipc::Service, T, ()>,
    time: Time,
    subscriber: Subscriber<ipc::Service, T, ()>,
    epoch: u64,
    sequence: u64,
    came: u64,
    rejected: Rejected,
    topic: PhantomData<T>,
}

impl<T: Message> Sink<T> {
    /// The next message in order, if any. Passes over other schemas, wrong checksums, older lives of the
    /// source and what was seen already: after a publisher dies, its last sample may still arrive.
    pub fn receive(&mut self) -> Option<T> {
        // At most what the buffers of all publishers can hold: a flood cannot keep the caller here.
        for _ in 0..MAX_PUBLISHERS * BUFFER {
            let message = match self.subscriber.receive() {
                Ok(Some(sample)) => *sample.payload(),
                Ok(None) => return None,
                Err(_) => {
                    self.rejected.repeated += 1;
                    return None;
                }
            };
            let header = message.header();
            let order = (header.epoch, header.sequence);
            // A life that has not begun (another clock) would outrank all that come after it. Who lives in
            // simulated time may begin at any.
            let has_begun = self.time == Time::Simulated || header.epoch <= monotonic_ns();
            let is_readable = header.schema == SCHEMA && message.is_whole() && has_begun;
            if is_readable && order > (self.epoch, self.sequence) {
                let same_life = header.epoch == self.epoch;
                self.came += if same_life { header.sequence - self.sequence } else { 1 };
                (self.epoch, self.sequence) = order;
                return Some(message);
            }
            let Rejected { schema, older_source, repeated, damaged } = &mut self.rejected;
            *(if header.schema != SCHEMA {
                schema
            } else if !is_readable {
                damaged
            } else if header.epoch < self.epoch {
                older_source
            } else {
                repeated
            }) += 1;
        }
        None
    }

    /// The next message of any source that is alive or was, each once: where nobody's word may be lost
    /// because somebody else came later.
    pub fn receive_from_any(&mut self) -> Option<T> {
        for _ in 0..MAX_PUBLISHERS * BUFFER {
            match self.subscriber.receive() {
                Ok(Some(sample)) if sample.payload().header().schema == SCHEMA => {
                    return Some(*sample.payload());
                }
                Ok(None) => return None,
                Ok(Some(_)) => self.rejected.schema += 1,
                Err(_) => {
                    self.rejected.repeated += 1;
                    return None;
                }
            }
        }
        None
    }

    /// The newest message that arrived since the last call, if any.
    pub fn newest(&mut self) -> Option<T> {
        let mut newest = None;
        for _ in 0..MAX_PUBLISHERS * BUFFER {
            match self.receive() {
                Some(message) => newest = Some(message),
                None => break,
            }
        }
        newest
    }

    /// How many sources are there now. One that was killed counts until somebody notices.
    pub fn sources(&self) -> usize {
        self.service.dynamic_config().number_of_publishers()
    }

    /// How many messages came: those accepted, and those that the source numbered in between and that found
    /// the buffer full.
    pub fn came(&self) -> u64 {
        self.came
    }

    /// How many messages were passed over.
    pub fn rejected(&self) -> Rejected {
        self.rejected
    }
}
