//! Text of a configuration file: all errors that come before the parsing as TOML.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use super::{ConfigError, Violation};

/// Size of the largest file: five times one that explains every key at length. Bounds memory and time for any file.
pub const MAX_FILE_BYTES: usize = 64 << 10;

/// Text of a file, and its name in error texts.
pub fn read_file(path: &Path) -> Result<(String, String), ConfigError> {
    let place = path.display().to_string();
    let file = File::open(path).map_err(unreadable(&place))?;
    Ok((read_text(file, &place)?, place))
}

/// Text of a file that has to be a regular one: no pipe can hold up the reader.
pub fn read_regular_file(path: &Path) -> Result<(String, String), ConfigError> {
    let place = path.display().to_string();
    let opened = File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path);
    let is_regular = |file: File| match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(io::Error::other("it is not a regular file")),
    };
    let file = opened.and_then(is_regular).map_err(unreadable(&place))?;
    Ok((read_text(file, &place)?, place))
}

/// Text of a source; error texts name it `place`.
pub fn read_text(source: impl Read, place: &str) -> Result<String, ConfigError> {
    let mut bytes = vec![];
    source.take(MAX_FILE_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(unreadable(place))?;
    let invalid = |line, key: &str, value: String, bound: String| ConfigError::Invalid {
        place: place.into(),
        violations: vec![Violation { line, key: key.into(), value: Some(value), bound }],
    };
    if bytes.len() > MAX_FILE_BYTES {
        let value = format!("more than {MAX_FILE_BYTES} bytes");
        return Err(invalid(1, "file size", value, format!("must be at most {MAX_FILE_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        let (sound, rest) = error.as_bytes().split_at(error.utf8_error().valid_up_to());
        let line = 1 + sound.iter().filter(|byte| **byte == b'\n').count();
        let value = format!("byte {:#04x}", rest.first().copied().unwrap_or_default());
        invalid(line, "encoding", value, "must be UTF-8".into())
    })
}

fn unreadable(place: &str) -> impl FnOnce(io::Error) -> ConfigError + use<> {
    let place = place.into();
    move |cause| ConfigError::Unreadable { place, cause }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error text for a source.
    fn refusal(source: impl Read) -> String {
        read_text(source, "x.toml").unwrap_err().to_string()
    }

    #[test]
    fn a_pipe_without_a_writer_holds_nobody_up() {
        let folder = tempfile::tempdir().unwrap();
        let [pipe, file] = ["pipe", "file"].map(|name| folder.path().join(name));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let refused = read_regular_file(&pipe).unwrap_err().to_string();
        assert!(refused.ends_with("it is not a regular file"), "{refused}");
        assert!(read_regular_file(folder.path()).is_err());
        std::fs::write(&file, "x").unwrap();
        assert_eq!(read_regular_file(&file).unwrap().0, "x");
    }

    #[test]
    fn an_endless_file_is_rejected() {
        let bound = "x.toml:1: file size = more than 65536 bytes: must be at most 65536 bytes";
        assert_eq!(refusal(io::repeat(b'#')), bound);
        assert_eq!(read_text(io::repeat(b'#').take(65536), "x.toml").unwrap().len(), 65536);
    }

    #[test]
    fn bytes_that_are_no_text_are_rejected_with_their_line() {
        assert_eq!(refusal(&b"a = 1\nb = \"\xff\"\n"[..]), "x.toml:2: encoding = byte 0xff: must be UTF-8");
        assert_eq!(refusal(&b"\xc3"[..]), "x.toml:1: encoding = byte 0xc3: must be UTF-8");
    }
}
