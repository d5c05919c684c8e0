//! Every cause comes with the number that caused it, its bound, and the leg or axis; and a cycle near a limit
//! says so before the limit bites.

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad::control::signals::inputs::{Input, SetpointKind};
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::State;
use hexad::model::task::TaskState;
use nalgebra::Vector6;

use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters};

/// Active, at rest at home.
fn at_rest() -> (Rig, TaskState) {
    let config = deployed("motion_base");
    let mut rig = Rig::new(&config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    rig.engage(&home);
    (rig, home)
}

/// What ends control if every input from now on is changed.
fn ends(change: impl Fn(&mut Input)) -> Output {
    let (mut rig, home) = at_rest();
    for _ in 0..200 {
        let mut input = rig.input(&home);
        change(&mut input);
        let output = rig.cycle(&input);
        if !matches!(output.state, State::Active) {
            return output;
        }
    }
    panic!("nothing ends it");
}

fn assert_evidence(output: &Output, cause: DiagnosticCode, value: f64, bound: f64, index: u32) {
    let found = output.diagnostic;
    assert_eq!((output.diagnostic.code, found.index), (cause, index), "{output:?}");
    let near = |found: f64, wanted: f64| (found - wanted).abs() <= 1e-3 * wanted.abs().max(1e-6);
    assert!(
        near(found.value, value) && near(found.bound, bound),
        "{cause:?}: {found:?}, not {value} {bound}"
    );
}

#[test]
fn measurements_are_refused_with_leg_value_and_bound() {
    let (rig, home) = at_rest();
    let length = rig.input(&home).measurement.unwrap().length_m;
    let actuator = deployed("motion_base").machine.actuator;
    let stroke = actuator.max_length_m - actuator.min_length_m;
    for leg in 0..6 {
        let index = leg as u32 + 1;
        let output = ends(|input| input.measurement.as_mut().unwrap().length_m[leg] -= 0.05);
        // One and a half times the greatest rate for a cycle, and a thousandth of the stroke.
        let furthest = 1.5 * actuator.max_rate_m_s * 1e-3 + 1e-3 * stroke;
        assert_evidence(&output, DiagnosticCode::MeasurementJumped, 0.05, furthest, index);
        let output = ends(|input| input.measurement.as_mut().unwrap().length_m[leg] = 3.0);
        assert_evidence(
            &output,
            DiagnosticCode::LengthOutOfStroke,
            3.0,
            actuator.max_length_m + 0.02 * stroke,
            index,
        );
        let output = ends(|input| input.measurement.as_mut().unwrap().length_m[leg] = 0.5);
        assert_evidence(
            &output,
            DiagnosticCode::LengthOutOfStroke,
            0.5,
            actuator.min_length_m - 0.02 * stroke,
            index,
        );
        let output = ends(|input| input.measurement.as_mut().unwrap().rate_m_s.as_mut().unwrap()[leg] = 1.0);
        assert_evidence(&output, DiagnosticCode::RateJumped, 1.0, 0.05 + 0.02 * actuator.max_rate_m_s, index);
        // Half the jump of rates that would be seen at once is seen by the lengths that do not follow.
        let output = ends(|input| input.measurement.as_mut().unwrap().rate_m_s.as_mut().unwrap()[leg] = 0.03);
        assert_eq!(
            (output.diagnostic.code, output.diagnostic.index),
            (DiagnosticCode::RateInconsistent, index)
        );
        assert!(output.diagnostic.value > output.diagnostic.bound, "{output:?}");
        // Noise, and a share of the little way that the platform has gone meanwhile.
        assert!((1.0..1.5).contains(&(output.diagnostic.bound / (3e-4 * stroke))), "{output:?}");
    }
    assert!(length.iter().all(|length| (1.2..2.2).contains(length)));
}

#[test]
fn ages_and_stamps_are_told_in_seconds() {
    let (rig, home) = at_rest();
    let last = rig.input(&home);
    let output = ends(|input| input.measurement = last.measurement);
    assert_evidence(&output, DiagnosticCode::MeasurementLost, 0.0205, 0.02, 0);
    let output = ends(|input| input.setpoint = last.setpoint);
    assert_evidence(&output, DiagnosticCode::SetpointEnded, 0.0505, 0.05, 0);
    let output = ends(|input| input.measurement.as_mut().unwrap().time_ns += 2_000_500_000);
    assert_evidence(&output, DiagnosticCode::MeasurementStampInvalid, -2.0, 0.02, 0);
    let output = ends(|input| input.measurement.as_mut().unwrap().time_ns += 19_000_000);
    assert_evidence(&output, DiagnosticCode::MeasurementStampInvalid, -0.0185, -1e-4, 0);
    let output = ends(|input| input.setpoint.as_mut().unwrap().time_ns -= 999_500_000);
    assert_evidence(&output, DiagnosticCode::SetpointStampInvalid, 1.0, 0.05, 0);
}

#[test]
fn setpoints_are_refused_with_axis_or_leg_and_share_of_the_limit() {
    let limits = parameters(&deployed("motion_base")).limits;
    let task = |change: fn(&mut TaskState)| ends(|input| change(&mut input.setpoint.as_mut().unwrap().task));
    assert_evidence(
        &task(|task| task.xd[3] = 1.1),
        DiagnosticCode::SetpointTooFast,
        1.1 / limits.position.velocity,
        1.0,
        0,
    );
    assert_evidence(
        &task(|task| task.xdd[1] = 30.0),
        DiagnosticCode::SetpointTooFast,
        30.0 / limits.orientation.acceleration,
        1.0,
        0,
    );
    let output = task(|task| task.x[5] += 2.0);
    assert_eq!(output.diagnostic.code, DiagnosticCode::SetpointOutOfReach);
    assert!(output.diagnostic.value > output.diagnostic.bound && (1..=6).contains(&output.diagnostic.index));
    let output = task(|task| task.x[4] += 0.005);
    // 5 mm of the 2 mm of control.engage_position_m.
    assert_evidence(&output, DiagnosticCode::SetpointJumped, 2.5, 1.0, 0);
    // X' counts as the distance that it is worth to the law: 0.2 m/s over wn.
    let parameters = parameters(&deployed("motion_base"));
    let distance = 0.2 / parameters.law.position.kp_per_s2.sqrt();
    let ratio = distance / parameters.engage_position_m;
    assert_evidence(&task(|task| task.xd[5] = 0.2), DiagnosticCode::SetpointJumped, ratio, 1.0, 0);
    let kind = |kind| ends(|input| input.setpoint.as_mut().unwrap().kind = kind);
    for unknown in [SetpointKind::Unknown, SetpointKind::Pose] {
        assert_eq!(kind(unknown).diagnostic.code, DiagnosticCode::SetpointKindInvalid);
    }
}

#[test]
fn a_setpoint_out_of_the_envelope_is_refused_with_axis_value_and_end() {
    let mut config = deployed("motion_base");
    let range = [0.1, 0.2, 0.3, 0.01, 0.02, 0.03];
    config.deployment.envelope = Some(hexad::analysis::envelope::EnvelopeBounds {
        pose_min: range.map(|x| -x),
        pose_max: range,
        velocity: [1.0; 6],
        acceleration: [1.0; 6],
    });
    for (axis, range) in range.into_iter().enumerate() {
        for sign in [1.0, -1.0] {
            let mut rig = Rig::new(&config, &config.machine);
            let mut task = TaskState::at_rest(config.machine.home);
            task.x[axis] += 1.1 * sign * range;
            let output = rig.cycle(&rig.input(&task));
            let bound = config.machine.home[axis] + sign * range;
            assert_eq!(output.state, State::Standby);
            assert_evidence(
                &output,
                DiagnosticCode::SetpointOutOfEnvelope,
                task.x[axis],
                bound,
                axis as u32 + 1,
            );
        }
    }
}

/// A share of each limit, and whether a cycle says that it is limited.
#[test]
fn what_is_near_a_limit_says_so() {
    let mut config = deployed("motion_base");
    let wide = [0.1, 1.0, 1.0, 1.0, 1.0, 1.0];
    config.deployment.envelope = Some(hexad::analysis::envelope::EnvelopeBounds {
        pose_min: wide.map(|x| -x),
        pose_max: wide,
        velocity: [1.0; 6],
        acceleration: [1.0; 6],
    });
    config.deployment.limits.reference.position.velocity = 0.5;
    let limits = parameters(&config).limits.position;
    let says = |limit: Limit, task: Vector6<f64>, rate: Vector6<f64>, accel: Vector6<f64>| {
        let mut rig = Rig::new(&config, &config.machine);
        let home = Vector6::from(config.machine.home);
        let output = rig.cycle(&rig.input(&TaskState { x: home + task, xd: rate, xdd: accel }));
        output.active_limits.contains(limit)
    };
    let (none, z) = (Vector6::zeros(), Vector6::ith(5, 1.0));
    for (share, near) in [(0.85, false), (0.95, true), (1.2, true)] {
        assert_eq!(
            says(Limit::Velocity, none, z * (share * limits.velocity), none),
            near,
            "velocity {share}"
        );
        assert_eq!(says(Limit::Acceleration, none, none, z * (share * limits.acceleration)), near, "{share}");
        assert_eq!(says(Limit::Envelope, Vector6::x() * (share * 0.1), none, none), near, "envelope {share}");
    }
    // A setpoint at rest is within the stroke or refused. Only the reference is held back before its end.
    assert!(!says(Limit::Stroke, none, none, none) && !says(Limit::Stroke, z * 0.42, none, none));
}

/// A motion that leads on beyond the stroke, each setpoint within it: the reference stops before the margin, and once the
/// setpoint is further ahead than the tolerance, the diagnostic says that a limit held the reference back.
#[test]
fn what_the_reference_is_held_back_from_says_so() {
    let config = deployed("motion_base");
    let (mut rig, home) = at_rest();
    let (speed, ramp) = (0.3, 0.6);
    let mut said = None;
    for cycle in 0..4000 {
        let t = f64::from(cycle) * 1e-3;
        let mut task = home;
        let rising = t.min(ramp);
        task.x[5] += speed * (0.5 * rising * rising / ramp + (t - rising));
        task.xd[5] = speed * rising / ramp;
        task.xdd[5] = if t < ramp { speed / ramp } else { 0.0 };
        let output = rig.cycle(&rig.input(&task));
        if output.active_limits.contains(Limit::Stroke) {
            said.get_or_insert(cycle);
        }
        if output.state != State::Active {
            assert_eq!(output.state, State::Stopping);
            let Diagnostic { code, value, bound, .. } = output.diagnostic;
            assert_eq!((code, bound), (DiagnosticCode::SetpointBeyondLimits, 1.0));
            assert!((1.0..10.0).contains(&value), "{value}");
            let timeout = (config.deployment.timeouts.setpoint_s * 1e3) as u32;
            println!("said {said:?}, {cycle}: {value}");
            // The stop was begun before, and the setpoint carried on for the timeout.
            assert!(
                said.is_some_and(|said| (timeout..timeout + 100).contains(&(cycle - said))),
                "{said:?} {cycle}"
            );
            return;
        }
    }
    panic!("nothing ends it");
}

#[test]
fn a_diagnostic_is_a_sentence_with_value_bound_and_remedy() {
    let near_singular = Diagnostic::new(DiagnosticCode::NearSingular, 143.21, 100.0).to_string();
    assert!(
        near_singular.contains("condition 143.21 exceeds the bound by limits.condition, 100;"),
        "{near_singular}"
    );
    let stroke = Diagnostic::new(DiagnosticCode::LengthOutOfStroke, 0.5, 1.076).at(2).to_string();
    assert!(stroke.contains("leg length 0.5 m of leg 3 is outside the stroke"), "{stroke}");
    assert!(stroke.contains(" 1.076 m; check the encoders"), "{stroke}");
    let envelope = Diagnostic::new(DiagnosticCode::SetpointOutOfEnvelope, -0.31, -0.3).at(3).to_string();
    assert!(envelope.contains("coordinate -0.31 rad or m of axis 4"), "{envelope}");
    let fast = Diagnostic::new(DiagnosticCode::SetpointTooFast, 4.0, 1.0).to_string();
    assert!(fast.contains("the setpoint is 4 times the limit in [limits]"), "{fast}");
    let lost = Diagnostic::new(DiagnosticCode::NearSingular, f64::INFINITY, 1e-7).to_string();
    assert!(lost.contains("condition inf exceeds the bound by limits.condition, 0.0000001;"), "{lost}");
    assert_eq!(
        Diagnostic::from(DiagnosticCode::NoMeasurement).to_string(),
        "no measurement; start the driver or the plant"
    );
    assert_eq!(Diagnostic::default().to_string(), "none");
}
