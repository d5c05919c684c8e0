//! Reads a recording, also one that a crash left unfinished.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::read::ChunkReader;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{CYCLE, Damage, GAP, Item, MEMORY, RECOVERED, RecordingError, RunInfo};
use hexad_client::messages::cdr;
use hexad_client::messages::layout::Declared as _;
use hexad_client::messages::{CycleMessage, GapMessage};
use hexad_machine::text::files::{FileError, remark};

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
    /// Whether it is unfinished, or was until `hexad recover` completed it: what followed its last cycle is unknown.
    pub is_broken_off: bool,
    /// What has changed since it was written; it was left out.
    pub damage: Vec<Damage>,
}

/// Whether a file is as it was written, and whole.
#[derive(Clone, Debug, Default)]
pub(super) struct Completeness {
    pub unfinished: Option<String>,
    pub damage: Vec<Damage>,
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

    /// All records as far as the file is complete and its checksums are right.
    pub(super) fn each_record(
        &self,
        mut visit: impl FnMut(Record<'_>) -> Result<(), RecordingError>,
    ) -> Result<Completeness, RecordingError> {
        let mut whole = Completeness::default();
        whole.unfinished = self.read_records(&mut visit, &mut whole.damage)?;
        Ok(whole)
    }

    /// Returns why reading ended, if the file is not finished.
    fn read_records(
        &self,
        visit: &mut impl FnMut(Record<'_>) -> Result<(), RecordingError>,
        damage: &mut Vec<Damage>,
    ) -> Result<Option<String>, RecordingError> {
        let mut file = File::open(&self.path).map_err(FileError::on(&self.path))?;
        let options = LinearReaderOptions::default().with_emit_chunks(true);
        let options = options.with_validate_data_section_crc(true);
        let (mut began_ns, mut is_over) = (None, false);
        let mut reader = LinearReader::new_with_options(options.with_record_length_limit(MAX_RECORD_BYTES));
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let buffer = reader.insert(wanted.min(READ_BYTES));
                    let count = file.read(buffer).map_err(FileError::on(&self.path))?;
                    reader.notify_read(count);
                }
                Ok(LinearReadEvent::Record { data, opcode }) => match mcap::parse_record(opcode, data) {
                    // What follows repeats what was read, but a file without it is cut short.
                    Ok(Record::DataEnd(_)) => is_over = true,
                    Ok(_) if is_over => {}
                    Ok(Record::Chunk { header, data }) => {
                        let began_ns = *began_ns.get_or_insert(header.message_start_time);
                        let times = [header.message_start_time, header.message_end_time]
                            .map(|at_ns| at_ns.saturating_sub(began_ns) as f64 * 1e-9);
                        // Its checksum is compared at its end, before anything of it counts.
                        let records = ChunkReader::new(header, &data).and_then(Iterator::collect);
                        match records {
                            Ok::<Vec<_>, McapError>(records) => {
                                records.into_iter().try_for_each(&mut *visit)?;
                            }
                            Err(_) => damage.push(Damage::Chunk(times)),
                        }
                    }
                    Ok(record) => visit(record)?,
                    Err(error) => return Ok(Some(error.to_string())),
                },
                Err(McapError::BadDataCrc { .. }) => {
                    // Of the whole: known already, unless it is outside of the chunks.
                    if damage.is_empty() {
                        damage.push(Damage::Rest);
                    }
                    return Ok(None);
                }
                Err(error) => return Ok(Some(error.to_string())),
            }
        }
        Ok((!is_over).then(|| "the end is missing".into()))
    }

    /// Writes to standard error if the end is missing: what is computed from the file covers less than was run.
    pub fn remark(&self, summary: &Summary) {
        if let Some(why) = &summary.unfinished {
            let path = self.path.display();
            remark(format_args!(
                "{path}: it is not complete ({why}): cycles at its end may be missing; hexad recover completes it"
            ));
        }
    }

    /// Calls `visit` with each item, and returns what the file says about itself. An error if parts of it are damaged.
    pub fn each(&self, visit: impl FnMut(Item)) -> Result<Summary, RecordingError> {
        let summary = self.each_undamaged(visit)?;
        if summary.damage.is_empty() {
            return Ok(summary);
        }
        Err(RecordingError::Damaged { path: self.path.clone(), damage: summary.damage })
    }

    /// The same without an error: damaged parts are left out.
    fn each_undamaged(&self, mut visit: impl FnMut(Item)) -> Result<Summary, RecordingError> {
        let mut summary = Summary::default();
        let mut topics = BTreeMap::new();
        let mut names = BTreeSet::new();
        let Completeness { unfinished, damage } = self.each_record(|record| {
            match record {
                Record::Channel(channel) => drop(topics.insert(channel.id, channel.topic)),
                Record::Metadata(found) => {
                    match found.name.as_str() {
                        "hexad" => summary.info = RunInfo::from_metadata(&found.metadata),
                        "fault" => {
                            summary.fault = found.metadata.get("cycle").and_then(|cycle| cycle.parse().ok());
                        }
                        RECOVERED => summary.is_broken_off = true,
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
        summary.is_broken_off |= unfinished.is_some();
        Ok(Summary { unfinished, damage, ..summary })
    }

    /// What the file says about itself.
    pub fn summary(&self) -> Result<Summary, RecordingError> {
        self.each_undamaged(|_| ())
    }
}

/// Those of some recordings that have a cycle, with what they say about themselves. If there are several, the others are
/// named on standard error. An error if none has a cycle.
pub fn with_cycles(paths: &[PathBuf]) -> Result<Vec<(Recording, Summary)>, RecordingError> {
    let (mut found, mut empty) = (vec![], None);
    for path in paths {
        let recording = Recording::open(path)?;
        match recording.summary() {
            // One without cycles because they are damaged is not left out.
            Err(error @ RecordingError::Empty(_)) if recording.each_record(|_| Ok(()))?.damage.is_empty() => {
                if paths.len() > 1 {
                    remark(format_args!("{}: it is left out: no complete cycle is in it", path.display()));
                }
                empty.get_or_insert(error);
            }
            summary => found.push((recording, summary?)),
        }
    }
    empty.filter(|_| found.is_empty()).map_or(Ok(found), Err)
}

/// The item of a message; `None` for topics that are only drawn.
pub(super) fn item(topic: &str, message: &[u8]) -> Result<Option<Item>, String> {
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
        let whole =
            fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/hexad-2026-11-25.mcap")).unwrap();
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
        let whole =
            fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/hexad-2026-11-25.mcap")).unwrap();
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

    /// Every changed bit is reported, and the items that are read are those that were written.
    #[test]
    fn no_bit_changes_in_silence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flipped.mcap");
        let whole =
            fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/hexad-2026-11-25.mcap")).unwrap();
        // Opcode and length of the record that ends the data; its checksum, and the index behind it, are not data.
        let end = whole.windows(9).rposition(|at| at == [0x0f, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        let read = |content: &[u8]| {
            fs::write(&path, content).unwrap();
            let mut items = vec![];
            let recording = Recording::open(&path)?;
            let summary = recording.each_undamaged(|item| items.push(item))?;
            Ok::<_, RecordingError>((items, summary))
        };
        let (items, _) = read(&whole).unwrap();
        let mut damaged_chunks = 0;
        for at in (0..end).step_by(end / 200) {
            let mut content = whole.clone();
            content[at] ^= 1 << (at % 8);
            let Ok((found, Summary { unfinished, damage, .. })) = read(&content) else { continue };
            assert!(unfinished.is_some() || !damage.is_empty(), "byte {at} of {end}");
            assert!(found.iter().all(|item| items.contains(item)), "byte {at} of {end}");
            damaged_chunks += usize::from(matches!(damage[..], [Damage::Chunk(_)]));
        }
        assert!(damaged_chunks > 100, "{damaged_chunks}");
    }
}
