//! Keys of `hexad jog`.

/// Meaning of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Key {
    /// Moves a coordinate of X, counted from 0, up or down.
    Move { axis: usize, sign: f64 },
    /// Changes velocity or step of x, y and z.
    Translation { is_faster: bool },
    /// Changes velocity or step of the angles.
    Rotation { is_faster: bool },
    /// Switches between continuous motion and steps.
    Mode,
    /// Ends the motion. Any key without another meaning does the same.
    Stop,
    /// Ends the command.
    Leave,
}

/// Keys of each coordinate of X, up and down: two rows of the keyboard, right of `q`. `z` acts as `y`, because German
/// keyboards have it in that place.
const KEYS: [(&[u8], &[u8]); 6] =
    [(b"t", b"g"), (b"yz", b"h"), (b"u", b"j"), (b"w", b"s"), (b"e", b"d"), (b"r", b"f")];

const ESCAPE: u8 = 0x1b;

/// Key from the bytes of a terminal. Of several keys only the last is used, because a slow connection may
/// have delayed the others.
pub fn last_key(bytes: &[u8]) -> Option<Key> {
    // The escape sequence of an arrow or function key moves nothing.
    if bytes.len() > 1 && bytes.contains(&ESCAPE) {
        return Some(Key::Stop);
    }
    bytes.last().map(|byte| key(*byte))
}

fn key(byte: u8) -> Key {
    let moves = KEYS.iter().enumerate().find_map(|(axis, (up, down))| {
        let sign = if up.contains(&byte) { 1.0 } else { -1.0 };
        (up.contains(&byte) || down.contains(&byte)).then_some(Key::Move { axis, sign })
    });
    moves.unwrap_or(match byte {
        b'+' | b'-' => Key::Translation { is_faster: byte == b'+' },
        // Without shift on the keyboards of most languages.
        b'.' | b',' => Key::Rotation { is_faster: byte == b'.' },
        b'm' => Key::Mode,
        b'q' | b'Q' | ESCAPE => Key::Leave,
        _ => Key::Stop,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_has_two_keys_and_everything_else_moves_nothing() {
        let mut moves = vec![];
        for byte in 0..=255 {
            if let Some(Key::Move { axis, sign }) = last_key(&[byte]) {
                moves.push((axis, sign as i32));
            }
        }
        moves.sort_unstable();
        moves.dedup();
        assert_eq!(moves.len(), 12);
        assert_eq!(last_key(b""), None);
        assert_eq!(last_key(b"wwws"), Some(Key::Move { axis: 3, sign: -1.0 }));
        // An arrow key whose last byte is the letter of another key.
        assert_eq!(last_key(b"\x1b[s"), Some(Key::Stop));
        for leaving in [b"q", b"Q", b"\x1b"] {
            assert_eq!(last_key(leaving), Some(Key::Leave), "{leaving:?}");
        }
    }
}
