//! Participation in the topics of one machine over iceoryx2.
//!
//! One function defines the service of a topic for every process: quality-of-service values are set by the process that
//! creates a service and stay until the last node leaves.
//!
//! A peer that connects or disappears is handled inside the next send or receive of every participant: allocations,
//! system calls, up to 0.1 ms. No real-time thread may own a port.

use std::thread::sleep;
use std::time::{Duration, Instant};

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::clock::monotonic_ns;
use super::lease::MAX_PUBLISHERS;
use super::location::{Location, SEGMENTS_DELETED};
use super::reservation::take_refusal;
use super::{LeasedSubscriber, Message, Publisher, Subscriber};

/// Largest number of subscribers: daemon, plant, recorder, monitors.
const MAX_SUBSCRIBERS: usize = 16;
const MAX_NODES: usize = 32;
/// Number of messages by which a slow subscriber (a recorder) may lag: 256 are 12.8 ms at 20 kHz, 0.25 s at 1
/// kHz.
pub(super) const BUFFERED_MESSAGES: usize = 256;

/// Failure of a call to iceoryx2: the attempt, and the error of iceoryx2.
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
    move |cause| PortError { what, cause: take_refusal().unwrap_or_else(|| with_cure(&format!("{cause:?}"))) }
}

/// Errors of iceoryx2 that give no remedy, each with its remedy.
const CURES: [(&str, &str); 7] = [
    ("SystemInFlux", SEGMENTS_DELETED),
    ("ServiceInCorruptedState", OTHER_VERSION),
    ("VersionMismatch", OTHER_VERSION),
    ("ServiceInUnknownState", OTHER_VERSION),
    (
        "IncompatibleTypes",
        "another participant has declared the topic with another type: build all with the declarations of hexad messages of this \
         version, then restart all",
    ),
    (
        "DoesNotSupportRequested",
        "another participant has opened the topic first, with other settings (docs/driver.md): correct its settings, then restart all",
    ),
    ("ExceedsMax", "all places of the topic are taken: end another participant"),
];
const OTHER_VERSION: &str = "another participant has another version of iceoryx2: every participant needs iceoryx2 0.9.3 exactly \
                             (pip install iceoryx2==0.9.3); end all participants, then start them again";

/// The text of an error, after its remedy.
fn with_cure(words: &str) -> String {
    let cure = CURES.iter().find(|(name, _)| words.contains(name));
    cure.map_or_else(|| words.into(), |(_, cure)| format!("{cure} ({words})"))
}

/// Errors of what another participant is just creating or removing: of a topic, and of a node.
const UNSETTLED: [&str; 4] = ["HangsInCreation", "SystemInFlux", "IsBeingCreated", "InternalError"];

/// Longest time that a participant takes to create or remove what it shares: it reads its program from a slow disk, or has no processor.
const SETTLING_LIMIT: Duration = Duration::from_secs(2);

/// The result of an attempt after others have created or removed what it needs, or after a time.
fn when_settled<T, E: core::fmt::Debug>(
    longest: Duration,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, E> {
    let begun = Instant::now();
    loop {
        let result = attempt();
        let is_unsettled = |error: &E| UNSETTLED.iter().any(|name| format!("{error:?}").contains(name));
        if !result.as_ref().is_err_and(is_unsettled) || begun.elapsed() >= longest {
            return result;
        }
        sleep(Duration::from_millis(5));
    }
}

/// Participation of this process in the topics of one machine.
pub struct Bus {
    node: Node<ipc::Service>,
    machine: String,
    is_simulated: bool,
    epoch: u64,
    /// Longest wait for what others are creating.
    patience: Duration,
}

impl Bus {
    /// Joins the topics `hexad/<machine>/...`, whose times are CLOCK_MONOTONIC. `machine` is the configured
    /// name. The epoch of all publishers is now.
    pub fn join(machine: &str) -> Result<Self, PortError> {
        Self::join_topics(machine, false, SETTLING_LIMIT)
    }

    /// Joins the topics `hexad-simulated/<machine>/...` of a daemon with `release = "lockstep"`, whose times are those
    /// of the measured messages. No hardware subscribes to them.
    pub fn join_simulated(machine: &str) -> Result<Self, PortError> {
        Self::join_topics(machine, true, SETTLING_LIMIT)
    }

    /// The same without any wait: for who has a stop to send or to receive.
    pub fn join_at_once(machine: &str, is_simulated: bool) -> Result<Self, PortError> {
        Self::join_topics(machine, is_simulated, Duration::ZERO)
    }

    fn join_topics(machine: &str, is_simulated: bool, patience: Duration) -> Result<Self, PortError> {
        // Its warnings (cleaned-up dead nodes) are routine here.
        set_log_level(LogLevel::Error);
        let location = Location::open()?;
        let create = || {
            // Signals belong to the command line, not to a library's wait loop.
            let builder = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled);
            builder.config(&location.config).create::<ipc::Service>()
        };
        let node = when_settled(patience, create).map_err(|cause| {
            let known = take_refusal().or_else(|| location.probe_writing());
            let cause = known.unwrap_or_else(|| format!("{cause:?}"));
            PortError::new("cannot create a node".into(), cause)
        })?;
        Ok(Self { node, machine: machine.into(), is_simulated, epoch: monotonic_ns(), patience })
    }

    /// Whether the times of the messages are simulated.
    pub fn is_simulated(&self) -> bool {
        self.is_simulated
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
        let port = service.subscriber_builder().buffer_size(depth.min(BUFFERED_MESSAGES)).create();
        let port = port.map_err(port_error(format!("cannot subscribe to {}", T::TOPIC)))?;
        Ok(Subscriber::new(service, port, self.is_simulated))
    }

    /// A subscriber to `T` with a lease: one publisher counts until it has left, or was silent for a time
    /// \[ns\].
    pub fn leased_subscriber<T: Message>(
        &self,
        depth: usize,
        silence_timeout_ns: u64,
    ) -> Result<LeasedSubscriber<T>, PortError> {
        // In simulated time a pause is no silence.
        let timeout_ns = if self.is_simulated { u64::MAX } else { silence_timeout_ns };
        Ok(LeasedSubscriber::new(self.subscriber(depth)?, timeout_ns))
    }

    /// Observer of the publishers of `T`. It uses none of the topic's ports.
    pub fn topic<T: Message>(&self) -> Result<TopicObserver<T>, PortError> {
        Ok(TopicObserver(self.service::<T>()?))
    }

    fn service<T: Message>(&self) -> Result<PortFactory<ipc::Service, T, ()>, PortError> {
        let prefix = if self.is_simulated { "hexad-simulated" } else { "hexad" };
        let name = format!("{prefix}/{}/{}", self.machine, T::TOPIC);
        let service_name = name.as_str().try_into().map_err(port_error(format!("bad topic {name}")))?;
        let open = || {
            let builder = self.node.service_builder(&service_name).publish_subscribe::<T>();
            let builder = builder.max_publishers(MAX_PUBLISHERS).max_subscribers(MAX_SUBSCRIBERS);
            let builder = builder.max_nodes(MAX_NODES).subscriber_max_buffer_size(BUFFERED_MESSAGES);
            builder.enable_safe_overflow(true).history_size(0).open_or_create()
        };
        when_settled(self.patience, open).map_err(port_error(format!("cannot open topic {name}")))
    }
}

/// Observer of the publishers of one topic.
pub struct TopicObserver<T: Message>(PortFactory<ipc::Service, T, ()>);

impl<T: Message> TopicObserver<T> {
    /// Process IDs of the publishers, the latest last. A killed publisher is listed until a participant
    /// notices its end.
    pub fn publisher_process_ids(&self) -> Vec<u32> {
        let mut found = vec![];
        self.0.dynamic_config().list_publishers(|details| {
            found.extend(u32::try_from(details.node_id.pid().value()));
            CallbackProgression::Continue
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::path::PathBuf;
    use std::time::Duration;
    use std::{fs, thread};

    use super::super::ForceMessage;
    use super::super::location::{ICEORYX_FOLDER, user_folder};
    use super::{Bus, with_cure};

    /// As a participant that waits for its disk leaves a topic: its description is not yet readable.
    #[test]
    fn a_topic_that_another_is_just_creating_is_waited_for() {
        let name = format!("case_creation_{}", std::process::id());
        let first = Bus::join(&name).unwrap();
        let _port = first.publisher::<ForceMessage>().unwrap();
        let is_of_topic = |path: &PathBuf| fs::read_to_string(path).is_ok_and(|text| text.contains(&name));
        let services = fs::read_dir(user_folder().join(ICEORYX_FOLDER).join("services")).unwrap();
        let description = services.flatten().map(|entry| entry.path()).find(is_of_topic).unwrap();
        let permit = |mode| fs::set_permissions(&description, fs::Permissions::from_mode(mode)).unwrap();
        permit(0o200);
        thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(Duration::from_millis(100));
                permit(0o400);
            });
            assert!(Bus::join_at_once(&name, false).unwrap().subscriber::<ForceMessage>(1).is_err());
            assert!(Bus::join(&name).unwrap().subscriber::<ForceMessage>(1).is_ok());
        });
    }

    #[test]
    fn words_of_iceoryx2_come_with_what_to_do() {
        for (words, cure) in [
            (
                "PublishSubscribeOpenError(ServiceInCorruptedState)",
                "every participant needs iceoryx2 0.9.3 exactly",
            ),
            (
                "PublishSubscribeOpenError(IncompatibleTypes)",
                "with another type: build all with the declarations",
            ),
            ("ExceedsMaxSupportedPublishers", "end another participant"),
        ] {
            let text = with_cure(words);
            assert!(text.contains(cure) && text.ends_with(&format!("({words})")), "{text}");
        }
        assert_eq!(with_cure("Interrupt"), "Interrupt");
    }
}
