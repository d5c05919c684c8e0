//! Measurements of a constant age: the loop stands them without an oscillation, or they are refused.

use std::collections::VecDeque;

use hexad::analysis::held_forces::HeldForces;
use hexad::config::Config;
use hexad::config::control_loops::longest_stable_age_s;
use hexad::control::controller::Controller;
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::plant::imperfections::Imperfections;

use rayon::prelude::*;

use hexad_support::certificate::cases;
use hexad_support::edited::configured;
use hexad_support::rig::{Rig, parameters};

/// After engaging, in which whatever grows has grown \[s\].
const RUN_S: f64 = 8.0;

/// Largest distance of the true platform from home in the last half of a run at rest \[m\]; or why it has no control.
fn wobble(config: &Config, age_ms: f64, mass: f64) -> Result<f64, DiagnosticCode> {
    wobble_with(config, &parameters(config), age_ms, mass)
}

/// The same with parameters of the controller.
fn wobble_with(
    config: &Config,
    parameters: &Parameters,
    age_ms: f64,
    mass: f64,
) -> Result<f64, DiagnosticCode> {
    let mut platform = config.machine.clone();
    platform.platform.mass_kg *= mass;
    let mut control = Rig::imperfect(config, &platform, &Imperfections::default());
    control.controller = Controller::new(&config.machine, *parameters);
    let home = TaskState::at_rest(config.machine.home);
    // The release is half a period after the measurement of now.
    let periods = (age_ms * 1e6 / control.parameters.period_ns as f64 - 0.5).round() as usize;
    let mut measured = VecDeque::new();
    let mut largest = 0.0_f64;
    let mut last = (State::Off, DiagnosticCode::None);
    while control.time_s() < RUN_S {
        let mut input = control.waiting_input(&home);
        measured.push_back(input.measurement);
        input.measurement = if measured.len() > periods { measured.pop_front().unwrap() } else { None };
        // Again and again, until it is carried out.
        let number = (control.time_s() / 0.1) as u64;
        input.request = (last.0 == State::Standby).then_some(OperatorRequest {
            request: Request::Engage,
            message: MessageId { epoch: 1, sequence: number },
        });
        let output = control.cycle(&input);
        last = (
            output.state,
            if output.state.has_control() {
                DiagnosticCode::None
            } else if output.diagnostic.code.is_fault() {
                output.diagnostic.code
            } else {
                output.request_diagnostic.code
            },
        );
        let away = control.hardware.simulator().state().pose.position - home.motion().pose.position;
        if control.time_s() > 0.5 * RUN_S {
            largest = largest.max(away.norm());
        }
    }
    if last.0 == State::Active { Ok(largest) } else { Err(last.1) }
}

/// Payloads and errors of the model for which the age that the loop stands is computed.
const MASSES: [f64; 3] = [0.9, 1.0, 1.1];

#[test]
fn certificate_ages_are_stood_without_an_oscillation_or_refused() {
    let loops = [
        ("motion_base", ""),
        ("motion_base", "[drive]\ndelay_us = 100.0\n"),
        ("motion_base", "[timeouts]\nmeasured_ms = 200.0\n"),
        ("fried2008", "[timeouts]\nmeasured_ms = 200.0\n[realtime]\nrate_hz = 500.0\n"),
    ];
    let all = loops.into_iter().flat_map(|of| MASSES.map(|mass| (of, mass)));
    cases(all, 4).into_par_iter().for_each(|((machine, lines), mass)| {
        let config = configured(machine, lines);
        let bound_ms = 1e3 * longest_stable_age_s(&config.deployment);
        let timeout_ms = 1e3 * config.deployment.timeouts.measured_s;
        println!("{machine} {lines:?}: {bound_ms:.2} ms");
        assert!((10.0..100.0).contains(&bound_ms), "{bound_ms}");
        let least_ms = bound_ms.min(timeout_ms);
        for age_ms in [10.0, least_ms - 2.6, bound_ms + 2.6, 70.0, 150.0] {
            let found = wobble(&config, age_ms, mass);
            println!("{age_ms:.2} ms, mass {mass}: {found:?}");
            match found {
                Ok(way) => assert!(age_ms < least_ms && way < 1e-4, "{age_ms} ms, mass {mass}: {way} m"),
                Err(_) if age_ms < least_ms => panic!("{age_ms} ms, mass {mass}: {found:?}"),
                Err(code) if age_ms < timeout_ms => assert_eq!(code, DiagnosticCode::MeasurementTooOld),
                Err(code) => assert_eq!(code, DiagnosticCode::MeasurementStampInvalid),
            }
        }
    });
}

/// The machine at the pose from which it moves away the fastest under held forces, a little within the limit of the condition.
fn at_fastest_pose(machine: &str, lines: &str) -> (Config, f64) {
    let mut config = configured(machine, lines);
    let survey = HeldForces::new(&config.machine).survey(WITHIN_LIMIT * config.deployment.limits.condition);
    let fastest = survey.iter().max_by(|a, b| a.pole_per_s.total_cmp(&b.pole_per_s)).unwrap();
    config.machine.home = task_coordinates(&fastest.pose, &config.machine.home);
    (config, fastest.pole_per_s)
}

/// More than any age of the tests \[ns\].
const A_SECOND_NS: u64 = 1_000_000_000;

/// Part of the limit of the condition that the home of a test has: transients need the rest.
const WITHIN_LIMIT: f64 = 0.9;

#[test]
fn certificate_near_singular_poses_ages_are_stood_without_an_oscillation_or_refused() {
    let loops = [
        ("tsai2000", "[limits]\ncondition = 50.0\n"),
        ("tsai2000", "[realtime]\nrate_hz = 250.0\n[limits]\ncondition = 20.0\n"),
        ("reference", "[limits]\ncondition = 30.0\n"),
    ];
    let all = loops.into_iter().flat_map(|of| MASSES.map(|mass| (of, mass)));
    cases(all, 2).into_par_iter().for_each(|((machine, lines), mass)| {
        let (config, pole) = at_fastest_pose(machine, &format!("{lines}[timeouts]\nmeasured_ms = 200.0\n"));
        let period_ms = 1e3 * config.deployment.realtime.period_s();
        let bound_ms = 1e3 * longest_stable_age_s(&config.deployment);
        let periods = (bound_ms / period_ms - 0.5).floor();
        println!("{machine} {lines:?}: {pole:.1}/s, {bound_ms:.2} ms, {periods} periods");
        let ages = [1.0, periods, periods + 2.0].map(|periods| (periods, (periods + 0.5) * period_ms));
        for (count, age_ms) in ages {
            let found = wobble(&config, age_ms, mass);
            println!("{age_ms:.2} ms, mass {mass}: {found:?}");
            match found {
                Ok(way) => assert!(count <= periods && way < 1e-4, "{age_ms} ms, mass {mass}: {way} m"),
                Err(code) => assert!(count > periods, "{age_ms} ms, mass {mass}: {code:?}"),
            }
        }
    });
}

/// The bound is not timid: it is the platform that leaves, not the check.
#[test]
fn near_singular_poses_measurements_twice_as_old_would_lose_the_platform() {
    let (config, _) = at_fastest_pose("tsai2000", "[limits]\ncondition = 50.0\n");
    let age_ms = 2.0 * 1e3 * longest_stable_age_s(&config.deployment);
    let accepting = Parameters {
        max_age_at_arrival_ns: A_SECOND_NS,
        measured_timeout_ns: A_SECOND_NS,
        ..parameters(&config)
    };
    let found = MASSES.map(|mass| wobble_with(&config, &accepting, age_ms, mass));
    println!("{age_ms:.1} ms: {found:?}");
    let is_lost = |found: &Result<f64, DiagnosticCode>| found.map_or(true, |way| way > 1e-4);
    assert!(found.iter().any(is_lost), "{found:?}");
}

#[test]
fn a_timeout_longer_than_the_age_that_the_loop_stands_is_refused_unless_accepted() {
    let examined = |lines: &str| configured("motion_base", lines).examine();
    assert_eq!(examined("").errors, []);
    let text = "[timeouts]\nmeasured_ms = 200.0\n";
    let found = examined(text);
    let [error] = found.errors.as_slice() else { panic!("{found:?}") };
    assert!(error.to_string().starts_with("timeouts.measured_ms = 200: must be at most 2"), "{error}");
    let accepted = examined(&format!("{text}allow_unstable_age = true\n"));
    assert_eq!(accepted.errors, []);
    assert!(accepted.warnings.iter().any(|warning| warning.key == error.key), "{accepted:?}");
}
