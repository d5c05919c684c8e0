//! Comparison of the clock that stamps measurements with the daemon's clock, if the stamps release the
//! cycles.
//!
//! With external release every age is computed from stamps alone. If they were frozen or slow, no measurement
//! would ever be too old. Therefore the offset between the two clocks is tracked, no faster than clocks
//! drift. A stamp that deviates from the tracked offset is a fault.

use serde::{Deserialize, Serialize};

use crate::control::cycle::Cycle;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};

/// Largest drift of the offset, as a ratio of the time: a hundred times the drift of two crystals. Frozen and
/// doubled stamps drift by the whole time.
const MAX_DRIFT: f64 = 0.01;

/// Tracked offset between the clocks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct StampClockOffset {
    /// Clock of the stamps minus the daemon's clock, as tracked \[ns\].
    offset_ns: i64,
    /// The daemon's clock at the last cycle \[ns\].
    daemon_clock_ns: u64,
}

impl StampClockOffset {
    /// Compares the offset of this cycle \[ns\] with the tracked one. Without control it is only tracked: a
    /// larger offset, which the freshest message has, is taken over at once.
    pub fn check(&mut self, cycle: &Cycle<'_>, offset_ns: i64) -> Result<(), Diagnostic> {
        let bound_ns = cycle.constants.parameters.measured_timeout_ns;
        let daemon_clock_ns = cycle.release_ns.wrapping_sub(offset_ns as u64);
        let drift_ns = (MAX_DRIFT * daemon_clock_ns.saturating_sub(self.daemon_clock_ns) as f64) as i64;
        self.daemon_clock_ns = daemon_clock_ns;
        let deviation_ns = offset_ns.saturating_sub(self.offset_ns);
        let is_beyond = deviation_ns.unsigned_abs() > bound_ns;
        if !cycle.state.has_control() && (is_beyond || deviation_ns > 0) {
            self.offset_ns = offset_ns;
            return Ok(());
        }
        let step_ns = deviation_ns.max(-drift_ns).min(drift_ns);
        self.offset_ns = self.offset_ns.saturating_add(step_ns);
        if !is_beyond {
            return Ok(());
        }
        let [deviation_s, bound_s] = [deviation_ns as f64, bound_ns as f64].map(|ns| ns * 1e-9);
        Err(Diagnostic::new(DiagnosticCode::StampClockInvalid, deviation_s, bound_s))
    }
}
