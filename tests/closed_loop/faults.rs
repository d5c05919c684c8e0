//! Every reason not to control, and that there is never a force with one.

use hexad::control::controller::{Controller, Input, Output};
use hexad::control::state::{Cause, State};
use hexad::model::task::TaskState;

use super::common::deployed;
use super::rig::{Rig, in_motion, parameters};

/// Asserts that an output has this cause and no force.
pub fn assert_without_force(output: &Output, cause: Cause) {
    assert_eq!((output.state, output.cause), (State::Waiting, cause));
    assert_eq!(output.force.map(f64::to_bits), [0; 6]);
    assert!(!output.limited);
}

/// What becomes of control when one cycle's input is changed, and of the good cycle after it.
pub fn after(change: impl FnOnce(&mut Input)) -> (Output, Output) {
    let (mut rig, task) = in_motion(&deployed("fried2008"));
    let good = rig.input(&task);
    let mut input = good;
    change(&mut input);
    let output = rig.controller.step(&input);
    (output, rig.controller.step(&good))
}

/// A change that takes control away; it comes back with the next good cycle.
fn lost(cause: Cause, change: impl FnOnce(&mut Input)) {
    let (output, next) = after(change);
    assert_without_force(&output, cause);
    assert_eq!((next.state, next.cause), (State::Active, Cause::None), "after {cause:?}");
}

fn at_rest(task: &TaskState) -> TaskState {
    TaskState::at_rest(task.x.into())
}

#[test]
fn nothing_changed_nothing_lost() {
    let (output, next) = after(|_| {});
    assert_eq!([output.state, next.state], [State::Active; 2]);
    assert!(output.force.iter().all(|force| *force != 0.0));
}

#[test]
fn without_messages_the_controller_waits() {
    let config = deployed("fried2008");
    let mut rig = Rig::new(&config, &config.machine);
    let full = rig.input(&TaskState::at_rest(config.machine.home));
    assert_without_force(&rig.controller.step(&Input::default()), Cause::NoMeasurement);
    assert_without_force(&rig.controller.step(&Input { measurement: None, ..full }), Cause::NoMeasurement);
    let output = rig.controller.step(&Input { setpoint: None, ..full });
    assert_without_force(&output, Cause::NoSetpoint);
    assert!(output.measured.is_some() && output.error.is_none(), "it knows the pose all the same");
    assert!(![Cause::NoMeasurement, Cause::NoSetpoint].iter().any(|cause| cause.is_fault()));
    assert_eq!(rig.controller.step(&full).state, State::Active);
    lost(Cause::NoSetpoint, |input| input.setpoint = None);
    lost(Cause::NoMeasurement, |input| input.measurement = None);
}

#[test]
fn control_begins_only_near_the_setpoint() {
    let config = deployed("fried2008");
    let parameters = parameters(&config);
    for (axis, tolerance) in [
        (0, parameters.engage_orientation),
        (1, parameters.engage_orientation),
        (2, parameters.engage_orientation),
        (3, parameters.engage_position),
        (4, parameters.engage_position),
        (5, parameters.engage_position),
    ] {
        for sign in [1.0, -1.0] {
            let mut rig = Rig::new(&config, &config.machine);
            let mut task = TaskState::at_rest(config.machine.home);
            task.x[axis] += sign * 1.001 * tolerance;
            let far = rig.input(&task);
            for _ in 0..3 {
                assert_without_force(&rig.controller.step(&far), Cause::SetpointTooFar);
            }
            task.x[axis] -= sign * 0.002 * tolerance;
            assert_eq!(rig.controller.step(&rig.input(&task)).state, State::Active);
            // In control, an error beyond the tolerance is what the law is for.
            assert_eq!(rig.controller.step(&far).state, State::Active);
        }
    }
    assert!(!Cause::SetpointTooFar.is_fault());
}

#[test]
fn a_setpoint_lost_in_motion_is_a_fault_and_one_that_ended_at_rest_is_not() {
    let timeout_ns = parameters(&deployed("fried2008")).setpoint_timeout_ns;
    let old = |input: &mut Input, age_ns: u64| {
        input.setpoint.as_mut().unwrap().time_ns = input.release_ns - age_ns;
    };
    lost(Cause::SetpointLost, |input| old(input, timeout_ns + 1));
    assert!(Cause::SetpointLost.is_fault() && !Cause::SetpointEnded.is_fault());
    assert_eq!(after(|input| old(input, timeout_ns)).0.state, State::Active, "to the last nanosecond");
    lost(Cause::SetpointEnded, |input| {
        old(input, timeout_ns + 1);
        let task = &mut input.setpoint.as_mut().unwrap().task;
        *task = at_rest(task);
    });
    for k in 0..6 {
        // A single rate or acceleration is motion, in either direction.
        for sign in [1.0, -1.0] {
            lost(Cause::SetpointLost, |input| {
                old(input, timeout_ns + 1);
                let task = &mut input.setpoint.as_mut().unwrap().task;
                *task = at_rest(task);
                task.xd[k] = sign * 1e-9;
            });
            lost(Cause::SetpointLost, |input| {
                old(input, timeout_ns + 1);
                let task = &mut input.setpoint.as_mut().unwrap().task;
                *task = at_rest(task);
                task.xdd[k] = sign * 1e-9;
            });
        }
    }
}

#[test]
fn a_platform_off_the_path_is_a_fault() {
    let parameters = parameters(&deployed("fried2008"));
    assert!(Cause::OffPath.is_fault());
    let jumps = |input: &mut Input, k: usize, share: f64| {
        let limit = if k < 3 { parameters.following_orientation } else { parameters.following_position };
        input.setpoint.as_mut().unwrap().task.x[k] += share * limit;
    };
    // Alpha turns about a base axis whatever the pose; the other angles need a little more.
    for k in 0..6 {
        lost(Cause::OffPath, |input| jumps(input, k, 1.05));
        assert_eq!(after(|input| jumps(input, k, 0.95)).0.state, State::Active);
    }
}

#[test]
fn an_old_measurement_is_lost() {
    let timeout_ns = parameters(&deployed("fried2008")).measured_timeout_ns;
    let old = |input: &mut Input, age_ns: u64| {
        input.measurement.as_mut().unwrap().time_ns = input.release_ns - age_ns;
    };
    lost(Cause::MeasurementLost, |input| old(input, timeout_ns + 1));
    assert!(Cause::MeasurementLost.is_fault());
    assert_eq!(after(|input| old(input, timeout_ns)).0.state, State::Active, "to the last nanosecond");
}

#[test]
fn time_stamps_from_another_world_are_lost() {
    for time_ns in [0, 1, u64::MAX / 2, u64::MAX / 2 + 1, u64::MAX - 1, u64::MAX] {
        lost(Cause::MeasurementLost, |input| input.measurement.as_mut().unwrap().time_ns = time_ns);
        lost(Cause::SetpointLost, |input| input.setpoint.as_mut().unwrap().time_ns = time_ns);
        lost(Cause::MeasurementLost, |input| input.release_ns = time_ns);
    }
    let far = |input: &mut Input, beyond: u64| {
        let timeout_ns = parameters(&deployed("fried2008")).setpoint_timeout_ns;
        input.setpoint.as_mut().unwrap().time_ns = input.release_ns + timeout_ns + beyond;
    };
    lost(Cause::SetpointLost, |input| far(input, 1));
}

/// At the end of time nothing overflows.
#[test]
fn the_last_cycle_of_all_is_a_cycle() {
    let config = deployed("fried2008");
    let rig = Rig::new(&config, &config.machine);
    let mut input = rig.input(&TaskState::at_rest(config.machine.home));
    input.release_ns = u64::MAX;
    input.measurement.as_mut().unwrap().time_ns = u64::MAX;
    input.setpoint.as_mut().unwrap().time_ns = u64::MAX;
    let output = Controller::new(&config.machine, parameters(&config)).step(&input);
    assert_eq!(output.state, State::Active);
}

#[test]
fn what_is_not_finite_is_refused_wherever_it_stands() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..6 {
            lost(Cause::MeasurementNotFinite, |input| input.measurement.as_mut().unwrap().length[k] = value);
            lost(Cause::MeasurementNotFinite, |input| input.measurement.as_mut().unwrap().rate[k] = value);
            lost(Cause::SetpointNotFinite, |input| input.setpoint.as_mut().unwrap().task.x[k] = value);
            lost(Cause::SetpointNotFinite, |input| input.setpoint.as_mut().unwrap().task.xd[k] = value);
            lost(Cause::SetpointNotFinite, |input| input.setpoint.as_mut().unwrap().task.xdd[k] = value);
        }
    }
}

/// Finite numbers too large to compute with: which step fails first is of no interest.
#[test]
fn what_overflows_is_refused() {
    let changes: [fn(&mut Input); 4] = [
        |input| input.measurement.as_mut().unwrap().rate[2] = 1e300,
        |input| input.measurement.as_mut().unwrap().length[0] = 1e300,
        |input| input.measurement.as_mut().unwrap().length[5] = -f64::MAX,
        |input| input.setpoint.as_mut().unwrap().task.xdd[4] = f64::MAX,
    ];
    for (k, change) in changes.into_iter().enumerate() {
        let (output, _) = after(change);
        assert_without_force(&output, output.cause);
        assert!(output.cause.is_fault(), "{k}: {:?}", output.cause);
    }
}
