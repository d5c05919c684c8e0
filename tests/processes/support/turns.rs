//! Tests that measure run alone: locks on files, so that it also holds between test processes.

use std::fs::File;
use std::path::Path;

/// Held for the duration of a test.
pub struct Turn(#[allow(dead_code, reason = "the lock lives as long as the file is open")] File);

fn file(name: &str) -> File {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("hexad-processes{name}.lock"));
    File::create(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The door to the other lock: behind a test that waits to run alone all others wait, and not only those that run alone.
fn door() -> File {
    let door = file("-door");
    door.lock().expect("the lock of the tests");
    door
}

/// Alone.
pub fn alone() -> Turn {
    let (_door, file) = (door(), file(""));
    file.lock().expect("the lock of the tests");
    Turn(file)
}

/// Beside others that do not measure.
pub fn beside_others() -> Turn {
    let (_door, file) = (door(), file(""));
    file.lock_shared().expect("the lock of the tests");
    Turn(file)
}
