//! PM QoS request for the wake-up latency of processors: deeper idle states take longer to leave.
//!
//! `/dev/cpu_dma_latency`, see the kernel's `Documentation/power/pm_qos_interface.rst`.

use std::fs::File;
use std::io::Write;

use super::permissions::open_cpu_dma_latency;
use super::refusals::SetupStep;
use super::{Shortfall, refusals};

/// PM QoS request to the kernel, in force until it is dropped or the process ends.
#[derive(Debug)]
pub struct PmQosRequest(#[allow(dead_code, reason = "the request lives as long as the file is open")] File);

/// Requests that no processor enter an idle state with a longer wake-up latency.
pub fn limit_wakeup_latency(latency_us: i32) -> Result<PmQosRequest, Shortfall> {
    let request = || {
        let mut file = open_cpu_dma_latency()?;
        // Four bytes are a number in the machine's own order; more would be text.
        file.write_all(&latency_us.to_ne_bytes()).map(|()| PmQosRequest(file))
    };
    request().map_err(|error| refusals::explained(&SetupStep::WakeupLatency, &error))
}
