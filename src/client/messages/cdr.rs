//! CDR, the encoding of ROS 2: numbers at multiples of their size, after four bytes of header.

/// The header: plain CDR, in the order of bytes of this processor.
pub const HEADER: [u8; 4] = [0, if cfg!(target_endian = "little") { 1 } else { 0 }, 0, 0];

/// Message in the making.
#[derive(Clone, Debug)]
pub struct CdrWriter {
    bytes: Vec<u8>,
}

impl CdrWriter {
    /// Begins in a buffer, whose content is lost and whose memory is used again.
    pub fn new(mut buffer: Vec<u8>) -> Self {
        buffer.clear();
        buffer.extend_from_slice(&HEADER);
        Self { bytes: buffer }
    }

    /// Adds the bytes of a struct that is its own encoding.
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend_from_slice(bytes);
        self
    }

    fn align(&mut self, size: usize) {
        while !(self.bytes.len() - HEADER.len()).is_multiple_of(size) {
            self.bytes.push(0);
        }
    }

    /// Adds an integer of 32 bits.
    pub fn u32(&mut self, number: u32) {
        self.align(4);
        self.bytes.extend_from_slice(&number.to_ne_bytes());
    }

    /// Adds an integer of 64 bits.
    pub fn u64(&mut self, number: u64) {
        self.align(8);
        self.bytes.extend_from_slice(&number.to_ne_bytes());
    }

    /// Adds floats.
    pub fn floats(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.u64(number.to_bits());
        }
    }

    /// Adds a sequence of bytes.
    pub fn sequence(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend_from_slice(bytes);
    }

    /// Adds a text.
    pub fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    /// Adds an instant since 1970 \[ns\] as `builtin_interfaces/Time`.
    pub fn time(&mut self, time_ns: u64) {
        self.u32((time_ns / 1_000_000_000) as u32);
        self.u32((time_ns % 1_000_000_000) as u32);
    }

    /// The message.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// Content of a message after the header; `None` if it is of another encoding.
pub fn content(message: &[u8]) -> Option<&[u8]> {
    message.strip_prefix(&HEADER)
}
