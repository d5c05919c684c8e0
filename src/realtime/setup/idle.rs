//! Idle states of processors: the deeper one sleeps, the longer it takes to wake.

extern crate std;

use std::fs::File;
use std::io::Write;
use std::prelude::rust_2024::*;

use super::Shortfall;
use super::permissions::open_cpu_dma_latency;
use super::refusals::{self, Step};

/// A request to the kernel; it holds until this is dropped or the process ends, however that comes about.
#[derive(Debug)]
pub struct ShallowSleep(#[allow(dead_code, reason = "the request lives as long as the file is open")] File);

/// Asks that no processor choose an idle state that takes longer than this to wake from.
pub fn bound_wakeup(latency_us: i32) -> Result<ShallowSleep, Shortfall> {
    let ask = || {
        let mut file = open_cpu_dma_latency()?;
        // Four bytes are a number in the machine's own order; more would be text.
        file.write_all(&latency_us.to_ne_bytes()).map(|()| ShallowSleep(file))
    };
    ask().map_err(|error| refusals::explained(&Step::ShallowSleep, &error))
}
