//! The node of ROS 2: its topics, its services, and the names of other nodes.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::net::IpAddr;
use std::pin::pin;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use futures::StreamExt;
use futures::executor::block_on_stream;
use futures::future::ready;
use futures::stream::select;
use ros2_client::dds::rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent as Event, StatusEvented,
};
use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{
    Context, Gid, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, Server, ServiceMapping,
    ServiceTypeName, Subscription,
};

use crate::first_request::repair_first_requests;
use crate::network_file::Ros2Section;
use crate::ros_messages::{RosMessage, TriggerRequest, TriggerResponse};

/// Number of bytes of an identity that name the process of an entity.
const PARTICIPANT_BYTES: usize = 12;

/// Largest number of processes whose nodes are known by name.
const MAX_PROCESSES: usize = 256;

/// Messages of a topic that are kept until they are read, or until the library's thread sends them: as many as come in a pause of a busy host.
pub const BUFFER: usize = 64;

/// Node of one machine. Its topics and services end with it.
pub struct BridgeNode {
    node: Node,
    namespace: String,
    /// Names of other nodes.
    pub names: NodeNames,
}

impl BridgeNode {
    /// Joins the domain at the addresses of the interface.
    pub fn join(section: &Ros2Section, addresses: Vec<IpAddr>) -> Result<Self, String> {
        let is_loopback = addresses.iter().all(IpAddr::is_loopback);
        let participant = DomainParticipantBuilder::new(section.domain_id)
            .with_only_networks(addresses)
            .same_host_loopback(is_loopback)
            .build();
        let participant = participant.map_err(text)?;
        let first_requests = repair_first_requests(participant.clone()).map_err(text)?;
        let context = Context::from_domain_participant(participant.clone()).map_err(text)?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let name = NodeName::new(&section.namespace, "hexad_ros2").map_err(text)?;
        let mut node = context.new_node(name, options).map_err(text)?;
        // Not the spinner of the library: it subscribes to /clock, which the bridge has no use for, with a wrong type and without a node.
        let kept = QosProfile::publisher_default().durability(Durability::TransientLocal);
        let type_name = MessageTypeName::new("rmw_dds_common", "ParticipantEntitiesInfo");
        let topic = context.create_topic("ros_discovery_info".into(), type_name, &kept).map_err(text)?;
        let processes = node.create_subscription(&topic, None).map_err(text)?;
        let names = NodeNames::default();
        names.watch(participant, processes, first_requests);
        Ok(Self { node, namespace: section.namespace.clone(), names })
    }

    /// Publisher of the topic `name` in the namespace, or of an absolute one. It waits for no reader: setpoints would wait, too.
    pub fn publisher<M: RosMessage>(&mut self, name: &str) -> Result<Publisher<M>, String> {
        let quality = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .history(History::KeepLast { depth: BUFFER });
        let topic =
            self.node.create_topic(&self.absolute(name)?, type_name::<M>(), &quality).map_err(text)?;
        self.node.create_publisher(&topic, None).map_err(text)
    }

    /// Subscription that requests no repetition: what is lost would be too old.
    pub fn subscription<M: RosMessage + 'static>(&mut self, name: &str) -> Result<Subscription<M>, String> {
        let quality = QosProfile::subscription_default().history(History::KeepLast { depth: BUFFER });
        let topic =
            self.node.create_topic(&self.absolute(name)?, type_name::<M>(), &quality).map_err(text)?;
        self.node.create_subscription(&topic, None).map_err(text)
    }

    /// Server of a service `std_srvs/srv/Trigger`.
    pub fn trigger(&mut self, name: &str) -> Result<Server<TriggerRequest, TriggerResponse>, String> {
        let quality = QosProfile::subscription_default()
            .reliability_reliable(WhenFull::DEFAULT)
            .history(History::KeepLast { depth: 10 });
        let (name, type_name) = (self.absolute(name)?, ServiceTypeName::new("std_srvs", "Trigger"));
        let server =
            self.node.create_server(ServiceMapping::Enhanced, &name, &type_name, quality.clone(), quality);
        server.map_err(text)
    }

    fn absolute(&self, name: &str) -> Result<Name, String> {
        let namespace = if name.starts_with('/') { "" } else { self.namespace.trim_end_matches('/') };
        Name::parse(&format!("{namespace}/{}", name.trim_start_matches('/'))).map_err(text)
    }
}

fn text(error: impl Display) -> String {
    format!("ROS 2: {error}")
}

fn type_name<M: RosMessage>() -> MessageTypeName {
    let mut parts = M::NAME.split("/msg/");
    MessageTypeName::new(parts.next().unwrap_or_default(), parts.next().unwrap_or_default())
}

/// Names of the nodes of each process, as the processes state them.
#[derive(Clone, Default)]
pub struct NodeNames(Arc<Mutex<BTreeMap<[u8; PARTICIPANT_BYTES], String>>>);

impl NodeNames {
    /// Receives the statements of all processes, in a thread of its own. It also signals each of them, and each match.
    fn watch(
        &self,
        domain: DomainParticipant,
        processes: Subscription<ParticipantEntitiesInfo>,
        first_requests: Sender<()>,
    ) {
        let names = self.clone();
        thread::spawn(move || {
            let statuses = domain.status_listener();
            let matches = statuses.as_async_status_stream().filter_map(|event| {
                let is_match =
                    matches!(event, Event::RemoteWriterMatched { .. } | Event::RemoteReaderMatched { .. });
                ready(is_match.then_some(None))
            });
            let statements = processes.async_stream().map(Result::ok);
            for process in block_on_stream(pin!(select(matches, statements))) {
                let _ = first_requests.send(());
                let Some((process, _)) = process else { continue };
                let nodes: Vec<_> = process.nodes().iter().map(|node| node.fully_qualified_name()).collect();
                let mut names = names.0.lock().unwrap_or_else(PoisonError::into_inner);
                if names.len() >= MAX_PROCESSES {
                    names.pop_first();
                }
                names.insert(participant(&process.gid()), nodes.join(" "));
            }
        });
    }

    /// Names of the nodes of the process of a publisher or client, and its identity.
    pub fn of(&self, id: &Gid) -> String {
        let names = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let name = names.get(&participant(id)).map_or("a node without a name", String::as_str);
        format!("{name} ({id:?})")
    }
}

fn participant(id: &Gid) -> [u8; PARTICIPANT_BYTES] {
    id.as_bytes().first_chunk().copied().unwrap_or_default()
}
