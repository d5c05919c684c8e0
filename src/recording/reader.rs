//! Reads a recording, also one that a crash left unfinished.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::cdr;
use super::{CYCLE, GAP, Item, MEMORY, RecordingError, RunInfo};
use crate::messages::layout::Declared as _;
use crate::messages::{CycleMessage, GapMessage};
use crate::output::files::FileError;

/// Most bytes that are read at once: a chunk. A damaged length cannot demand more.
const READ_BYTES: usize = 128 * 1024;
/// Longest record \[bytes\]: many times a chunk and a configuration.
const MAX_RECORD_BYTES: usize = 64 << 20;

/// A recording, which is read anew from its file each time.
pub struct Recording {
    path: PathBuf,
}

/// What a file says about itself.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// What was recorded.
    pub info: RunInfo,
    /// The cycle of the fault whose window it is.
    pub fault: Option<u64>,
    /// Number of the first cycle.
    pub first: CycleMessage,
    /// Number of cycles.
    pub cycles: u64,
    /// Why reading ended before the end of the file: a crash or a full disk has left it so.
    pub unfinished: Option<String>,
}

impl Recording {
    /// Opens a file, which must begin as an MCAP file, as far as its bytes go: a crash leaves also empty files.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let recording = Self { path: path.to_path_buf() };
        let mut magic = vec![];
        let file = File::open(path).map_err(FileError::on(path))?;
        file.take(mcap::MAGIC.len() as u64).read_to_end(&mut magic).map_err(FileError::on(path))?;
        if !mcap::MAGIC.starts_with(&magic) {
            return Err(recording.foreign("it is not an MCAP file"));
        }
        Ok(recording)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn foreign(&self, cause: impl ToString) -> RecordingError {
        RecordingError::Foreign { path: self.path.clone(), cause: cause.to_string() }
    }

    /// All records as far as the file is complete; why it ended, if it is not finished.
    pub(super) fn each_record(
        &self,
        mut visit: impl FnMut(Record<'_>) -> Result<(), RecordingError>,
    ) -> Result<Option<String>, RecordingError> {
        let mut file = File::open(&self.path).map_err(FileError::on(&self.path))?;
        let options = LinearReaderOptions::default().with_skip_end_magic(true);
        let mut reader = LinearReader::new_with_options(options.with_record_length_limit(MAX_RECORD_BYTES));
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let buffer = reader.insert(wanted.min(READ_BYTES));
                    let count = file.read(buffer).map_err(FileError::on(&self.path))?;
                    reader.notify_read(count);
                }
                Ok(LinearReadEvent::Record { data, opcode }) => match mcap::parse_record(opcode, data) {
                    Ok(Record::DataEnd(_)) => return Ok(None),
                    Ok(record) => visit(record)?,
                    Err(error) => return Ok(Some(error.to_string())),
                },
                Err(error) => return Ok(Some(error.to_string())),
            }
        }
        Ok(Some("the end is missing".into()))
    }

    /// Calls `visit` with each item, and returns what the file says about itself.
    pub fn each(&self, mut visit: impl FnMut(Item)) -> Result<Summary, RecordingError> {
        let mut summary = Summary::default();
        let mut topics = BTreeMap::new();
        let mut names = BTreeSet::new();
        let unfinished = self.each_record(|record| {
            match record {
                Record::Channel(channel) => drop(topics.insert(channel.id, channel.topic)),
                Record::Metadata(found) => {
                    match found.name.as_str() {
                        "hexad" => summary.info = RunInfo::from_metadata(&found.metadata),
                        "fault" => {
                            summary.fault = found.metadata.get("cycle").and_then(|cycle| cycle.parse().ok());
                        }
                        _ => {}
                    }
                    names.insert(found.name);
                }
                Record::Message { header, data } => {
                    let Some(topic) = topics.get(&header.channel_id) else { return Ok(()) };
                    let item = item(topic, &data).map_err(|cause| self.foreign(cause))?;
                    if let Some(Item::Cycle(cycle)) = &item {
                        if summary.cycles == 0 {
                            summary.first = **cycle;
                        }
                        summary.cycles += 1;
                    }
                    item.into_iter().for_each(&mut visit);
                }
                _ => {}
            }
            Ok(())
        })?;
        // The daemon may have died before the first record was complete.
        let is_cut_short = unfinished.is_some() && names.is_empty();
        if !names.contains("hexad") && !is_cut_short {
            return Err(self.foreign("it does not say what was recorded"));
        }
        if summary.cycles == 0 {
            return Err(RecordingError::Empty(self.path.clone()));
        }
        Ok(Summary { unfinished, ..summary })
    }

    /// What the file says about itself.
    pub fn summary(&self) -> Result<Summary, RecordingError> {
        self.each(|_| ())
    }
}

/// The item of a message; `None` for topics that are only drawn.
fn item(topic: &str, message: &[u8]) -> Result<Option<Item>, String> {
    let is_hexad = [CYCLE, MEMORY, GAP].contains(&topic);
    if !is_hexad {
        return Ok(None);
    }
    let bytes = cdr::content(message).ok_or("its numbers are those of another processor")?;
    let other_layout = || format!("its messages on {topic} are of another version of hexad");
    match topic {
        CYCLE => CycleMessage::from_bytes(bytes).map(|cycle| Item::Cycle(Box::new(cycle))),
        GAP => GapMessage::from_bytes(bytes).map(Item::Gap),
        _ => memory(bytes),
    }
    .map(Some)
    .ok_or_else(other_layout)
}

fn memory(bytes: &[u8]) -> Option<Item> {
    let (cycle, rest) = bytes.split_first_chunk()?;
    let (length, content) = rest.split_first_chunk()?;
    let is_whole = u32::from_ne_bytes(*length) as usize == content.len();
    is_whole.then(|| Item::Memory { cycle: u64::from_ne_bytes(*cycle), bytes: content.into() })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// Wherever the daemon died before the first cycle was complete.
    #[test]
    fn a_file_that_was_hardly_begun_is_empty_and_not_foreign() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("begun.mcap");
        let whole = fs::read("tests/data/hexad-2026-11-25.mcap").unwrap();
        for length in mcap::MAGIC.len()..2000 {
            fs::write(&path, &whole[..length]).unwrap();
            let summary = Recording::open(&path).unwrap().summary();
            assert!(matches!(summary, Err(RecordingError::Empty(_))), "{length}: {summary:?}");
        }
    }

    #[test]
    fn no_length_in_a_damaged_file_is_trusted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.mcap");
        let first_record = [mcap::MAGIC, &[1], &u64::MAX.to_le_bytes(), b"rest"].concat();
        let whole = fs::read("tests/data/hexad-2026-11-25.mcap").unwrap();
        let damaged = (mcap::MAGIC.len()..whole.len()).step_by(whole.len() / 500).map(|at| {
            let mut content = whole.clone();
            content.iter_mut().skip(at).take(8).for_each(|byte| *byte = 0xff);
            content
        });
        for content in [first_record].into_iter().chain(damaged) {
            fs::write(&path, content).unwrap();
            // Refused, or read as far as it is whole.
            let _ = Recording::open(&path).unwrap().summary();
        }
        fs::write(&path, &whole).unwrap();
        assert!(Recording::open(&path).unwrap().summary().is_ok());
    }
}
