//! What ends or prevents control although inputs are valid: each check alone, the others wide.

use hexad::control::controller::Controller;
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::{Request, State};
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::rigid::{Acceleration, Motion, Twist};
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};
use nalgebra::Vector3;

use hexad_support::rig::{Rig, in_motion, parameters};
use hexad_support::{angle_between, deployed};

/// Following limits that nothing reaches.
fn wide(parameters: Parameters) -> Parameters {
    Parameters {
        following_position_m: 1e9,
        following_orientation_rad: 1e9,
        following_velocity_m_s: 1e9,
        following_angular_velocity_rad_s: 1e9,
        ..parameters
    }
}

#[test]
fn each_following_limit_alone_ends_control() {
    let config = deployed("motion_base");
    let mut heavy = config.machine.clone();
    heavy.platform.mass_kg *= 1.1;
    let scene = fit(&config.machine, BuiltInMotion::Sines, 4.0);
    let parameters = parameters(&config);
    let ends = |parameters: Parameters| {
        let mut rig = Rig::new(&config, &heavy);
        rig.controller = Controller::new(&config.machine, parameters);
        rig.ask(Request::Engage);
        for k in 0..1500 {
            let input = rig.input(&scene.at(f64::from(k) * 1e-3));
            let output = rig.cycle(&input);
            if output.state == State::Fault {
                return Some(output.diagnostic);
            }
        }
        None
    };
    assert_eq!(ends(wide(parameters)), None);
    let narrow = 1e-6;
    let (position, velocity) = (DiagnosticCode::FollowingError, DiagnosticCode::VelocityError);
    for (parameters, code) in [
        (Parameters { following_position_m: narrow, ..wide(parameters) }, position),
        (Parameters { following_orientation_rad: narrow, ..wide(parameters) }, position),
        (Parameters { following_velocity_m_s: narrow, ..wide(parameters) }, velocity),
        (Parameters { following_angular_velocity_rad_s: narrow, ..wide(parameters) }, velocity),
    ] {
        let found = ends(parameters).unwrap_or_default();
        assert_eq!((found.code, found.bound), (code, 1.0));
        assert!(found.value > 1.0, "{found:?}");
    }
}

#[test]
fn a_missed_deadline_ends_control() {
    let config = deployed("motion_base");
    let (mut rig, task) = in_motion(&config);
    let mut input = rig.input(&task);
    input.had_faulty_overrun = true;
    let output = rig.cycle(&input);
    assert_eq!((output.state, output.diagnostic.code), (State::Stopping, DiagnosticCode::DeadlineMissed));
}

/// A platform that is beside its reference, where the condition is a little larger than the limit.
#[test]
fn a_condition_beyond_the_limit_ends_control_and_prevents_it() {
    let config = deployed("motion_base");
    let home = TaskState::at_rest(config.machine.home);
    let max_condition =
        KinematicState::new(&config.machine, config.machine.home_pose()).sensitivity().condition;
    let mut codes = Vec::new();
    for factor in [0.8, 1.25] {
        let mut plant = config.machine.clone();
        plant.platform.mass_kg *= factor;
        let mut rig = Rig::new(&config, &plant);
        let parameters =
            Parameters { max_condition: max_condition * (1.0 + 1e-8), ..wide(parameters(&config)) };
        rig.controller = Controller::new(&config.machine, parameters);
        rig.ask(Request::Engage);
        let mut output = rig.cycle(&rig.input(&home));
        assert_eq!(output.state, State::Engaging, "{output:?}");
        for _ in 0..200 {
            if output.state.has_control() && output.state != State::Stopping {
                output = rig.cycle(&rig.input(&home));
            }
        }
        codes.push((output.state, output.diagnostic.code));
    }
    assert!(codes.contains(&(State::Stopping, DiagnosticCode::NearSingular)), "{codes:?}");
    let mut rig = Rig::new(&config, &config.machine);
    let parameters = Parameters { max_condition: max_condition * 0.99, ..parameters(&config) };
    rig.controller = Controller::new(&config.machine, parameters);
    rig.ask(Request::Engage);
    let output = rig.cycle(&rig.input(&home));
    assert_eq!(
        (output.state, output.request_diagnostic.code),
        (State::Standby, DiagnosticCode::NearSingular)
    );
}

/// The setpoint is where the platform is and moves as it does: only the stop is missing.
#[test]
fn control_does_not_begin_without_a_verified_stop() {
    let config = deployed("motion_base");
    for (ratio, is_refused) in [(0.5, false), (1.5, true)] {
        let parameters = Parameters { on_violation: ViolationPolicy::Limit, ..parameters(&config) };
        let mut rig = Rig::new(&config, &config.machine);
        rig.controller = Controller::new(&config.machine, parameters);
        let speed = ratio * parameters.limits.position.velocity;
        let mut output = None;
        for k in 0..5 {
            let mut task = TaskState::at_rest(config.machine.home);
            task.x[3] += speed * f64::from(k) * 1e-3;
            task.xd[3] = speed;
            if k == 3 {
                rig.ask(Request::Engage);
            }
            let mut input = rig.input(&task);
            let twist = Twist { angular: Vector3::zeros(), linear: Vector3::x() * speed };
            let motion = Motion { pose: task.motion().pose, twist, acceleration: Acceleration::default() };
            let legs = leg_motion(&config.machine, &motion);
            let measurement = input.measurement.as_mut().unwrap();
            (measurement.length_m, measurement.rate_m_s) = (legs.length_m, Some(legs.rate_m_s));
            if k <= 3 {
                output = Some(rig.controller.step(&input));
            }
            rig.now_ns += rig.parameters.period_ns;
        }
        let output = output.unwrap();
        let (state, code) = match is_refused {
            false => (State::Engaging, DiagnosticCode::None),
            true => (State::Standby, DiagnosticCode::PlatformMoving),
        };
        assert_eq!((output.state, output.request_diagnostic), (state, code.into()), "{output:?}");
    }
}

/// A stop lasts until the reference is at rest, engaging until it is on the setpoint, parking until it is at home.
#[test]
fn states_end_where_their_motion_does() {
    let config = deployed("motion_base");
    let parameters = parameters(&config);
    let (mut rig, task) = in_motion(&config);
    rig.ask(Request::Stop);
    let mut cycles = 0;
    let mut output = rig.cycle(&rig.input(&task));
    while output.state == State::Stopping {
        (output, cycles) = (rig.cycle(&rig.input(&task)), cycles + 1);
    }
    assert_eq!(output.state, State::Standby);
    let speed = rig.simulator().state().twist.linear.norm();
    assert!(cycles > 50 && speed < 1e-4, "{cycles} cycles, {speed} m/s");
    // Distance of the reference from a task over the engage tolerance, when a state ends.
    let distance = |motion: &Motion, task: &TaskState| {
        let pose = task.motion().pose;
        let position = (motion.pose.position - pose.position).norm() / parameters.engage_position_m;
        position.max(angle_between(&motion.pose.rotation, &pose.rotation) / parameters.engage_orientation_rad)
    };
    let home = TaskState::at_rest(config.machine.home);
    let mut near = home;
    near.x[4] += 0.9 * parameters.engage_position_m;
    let mut rig = Rig::new(&config, &config.machine);
    rig.ask(Request::Engage);
    let mut before = rig.cycle(&rig.input(&near));
    let mut ended = |rig: &mut Rig, state: State, task: &TaskState| {
        loop {
            let output = rig.cycle(&rig.input(&near));
            if output.state != state && before.state == state {
                return distance(&before.reference.unwrap(), task);
            }
            before = output;
        }
    };
    let engaged = ended(&mut rig, State::Engaging, &near);
    rig.ask(Request::Park);
    let parked = ended(&mut rig, State::Parking, &home);
    // 0.036 and 0.0019, as the velocity counts too.
    assert!((0.03..0.045).contains(&engaged) && (0.0015..0.0023).contains(&parked), "{engaged} {parked}");
}

/// Of a setpoint that is not followed the age counts, of any kind and under any policy, and at rest is without both derivatives.
#[test]
fn an_old_setpoint_does_not_begin_control() {
    let config = deployed("motion_base");
    for policy in [ViolationPolicy::Stop, ViolationPolicy::Limit] {
        for kind in [SetpointKind::Motion, SetpointKind::Target] {
            for (velocity, acceleration) in [(0.0, 0.0), (1e-4, 0.0), (0.0, 1e-3)] {
                let parameters = Parameters { on_violation: policy, ..parameters(&config) };
                let mut rig = Rig::new(&config, &config.machine);
                rig.controller = Controller::new(&config.machine, parameters);
                let mut task = TaskState::at_rest(config.machine.home);
                (task.xd[3], task.xdd[3]) = (velocity, acceleration);
                let mut setpoint = rig.input(&task).setpoint.unwrap();
                setpoint.kind = kind;
                for _ in 0..parameters.setpoint_timeout_ns / rig.parameters.period_ns + 2 {
                    let mut input = rig.input(&task);
                    input.setpoint = Some(setpoint);
                    _ = rig.cycle(&input);
                }
                rig.ask(Request::Engage);
                let mut input = rig.input(&task);
                input.setpoint = Some(setpoint);
                let output = rig.cycle(&input);
                let is_at_rest = kind == SetpointKind::Target || velocity == 0.0 && acceleration == 0.0;
                let code =
                    if is_at_rest { DiagnosticCode::SetpointEnded } else { DiagnosticCode::SetpointLost };
                assert_eq!(
                    (output.state, output.request_diagnostic.code),
                    (State::Standby, code),
                    "{kind:?}"
                );
            }
        }
    }
}
