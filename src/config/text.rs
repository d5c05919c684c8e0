//! From a file to its text: all that can be wrong before anything is read as TOML.

use std::io::{self, Read};
use std::{fs::File, path::Path};

use super::{ConfigError, Violation};

/// Largest file: five times one that explains every key at length. Bounds memory and time, whatever is
/// given for a file.
pub const MAX_FILE_BYTES: usize = 64 << 10;

/// The text of a file, and what messages call it.
pub fn text_of(path: &Path) -> Result<(String, String), ConfigError> {
    let place = path.display().to_string();
    let file = File::open(path).map_err(unreadable(&place))?;
    Ok((text(file, &place)?, place))
}

/// The text of a source; `place` is what messages call it.
pub fn text(source: impl Read, place: &str) -> Result<String, ConfigError> {
    let mut bytes = vec![];
    source.take(MAX_FILE_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(unreadable(place))?;
    let refused = |line, key: &str, value: String, bound: String| ConfigError::Invalid {
        place: place.into(),
        violations: vec![Violation { line, key: key.into(), value: Some(value), bound }],
    };
    if bytes.len() > MAX_FILE_BYTES {
        let value = format!("more than {MAX_FILE_BYTES} bytes");
        return Err(refused(1, "file size", value, format!("must be at most {MAX_FILE_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        let (sound, rest) = error.as_bytes().split_at(error.utf8_error().valid_up_to());
        let line = 1 + sound.iter().filter(|byte| **byte == b'\n').count();
        let value = format!("byte {:#04x}", rest.first().copied().unwrap_or_default());
        refused(line, "encoding", value, "must be UTF-8".into())
    })
}

fn unreadable(place: &str) -> impl FnOnce(io::Error) -> ConfigError + use<> {
    let place = place.into();
    move |cause| ConfigError::Unreadable { place, cause }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said about bytes.
    fn refusal(source: impl Read) -> String {
        text(source, "x.toml").unwrap_err().to_string()
    }

    #[test]
    fn a_file_without_end_is_refused() {
        let bound = "x.toml:1: file size = more than 65536 bytes: must be at most 65536 bytes";
        assert_eq!(refusal(io::repeat(b'#')), bound);
        assert_eq!(text(io::repeat(b'#').take(65536), "x.toml").unwrap().len(), 65536);
    }

    #[test]
    fn bytes_that_are_no_text_are_refused_with_their_line() {
        assert_eq!(refusal(&b"a = 1\nb = \"\xff\"\n"[..]), "x.toml:2: encoding = byte 0xff: must be UTF-8");
        assert_eq!(refusal(&b"\xc3"[..]), "x.toml:1: encoding = byte 0xc3: must be UTF-8");
    }
}
