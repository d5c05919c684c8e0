//! Terminal that returns keys at once and does not echo them. Its settings are restored when it is dropped.

use std::io::{self, Read, Write, stdin, stdout};

use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};

/// Escape sequences: switch to another screen and back, go to its first line, clear the rest of a line, clear
/// everything below.
const ENTER: &str = "\x1b[?1049h\x1b[?25l";
const LEAVE: &str = "\x1b[?25h\x1b[?1049l";
const HOME: &str = "\x1b[H";
const CLEAR_LINE: &str = "\x1b[K";
const CLEAR_BELOW: &str = "\x1b[J";

/// Largest number of bytes read at once.
const KEY_BYTES: usize = 256;

/// Terminal of this process.
pub struct Terminal {
    before: Termios,
}

impl Terminal {
    /// Switches to keys without line buffering and without echo. Ctrl-C remains a signal.
    pub fn open() -> io::Result<Self> {
        let before = tcgetattr(stdin())?;
        let mut keys = before.clone();
        keys.local_flags.remove(LocalFlags::ICANON | LocalFlags::ECHO);
        for index in [SpecialCharacterIndices::VMIN, SpecialCharacterIndices::VTIME] {
            if let Some(value) = keys.control_chars.get_mut(index as usize) {
                *value = 0;
            }
        }
        // Discards earlier input.
        tcsetattr(stdin(), SetArg::TCSAFLUSH, &keys)?;
        show(ENTER);
        Ok(Self { before })
    }

    /// Bytes typed since the last call.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = [0; KEY_BYTES];
        let count = stdin().lock().read(&mut bytes).unwrap_or_default();
        bytes.get(..count).unwrap_or_default().to_vec()
    }

    /// Replaces the screen.
    pub fn draw(&self, text: &str) {
        let lines: String = text.lines().map(|line| format!("{line}{CLEAR_LINE}\n")).collect();
        show(&format!("{HOME}{}{CLEAR_BELOW}", lines.trim_end()));
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        show(LEAVE);
        // Nothing can be done if this fails.
        let _ = tcsetattr(stdin(), SetArg::TCSAFLUSH, &self.before);
    }
}

/// Writes to the terminal. Errors are ignored, for a closed terminal.
fn show(text: &str) {
    let mut out = stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
