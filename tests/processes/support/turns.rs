//! Who measures runs alone: a lock on a file, so that it also holds between test processes.

use std::fs::File;
use std::path::Path;

/// Held for the duration of a test.
pub struct Turn(#[allow(dead_code, reason = "the lock lives as long as the file is open")] File);

fn file() -> File {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hexad-processes.lock");
    File::create(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Alone.
pub fn alone() -> Turn {
    let file = file();
    file.lock().expect("the lock of the tests");
    Turn(file)
}

/// Beside others that do not measure.
pub fn beside_others() -> Turn {
    let file = file();
    file.lock_shared().expect("the lock of the tests");
    Turn(file)
}
