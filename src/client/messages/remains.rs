//! What participants leave that were killed.
//!
//! iceoryx2 removes what a killed participant held when another one joins or leaves. What is left of one that was killed
//! while it joined or left, or while it removed another's, it leaves for good: the book-keeping of a node without a
//! lock, or without details, and segments of ports that no node counts as its own. Hundreds of restarts would fill
//! `/dev/shm`, so the daemon removes that as well.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState, NodeView as _};
use iceoryx2::prelude::*;

use super::bus::PortError;
use super::location::{Location, SEGMENT_FOLDER, entries};

/// Folder of the nodes in iceoryx2's book-keeping: files and a folder of each, named after its number.
const NODES: &str = "nodes";
/// End of the name of a file that says that a port, whose number is in the name, belongs to a node.
const PORT_TAG: &str = "port_tag";
/// Ends of the names of segments that belong to the ports whose numbers are in the name.
const OF_PORTS: [&str; 2] = ["data", "connection"];

/// What ended participants of this user have left.
pub struct Remains {
    config: Config,
    /// What belonged to no living participant at the last look: the book-keeping of one that is about to join, or is
    /// just being removed, looks like that for a moment.
    seen: BTreeSet<PathBuf>,
}

impl Remains {
    /// Nothing is removed yet.
    pub fn open() -> Result<Self, PortError> {
        Ok(Self { config: Location::open()?.config, seen: BTreeSet::new() })
    }

    /// Removes what killed participants held, and what belongs to no living one now and belonged to none at the last
    /// call. Calls should be a second apart or more.
    pub fn remove(&mut self) {
        Node::<ipc::Service>::try_cleanup_dead_nodes(&self.config);
        let found = self.without_owner().unwrap_or_default();
        for path in found.intersection(&self.seen) {
            // Another may remove it at the same time.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
        self.seen = found;
    }

    /// Everything that belongs to no living node; `None` if the nodes cannot be listed.
    fn without_owner(&self) -> Option<BTreeSet<PathBuf>> {
        let (mut nodes, mut ports) = (BTreeSet::new(), BTreeSet::new());
        // List the nodes before reading the folders. A node that joins in between is listed in the next call.
        let listed = Node::<ipc::Service>::list(&self.config, |node| {
            match node {
                NodeState::Alive(view) => nodes.insert(view.id().value()),
                NodeState::Inaccessible(id) | NodeState::Undefined(id) => nodes.insert(id.value()),
                NodeState::Dead(_) => false,
            };
            CallbackProgression::Continue
        });
        listed.ok()?;
        let folder = PathBuf::from(self.config.global.root_path().to_string()).join(NODES);
        for node in &nodes {
            let tags = entries(folder.join(node.to_string())).filter(|tag| has_extension(tag, &[PORT_TAG]));
            ports.extend(tags.flat_map(|tag| self.numbers(&tag)));
        }
        let of_nodes = entries(&folder).filter(|it| {
            let numbers = self.numbers(it);
            !numbers.is_empty() && numbers.is_disjoint(&nodes)
        });
        let of_ports = entries(SEGMENT_FOLDER).filter(|it| {
            let numbers = self.numbers(it);
            has_extension(it, &OF_PORTS) && !numbers.is_empty() && !numbers.is_subset(&ports)
        });
        Some(of_nodes.chain(of_ports).collect())
    }

    /// Numbers in the name of an entry, without the prefix; none if the prefix is another's.
    fn numbers(&self, path: &Path) -> BTreeSet<u128> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_folder = name.bytes().all(|byte| byte.is_ascii_digit());
        let prefix = self.config.global.prefix.to_string();
        let own = if is_folder { Some(&*name) } else { name.strip_prefix(&prefix) };
        own.map_or_else(BTreeSet::new, |own| {
            own.split(['_', '.']).filter_map(|part| part.parse().ok()).collect()
        })
    }
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|it| found == *it))
}
