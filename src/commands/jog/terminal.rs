//! Terminal whose keys arrive at once and are not shown; as before when dropped.

use std::io::{self, Read, Write, stdin, stdout};

use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};

/// To another screen and back; to its first line; clears the rest of a line, and everything below.
const ENTER: &str = "\x1b[?1049h\x1b[?25l";
const LEAVE: &str = "\x1b[?25h\x1b[?1049l";
const HOME: &str = "\x1b[H";
const CLEAR_LINE: &str = "\x1b[K";
const CLEAR_BELOW: &str = "\x1b[J";

/// Most bytes of keys read at once.
const KEY_BYTES: usize = 256;

/// Terminal of this process.
pub struct Terminal {
    before: Termios,
}

impl Terminal {
    /// Keys without waiting for a line, and without echo; Ctrl-C remains a signal.
    pub fn open() -> io::Result<Self> {
        let before = tcgetattr(stdin())?;
        let mut keys = before.clone();
        keys.local_flags.remove(LocalFlags::ICANON | LocalFlags::ECHO);
        for index in [SpecialCharacterIndices::VMIN, SpecialCharacterIndices::VTIME] {
            if let Some(value) = keys.control_chars.get_mut(index as usize) {
                *value = 0;
            }
        }
        // What was typed before belongs to nobody.
        tcsetattr(stdin(), SetArg::TCSAFLUSH, &keys)?;
        show(ENTER);
        Ok(Self { before })
    }

    /// What has been typed since the last call.
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
        // Nothing is left to do if it fails.
        let _ = tcsetattr(stdin(), SetArg::TCSAFLUSH, &self.before);
    }
}

/// Writes to the terminal; one that has gone shows nothing.
fn show(text: &str) {
    let mut out = stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
