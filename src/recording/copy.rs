//! Copies of recordings: `hexad recover` completes what a crash left, `hexad replay --extract` keeps a part.

use core::ops::RangeInclusive;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::records::{Metadata, Record};
use mcap::{McapError, Writer};

use super::RecordingError;
use super::file::{on, options};
use super::reader::Recording;
use crate::output::files::FileError;

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
    let mut messages = 0;
    recording.each_record(|record| {
        if let Record::Message { header, .. } = &record {
            if !times_ns.contains(&header.log_time) {
                return Ok(());
            }
            messages += 1;
        }
        write(&mut writer, record).map_err(on(to))
    })?;
    writer.finish().map_err(on(to))?;
    let file = writer.into_inner();
    file.sync_all().map_err(FileError::on(to))?;
    Ok(messages)
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
