//! Largest ages of messages, which the real-time thread changes with its constants and the I/O thread reads in every round.

use core::sync::atomic::{AtomicU64, Ordering};

use crate::config::deployment::Timeouts;
use crate::daemon::parameters::nanoseconds;

/// `[timeouts]` \[ns\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeoutsNs {
    /// Of the setpoint.
    pub setpoint_ns: u64,
    /// Of the measurement.
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
    /// Those of the start.
    pub fn new(TimeoutsNs { setpoint_ns, measured_ns }: TimeoutsNs) -> Self {
        Self { setpoint_ns: AtomicU64::new(setpoint_ns), measured_ns: AtomicU64::new(measured_ns) }
    }

    /// Puts others in force.
    pub fn set(&self, TimeoutsNs { setpoint_ns, measured_ns }: TimeoutsNs) {
        self.setpoint_ns.store(setpoint_ns, Ordering::Relaxed);
        self.measured_ns.store(measured_ns, Ordering::Relaxed);
    }

    /// Those in force.
    pub fn get(&self) -> TimeoutsNs {
        let [setpoint_ns, measured_ns] =
            [&self.setpoint_ns, &self.measured_ns].map(|age_ns| age_ns.load(Ordering::Relaxed));
        TimeoutsNs { setpoint_ns, measured_ns }
    }
}
