//! Number of files that this process may have open: an operator's connection must not fail for want of one.

use std::io;

use super::Shortfall;

/// Raises the limit of this process to a number of open files, as far as it is below and its own hard limit permits.
pub fn permit(count: u64) -> Result<(), Shortfall> {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: the call writes to the struct.
    let mut result = unsafe { libc::getrlimit(libc::RLIMIT_NOFILE, &raw mut limit) };
    if result == 0 && limit.rlim_cur < count && count <= limit.rlim_max {
        limit.rlim_cur = count;
        // SAFETY: the call reads the struct.
        result = unsafe { libc::setrlimit(libc::RLIMIT_NOFILE, &raw const limit) };
    }
    let reason = match result {
        0 if count <= limit.rlim_cur => return Ok(()),
        0 => format!("RLIMIT_NOFILE is {}", limit.rlim_max),
        _ => io::Error::last_os_error().to_string(),
    };
    let remedy = format!("LimitNOFILE={count} in the unit, or ulimit -n {count}");
    Err(Shortfall { what: format!("{count} open files"), reason, remedy })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_the_hard_limit_is_refused_with_the_remedy() {
        assert_eq!(permit(1), Ok(()));
        let refused = permit(u64::MAX - 1).map_err(|shortfall| shortfall.to_string());
        assert!(refused.is_err_and(|text| text.contains("RLIMIT_NOFILE is ") && text.contains("ulimit -n ")));
    }
}
