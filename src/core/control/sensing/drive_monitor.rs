//! Supervision of the drives by the status that their driver reports: enabled, brakes open, actual forces.
//!
//! Only what the driver reports is checked. After `engage` the platform is held at its pose until all drives
//! are ready.

use serde::{Deserialize, Serialize};

use crate::control::cycle::Cycle;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::inputs::Measurement;
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;

/// Time for which a drive that was ready may report that it is not \[s\]. One message may be wrong. A brake
/// that closes against its motor also shows in the motion.
const MAX_UNREADY_S: f64 = 0.02;

/// Time constant of the filters of commanded and actual forces \[s\]: several times the dead time of a drive,
/// so that the dead time does not count.
const FORCE_FILTER_TIME_CONSTANT_S: f64 = 0.03;
/// Plausible difference between actual and commanded force: this ratio of the command plus the next ratio of
/// the largest force. It allows for scale, offset and friction of a drive.
const FORCE_DIFFERENCE_RATIO: f64 = 0.2;
const FORCE_OFFSET_RATIO: f64 = 0.02;
/// Time for which the difference may be larger \[s\]: after a step of the command the actual force lags.
const MAX_MISSING_S: f64 = 0.05;

/// Checks of the drives' status over time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct DriveMonitor {
    /// Commands sent in the previous cycle \[N\].
    sent: [f64; LEGS],
    commanded: [f64; LEGS],
    actual: [f64; LEGS],
    /// Time for which each force has been missing \[s\].
    missing_s: [f64; LEGS],
    /// Last instant at which all drives were ready, or the start of control \[ns\].
    ready_ns: u64,
    /// Time stamp of the newest measurement \[ns\].
    measured_ns: u64,
    /// Whether all drives have been ready since control began.
    has_been_ready: bool,
    /// Whether all drives are ready, or the driver does not report it.
    pub is_ready: bool,
}

impl DriveMonitor {
    /// Checks the status of a measurement.
    #[inline(never)]
    pub fn check(&mut self, cycle: &Cycle<'_>, measurement: Option<&Measurement>) -> Result<(), Diagnostic> {
        let Some(Measurement { drives, time_ns, .. }) = measurement else { return Ok(()) };
        let dt = seconds_between(self.measured_ns, *time_ns).max(0.0);
        self.measured_ns = *time_ns;
        let unready = drives.first_unready_leg();
        self.is_ready = unready.is_none();
        if let Some(leg) = drives.first_faulty_leg() {
            return Err(Diagnostic::from(DiagnosticCode::DriveFault).at(leg));
        }
        if !cycle.state.has_control() {
            let ready_ns = cycle.release_ns;
            let Self { measured_ns, is_ready, .. } = *self;
            *self = Self { ready_ns, measured_ns, is_ready, ..Self::default() };
            return Ok(());
        }
        self.check_ready(cycle, unready)?;
        match drives.force_n.filter(|_| self.is_ready) {
            Some(force) => self.check_force(cycle.constants.machine().actuator.max_force_n, &force, dt),
            None => Ok(()),
        }
    }

    /// Records the commands that are sent in this cycle.
    pub fn record_sent(&mut self, force_n: &[f64; LEGS]) {
        self.sent = *force_n;
    }

    fn check_ready(&mut self, cycle: &Cycle<'_>, unready: Option<usize>) -> Result<(), Diagnostic> {
        let Some(leg) = unready else {
            (self.ready_ns, self.has_been_ready) = (cycle.release_ns, true);
            return Ok(());
        };
        let longest_s = cycle.constants.parameters.ready_timeout_ns as f64 * 1e-9;
        let bound_s = if self.has_been_ready { MAX_UNREADY_S } else { longest_s };
        let waited_s = seconds_between(self.ready_ns, cycle.release_ns);
        if waited_s <= bound_s {
            return Ok(());
        }
        Err(Diagnostic::new(DiagnosticCode::DriveNotReady, waited_s, bound_s).at(leg))
    }

    fn check_force(&mut self, max_force: f64, force: &[f64; LEGS], dt: f64) -> Result<(), Diagnostic> {
        // The command that the drives had in a longer gap of the messages is unknown: the comparison starts again.
        if dt > FORCE_FILTER_TIME_CONSTANT_S {
            (self.commanded, self.actual, self.missing_s) = <_>::default();
            return Ok(());
        }
        let share = dt / FORCE_FILTER_TIME_CONSTANT_S;
        let filtered = self.commanded.iter_mut().zip(&mut self.actual).zip(&mut self.missing_s);
        for (leg, (((commanded, actual), missing_s), (sent, force))) in
            filtered.zip(self.sent.iter().zip(force)).enumerate()
        {
            *commanded += (sent - *commanded) * share;
            *actual += (force - *actual) * share;
            let difference = (*commanded - *actual).abs();
            let bound = FORCE_OFFSET_RATIO * max_force + FORCE_DIFFERENCE_RATIO * commanded.abs();
            *missing_s = if difference <= bound { 0.0 } else { *missing_s + dt };
            if *missing_s > MAX_MISSING_S {
                return Err(Diagnostic::new(DiagnosticCode::DriveForceMissing, difference, bound).at(leg));
            }
        }
        Ok(())
    }
}
