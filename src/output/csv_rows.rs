//! Rows of CSV text, each with the line it begins in, none longer than a bound.

use core::cell::Cell;
use std::io::{self, Chain, Read};
use std::rc::Rc;

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};

/// Longest row; a trajectory's have about 400 bytes. A quote that is not closed swallows no more than this.
pub const MAX_ROW_BYTES: usize = 64 << 10;

/// Reads row after row.
pub struct Rows<R> {
    reader: Reader<Rationed<Chain<R, &'static [u8]>>>,
    left: Rc<Cell<usize>>,
    record: ByteRecord,
}

impl<R: Read> Rows<R> {
    pub fn of(source: R) -> Self {
        let left = Rc::default();
        // The last line shall end like all others, so that all are counted alike.
        let source = Rationed { source: source.chain(&b"\n"[..]), left: Rc::clone(&left) };
        // The carriage return of a Windows file is left to who trims blanks: as an end of its own, it would
        // be counted as a line of the row before.
        let ends = Terminator::Any(b'\n');
        let mut builder = ReaderBuilder::new();
        let reader = builder.has_headers(false).flexible(true).terminator(ends).from_reader(source);
        Self { reader, left, record: ByteRecord::new() }
    }

    /// The next row that is not blank, with its line; or what is wrong, after which there is no other.
    pub fn next(&mut self) -> Result<Option<(u64, &ByteRecord)>, String> {
        loop {
            let above = self.reader.position().line();
            // One more, to see whether there is more.
            self.left.set(MAX_ROW_BYTES + 1);
            let found = self.reader.read_byte_record(&mut self.record);
            if !found.map_err(|error| format!("line {above}: {error}"))? {
                return Ok(None);
            }
            let text = self.record.as_slice();
            if self.record.len() > 1 || !text.trim_ascii().is_empty() {
                // Blank lines may be above it, and ends of lines within it.
                let within = text.iter().filter(|byte| **byte == b'\n').count() as u64;
                let line = self.reader.position().line().saturating_sub(1 + within).max(above);
                return Ok(Some((line, &self.record)));
            }
        }
    }
}

/// A source that fails when nothing is left of what may be read.
struct Rationed<R> {
    source: R,
    left: Rc<Cell<usize>>,
}

impl<R: Read> Read for Rationed<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let allowed = buffer.len().min(self.left.get());
        let read = self.source.read(buffer.get_mut(..allowed).unwrap_or_default())?;
        self.left.set(self.left.get() - read);
        if self.left.get() == 0 {
            let bound = format!("a row longer than {MAX_ROW_BYTES} bytes: must be at most that long");
            return Err(io::Error::other(bound));
        }
        Ok(read)
    }
}
