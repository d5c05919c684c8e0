//! Rows of CSV text, each with the line it begins in, none longer than a bound.

use core::cell::Cell;
use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::rc::Rc;

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};

/// Longest row; a trajectory's have about 400 bytes. A quote that is not closed swallows no more than this.
pub const MAX_ROW_BYTES: usize = 64 << 10;

/// Marks a text as UTF-8, as spreadsheets write it.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The source again, after its header was looked at, and an end of its last line.
type Text<R> = Chain<Chain<Cursor<Vec<u8>>, BufReader<R>>, &'static [u8]>;

/// Reader of CSV text, row by row.
pub struct CsvRows<R> {
    reader: Reader<Limited<Text<R>>>,
    delimiter: u8,
    /// Bytes that the present row may still take.
    remaining: Rc<Cell<usize>>,
    record: ByteRecord,
}

impl<R: Read> CsvRows<R> {
    /// Reader of a source whose first line is line 1. What separates fields is seen in the first line that is not blank.
    pub fn new(source: R) -> io::Result<Self> {
        let remaining = Rc::default();
        let mut source = BufReader::new(source);
        let head = head(&mut source)?;
        let has = |byte: u8| head.contains(&byte);
        let delimiter = [b',', b';', b'\t'].into_iter().find(|byte| has(*byte)).unwrap_or(b',');
        let source = Cursor::new(head).chain(source);
        // The last line shall end like all others, so that all are counted alike.
        let source = Limited { source: source.chain(&b"\n"[..]), remaining: Rc::clone(&remaining) };
        // The carriage return of a Windows file is trimmed as a blank later: as a terminator of its own it would
        // be counted as a line of the row before.
        let ends = Terminator::Any(b'\n');
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).delimiter(delimiter).terminator(ends);
        let reader = builder.from_reader(source);
        Ok(Self { reader, delimiter, remaining, record: ByteRecord::new() })
    }

    /// What separates fields.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// The next row that is not blank, with its line; or an error, after which there is no other row.
    pub fn next_row(&mut self) -> Result<Option<(u64, &ByteRecord)>, String> {
        loop {
            let above = self.reader.position().line();
            // One more, to see whether the row goes on.
            self.remaining.set(MAX_ROW_BYTES + 1);
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

/// The text to the end of the first line that is not blank, without a byte order mark; no more than a row may have.
fn head(source: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut head = vec![];
    while head.len() <= MAX_ROW_BYTES {
        let begin = head.len();
        let room = (MAX_ROW_BYTES + 1 - begin) as u64;
        let count = source.take(room).read_until(b'\n', &mut head)?;
        if begin == 0 && head.starts_with(BYTE_ORDER_MARK) {
            head.drain(..BYTE_ORDER_MARK.len());
        }
        if count == 0 || head.get(begin..).is_some_and(|line| !line.trim_ascii().is_empty()) {
            break;
        }
    }
    Ok(head)
}

/// Source that fails once a limited number of bytes has been read.
struct Limited<R> {
    source: R,
    remaining: Rc<Cell<usize>>,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let allowed = buffer.len().min(self.remaining.get());
        let read = self.source.read(buffer.get_mut(..allowed).unwrap_or_default())?;
        self.remaining.set(self.remaining.get() - read);
        if self.remaining.get() == 0 {
            let bound = format!("a row longer than {MAX_ROW_BYTES} bytes: must be at most that long");
            return Err(io::Error::other(bound));
        }
        Ok(read)
    }
}
