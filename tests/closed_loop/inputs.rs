//! Which inputs count: what it takes to begin, and that one wrong message changes nothing.

use std::sync::LazyLock;

use hexad::control::controller::{Controller, Output};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{Request, State};
use hexad::model::kinematic_state::KinematicState;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::rig::{Rig, in_motion, parameters};
use hexad_support::{deployed, largest};

/// Asserts a state without force, and why.
pub fn assert_without_force(output: &Output, state: State, cause: DiagnosticCode) {
    assert_eq!((output.state, output.diagnostic.code), (state, cause));
    assert!(!state.has_control());
    assert_eq!(output.command_n.map(f64::to_bits), [0; 6]);
    assert!(!output.active_limits.contains(Limit::Force) && !output.active_limits.contains(Limit::ForceRate));
}

#[test]
fn without_messages_the_controller_is_off() {
    let config = deployed("fried2008");
    let mut rig = Rig::new(&config, &config.machine);
    rig.ask(Request::Engage);
    let full = rig.input(&TaskState::at_rest(config.machine.home));
    let lacks = |cause| move |output: &Output| assert_eq!(output.request_diagnostic.code, cause);
    let output = rig.controller.step(&Input { measurement: None, setpoint: None, ..full });
    assert_without_force(&output, State::Off, DiagnosticCode::NoMeasurement);
    lacks(DiagnosticCode::NoMeasurement)(&output);
    let output = rig.controller.step(&Input { measurement: None, ..full });
    assert_without_force(&output, State::Off, DiagnosticCode::NoMeasurement);
    rig.ask(Request::Engage);
    let output = Rig::new(&config, &config.machine).controller.step(&Input {
        setpoint: None,
        request: rig.asked,
        ..full
    });
    assert_without_force(&output, State::Standby, DiagnosticCode::NoSetpoint);
    lacks(DiagnosticCode::NoSetpoint)(&output);
    assert!(output.platform.is_some() && output.error.is_none(), "it knows the pose all the same");
    assert!(
        ![DiagnosticCode::NoMeasurement, DiagnosticCode::NoSetpoint].iter().any(|cause| cause.is_fault())
    );
    // The request was answered once, and is not carried out later.
    assert_without_force(&rig.controller.step(&full), State::Standby, DiagnosticCode::ReadyToEngage);
    let output = rig.controller.step(&Input { request: rig.asked, ..full });
    assert_eq!(
        (output.state, output.request_diagnostic.code, output.answered_message),
        (State::Engaging, DiagnosticCode::None, rig.asked.unwrap().message)
    );
}

#[test]
fn control_begins_only_near_the_setpoint() {
    let config = deployed("fried2008");
    let parameters = parameters(&config);
    let (turn, way) = (parameters.engage_orientation_rad, parameters.engage_position_m);
    for (axis, tolerance) in [turn, turn, turn, way, way, way].into_iter().enumerate() {
        // An error of velocity counts as the error of pose that it is worth to the law.
        let law = &parameters.law;
        let wn = if axis < 3 { law.orientation.kp_per_s2 } else { law.position.kp_per_s2 }.sqrt();
        for (is_rate, sign) in [(false, 1.0), (false, -1.0), (true, 1.0), (true, -1.0)] {
            let setpoint = |share: f64| {
                let mut task = TaskState::at_rest(config.machine.home);
                if is_rate {
                    task.xd[axis] = sign * share * tolerance * wn;
                } else {
                    task.x[axis] += sign * share * tolerance;
                }
                task
            };
            let mut rig = Rig::new(&config, &config.machine);
            for _ in 0..3 {
                rig.ask(Request::Engage);
                let mut far = rig.input(&setpoint(1.001));
                if is_rate {
                    // Passing by, just now.
                    let age_ns = 500_000;
                    far.release_ns -= age_ns;
                }
                let output = rig.controller.step(&far);
                assert_without_force(&output, State::Standby, DiagnosticCode::SetpointTooFar);
                assert_eq!(output.request_diagnostic.code, DiagnosticCode::SetpointTooFar);
                assert!((output.diagnostic.value - 1.001).abs() < 1e-6 && output.diagnostic.bound == 1.0);
                rig.now_ns += 1_000_000;
            }
            rig.ask(Request::Engage);
            assert_eq!(rig.controller.step(&rig.input(&setpoint(0.999))).state, State::Engaging);
        }
    }
    assert!(!DiagnosticCode::SetpointTooFar.is_fault());
}

/// A rig in the middle of a motion, and the task at its next cycle.
static IN_MOTION: LazyLock<(Rig, TaskState)> = LazyLock::new(|| in_motion(&deployed("fried2008")));

/// Changes of one message, in motion.
fn wrong(change: impl Fn(&mut Input)) {
    let (mut rig, task) = IN_MOTION.clone();
    let good = rig.input(&task);
    let mut twin = rig.controller.clone();
    let mut input = good;
    change(&mut input);
    let (output, undisturbed) = (rig.controller.step(&input), twin.step(&good));
    assert_eq!((output.state, output.diagnostic.code), (State::Active, DiagnosticCode::None));
    let waited = [output.missed_measurements, output.missed_setpoints];
    // The one message does not count.
    assert_eq!(waited[0] + waited[1], 1 + undisturbed.missed_measurements + undisturbed.missed_setpoints);
    for (force, should) in output.command_n.iter().zip(undisturbed.command_n) {
        // It goes on with what was good a millisecond ago.
        assert!((force - should).abs() < 0.1, "{force} instead of {should}");
    }
    rig.now_ns += 1_000_000;
    assert_eq!(rig.controller.step(&rig.input(&task.after(1e-3))).missed_setpoints, output.missed_setpoints);
}

#[test]
fn one_number_that_is_not_finite_is_ridden_through_wherever_it_stands() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..6 {
            wrong(|input| input.measurement.as_mut().unwrap().length_m[k] = value);
            wrong(|input| input.measurement.as_mut().unwrap().rate_m_s.as_mut().unwrap()[k] = value);
            wrong(|input| input.setpoint.as_mut().unwrap().task.x[k] = value);
            wrong(|input| input.setpoint.as_mut().unwrap().task.xd[k] = value);
            wrong(|input| input.setpoint.as_mut().unwrap().task.xdd[k] = value);
        }
    }
}

/// Finite numbers too large to compute with, and those that are merely wrong.
#[test]
fn one_message_far_away_is_ridden_through() {
    for away in [0.05, 1.0, 1e3, 1e100, 1e300, f64::MAX, -1.0, -1e300] {
        for k in 0..6 {
            wrong(|input| input.measurement.as_mut().unwrap().length_m[k] += away);
            wrong(|input| input.measurement.as_mut().unwrap().rate_m_s.as_mut().unwrap()[k] += 20.0 * away);
            wrong(|input| input.setpoint.as_mut().unwrap().task.x[k] += away);
            wrong(|input| input.setpoint.as_mut().unwrap().task.xd[k] += 10.0 * away);
            // Beyond the limit of acceleration, and above beyond the tolerance; what is within is followed, see below.
            wrong(|input| input.setpoint.as_mut().unwrap().task.xdd[k] += 600.0 * away);
        }
    }
}

/// A wrong X' or X'' within the limits and the tolerance cannot be told from a right one. The reference begins to follow it
/// with the limit of jerk, and has left nothing of it a fifth of a second later.
#[test]
fn one_wrong_derivative_within_the_limits_leaves_nothing() {
    let config = deployed("fried2008");
    let limits = parameters(&config).limits;
    let (start, task) = in_motion(&config);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    for (k, derivative, away) in (0..6).flat_map(|k| [(k, 1, 1.0), (k, 1, -1.0), (k, 2, 1.0), (k, 2, -1.0)]) {
        let (mut rig, mut twin) = (start.clone(), start.clone());
        let limit = if k < 3 { limits.orientation } else { limits.position };
        let mut furthest = 0.0_f64;
        for cycle in 0..200 {
            let task = if cycle == 0 { task } else { scene.at(1.5 + f64::from(cycle) * 1e-3) };
            let mut input = rig.input(&task);
            let undisturbed = twin.cycle(&input);
            if cycle == 0 {
                let task = &mut input.setpoint.as_mut().unwrap().task;
                match derivative {
                    1 => task.xd[k] += away * 0.03,
                    _ => task.xdd[k] += away * 0.5 * limit.acceleration,
                }
            }
            let input = Input { measurement: rig.input(&task).measurement, ..input };
            let output = rig.cycle(&input);
            assert_eq!(
                (output.state, output.diagnostic.code, output.missed_setpoints),
                (State::Active, DiagnosticCode::None, 0)
            );
            let [found, should] = [output, undisturbed].map(|output| output.reference.unwrap());
            let apart = should.pose.displacement_to(&found.pose).vector().norm();
            furthest = furthest.max(apart);
            if cycle == 0 {
                let change = (found.acceleration.vector() - should.acceleration.vector()).norm();
                assert!(change <= 2.0 * 1e-3 * limit.jerk, "{k}: {change}");
            }
            assert!(cycle < 199 || apart < 1e-9, "{k}: {apart}");
        }
        println!("{k} {derivative} {away}: {furthest:e}");
        assert!((1e-8..1e-4).contains(&furthest), "{k}: {furthest}");
    }
}

#[test]
fn one_time_stamp_from_another_world_is_ridden_through() {
    for time_ns in [0, 1, u64::MAX / 2, u64::MAX / 2 + 1, u64::MAX - 1, u64::MAX] {
        wrong(|input| input.measurement.as_mut().unwrap().time_ns = time_ns);
        wrong(|input| input.setpoint.as_mut().unwrap().time_ns = time_ns);
    }
}

/// To the last nanosecond.
#[test]
fn a_message_counts_until_it_is_as_old_as_its_timeout() {
    let mut config = deployed("fried2008");
    let parameters = parameters(&config);
    let mut after = |age_ns: u64, of_setpoint: bool| {
        if of_setpoint {
            // A pause of the loop as long as this is no loss of the measurement then.
            config.deployment.timeouts.measured_s = 1.0;
        }
        let (mut rig, task) = in_motion(&config);
        let mut input = rig.input(&task);
        let force = rig.controller.step(&input).command_n;
        let begin_ns = rig.now_ns;
        input.release_ns = begin_ns + age_ns;
        if of_setpoint {
            rig.hardware.advance(age_ns, Some(force));
            rig.put(rig.hardware.clone());
        }
        rig.now_ns = input.release_ns;
        let young = rig.input(&task.after(age_ns as f64 * 1e-9));
        if of_setpoint {
            input.measurement = young.measurement;
        } else {
            input.setpoint = young.setpoint;
        }
        let output = rig.controller.step(&input);
        (output.state, output.diagnostic.code)
    };
    let lost =
        [(State::Fault, DiagnosticCode::MeasurementLost), (State::Stopping, DiagnosticCode::SetpointLost)];
    for (of_setpoint, timeout_ns) in
        [(false, parameters.measured_timeout_ns), (true, parameters.setpoint_timeout_ns)]
    {
        let at = after(timeout_ns, of_setpoint);
        assert_eq!(at, (State::Active, DiagnosticCode::None), "{of_setpoint}");
        assert_eq!(after(timeout_ns + 1, of_setpoint), lost[usize::from(of_setpoint)]);
    }
}

/// At the end of time nothing overflows.
#[test]
fn the_last_cycle_of_all_is_a_cycle() {
    let config = deployed("fried2008");
    let mut rig = Rig::new(&config, &config.machine);
    rig.ask(Request::Engage);
    let mut input = rig.input(&TaskState::at_rest(config.machine.home));
    input.release_ns = u64::MAX;
    input.measurement.as_mut().unwrap().time_ns = u64::MAX;
    input.setpoint.as_mut().unwrap().time_ns = u64::MAX;
    let mut controller = Controller::new(&config.machine, parameters(&config));
    let output = controller.step(&input);
    assert_eq!(output.state, State::Engaging);
    assert!(largest(&output.command_n) > 1.0);
}

/// The lengths are then further away than one trusted step of forward kinematics.
#[test]
fn after_a_pause_of_the_measurements_the_pose_is_found_in_the_same_cycle() {
    let mut config = deployed("fried2008");
    config.deployment.timeouts.measured_s = 0.2;
    let (mut rig, _) = in_motion(&config);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let stale = rig.input(&scene.at(1.5)).measurement.unwrap();
    let mut furthest = 0.0_f64;
    for k in 0..=150 {
        let mut input = rig.input(&scene.at(1.5 + f64::from(k) * 1e-3));
        let fresh = input.measurement.unwrap();
        if k < 150 {
            input.measurement = Some(stale);
        } else {
            furthest =
                (0..6).fold(0.0, |most, leg| most.max((fresh.length_m[leg] - stale.length_m[leg]).abs()));
        }
        let output = rig.cycle(&input);
        assert_eq!(
            (output.state, output.diagnostic.code),
            (State::Active, DiagnosticCode::None),
            "{k}: {:?}",
            output.diagnostic
        );
    }
    let kinematic_state = KinematicState::new(&config.machine, rig.simulator().state().pose);
    let trusted = kinematic_state.sensitivity().trusted_step * config.machine.joints.radius_m;
    assert!(furthest > 1.5 * trusted, "{furthest} m of {trusted} m");
}

/// A source that comes after a gap is taken over without a jolt if it is near what was led to, and refused else.
#[test]
fn after_a_gap_another_source_is_taken_over_gently_or_not_at_all() {
    let config = deployed("fried2008");
    let limits = parameters(&config).limits.position;
    for (away, expected) in [
        (0.0005, (State::Active, DiagnosticCode::None)),
        (0.0035, (State::Fault, DiagnosticCode::SetpointJumped)),
    ] {
        let (mut rig, _) = in_motion(&config);
        let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
        let last = rig.input(&scene.at(1.5)).setpoint;
        let (mut twist, mut before) = (rig.simulator().state().twist.linear, None);
        let (mut strongest, mut jolt) = (0.0_f64, 0.0_f64);
        let mut end = (State::Off, DiagnosticCode::None);
        for k in 0..400 {
            let mut task = scene.at(1.5 + f64::from(k) * 1e-3);
            task.x[3] += away;
            let mut input = rig.input(&task);
            if k < 40 {
                input.setpoint = last;
            }
            let output = rig.cycle(&input);
            end = (output.state, output.diagnostic.code);
            if !output.state.has_control() {
                break;
            }
            let now = rig.simulator().state().twist.linear;
            let acceleration = (now - twist) / 1e-3;
            twist = now;
            strongest = strongest.max(acceleration.norm());
            if let Some(before) = before.replace(acceleration) {
                jolt = jolt.max((acceleration - before).norm() / 1e-3);
            }
        }
        assert_eq!(end, expected, "{away}");
        assert!(
            // A force is held for a period: of the platform, not of its reference.
            strongest < 1.02 * limits.acceleration && jolt < 1.02 * limits.jerk,
            "{away}: {strongest} m/s^2, {jolt} m/s^3"
        );
    }
}

/// The host takes everybody away at once: the message of before is seen only after it, and the next one in the
/// next cycle.
#[test]
fn a_message_seen_only_after_a_pause_does_not_make_the_next_one_a_jump() {
    let config = deployed("fried2008");
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let (mut rig, _) = in_motion(&config);
    let [mut seen, mut kept] = [Input::default(); 2];
    for k in 0..6000 {
        let fresh = rig.input(&scene.at(1.5 + f64::from(k) * 1e-3));
        match k % 100 {
            0 => kept = fresh,
            1..18 => {}
            18 => seen = kept,
            _ => seen = fresh,
        }
        let output = rig.cycle(&Input { release_ns: fresh.release_ns, ..seen });
        let state = (output.state, output.diagnostic.code);
        assert_eq!(state, (State::Active, DiagnosticCode::None), "{k}: {:?}", output.diagnostic);
    }
}
