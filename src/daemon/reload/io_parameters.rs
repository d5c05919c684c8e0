//! Parameters of the I/O thread. The real-time thread changes them with its constants, and the I/O thread reads them
//! in every round.

use core::sync::atomic::{AtomicU64, Ordering};

use crate::parameters::nanoseconds;
use hexad_core::control::supervision::in_position::InPositionWindow;
use hexad_machine::config::deployment::Deployment;

/// Parameters that a reload may change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IoParameters {
    /// Largest age of the setpoint \[ns\].
    pub setpoint_ns: u64,
    /// Largest age of the measurement \[ns\].
    pub measured_ns: u64,
    /// `limits.scale`.
    pub limits_scale: f64,
    /// Section `[in_position]`.
    pub in_position: InPositionWindow,
}

impl From<&Deployment> for IoParameters {
    fn from(deployment: &Deployment) -> Self {
        let Deployment { timeouts, limits, in_position, .. } = deployment;
        let [setpoint_ns, measured_ns] = [timeouts.setpoint_s, timeouts.measured_s].map(nanoseconds);
        Self { setpoint_ns, measured_ns, limits_scale: limits.scale, in_position: *in_position }
    }
}

/// Parameters in force. They change only while no force is valid, so a reader may load the numbers one by one.
#[derive(Debug)]
pub struct IoParametersInForce([AtomicU64; 6]);

impl IoParametersInForce {
    /// Parameters at the start.
    pub fn new(parameters: &IoParameters) -> Self {
        Self(words(parameters).map(AtomicU64::new))
    }

    /// Replaces the parameters.
    pub fn set(&self, parameters: &IoParameters) {
        self.0.iter().zip(words(parameters)).for_each(|(shared, word)| shared.store(word, Ordering::Relaxed));
    }

    /// Returns the parameters.
    pub fn get(&self) -> IoParameters {
        let [setpoint_ns, measured_ns, limits_scale, tolerance_m, tolerance_rad, settling_ns] =
            self.0.each_ref().map(|word| word.load(Ordering::Relaxed));
        let [limits_scale, tolerance_m, tolerance_rad] =
            [limits_scale, tolerance_m, tolerance_rad].map(f64::from_bits);
        let in_position = InPositionWindow { tolerance_m, tolerance_rad, settling_ns };
        IoParameters { setpoint_ns, measured_ns, limits_scale, in_position }
    }
}

fn words(parameters: &IoParameters) -> [u64; 6] {
    let IoParameters { setpoint_ns, measured_ns, limits_scale, in_position } = *parameters;
    let InPositionWindow { tolerance_m, tolerance_rad, settling_ns } = in_position;
    let [limits_scale, tolerance_m, tolerance_rad] =
        [limits_scale, tolerance_m, tolerance_rad].map(f64::to_bits);
    [setpoint_ns, measured_ns, limits_scale, tolerance_m, tolerance_rad, settling_ns]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_in_force() {
        let window = InPositionWindow { tolerance_m: 3.0, tolerance_rad: 4.0, settling_ns: 5 };
        let new = IoParameters { setpoint_ns: 1, measured_ns: 2, limits_scale: 0.25, in_position: window };
        let in_force = IoParametersInForce::new(&IoParameters::default());
        in_force.set(&new);
        assert_eq!(in_force.get(), new);
    }
}
