//! Version of the program, as `--version`, reports and the status show it.

/// Number of the version.
pub const NUMBER: &str = env!("CARGO_PKG_VERSION");
/// Commit of a release build from a checkout; it ends with `-dirty` where files had been changed.
pub const COMMIT: &str = env!("HEXAD_COMMIT");
/// Version, commit and build profile: `0.1.0 (commit 0123456789ab, release)`.
pub const VERSION: &str =
    concat!(env!("CARGO_PKG_VERSION"), " (commit ", env!("HEXAD_COMMIT"), ", ", env!("HEXAD_PROFILE"), ")");
