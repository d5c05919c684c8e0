//! Tests of setpoints between validation and reference: an invalid setpoint is no target, and a gap gives no
//! jerk.

use crate::control::tests::*;

#[test]
fn a_setpoint_that_is_not_valid_is_neither_approached_nor_compared_with() {
    let machine = machine(&mut RandomVectors::new(73));
    let constants = Constants::new(&machine, parameters(&machine));
    let motion = SetpointMotion::new(Setpoint::motion(0, TaskState::at_rest(machine.home)));
    let samples = PoseSamples::default();
    let measurement = Measurement::default();
    let located = located(&measurement, *constants.home.pose(), Twist::default());
    let lost = Err(Diagnostic::from(DiagnosticCode::HoldingPose));
    for (status, is_valid) in [(Ok(()), true), (lost, false)] {
        let setpoint = ValidatedSetpoint {
            valid: Some(&motion),
            target: Some(Target::of_setpoint(&motion, &samples)),
            follow_check: status,
            active_limits: LimitSet::default(),
            keeps_limits: true,
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
