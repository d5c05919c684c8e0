//! Wrong measurements, drives, hosts and surroundings.

use core::f64::consts::TAU;

use hexad::control::signals::inputs::DriveStatus;
use hexad::control::signals::state::{Request, State};
use hexad::model::LEGS;
use hexad::motion::built_in::BuiltInMotion;

use super::Script;
use super::recorder::{Moment, Recorder};

pub const SCRIPTS: &[Script] = &[
    ("measurements_wrong", "reference", "[drive]\ndelay_us = 100.0", measurements_wrong),
    ("measurements_implausible", "fried2008", "[measured]\nlength_step_m = 1e-7", measurements_implausible),
    ("drives_and_external_poses", "fried2008", "[drive]\nready_timeout_ms = 40.0", drives_and_external_poses),
    ("bus_of_drives_fails", "tabletop", "", bus_of_drives_fails),
    ("stamps_release_the_cycles", "tsai2000", EXTERNAL, stamps),
    ("payload_and_impacts", "motion_base", IMPERFECT, payload_and_impacts),
    ("weak_feedback", "scattered", WEAK, weak_feedback),
];

/// A disturbance, and for how many cycles it lasts.
type Fault = (u64, fn(&mut Moment<'_>));

const MOVES: [f64; 6] = [0.05, -0.03, 0.04, 0.02, -0.02, 0.03];

/// Each fault in the middle of a motion, one there, the next back.
fn each_in_motion(recorder: &mut Recorder, faults: &[Fault]) {
    for (number, (cycles, fault)) in faults.iter().enumerate() {
        recorder.engage();
        recorder.go(MOVES.map(|x| if number % 2 == 0 { x } else { -x }), 0.2);
        recorder.run(70);
        recorder.run_with(*cycles, fault);
        recorder.run(30);
    }
}

fn measurements_wrong(recorder: &mut Recorder) {
    // Lengths far from home's, which are found step by step.
    recorder.run_with(30, |m| m.measured().length_m = [0.86, 0.86, 0.6, 0.6, 0.86, 0.86]);
    recorder.run(30);
    let faults: &[Fault] = &[
        (14, |m| m.input.measurement = m.before.measurement),
        (14, |m| m.measured().length_m[2] = f64::NAN),
        (14, |m| m.rate()[1] = f64::INFINITY),
        (14, |m| m.measured().length_m[3] += 0.02),
        (14, |m| m.measured().length_m[0] = 1.2),
        (14, |m| m.measured().time_ns -= 1_000_000_000),
        (14, |m| m.measured().time_ns += 1_000_000_000),
        (14, |m| m.measured().time_ns = m.before.release_ns - 100_000 * (m.cycle + 6)),
        (14, |m| m.rate().iter_mut().for_each(|rate| *rate *= 1e3)),
        // One wrong message is passed over.
        (30, |m| m.measured().length_m[5] += if m.cycle == 3 { 0.02 } else { 0.0 }),
    ];
    each_in_motion(recorder, faults);
}

fn measurements_implausible(recorder: &mut Recorder) {
    // No pose has these lengths.
    recorder.run_with(90, |m| m.measured().length_m = [1.59, 0.86, 0.86, 0.86, 0.86, 0.86]);
    let faults: &[Fault] = &[
        (20, |m| m.measured().length_m[3] += 0.002),
        (30, |m| {
            let mut frozen = m.before.measurement.unwrap();
            frozen.time_ns = m.measured().time_ns;
            m.input.measurement = Some(frozen);
        }),
        (30, |m| m.measured().length_m[4] = m.before.measurement.unwrap().length_m[4]),
        (20, |m| m.rate().iter_mut().for_each(|rate| *rate = -*rate)),
        (60, |m| m.rate().iter_mut().for_each(|rate| *rate *= 0.5)),
        (30, |m| m.rate()[2] = 0.0),
        // Sensors that drift apart.
        (80, |m| m.measured().length_m[1] += 2e-5 * m.cycle as f64),
        (30, |m| m.measured().rate_m_s = None),
    ];
    each_in_motion(recorder, faults);
    // The host takes the processor for a while.
    recorder.engage();
    recorder.go(MOVES, 0.2);
    recorder.run(70);
    recorder.pause(100);
    recorder.run(30);
    // A drive that braked by itself.
    recorder.engage();
    recorder.drives = Box::new(|_, _| None);
    recorder.go(MOVES, 0.2);
    recorder.run(100);
}

const ALL: u32 = (1 << LEGS) - 1;

/// All that a driver may report, in order.
fn report(m: &mut Moment<'_>) {
    let x = m.x;
    let force = m.force;
    let of_all = |is_set: bool| Some(if is_set { ALL } else { 0 });
    let (enabled, brake_open) = (of_all(force.is_some()), of_all(force.is_some()));
    let measured = m.measured();
    measured.pose = Some(x);
    let force_n = Some(force.unwrap_or_default());
    measured.drives = DriveStatus { enabled, brake_open, fault: Some(0), force_n };
}

fn drives_and_external_poses(recorder: &mut Recorder) {
    recorder.always = report;
    let faults: &[Fault] = &[
        (60, |m| m.measured().pose.as_mut().unwrap()[3] += 0.0012),
        (40, |m| m.measured().drives.enabled = Some(ALL & !4)),
        (40, |m| m.measured().drives.brake_open = Some(ALL & !32)),
        (10, |m| m.measured().drives.fault = Some(8)),
        (120, |m| m.measured().drives.force_n.as_mut().unwrap()[1] *= 0.3),
        // A driver that reports less and less.
        (10, |m| m.measured().drives = DriveStatus { force_n: None, ..DriveStatus::default() }),
        (10, |m| m.measured().pose.as_mut().unwrap()[0] = f64::NAN),
    ];
    each_in_motion(recorder, faults);
    // Drives that never become ready.
    recorder.stand();
    recorder.ask(Request::Clear);
    recorder.run(40);
    recorder.ask(Request::Engage);
    recorder.run_with(60, |m| m.measured().drives.enabled = Some(0));
    recorder.always = |m| m.measured().drives.fault = Some(0);
    recorder.engage();
    recorder.go(MOVES, 0.3);
}

fn bus_of_drives_fails(recorder: &mut Recorder) {
    recorder.always = report;
    let faults: &[Fault] = &[
        (14, |m| m.measured().drives.fault = Some(DriveStatus::BUS_FAILED_BIT)),
        (1, |m| m.measured().drives.fault = Some(DriveStatus::BUS_FAILED_BIT | 8)),
        (30, |m| {
            m.measured().drives.fault = Some(DriveStatus::BUS_FAILED_BIT);
            m.measured().length_m = [f64::NAN; LEGS];
        }),
    ];
    each_in_motion(recorder, faults);
    recorder.engage();
    recorder.go(MOVES, 0.3);
}

/// The timeout is longer than the loop is stable with.
const EXTERNAL: &str = "
[realtime]
release = \"external\"
rate_hz = 500.0
[timeouts]
measured_ms = 20.0
allow_unstable_age = true
";

fn stamps(recorder: &mut Recorder) {
    recorder.phase_ns = 0;
    // The clock of the drives began at another time and is a little fast; messages arrive up to 0.3 ms late.
    recorder.always = |m| {
        let jitter_ns = (3e5 * m.random.uniform()) as i64;
        let offset_ns = -3_600_000_000_000 + (m.input.release_ns / 100_000) as i64 - jitter_ns;
        m.input.clock_offset_ns = offset_ns;
        m.input.setpoint_publishers.used_pid = 4711;
        m.input.measured_publishers.used_pid = 4712;
    };
    recorder.run_with(30, |m| m.input.setpoint_publishers.ignored_pid_or_0 = 4713);
    recorder.ask(Request::Engage);
    recorder.run_with(30, |m| m.input.setpoint_publishers.ignored_pid_or_0 = 4713);
    recorder.ask(Request::Engage);
    recorder.run_with(30, |m| m.input.measured_publishers.ignored_pid_or_0 = 4714);
    recorder.engage();
    recorder.go(MOVES, 0.5);
    recorder.run(150);
    recorder.run_with(1, |m| m.input.had_faulty_overrun = true);
    recorder.until(State::Fault);
    recorder.engage();
    recorder.play(BuiltInMotion::Circle, 3.0);
    recorder.run(400);
    // Of the daemon's clock three milliseconds pass in each cycle.
    recorder.run_with(60, |m| m.input.clock_offset_ns -= 1_000_000 * (m.cycle as i64 + 1));
    recorder.engage();
    recorder.go(MOVES.map(|x| -x), 0.6);
    recorder.run(100);
    recorder.run_with(14, |m| m.measured().time_ns -= 19_000_000);
    recorder.run(20);
    recorder.engage();
    recorder.go(MOVES, 0.6);
    recorder.run(100);
    // Two sources once control has begun.
    recorder.run_with(100, |m| {
        (m.input.setpoint_publishers.ignored_pid_or_0, m.input.measured_publishers.ignored_pid_or_0) =
            (4715, 4716);
    });
    recorder.pause(40);
    recorder.run(20);
    recorder.engage();
    recorder.play(BuiltInMotion::Sines, 3.0);
}

/// Sensors with noise, friction, a payload that the model lacks; no rates are measured.
const IMPERFECT: &str = "
[realtime]
rate_hz = 500.0
[measured]
length_step_m = 1e-6
length_noise_m = 2e-6
[plant]
sensor = { length_step_m = 1e-6, length_noise_m = 2e-6 }
friction = { coulomb_n = 40.0, stiction_n = 20.0, viscous_n_s_m = 50.0 }
build = { payload_kg = 40.0, joint_error_m = 1e-4 }
drive = { force_step_n = 0.5, dead_time_us = 300.0 }
external = { force_n = [30.0, 0.0, 20.0], frequency_hz = 3.0 }
";

/// The force of the drives, and what pushes beside them.
fn pushed(recorder: &mut Recorder, push: fn(f64) -> [f64; LEGS]) {
    recorder.drives = Box::new(move |time_s, force| {
        let push = push(time_s);
        Some(core::array::from_fn(|leg| force[leg] + push[leg]))
    });
}

/// Mostly aside.
const ASIDE: [f64; LEGS] = [3000.0, -3000.0, -3000.0, 3000.0, 0.0, 0.0];

fn payload_and_impacts(recorder: &mut Recorder) {
    recorder.has_rates = false;
    recorder.engage();
    // A weight of a sixth of the platform, a second after control began.
    recorder.run(560);
    pushed(recorder, |_| [-400.0; LEGS]);
    recorder.until(State::Fault);
    pushed(recorder, |_| [0.0; LEGS]);
    recorder.engage();
    recorder.play(BuiltInMotion::Sines, 4.0);
    recorder.run(120);
    // Struck for 12 ms.
    pushed(recorder, |_| ASIDE);
    recorder.run(6);
    pushed(recorder, |_| [0.0; LEGS]);
    recorder.until(State::Fault);
    recorder.engage();
    // A drive that shakes.
    pushed(recorder, |t| [0.0, 0.0, 0.0, 0.0, 2000.0 * (30.0 * TAU * t).sin(), 0.0]);
    recorder.run(600);
    pushed(recorder, |_| [0.0; LEGS]);
    recorder.engage();
    recorder.play(BuiltInMotion::Sines, 4.0);
    recorder.run(120);
    // A collision that lasts.
    pushed(recorder, |_| ASIDE);
    recorder.run(40);
    pushed(recorder, |_| [0.0; LEGS]);
    recorder.engage();
    recorder.run(150);
    recorder.drives = Box::new(|_, mut force| {
        force[4] = 0.0;
        Some(force)
    });
    recorder.run(60);
}

/// Changes of payload and surroundings are allowed, and feedback is weak.
const WEAK: &str = "
[control]
fidelity = \"lumped-legs\"
following_position_m = 0.004
following_velocity_m_s = 0.5
following_velocity_rad_s = 0.05
[limits]
acceleration_m_s2 = 0.6
feedback_scale = 0.02
payload_change_kg = inf
disturbance_step_m_s2 = inf
";

fn weak_feedback(recorder: &mut Recorder) {
    recorder.engage();
    recorder.play(BuiltInMotion::MinimumJerk, 12.0);
    recorder.run(600);
    let aside = |_| ASIDE.map(|force| 0.2 * force);
    for push in [|_| [-20.0; LEGS], |_| [-600.0; LEGS], aside, |_| [-90.0; LEGS], |_| [-150.0; LEGS]] {
        pushed(recorder, push);
        recorder.run(160);
        pushed(recorder, |_| [0.0; LEGS]);
        recorder.run(100);
        recorder.engage();
    }
    recorder.go([0.01, 0.01, 0.01, 0.01, 0.01, 0.01], 1.0);
}
