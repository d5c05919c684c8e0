//! Tests of setpoints between validation and reference: an invalid setpoint is no target, and a gap gives no
//! jerk.

use crate::control::cycle::Cycle;
use crate::control::law::error_tracker::setpoint_error;
use crate::control::sensing::localization::{Located, PlatformState};
use crate::control::setpoint::motion::SetpointMotion;
use crate::control::setpoint::pose_samples::PoseSamples;
use crate::control::setpoint::target::Target;
use crate::control::setpoint::validated::ValidatedSetpoint;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::PoseError;
use crate::control::signals::inputs::{Measurement, Setpoint};
use crate::control::signals::limits::LimitSet;
use crate::control::signals::state::State;
use crate::control::tests::*;
use crate::model::rigid::Twist;
use crate::model::task::TaskState;

const MS: u64 = 1_000_000;

#[test]
fn a_setpoint_that_is_not_valid_is_neither_approached_nor_compared_with() {
    let machine = machine(&mut RandomVectors::new(73));
    let constants = Constants::new(&machine, parameters(&machine));
    let motion = SetpointMotion::new(Setpoint::motion(0, TaskState::at_rest(machine.home)));
    let samples = PoseSamples::default();
    let measurement = Measurement::default();
    let platform = PlatformState {
        pose: *constants.home.pose(),
        twist: Twist::default(),
        condition: 2.0,
        time_to_singularity: f64::INFINITY,
    };
    let located = Located { measurement: &measurement, rate: [0.0; LEGS], platform };
    let lost = Err(Diagnostic::from(DiagnosticCode::HoldingPose));
    for (status, is_valid) in [(Ok(()), true), (lost, false)] {
        let setpoint = ValidatedSetpoint {
            valid: Some(&motion),
            target: Some(Target::of_setpoint(&motion, &samples)),
            follow_check: status,
            active_limits: LimitSet::default(),
        };
        for state in [State::Engaging, State::Active] {
            assert_eq!(setpoint.target_in(&constants, state).is_some(), is_valid, "{state:?}");
        }
        assert!(setpoint.target_in(&constants, State::Stopping).is_none());
        assert!(setpoint.target_in(&constants, State::Parking).is_some());
        let cycle = Cycle { constants: &constants, release_ns: 0, state: State::Standby };
        let error = setpoint_error(&cycle, &setpoint, &located);
        assert_eq!(error, is_valid.then(PoseError::default));
    }
}

/// The accelerations are at most 25 ms apart, in the order of their stamps.
#[test]
fn the_jerk_of_a_setpoint_is_that_of_motions_without_a_gap() {
    let machine = machine(&mut RandomVectors::new(73));
    let parameters = parameters(&machine);
    let motion = |time_ns: u64, acceleration: f64| {
        let mut task = TaskState::at_rest(machine.home);
        task.xdd[3] = acceleration;
        SetpointMotion::new(Setpoint::motion(time_ns, task))
    };
    for (dt_ms, has_jerk) in [(0, false), (1, true), (25, true), (26, false), (1000, false), (-1, false)] {
        let before = motion(5000 * MS, 0.0);
        let mut next = motion((5000 * MS).saturating_add_signed(dt_ms * 1_000_000), 0.05);
        next.set_jerk_from_previous(&parameters, Some(&before));
        let after = next.continued(1e-3);
        let change = after.acceleration.linear.x - 0.05;
        let jerk = if has_jerk { 0.05 / (dt_ms as f64 * 1e-3) } else { 0.0 };
        assert!((change - 1e-3 * jerk).abs() < 1e-9, "{dt_ms}: {change}");
    }
}
