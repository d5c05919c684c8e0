//! Recordings: every cycle of the controller in files of the format MCAP.
//!
//! | topic | content |
//! | --- | --- |
//! | `/hexad/cycle` | [`CycleMessage`]: timing, input and output of each cycle |
//! | `/hexad/memory` | memory of the controller before a cycle, once a second: there a replay can begin |
//! | `/hexad/gap` | [`GapMessage`]: cycles that are missing |
//! | `/tf` | base, platform and legs, 100 times a second |
//! | `/joint_states` | lengths, rates and forces of the legs, 100 times a second |
//!
//! All messages are CDR with a schema in `ros2msg`. The metadata `hexad` says what was recorded ([`RunInfo`]), the metadata
//! `fault` for which cycle a window was written. `docs/recording.md` is for users.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hexad_client::messages::{CycleMessage, GapMessage};
use hexad_core::control::controller::Memory;
use hexad_machine::text::files::FileError;

pub mod copy;
pub mod file;
pub mod reader;
pub mod scene;
pub mod schema;
pub mod table;
pub mod table_choice;

/// Topic of [`CycleMessage`].
pub const CYCLE: &str = "/hexad/cycle";
/// Topic of the memory of the controller.
pub const MEMORY: &str = "/hexad/memory";
/// Topic of [`GapMessage`].
pub const GAP: &str = "/hexad/gap";
/// Metadata of a file that `hexad recover` has completed: why it was not complete.
const RECOVERED: &str = "recovered";
/// Topic of the frames, as ROS tools expect it.
pub const FRAMES: &str = "/tf";
/// Topic of the legs, as ROS tools expect it.
pub const JOINTS: &str = "/joint_states";

/// Why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not MCAP, or not one of hexad.
    #[error("{}: {cause}; name a recording of `hexad run --record` or `--faults`", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// A checksum says that parts of the file have changed since they were written.
    #[error("{}: damaged: {}; hexad recover --output NEW writes the rest", path.display(), damage_text(.damage))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What has changed.
        damage: Vec<Damage>,
    },
    /// Nothing of the file is left.
    #[error("{}: no complete cycle is in it: nothing can be recovered", .0.display())]
    Empty(PathBuf),
    /// Columns were chosen that the table does not have.
    #[error("--columns: {0}")]
    Columns(String),
}

/// Part of a file that has changed since it was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damage {
    /// A chunk: the time of its messages since the beginning of the file \[s\].
    Chunk([f64; 2]),
    /// Something outside of the chunks: what the file says about itself.
    Rest,
}

/// Damage in words.
pub fn damage_text(damage: &[Damage]) -> String {
    let words = damage.iter().map(|it| match it {
        Damage::Chunk([from, to]) => format!("{from:.3} to {to:.3} s"),
        Damage::Rest => "what the file says about itself".into(),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// What was recorded: the metadata `hexad` of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunInfo {
    /// Name of the configuration.
    pub name: String,
    /// Version of hexad.
    pub version: String,
    /// Commit of the source, or `unknown`.
    pub commit: String,
    /// Instruction set of the model's lanes.
    pub instruction_set: String,
    /// Fidelity that the configuration resolved to.
    pub fidelity: String,
    /// Text of the configuration.
    pub configuration: String,
    /// The machine as it was read, every constant.
    pub machine: String,
    /// Unix time less CLOCK_MONOTONIC \[ns\], by which `log_time` follows from `due_ns`.
    pub clock_offset_ns: u64,
}

impl RunInfo {
    /// As the metadata of a file.
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let offset = self.clock_offset_ns.to_string();
        [
            ("name", &self.name),
            ("version", &self.version),
            ("commit", &self.commit),
            ("instruction_set", &self.instruction_set),
            ("fidelity", &self.fidelity),
            ("configuration", &self.configuration),
            ("machine", &self.machine),
            ("clock_offset_ns", &offset),
        ]
        .into_iter()
        .map(|(key, value)| (key.into(), value.clone()))
        .collect()
    }

    /// From the metadata of a file; what is missing is empty.
    pub fn from_metadata(metadata: &BTreeMap<String, String>) -> Self {
        let value = |key: &str| metadata.get(key).cloned().unwrap_or_default();
        Self {
            name: value("name"),
            version: value("version"),
            commit: value("commit"),
            instruction_set: value("instruction_set"),
            fidelity: value("fidelity"),
            configuration: value("configuration"),
            machine: value("machine"),
            clock_offset_ns: value("clock_offset_ns").parse().unwrap_or_default(),
        }
    }
}

/// Bytes of the memory of a controller, every number to the bit.
pub fn memory_bytes(memory: &Memory) -> Vec<u8> {
    // It fails for types of unknown length alone, of which a memory has none.
    postcard::to_allocvec(memory).unwrap_or_default()
}

/// Memory of a controller from its bytes; `None` if another version wrote them.
pub fn memory_from(bytes: &[u8]) -> Option<Memory> {
    postcard::from_bytes(bytes).ok()
}

/// Content of a recording, in the order of the cycles.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// One cycle.
    Cycle(Box<CycleMessage>),
    /// Memory of the controller before a cycle.
    Memory {
        /// Number of the cycle.
        cycle: u64,
        /// See [`memory_bytes`].
        bytes: Vec<u8>,
    },
    /// Cycles that are missing.
    Gap(GapMessage),
}
