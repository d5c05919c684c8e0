//! Detection of faults that end control, and of the end of the window around each.

use hexad_client::messages::CycleMessage;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::State;

/// Detector of the cycles of faults.
pub struct FaultWatch {
    /// Cycles after a fault that belong to its window: one second.
    after: u64,
    last: u32,
    /// Code and cycle of the fault whose window is not written yet.
    fault: Option<(u32, u64)>,
    newest: u64,
}

impl FaultWatch {
    /// Detector with windows that end `after` cycles after their fault.
    pub fn new(after: u64) -> Self {
        Self { after, last: 0, fault: None, newest: 0 }
    }

    /// Adds a cycle.
    pub fn add(&mut self, cycle: &CycleMessage) {
        let code = cycle.diagnostic.code;
        self.newest = cycle.cycle;
        // A diagnostic is a fault only if it ends control.
        let ends_control = [State::Stopping, State::Fault].iter().any(|state| *state as u32 == cycle.state);
        let is_fault = DiagnosticCode::from_number(code).is_some_and(DiagnosticCode::is_fault);
        if code != self.last && is_fault && ends_control && self.fault.is_none() {
            self.fault = Some((code, cycle.cycle));
        }
        self.last = code;
    }

    /// Code and cycle of a fault whose window is complete, or incomplete because the run ends. Returned once.
    pub fn due(&mut self, is_ending: bool) -> Option<(u32, u64)> {
        let is_complete = |(_, cycle): &(u32, u64)| is_ending || self.newest >= cycle + self.after;
        let due = self.fault.filter(is_complete);
        if due.is_some() {
            self.fault = None;
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_client::messages::DiagnosticRecord;

    #[test]
    fn each_fault_that_ends_control_is_due_once_when_its_window_is_complete() {
        let mut watch = FaultWatch::new(200);
        let mut due = vec![];
        for cycle in 1..=9000 {
            let code = match cycle {
                3000..3500 => DiagnosticCode::FollowingError,
                8950.. => DiagnosticCode::MeasurementLost,
                _ => DiagnosticCode::None,
            };
            // The same diagnostic without control is no fault.
            let state = if (100..200).contains(&cycle) { State::Off } else { State::Stopping };
            let code = if state == State::Off { DiagnosticCode::MeasurementLost } else { code };
            let diagnostic = DiagnosticRecord { code: code as u32, ..DiagnosticRecord::default() };
            watch.add(&CycleMessage { cycle, state: state as u32, diagnostic, ..CycleMessage::default() });
            due.extend(watch.due(false).map(|fault| (cycle, fault)));
        }
        due.extend(watch.due(true).map(|fault| (9000, fault)));
        assert_eq!(due, [(3200, (108, 3000)), (9000, (101, 8950))]);
    }
}
