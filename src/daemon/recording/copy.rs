//! Copies of recordings: `hexad recover` completes what a crash left, `hexad replay --extract` keeps a part.

use core::ops::RangeInclusive;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata, Record};
use mcap::{McapError, Writer};

use super::file::{on, options};
use super::reader::{Recording, item};
use super::{GAP, Item, RECOVERED, RecordingError};
use hexad_client::messages::cdr::CdrWriter;
use hexad_client::messages::layout::Declared as _;
use hexad_client::messages::{CycleMessage, GapMessage};
use hexad_machine::text::files::FileError;

/// Copies what is complete and lies in a range of `log_time` to a file, which appears only when it is whole. Returns the number
/// of messages.
pub fn copy(recording: &Recording, to: &Path, times_ns: RangeInclusive<u64>) -> Result<u64, RecordingError> {
    let mut part = to.as_os_str().to_os_string();
    part.push(".part");
    let part = PathBuf::from(part);
    copy_to(recording, &part, times_ns)
        .and_then(|messages| {
            fs::rename(&part, to).map_err(FileError::on(to))?;
            Ok(messages)
        })
        .inspect_err(|_| drop(fs::remove_file(&part)))
}

fn copy_to(recording: &Recording, to: &Path, times_ns: RangeInclusive<u64>) -> Result<u64, RecordingError> {
    let file = File::create(to).map_err(FileError::on(to))?;
    let mut writer = options().create(file).map_err(on(to))?;
    let (mut messages, mut topics, mut gap) = (0, BTreeMap::new(), None);
    let mut has_end = true;
    let whole = recording.each_record(|record| {
        match &record {
            Record::Channel(channel) => _ = topics.insert(channel.id, channel.topic.clone()),
            // It follows the messages.
            Record::Metadata(it) if it.name == RECOVERED && !has_end => return Ok(()),
            Record::Message { header, .. } if !times_ns.contains(&header.log_time) => {
                has_end = false;
                return Ok(());
            }
            Record::Message { header, data } => {
                (messages, has_end) = (messages + 1, true);
                let topic = topics.get(&header.channel_id).map_or("", String::as_str);
                if let Ok(Some(Item::Cycle(cycle))) = item(topic, data) {
                    let missing =
                        gap.replace(cycle.cycle + 1).map_or(0, |next| cycle.cycle.saturating_sub(next));
                    write_gap(&mut writer, &topics, header, &cycle, missing).map_err(on(to))?;
                }
                if let Ok(Some(Item::Gap(marked))) = item(topic, data) {
                    gap = Some(marked.first_cycle + marked.cycles);
                }
            }
            _ => {}
        }
        write(&mut writer, record).map_err(on(to))
    })?;
    if let Some(cause) = whole.unfinished.filter(|_| has_end) {
        let metadata = BTreeMap::from([("cause".into(), cause)]);
        writer.write_metadata(&Metadata { name: RECOVERED.into(), metadata }).map_err(on(to))?;
    }
    writer.finish().map_err(on(to))?;
    let file = writer.into_inner();
    file.sync_all().map_err(FileError::on(to))?;
    Ok(messages)
}

/// Marks cycles that are missing before one, because their part of the file was damaged.
fn write_gap(
    writer: &mut Writer<File>,
    topics: &BTreeMap<u16, String>,
    header: &MessageHeader,
    cycle: &CycleMessage,
    missing: u64,
) -> Result<(), McapError> {
    let channel = topics.iter().find(|(_, topic)| *topic == GAP).filter(|_| missing > 0);
    let Some((channel_id, _)) = channel else { return Ok(()) };
    let gap = GapMessage { first_cycle: cycle.cycle - missing, cycles: missing };
    let message = CdrWriter::new(vec![]).bytes(gap.bytes()).finish();
    writer.write_to_known_channel(&MessageHeader { channel_id: *channel_id, ..*header }, &message)
}

fn write(writer: &mut Writer<File>, record: Record<'_>) -> Result<(), McapError> {
    match record {
        Record::Schema { header, data } => {
            writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop)
        }
        Record::Channel(it) => {
            let channel = (it.id, it.schema_id, &it.topic, &it.message_encoding, &it.metadata);
            let (id, schema, topic, encoding, metadata) = channel;
            writer.add_channel_with_id(id, schema, topic, encoding, metadata).map(drop)
        }
        Record::Message { header, data } => writer.write_to_known_channel(&header, &data),
        Record::Metadata(Metadata { name, metadata }) => writer.write_metadata(&Metadata { name, metadata }),
        _ => Ok(()),
    }
}
