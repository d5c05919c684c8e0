//! Snapshot of the daemon for the control thread, written by the I/O thread after each cycle.

use hexad_client::messages::{LoopTimes, Rejection, StatusMessage};
use hexad_core::control::signals::diagnostic::Diagnostic;
use hexad_core::control::signals::inputs::{Measurement, Publishers, Setpoint};
use hexad_core::model::LEGS;

/// Newest published cycle, with its inputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Snapshot {
    /// Status of the cycle, without header.
    pub status: StatusMessage,
    /// Times of the last complete second.
    pub window: LoopTimes,
    /// Forces \[N\]; zero unless the state has control.
    pub command_n: [f64; LEGS],
    /// CLOCK_MONOTONIC instant at which it was published \[ns\]; 0 before the first cycle.
    pub time_ns: u64,
    /// The newest setpoint; `None` if none ever arrived.
    pub setpoint: Option<Setpoint>,
    /// The newest measurement; `None` if none ever arrived.
    pub measurement: Option<Measurement>,
    /// Processes that publish setpoints.
    pub setpoint_publishers: Publishers,
    /// Processes that publish measurements.
    pub measured_publishers: Publishers,
    /// Reasons why messages were rejected independently of their content, of setpoints and of measurements.
    pub setpoint_rejection: Option<Rejection>,
    pub measured_rejection: Option<Rejection>,
    /// The last request word that was carried out or refused; 0 if none ever was.
    pub answered: u64,
    /// Reason why that request was refused; code `None` if it was carried out.
    pub refusal: Diagnostic,
}
