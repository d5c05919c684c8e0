//! Checks of setpoints, each alone: what it accepts just within its bound and refuses just beyond it.

use hexad::control::parameters::{Envelope, Parameters};
use hexad::control::setpoint::motion::SetpointMotion;
use hexad::control::setpoint::validation::check_setpoint;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Setpoint;
use hexad::control::signals::limits::LimitSet;
use hexad::control::signals::state::{Request, State};
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::task::TaskState;

use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

#[test]
fn a_setpoint_is_checked_against_each_limit() {
    let config = deployed("motion_base");
    let home = TaskState::at_rest(config.machine.home);
    let wide = Parameters { envelope: None, ..parameters(&config) };
    let check = |machine: &_, parameters: &Parameters, task: TaskState| {
        let setpoint = SetpointMotion::new(Setpoint::motion(0, task));
        check_setpoint(machine, parameters, &setpoint, &mut LimitSet::default()).map_err(|found| found.code)
    };
    for axis in 0..6 {
        let limits = if axis < 3 { wide.limits.orientation } else { wide.limits.position };
        for (share, result) in [(0.99, Ok(())), (1.01, Err(DiagnosticCode::SetpointTooFast))] {
            let mut fast = home;
            fast.xd[axis] = share * limits.velocity;
            let mut machine = config.machine.clone();
            machine.actuator.max_rate_m_s = 1e3;
            assert_eq!(check(&machine, &wide, fast), result, "velocity {axis}");
            let rates = leg_motion(&machine, &fast.motion()).rate_m_s;
            machine.actuator.max_rate_m_s =
                rates.iter().fold(0.0_f64, |most, rate| most.max(rate.abs())) / share;
            fast.xd[axis] *= 0.99 / share;
            machine.actuator.max_rate_m_s *= 0.99 / share;
            assert_eq!(check(&machine, &wide, fast), result, "leg rate {axis}");
            let mut hard = home;
            hard.xdd[axis] = share * limits.acceleration;
            assert_eq!(check(&config.machine, &wide, hard), result, "acceleration {axis}");
        }
    }
    let lengths = leg_motion(&config.machine, &home.motion()).length_m;
    let longest = lengths.iter().fold(0.0_f64, |most, length| most.max(*length));
    let shortest = lengths.iter().fold(f64::INFINITY, |least, length| least.min(*length));
    assert!(wide.stroke_margin_m > 1e-3);
    for (share, result) in [(1.01, Ok(())), (0.99, Err(DiagnosticCode::SetpointOutOfReach))] {
        let mut machine = config.machine.clone();
        machine.actuator.max_length_m = longest + share * wide.stroke_margin_m;
        assert_eq!(check(&machine, &wide, home), result, "long {share}");
        let mut machine = config.machine.clone();
        machine.actuator.min_length_m = shortest - share * wide.stroke_margin_m;
        assert_eq!(check(&machine, &wide, home), result, "short {share}");
    }
    // A range without width is kept by its one value.
    let x = home.x.into();
    let locked = Parameters { envelope: Some(Envelope { lowest: x, highest: x }), ..wide };
    assert_eq!(check(&config.machine, &locked, home), Ok(()));
}

#[test]
fn a_setpoint_that_is_not_newer_is_refused() {
    let config = deployed("motion_base");
    let home = TaskState::at_rest(config.machine.home);
    let mut rig = Rig::new(&config, &config.machine);
    rig.engage(&home);
    let last = rig.input(&home).setpoint.unwrap();
    let mut output = rig.cycle(&rig.input(&home));
    for k in 0..200 {
        let mut input = rig.input(&home);
        let mut setpoint = last;
        setpoint.task.x[3] += 1e-9 * f64::from(k + 1);
        input.setpoint = Some(setpoint);
        let before = output.missed_setpoints;
        output = rig.cycle(&input);
        assert_eq!(output.missed_setpoints, before + 1, "{k}");
        if output.state != State::Active {
            break;
        }
    }
    assert_eq!(
        (output.state, output.diagnostic.code),
        (State::Stopping, DiagnosticCode::SetpointStampInvalid)
    );
}

/// While the platform engages a setpoint may jump by the engage tolerance, and no further.
#[test]
fn a_jump_while_engaging_is_refused_beyond_the_tolerance() {
    let config = deployed("motion_base");
    let home = TaskState::at_rest(config.machine.home);
    let tolerance = parameters(&config).engage_position_m;
    for (share, missed) in [(0.99, 0), (1.01, 1)] {
        let mut rig = Rig::new(&config, &config.machine);
        let mut near = home;
        near.x[3] += 0.9 * tolerance;
        rig.ask(Request::Engage);
        let before = rig.cycle(&rig.input(&near));
        let mut far = near;
        far.x[3] += share * tolerance;
        let output = rig.cycle(&rig.input(&far));
        assert_eq!([before.state, output.state], [State::Engaging; 2]);
        assert_eq!(output.missed_setpoints - before.missed_setpoints, missed, "{share}");
    }
}

/// There is one examination in a cycle: in the first under control the reference follows the stop that was verified to begin.
#[test]
fn the_reference_moves_from_the_second_cycle_under_control_on() {
    let config = deployed("motion_base");
    let mut near = TaskState::at_rest(config.machine.home);
    near.x[3] += 0.5 * parameters(&config).engage_position_m;
    let mut rig = Rig::new(&config, &config.machine);
    rig.ask(Request::Engage);
    let [first, second] = [0; 2].map(|_| rig.cycle(&rig.input(&near)).reference.unwrap());
    assert_eq!(first.acceleration.linear.norm(), 0.0);
    assert!(second.acceleration.linear.norm() > 0.0);
}
