//! Idle states of processors: the deeper one sleeps, the longer it takes to wake.

use std::fs::File;
use std::io::Write;

use super::permissions::open_cpu_dma_latency;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// A request to the kernel; it holds until this is dropped or the process ends, however that comes about.
#[derive(Debug)]
pub struct PmQosRequest(#[allow(dead_code, reason = "the request lives as long as the file is open")] File);

/// Asks that no processor choose an idle state that takes longer than this to wake from.
pub fn limit_wakeup_latency(latency_us: i32) -> Result<PmQosRequest, Shortfall> {
    let ask = || {
        let mut file = open_cpu_dma_latency()?;
        // Four bytes are a number in the machine's own order; more would be text.
        file.write_all(&latency_us.to_ne_bytes()).map(|()| PmQosRequest(file))
    };
    ask().map_err(|error| refusals::explained(&SetupStep::WakeupLatency, &error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn what_is_asked_for_is_in_force_until_dropped() {
        const ASKED_US: i32 = 123;
        let mut held = match limit_wakeup_latency(ASKED_US) {
            Ok(held) => held,
            Err(shortfall) => return println!("SKIPPED, as there is {shortfall}"),
        };
        // The least that any process asks for.
        let mut in_force = [0; 4];
        held.0.read_exact(&mut in_force).unwrap();
        assert!(i32::from_ne_bytes(in_force) <= ASKED_US);
    }
}
