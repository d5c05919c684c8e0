//! What a driver reports of its drives: control waits for them, and ends if they fault or if a force does not arrive.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::DriveStatus;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::{Request, State};
use hexad::model::LEGS;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad::model::random::Random;
use hexad_support::deployed;
use hexad_support::edited::configured;
use hexad_support::rig::{Rig, in_motion};

const ALL: u32 = (1 << LEGS) - 1;

fn reporting(input: &Input, drives: DriveStatus) -> Input {
    let mut input = *input;
    input.measurement.as_mut().unwrap().drives = drives;
    input
}

/// Engages at rest with brakes that open so many cycles after the first force; the outputs until active or without control, and
/// the largest way of the platform \[m\].
fn engaged(opens_after: usize) -> (Vec<Output>, f64) {
    let config = deployed("motion_base");
    let mut rig = Rig::new(&config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    for _ in 0..50 {
        rig.cycle(&rig.input(&home));
    }
    rig.ask(Request::Engage);
    let (mut outputs, mut farthest) = (Vec::<Output>::new(), 0.0_f64);
    while outputs.len() < 2000 {
        let is_open = outputs.len() > opens_after;
        let drives = DriveStatus {
            enabled: Some(ALL),
            brake_open: Some(if is_open { ALL } else { ALL & !(1 << 4) }),
            ..DriveStatus::default()
        };
        let output = rig.controller.step(&reporting(&rig.input(&home), drives));
        rig.pass((is_open && output.state.has_control()).then_some(output.command_n));
        let way = rig.simulator().state().pose.position - home.motion().pose.position;
        farthest = farthest.max(way.norm());
        outputs.push(output);
        if output.state == State::Active || !output.state.has_control() {
            break;
        }
    }
    (outputs, farthest)
}

#[test]
fn engaging_waits_for_the_brakes_and_no_longer_than_the_timeout() {
    for opens_after in [0, 200, 490] {
        let (outputs, farthest) = engaged(opens_after);
        let waited = outputs.iter().filter(|output| output.state == State::Engaging).count();
        println!("{opens_after}: active after {waited} cycles, {farthest:.1e} m");
        assert_eq!(outputs.last().unwrap().state, State::Active);
        assert!(waited >= opens_after && waited <= opens_after + 50 && farthest < 1e-5);
    }
    let (outputs, farthest) = engaged(600);
    let last = outputs.last().unwrap();
    assert_eq!((last.state, last.diagnostic.code), (State::Fault, DiagnosticCode::DriveNotReady));
    assert_eq!((last.diagnostic.index, last.diagnostic.bound, outputs.len()), (5, 0.5, 502));
    assert!(farthest < 1e-9);
    let text = last.diagnostic.to_string();
    assert!(text.starts_with("drive not ready: time without enabled drive and open brake 0.50"), "{text}");
}

#[test]
fn a_brake_that_closes_or_a_drive_that_faults_ends_control() {
    let config = deployed("motion_base");
    let ready = DriveStatus { enabled: Some(ALL), brake_open: Some(ALL), fault: Some(0), force_n: None };
    for (bad, code, longest) in [
        (DriveStatus { brake_open: Some(ALL & !(1 << 2)), ..ready }, DiagnosticCode::DriveNotReady, 22),
        (DriveStatus { enabled: Some(ALL & !(1 << 2)), ..ready }, DiagnosticCode::DriveNotReady, 22),
        (DriveStatus { fault: Some(1 << 2), ..ready }, DiagnosticCode::DriveFault, 1),
    ] {
        let (mut rig, task) = in_motion(&config);
        rig.cycle(&reporting(&rig.input(&task), ready));
        let end = (1..100).find_map(|cycle| {
            let input = reporting(&rig.input(&TaskState::at_rest(task.x.into())), bad);
            let output = rig.cycle(&Input { setpoint: rig.input(&task).setpoint, ..input });
            (!output.state.has_control()).then_some((cycle, output))
        });
        let (cycles, output) = end.expect("control ends");
        assert_eq!((output.diagnostic.code, output.diagnostic.index), (code, 3));
        assert!(cycles <= longest, "{cycles}");
        // And it does not begin again.
        rig.ask(Request::Clear);
        rig.cycle(&reporting(&rig.input(&task), bad));
        rig.ask(Request::Engage);
        let refused = rig.cycle(&reporting(&rig.input(&task), bad)).request_diagnostic;
        assert!(code != DiagnosticCode::DriveFault || refused.code == code, "{refused:?}");
    }
}

/// In motion, with actual forces reported as `scale` of the commanded ones, so many cycles late, of which one leg reports the first
/// share and has the second. While the link is down no message passes, and the drives hold their forces. The cycles until control
/// ends, cause, leg, and the largest way from the setpoint \[m\].
fn with_forces(
    config: &Config,
    (scale, late, [reported, acting]): (f64, usize, [f64; 2]),
    cycles: usize,
    is_down: impl Fn(usize) -> bool,
) -> Option<(usize, DiagnosticCode, u32, f64)> {
    let (mut rig, _) = in_motion(config);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let period_s = rig.parameters.period_ns as f64 * 1e-9;
    let mut arrived = vec![];
    let mut farthest = 0.0_f64;
    for k in 0..cycles {
        let task = scene.at(period_s * (1500 + k) as f64);
        let mut input = rig.input(&task);
        if arrived.len() > late {
            let mut force: [f64; LEGS] = arrived[arrived.len() - 1 - late];
            force = force.map(|force| scale * force);
            force[1] *= reported;
            let drives = DriveStatus { force_n: Some(force), ..DriveStatus::default() };
            input = reporting(&input, drives);
        }
        if is_down(k) {
            input.measurement = None;
            // The source gets a processor before the driver.
            input.setpoint = input.setpoint.filter(|_| !is_down(k + 12));
        }
        let output = rig.controller.step(&input);
        if !output.state.has_control() {
            return Some((k, output.diagnostic.code, output.diagnostic.index, farthest));
        }
        let held = arrived.last().copied().filter(|_| is_down(k));
        let mut acts = held.unwrap_or(output.command_n);
        arrived.push(acts);
        acts[1] *= acting;
        let way = rig.simulator().state().pose.position - task.motion().pose.position;
        farthest = farthest.max(way.norm());
        rig.pass(Some(acts));
    }
    None
}

#[test]
fn a_force_that_does_not_arrive_is_noticed_by_the_drive_that_lacks_it() {
    let half = (1.0, 1, [0.5; 2]);
    let (cycles, code, leg, farthest) =
        with_forces(&deployed("motion_base"), half, 2000, |_| false).expect("control ends");
    println!("half of a force: {cycles} cycles, {farthest:.2e} m");
    assert_eq!((code, leg), (DiagnosticCode::DriveForceMissing, 2));
    assert!(cycles < 150 && farthest < 2e-3, "{cycles} cycles, {farthest} m");
}

#[test]
fn forces_of_a_tenth_less_that_are_late_are_no_fault() {
    for (scale, late) in [(1.0, 0), (0.9, 5), (1.1, 10)] {
        let end = with_forces(&deployed("motion_base"), (scale, late, [1.0; 2]), 4000, |_| false);
        assert_eq!(end, None, "{scale}, {late} ms late");
    }
}

/// A pause of the link that the timeouts permit ends nothing, whenever and however often it comes; a drive that then
/// reports half of its force is still found.
#[test]
fn a_link_that_was_down_is_no_fault_of_a_drive() {
    let timeouts = "[timeouts]\nsetpoint_ms = 100.0\nmeasured_ms = 100.0\nallow_unstable_age = true\n[drive]\ndelay_us = 100";
    let config = configured("motion_base", timeouts);
    for number in 0..12 {
        let mut random = Random::new(number);
        let pauses: [_; 8] = std::array::from_fn(|k| {
            let start = 250 * k + 50 + (100.0 * random.uniform()) as usize;
            start..start + (80.0 * random.uniform()) as usize
        });
        let is_down = |k: usize| pauses.iter().any(|pause| pause.contains(&k));
        let end = with_forces(&config, (1.0, 2, [1.0; 2]), 2000, is_down);
        assert_eq!(end, None, "{number}: {pauses:?}");
        // By the report alone: the motion shows nothing.
        let end = with_forces(&config, (1.0, 2, [0.5, 1.0]), 2000, is_down);
        assert!(
            end.is_some_and(|(_, code, leg, _)| (code, leg) == (DiagnosticCode::DriveForceMissing, 2)),
            "{end:?}"
        );
    }
}
