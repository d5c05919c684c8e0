//! Rows of CSV text, each with the line it begins in, none longer than a bound.

use core::cell::Cell;
use std::io::{self, Chain, Cursor, Read};
use std::rc::Rc;

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};

/// Longest row; a trajectory's have about 400 bytes. A quote that is not closed swallows no more than this.
pub const MAX_ROW_BYTES: usize = 64 << 10;

/// Longest text in UTF-16, twice that of the most rows that a spreadsheet has. It is decoded in memory.
const MAX_UTF16_BYTES: u64 = 1 << 30;

/// Marks a text as UTF-8, as spreadsheets write it.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// What may separate fields; of several in a header, the first here.
const DELIMITERS: [u8; 4] = *b",;\t|";

/// Begins a line that is a comment.
const COMMENT: u8 = b'#';

/// The source again, after its beginning was looked at, and an end of its last line.
type Text<R> = Chain<Chain<Cursor<Vec<u8>>, Utf8<R>>, &'static [u8]>;

/// Source whose beginning was read, and decoded.
type Utf8<R> = Chain<Cursor<Vec<u8>>, R>;

/// Reader of CSV text, row by row.
pub struct CsvRows<R> {
    reader: Reader<Limited<Text<R>>>,
    /// What separates fields.
    pub delimiter: u8,
    /// Bytes that the present row may still take.
    remaining: Rc<Cell<usize>>,
    record: ByteRecord,
}

impl<R: Read> CsvRows<R> {
    /// Reader of a source whose first line is line 1. What separates fields is seen in the header or stated above it.
    pub fn new(source: R) -> io::Result<Self> {
        let remaining = Rc::default();
        let mut source = as_utf8(source)?;
        let mut head = vec![];
        source.by_ref().take(MAX_ROW_BYTES as u64 + 1).read_to_end(&mut head)?;
        if head.starts_with(BYTE_ORDER_MARK) {
            head.drain(..BYTE_ORDER_MARK.len());
        }
        let has_lone_returns = has_lone_returns(&head);
        if has_lone_returns {
            replace_returns(&mut head);
        }
        let delimiter = prepare_header(&mut head);
        // The last line shall end like all others, so that all are counted alike.
        let source = Cursor::new(head).chain(source).chain(&b"\n"[..]);
        let source = Limited { source, remaining: Rc::clone(&remaining), has_lone_returns };
        // The carriage return of a Windows file is trimmed as a blank later: as a terminator of its own it would
        // be counted as a line of the row before.
        let ends = Terminator::Any(b'\n');
        let mut builder = ReaderBuilder::new();
        builder
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .terminator(ends)
            .comment(Some(COMMENT));
        let reader = builder.from_reader(source);
        Ok(Self { reader, delimiter, remaining, record: ByteRecord::new() })
    }

    /// The next row that has a field that is not blank, with its line; or an error, after which there is no other row.
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
            if !text.trim_ascii().is_empty() {
                // Blank lines may be above it, and ends of lines within it.
                let within = text.iter().filter(|byte| **byte == b'\n').count() as u64;
                let line = self.reader.position().line().saturating_sub(1 + within).max(above);
                return Ok(Some((line, &self.record)));
            }
        }
    }
}

/// The source with its beginning again. UTF-16, which its first two bytes show, is decoded.
fn as_utf8<R: Read>(mut source: R) -> io::Result<Utf8<R>> {
    let mut text = vec![];
    source.by_ref().take(2).read_to_end(&mut text)?;
    let unit = match text.as_slice() {
        [0xff, 0xfe] => u16::from_le_bytes,
        [0xfe, 0xff] => u16::from_be_bytes,
        _ => return Ok(Cursor::new(text).chain(source)),
    };
    text.clear();
    source.by_ref().take(MAX_UTF16_BYTES).read_to_end(&mut text)?;
    if text.len() as u64 == MAX_UTF16_BYTES {
        let bound = format!("UTF-16 of {MAX_UTF16_BYTES} bytes: must be shorter; save the file as UTF-8");
        return Err(io::Error::other(bound));
    }
    let chars = char::decode_utf16(text.as_chunks().0.iter().copied().map(unit));
    let text: String = chars.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Ok(Cursor::new(text.into_bytes()).chain(source))
}

/// Whether lines end with a carriage return alone, as the first does.
fn has_lone_returns(head: &[u8]) -> bool {
    let mut ends = head.iter().skip_while(|byte| !b"\r\n".contains(byte));
    ends.next() == Some(&b'\r') && ends.next() != Some(&b'\n')
}

/// Puts line feeds in the place of carriage returns.
fn replace_returns(text: &mut [u8]) {
    text.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
}

/// Finds the header below blank lines, comments and a line `sep=;`, which it blanks, and returns what separates fields.
/// Above a row of numbers the last comment is the header; it loses its mark.
fn prepare_header(head: &mut [u8]) -> u8 {
    let (mut stated, mut comment) = (None, None);
    for line in head.split_inclusive_mut(|byte| *byte == b'\n') {
        if let [b's', b'e', b'p', b'=', delimiter, ..] = *line
            && DELIMITERS.contains(&delimiter)
        {
            stated = Some(delimiter);
            line.iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
        } else if line.first() == Some(&COMMENT) {
            comment = Some(line);
        } else if !line.iter().all(|byte| byte.is_ascii_whitespace() || DELIMITERS.contains(byte)) {
            let of_number = |byte: &u8| !byte.is_ascii_alphabetic() || b"eE".contains(byte);
            let header = match comment {
                Some(comment) if line.iter().all(of_number) => comment,
                _ => line,
            };
            header.iter_mut().take_while(|byte| **byte == COMMENT).for_each(|byte| *byte = b' ');
            let seen = DELIMITERS.into_iter().find(|delimiter| header.contains(delimiter));
            return stated.or(seen).unwrap_or(b',');
        }
    }
    stated.unwrap_or(b',')
}

/// Source that fails once a limited number of bytes has been read, with line feeds as ends of lines.
struct Limited<R> {
    source: R,
    remaining: Rc<Cell<usize>>,
    has_lone_returns: bool,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let allowed = buffer.len().min(self.remaining.get());
        let buffer = buffer.get_mut(..allowed).unwrap_or_default();
        let read = self.source.read(buffer)?;
        if self.has_lone_returns {
            replace_returns(buffer);
        }
        self.remaining.set(self.remaining.get() - read);
        if self.remaining.get() == 0 {
            let bound = format!("a row longer than {MAX_ROW_BYTES} bytes: must be at most that long");
            return Err(io::Error::other(bound));
        }
        Ok(read)
    }
}
