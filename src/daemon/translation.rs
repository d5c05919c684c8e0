//! Between messages and what the loop takes and gives.

use super::cycle::CycleOutput;
use crate::control::controller::{Measurement, Output};
use crate::messages::structs::{ForceMessage, MeasuredMessage, StatusMessage};
use crate::model::task::task_coordinates;

/// What a driver measured.
pub(super) fn measurement(message: &MeasuredMessage) -> Measurement {
    Measurement { time_ns: message.header.time_ns, length: message.length_m, rate: message.length_rate_m_s }
}

/// What the drives are to do.
pub(super) fn force_message(cycle: &CycleOutput) -> ForceMessage {
    let Output { state, diagnostic, force, active_limits, .. } = cycle.output;
    ForceMessage {
        force_n: force,
        valid: u32::from(state.has_control()),
        state: state as u32,
        fault: diagnostic.code as u32,
        limiting: active_limits.0,
        release_ns: cycle.release_ns,
        ..ForceMessage::default()
    }
}

/// What there is to know of a cycle. Statistics and counts of the io thread are not in it.
pub(super) fn status_message(home: &[f64; 6], cycle: &CycleOutput) -> StatusMessage {
    let CycleOutput { output, counters, .. } = cycle;
    let mut message = StatusMessage {
        state: output.state as u32,
        fault: output.diagnostic.code as u32,
        refused: output.request_diagnostic.code as u32,
        limiting: output.active_limits.0,
        fault_value: output.diagnostic.value,
        fault_bound: output.diagnostic.bound,
        fault_index: output.diagnostic.index,
        without_measurement: output.missed_measurements,
        without_setpoint: output.missed_setpoints,
        wrench_error: output.wrench_error.vector().into(),
        answered_epoch: output.answered.0,
        answered_sequence: output.answered.1,
        cycles: counters.cycles,
        late_wakeups: counters.late_wakeups,
        overruns: counters.overruns,
        skipped: counters.skipped,
        caught_up: counters.caught_up,
        allocations: counters.allocations,
        ..StatusMessage::default()
    };
    if let Some(platform) = &output.platform {
        message.pose_valid = 1;
        message.x = task_coordinates(&platform.pose, home);
        message.twist = platform.twist.vector().into();
        message.condition = platform.condition;
        message.singular_in_s = platform.time_to_singularity;
    }
    if let Some(error) = &output.error {
        message.error_valid = 1;
        message.position_error_m = error.pose.linear.into();
        message.orientation_error_rad = error.pose.angular.into();
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::diagnostic::{Diagnostic, DiagnosticCode};
    use crate::control::limits::LimitSet;
    use crate::control::localization::PlatformState;
    use crate::control::state::State;
    use crate::control::tracking_error::TrackingError;
    use crate::model::rigid::{Twist, Wrench};
    use crate::model::task::TaskState;
    use crate::realtime::cyclic::Counters;
    use nalgebra::Vector6;

    const HOME: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];

    fn six(first: f64) -> [f64; 6] {
        core::array::from_fn(|k| first + k as f64)
    }

    /// No two numbers are alike.
    fn cycle() -> CycleOutput {
        let twist = |first: f64| Twist::from_vector(&Vector6::from(six(first)));
        let output = Output {
            state: State::Active,
            diagnostic: Diagnostic { code: DiagnosticCode::SetpointTooFar, value: 1.0, bound: 2.0, index: 3 },
            answered: (4, 5),
            request_diagnostic: DiagnosticCode::InvalidInState.into(),
            force: six(10.0),
            wrench_error: Wrench::from_vector(&Vector6::from(six(20.0))),
            active_limits: LimitSet(6),
            missed_measurements: 7,
            missed_setpoints: 8,
            platform: Some(PlatformState {
                pose: TaskState::at_rest(HOME).motion().pose,
                twist: twist(30.0),
                condition: 50.0,
                time_to_singularity: 51.0,
            }),
            error: Some(TrackingError { pose: twist(60.0), twist: twist(70.0) }),
        };
        let counters = Counters {
            cycles: 80,
            late_wakeups: 81,
            overruns: 82,
            skipped: 83,
            caught_up: 84,
            allocations: 85,
            ..Counters::default()
        };
        CycleOutput { due_ns: 90, release_ns: 91, output, counters }
    }

    #[test]
    fn a_status_says_what_the_cycle_said() {
        let message = status_message(&HOME, &cycle());
        let numbers = [message.state, message.fault, message.refused, message.limiting, message.fault_index];
        let said = [
            State::Active as u32,
            DiagnosticCode::SetpointTooFar as u32,
            DiagnosticCode::InvalidInState as u32,
            6,
            3,
        ];
        assert_eq!(numbers, said);
        assert_eq!([message.fault_value, message.fault_bound], [1.0, 2.0]);
        assert_eq!([message.answered_epoch, message.answered_sequence], [4, 5]);
        assert_eq!([message.without_measurement, message.without_setpoint], [7, 8]);
        assert_eq!([message.condition, message.singular_in_s], [50.0, 51.0]);
        assert_eq!([message.wrench_error, message.twist], [six(20.0), six(30.0)]);
        assert_eq!([message.pose_valid, message.error_valid], [1, 1]);
        assert!(message.x.iter().zip(HOME).all(|(x, home)| (x - home).abs() < 1e-12), "{:?}", message.x);
        assert_eq!(
            [message.orientation_error_rad, message.position_error_m],
            [[60.0, 61.0, 62.0], [63.0, 64.0, 65.0]]
        );
        let counts = [message.cycles, message.late_wakeups, message.overruns, message.skipped];
        assert_eq!((counts, message.caught_up, message.allocations), ([80, 81, 82, 83], 84, 85));
        let nothing = CycleOutput { output: Output::default(), ..cycle() };
        let message = status_message(&HOME, &nothing);
        assert_eq!([message.pose_valid, message.error_valid], [0, 0]);
    }

    #[test]
    fn a_force_is_valid_only_under_control() {
        let mut cycle = cycle();
        let message = force_message(&cycle);
        let numbers = [message.valid, message.state, message.fault, message.limiting];
        assert_eq!(numbers, [1, State::Active as u32, DiagnosticCode::SetpointTooFar as u32, 6]);
        assert_eq!((message.force_n, message.release_ns), (six(10.0), 91));
        for state in State::ALL {
            cycle.output.state = state;
            assert_eq!(force_message(&cycle).valid, u32::from(state.has_control()), "{state:?}");
        }
    }

    #[test]
    fn a_measurement_is_that_of_the_message() {
        let mut message =
            MeasuredMessage { length_m: six(1.0), length_rate_m_s: six(7.0), ..Default::default() };
        message.header.time_ns = 42;
        assert_eq!(measurement(&message), Measurement { time_ns: 42, length: six(1.0), rate: six(7.0) });
    }
}
