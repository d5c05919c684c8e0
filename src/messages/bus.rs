//! Participation in the topics of one machine over iceoryx2.
//!
//! One function defines the service of a topic for every process: quality-of-service values are set by the process that
//! creates a service and stay until the last node leaves.
//!
//! A peer that connects or disappears is handled inside the next send or receive of every participant: allocations,
//! system calls, up to 0.1 ms. No real-time thread may own a port.

use core::time::Duration;
use std::fs::metadata;
use std::os::unix::fs::MetadataExt;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::clock::monotonic_ns;
use super::{LeasedSubscriber, Message, Publisher, Subscriber};

/// Daemon, plant, recorder, monitors.
const MAX_SUBSCRIBERS: usize = 16;
const MAX_NODES: usize = 32;
/// Messages that a slow subscriber (a recorder) may fall behind: 256 are 12.8 ms at 20 kHz, 0.25 s at 1 kHz.
pub(super) const BUFFER: usize = 256;
/// A port that cannot be opened (another user's) must not block the I/O thread for the default second.
const CREATION_TIMEOUT: Duration = Duration::from_millis(5);

/// Failure of a call to iceoryx2: what was attempted, and its own words.
#[derive(Debug, thiserror::Error)]
#[error("shared memory: {what}: {cause}")]
pub struct PortError {
    what: String,
    cause: String,
}

impl PortError {
    pub(super) fn new(what: String, cause: String) -> Self {
        Self { what, cause }
    }
}

pub(super) fn port_error<E: core::fmt::Debug>(what: String) -> impl FnOnce(E) -> PortError {
    move |cause| PortError { what, cause: format!("{cause:?}") }
}

/// Location of the shared memory: iceoryx2's usual one, or, where that belongs to another user, one of this user's
/// own with a sentence about it. Another user's could not be opened, and root and others may use one host.
pub(super) fn location() -> Result<(Config, Option<String>), PortError> {
    let bad_name = || port_error::<SemanticStringError>("cannot name the shared memory".into());
    let mut config = Config::default();
    config.global.creation_timeout = CREATION_TIMEOUT;
    let usual = config.global.root_path().to_string();
    let owner = |path: &str| metadata(path).map(|found| found.uid()).ok();
    if let (Some(owner), Some(user)) = (owner(&usual), owner("/proc/self"))
        && owner != user
    {
        let own = format!("{}-{user}", usual.trim_end_matches('/'));
        config.global.set_root_path(&Path::new(own.as_bytes()).map_err(bad_name())?);
        config.global.prefix = FileName::new(format!("iox2_{user}_").as_bytes()).map_err(bad_name())?;
        let moved = format!("{usual} belongs to user {owner}: using {own} and the prefix iox2_{user}_");
        return Ok((config, Some(moved)));
    }
    Ok((config, None))
}

/// Participation of this process in the topics of one machine.
pub struct Bus {
    node: Node<ipc::Service>,
    machine: String,
    is_simulated: bool,
    epoch: u64,
}

impl Bus {
    /// Joins the topics `hexad/<machine>/...`, whose times are CLOCK_MONOTONIC. `machine` is the configured name; the
    /// epoch of everything published is now.
    pub fn join(machine: &str) -> Result<Self, PortError> {
        Self::join_topics(machine, false)
    }

    /// Joins the topics `hexad-simulated/<machine>/...` of a daemon with `release = "lockstep"`, whose times are those
    /// of the measured messages. No hardware subscribes to them.
    pub fn join_simulated(machine: &str) -> Result<Self, PortError> {
        Self::join_topics(machine, true)
    }

    fn join_topics(machine: &str, is_simulated: bool) -> Result<Self, PortError> {
        // Its warnings (dead nodes cleaned up) are routine here.
        set_log_level(LogLevel::Error);
        let (config, _) = location()?;
        let node = NodeBuilder::new()
            // Signals belong to the command line, not to a library's wait loop.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&config)
            .create::<ipc::Service>()
            .map_err(port_error(format!(
                "cannot create a node; {} and the files iox2_* in /dev/shm must belong to this user: all \
                 participants of a machine run as one user",
                config.global.root_path()
            )))?;
        Ok(Self { node, machine: machine.into(), is_simulated, epoch: monotonic_ns() })
    }

    /// Whether the times of the messages are simulated.
    pub fn is_simulated(&self) -> bool {
        self.is_simulated
    }

    /// Why and where this user's shared memory is not in the usual location, if so.
    pub fn fallback_location() -> Option<String> {
        location().ok()?.1
    }

    /// A publisher of `T`.
    pub fn publisher<T: Message>(&self) -> Result<Publisher<T>, PortError> {
        let port = self.service::<T>()?.publisher_builder().create();
        let port = port.map_err(port_error(format!("cannot publish {}", T::TOPIC)))?;
        Ok(Publisher::new(port, self.epoch))
    }

    /// A subscriber to `T` that keeps up to `depth` messages.
    pub fn subscriber<T: Message>(&self, depth: usize) -> Result<Subscriber<T>, PortError> {
        let service = self.service::<T>()?;
        let port = service.subscriber_builder().buffer_size(depth.min(BUFFER)).create();
        let port = port.map_err(port_error(format!("cannot subscribe to {}", T::TOPIC)))?;
        Ok(Subscriber::new(service, port, self.is_simulated))
    }

    /// A subscriber to `T` for which one publisher counts until it has left, or was silent for so long \[ns\].
    pub fn leased_subscriber<T: Message>(
        &self,
        depth: usize,
        timeout_ns: u64,
    ) -> Result<LeasedSubscriber<T>, PortError> {
        // In simulated time nobody is silent for long.
        let timeout_ns = if self.is_simulated { u64::MAX } else { timeout_ns };
        Ok(LeasedSubscriber::new(self.subscriber(depth)?, timeout_ns))
    }

    /// Observer of the publishers of `T`, which takes none of the topic's ports.
    pub fn topic<T: Message>(&self) -> Result<TopicObserver<T>, PortError> {
        Ok(TopicObserver(self.service::<T>()?))
    }

    fn service<T: Message>(&self) -> Result<PortFactory<ipc::Service, T, ()>, PortError> {
        let prefix = if self.is_simulated { "hexad-simulated" } else { "hexad" };
        let name = format!("{prefix}/{}/{}", self.machine, T::TOPIC);
        let service_name = name.as_str().try_into().map_err(port_error(format!("bad topic {name}")))?;
        self.node
            .service_builder(&service_name)
            .publish_subscribe::<T>()
            .max_publishers(T::MAX_PUBLISHERS)
            .max_subscribers(MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(BUFFER)
            .enable_safe_overflow(true)
            .history_size(0)
            .open_or_create()
            .map_err(port_error(format!("cannot open topic {name}")))
    }
}

/// Observer of the publishers of one topic.
pub struct TopicObserver<T: Message>(PortFactory<ipc::Service, T, ()>);

impl<T: Message> TopicObserver<T> {
    /// Process numbers of the publishers, the latest last. A killed one is there until a participant notices its end.
    pub fn publisher_process_ids(&self) -> Vec<u32> {
        let mut found = vec![];
        self.0.dynamic_config().list_publishers(|details| {
            found.extend(u32::try_from(details.node_id.pid().value()));
            CallbackProgression::Continue
        });
        found
    }
}
