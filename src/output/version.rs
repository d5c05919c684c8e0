//! Version of the program, as `--version`, reports and the status show it.

/// Version, commit and build profile: `0.1.0 (commit 0123456789ab, release)`. The commit ends with `-dirty` where files had been changed.
pub const VERSION: &str =
    concat!(env!("CARGO_PKG_VERSION"), " (commit ", env!("HEXAD_COMMIT"), ", ", env!("HEXAD_PROFILE"), ")");
