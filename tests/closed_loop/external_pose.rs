//! The pose of another sensor: it shows homing, scale and slip, which lengths alone cannot.

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::deployed;
use hexad_support::rig::Rig;

/// What the readings of a leg are in place of its length.
type Reading = fn(leg: usize, length: f64, home: f64) -> f64;

/// Settles at home, engages, and plays: the end of control or the refusal, and the largest distance of the true platform from the
/// setpoint until then \[m\]. The pose is measured with this error \[m\].
fn play(read: Reading, noise_m: f64, is_measured: bool) -> (Option<Output>, f64) {
    let config = deployed("motion_base");
    let machine = &config.machine;
    let mut rig = Rig::new(&config, machine);
    let scene = fit(machine, BuiltInMotion::Sines, 8.0);
    let home_length = rig.simulator().leg_motion().length_m;
    let mut farthest = 0.0_f64;
    for k in 0..7000_u32 {
        let task = if k < 1000 {
            TaskState::at_rest(scene.at(0.0).x.into())
        } else {
            scene.at(1e-3 * f64::from(k - 1000))
        };
        let mut input: Input = rig.input(&task);
        let state = *rig.simulator().state();
        let measurement = input.measurement.as_mut().unwrap();
        for (leg, length) in measurement.length_m.iter_mut().enumerate() {
            *length = read(leg, *length, home_length[leg]);
        }
        measurement.rate_m_s = None;
        let mut x = task_coordinates(&state.pose, &machine.home);
        x[3] += noise_m * f64::from(k % 3).mul_add(1.0, -1.0);
        measurement.pose = is_measured.then_some(x);
        if k == 100 {
            rig.ask(Request::Engage);
            input.request = rig.asked;
        }
        let output = rig.cycle(&input);
        if k == 100 && output.state != State::Engaging {
            return (Some(Output { diagnostic: output.request_diagnostic, ..output }), farthest);
        }
        if k > 100 && !output.state.has_control() {
            return (Some(output), farthest);
        }
        if output.state == State::Active {
            let way = state.pose.position - task.motion().pose.position;
            farthest = farthest.max(way.norm());
        }
    }
    (None, farthest)
}

const TRUE: Reading = |_, length, _| length;
const HOMING: Reading = |leg, length, _| if leg == 3 { length + 1e-3 } else { length };
const SCALE: Reading = |leg, length, home| if leg == 1 { home + 1.1 * (length - home) } else { length };

#[test]
fn a_leg_that_is_homed_a_millimetre_off_is_named_before_control_begins() {
    let (unseen, farthest) = play(HOMING, 0.0, false);
    assert!(unseen.is_none() && farthest > 5e-4, "lengths alone do not show it: {farthest}");
    let (refused, _) = play(HOMING, 1e-4, true);
    let Output { state, diagnostic, .. } = refused.expect("a refusal");
    assert_eq!((state, diagnostic.code), (State::Standby, DiagnosticCode::ExternalPoseMismatch));
    assert_eq!((diagnostic.index, diagnostic.bound), (4, 5e-4));
    assert!((0.8e-3..1.2e-3).contains(&diagnostic.value), "{diagnostic}");
    let text = diagnostic.to_string();
    assert!(text.contains(" of leg 4 exceeds measured.pose_tolerance_m 0.0005 m"), "{text}");
}

#[test]
fn a_scale_that_is_a_tenth_wrong_ends_control_in_motion() {
    let (unseen, farthest) = play(SCALE, 0.0, false);
    assert!(unseen.is_none() && farthest > 2e-3, "lengths alone do not show it: {farthest}");
    let (end, farthest) = play(SCALE, 1e-4, true);
    let Output { diagnostic, .. } = end.expect("control ends");
    println!("{diagnostic}; {farthest:.2e} m");
    assert_eq!((diagnostic.code, diagnostic.index), (DiagnosticCode::ExternalPoseMismatch, 2));
    assert!(farthest < 2e-3, "{farthest}");
}

#[test]
fn noise_of_the_other_sensor_is_no_fault() {
    let (end, farthest) = play(TRUE, 4e-4, true);
    assert!(end.is_none() && farthest < 1e-4, "{:?}, {farthest}", end.map(|end| end.diagnostic));
}
