//! Differences of instants.

/// `to - from` in seconds; 0 if `to` is before `from`.
pub fn seconds_since_or_0(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// `to - from` in seconds, either sign.
pub fn seconds_between(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9
}
