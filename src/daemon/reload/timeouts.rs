//! Timeouts of messages. The real-time thread changes them with its constants, and the I/O thread reads them
//! in every round.

use core::sync::atomic::{AtomicU64, Ordering};

use crate::config::deployment::Timeouts;
use crate::daemon::parameters::nanoseconds;

/// Section `[timeouts]` \[ns\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeoutsNs {
    /// Largest age of the setpoint.
    pub setpoint_ns: u64,
    /// Largest age of the measurement.
    pub measured_ns: u64,
}

impl From<&Timeouts> for TimeoutsNs {
    fn from(timeouts: &Timeouts) -> Self {
        let [setpoint_ns, measured_ns] = [timeouts.setpoint_s, timeouts.measured_s].map(nanoseconds);
        Self { setpoint_ns, measured_ns }
    }
}

/// Timeouts in force. They change only while no force is valid, so a reader may load the two numbers separately.
#[derive(Debug)]
pub struct MessageTimeouts {
    setpoint_ns: AtomicU64,
    measured_ns: AtomicU64,
}

impl MessageTimeouts {
    /// Timeouts at the start.
    pub fn new(TimeoutsNs { setpoint_ns, measured_ns }: TimeoutsNs) -> Self {
        Self { setpoint_ns: AtomicU64::new(setpoint_ns), measured_ns: AtomicU64::new(measured_ns) }
    }

    /// Replaces the timeouts.
    pub fn set(&self, TimeoutsNs { setpoint_ns, measured_ns }: TimeoutsNs) {
        self.setpoint_ns.store(setpoint_ns, Ordering::Relaxed);
        self.measured_ns.store(measured_ns, Ordering::Relaxed);
    }

    /// Returns the timeouts.
    pub fn get(&self) -> TimeoutsNs {
        let [setpoint_ns, measured_ns] =
            [&self.setpoint_ns, &self.measured_ns].map(|age_ns| age_ns.load(Ordering::Relaxed));
        TimeoutsNs { setpoint_ns, measured_ns }
    }
}
