//! Setpoints of every kind, wrong ones and lost ones, under both policies.

use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::{Request, State};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::task::TaskState;
use hexad::motion::built_in::BuiltInMotion;
use nalgebra::Vector6;

use super::Script;
use super::recorder::{Moment, Recorder};

const LIMIT: &str = "[setpoint]\non_violation = \"limit\"\n[drive]\ndelay_us = 100.0\n";
const LIMIT_500: &str = "[setpoint]\non_violation = \"limit\"\n[realtime]\nrate_hz = 500.0\n[limits]\nautonomous_scale = 1.0\nforce_rate_n_s = 450.0";

pub const SCRIPTS: &[Script] = &[
    ("setpoints_wrong_stop", "tilted", "[drive]\ndelay_us = 100.0", wrong_under_stop),
    ("setpoints_beyond_limits_stop", "motion_base", ENVELOPE, beyond_limits_under_stop),
    ("setpoints_wrong_limit", "fried2008", WEAK_DRIVES, wrong_under_limit),
    ("poses_at_60_hz", "telescope", LIMIT, poses),
    ("parks_under_limit", "motion_base", PARKS, parks),
    ("targets", "tabletop", LIMIT_500, targets),
    ("near_singular_poses", "motion_base", NEAR_SINGULAR, near_singular),
    ("weak_poses", "motion_base", LIMIT, weak_poses),
];

const PARKS: &str = "
[setpoint]
on_violation = \"limit\"
[control]
on_setpoint_lost = \"park\"
lost_hold_s = 0.2
";

/// Drives that the limits of the reference demand too much of.
const WEAK_DRIVES: &str = "
[setpoint]
on_violation = \"limit\"
[drive]
delay_us = 100.0
[actuator]
max_force_n = 52.0
[limits]
acceleration_m_s2 = 5.0
force_rate_n_s = 2500.0
";

const ENVELOPE: &str = "
[limits]
autonomous_scale = 0.6
[envelope]
pose_min = [-0.5, -0.5, -0.1, -1.0, -1.0, -1.0]
pose_max = [0.5, 0.5, 0.1, 1.0, 1.0, 1.0]
velocity = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
acceleration = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0]
";

type Fault = fn(&mut Moment<'_>);

const MOVES: [f64; 6] = [0.03, -0.03, 0.04, 0.03, -0.02, 0.03];

/// Each fault for 55 cycles in the middle of a motion, one there, the next back.
fn each_in_motion(recorder: &mut Recorder, faults: &[Fault]) {
    for (number, fault) in faults.iter().enumerate() {
        recorder.engage();
        recorder.go(MOVES.map(|x| if number % 2 == 0 { x } else { -x }), 0.25);
        recorder.run(80);
        recorder.run_with(55, fault);
        recorder.until(State::Fault);
    }
}

fn wrong_under_stop(recorder: &mut Recorder) {
    each_in_motion(
        recorder,
        &[
            |m| m.input.setpoint = m.before.setpoint,
            |m| m.task().x[4] = f64::NAN,
            |m| m.task().xdd[0] = f64::NEG_INFINITY,
            |m| m.task().x[3] += 0.01,
            |m| m.task().xd *= -1.0,
            |m| m.setpoint().time_ns -= 1_000_000_000,
            |m| m.setpoint().kind = SetpointKind::Unknown,
            |m| m.setpoint().kind = SetpointKind::Pose,
        ],
    );
    recorder.engage();
    // One wrong message among right ones is passed over; a source that ends at rest is no fault.
    recorder.run_with(20, |m| m.task().x[2] += if m.cycle == 5 { 0.05 } else { 0.0 });
    recorder.fall_silent();
    recorder.run(120);
    recorder.stand();
    recorder.run(10);
    recorder.go([0.0, 0.0, 0.0, 0.0, 0.01, 0.0], 0.0);
    recorder.run(10);
    recorder.ask(Request::Engage);
}

fn beyond_limits_under_stop(recorder: &mut Recorder) {
    each_in_motion(recorder, &[|m| m.task().xd[4] = 1.5, |m| m.task().x[2] = 0.11, |m| m.task().x[5] += 0.9]);
    recorder.engage();
    // Smoothly to the end of the stroke.
    recorder.go([0.0, 0.0, 0.0, 0.0, 0.0, 0.9], 1.8);
}

fn wrong_under_limit(recorder: &mut Recorder) {
    recorder.engage();
    recorder.go(MOVES, 0.5);
    recorder.run(200);
    let wrong: &[Fault] = &[
        |m| m.task().x[3] += 0.1,
        |m| m.task().x[5] -= 2.0,
        |m| m.task().xd *= 100.0,
        |m| m.task().x[1] = f64::NAN,
        |m| m.setpoint().kind = SetpointKind::Unknown,
        |m| m.setpoint().time_ns += 500_000_000,
    ];
    for wrong in wrong {
        recorder.run_with(120, wrong);
        if recorder.output.state == State::Fault {
            recorder.engage();
        }
    }
    recorder.play(BuiltInMotion::Sines, 3.0);
    // Nothing but noise.
    recorder.run_with(250, |m| {
        let random = &mut *m.random;
        let mut noise = |size: f64| Vector6::from_fn(|_, _| size * (2.0 * random.uniform() - 1.0));
        let (x, xd, xdd) = (noise(0.1), noise(2.0), noise(50.0));
        let task = m.task();
        (task.x, task.xd, task.xdd) = (task.x + x, xd, xdd);
    });
    recorder.fall_silent();
    recorder.run(350);
    recorder.go(MOVES, 0.5);
    recorder.run(150);
    recorder.ask(Request::Stop);
}

fn poses(recorder: &mut Recorder) {
    (recorder.kind, recorder.interval) = (SetpointKind::Pose, 17);
    recorder.run(20);
    recorder.engage();
    recorder.play(BuiltInMotion::Sines, 3.0);
    // A third of the messages is lost, and one measurement in five.
    recorder.run_with(900, |m| {
        if m.random.uniform() < 0.2 {
            m.input.measurement = m.last.measurement;
        }
        let is_new = m.input.setpoint != m.last.setpoint;
        if is_new && m.random.uniform() < 0.33 {
            m.input.setpoint = m.last.setpoint;
        }
    });
    recorder.fall_silent();
    recorder.run(300);
    recorder.play(BuiltInMotion::Circle, 3.0);
    recorder.run(300);
    recorder.kind = SetpointKind::Motion;
    recorder.run(150);
}

/// The source ends while the platform is tilted.
fn parks(recorder: &mut Recorder) {
    recorder.run(20);
    recorder.engage();
    recorder.go([0.05, 0.0, 0.0, 0.0, 0.0, 0.02], 0.4);
    recorder.run(450);
    recorder.fall_silent();
    recorder.until(State::Off);
}

fn targets(recorder: &mut Recorder) {
    recorder.kind = SetpointKind::Target;
    recorder.interval = 10;
    recorder.run(20);
    recorder.engage();
    for (offset, speed) in [
        ([0.05, 0.0, 0.0, 0.004, 0.0, 0.003], 0.0),
        ([0.0, -0.08, 0.0, 0.0, -0.006, 0.0], 0.5),
        ([-0.05, 0.08, 0.1, -0.004, 0.006, 0.0], 0.1),
        ([0.0, 0.0, -0.4, 0.0, 0.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.1], 0.0),
    ] {
        recorder.target_speed = speed;
        recorder.go(offset, 0.0);
        recorder.run(180);
    }
    recorder.fall_silent();
    recorder.run(250);
    recorder.ask(Request::Park);
    recorder.until(State::Off);
    recorder.stand();
    recorder.engage();
    recorder.kind = SetpointKind::Motion;
    recorder.interval = 1;
    recorder.go([0.03, 0.0, 0.0, 0.0, 0.003, 0.0], 0.3);
}

/// A quarter turn from the usual home is a singular pose: home is 0.3 rad before it.
const NEAR_SINGULAR: &str = "
[realtime]
rate_hz = 500.0
[control]
orientation_bandwidth_hz = 3.0
compensate_disturbances = false
[home]
pose = [0.0, 0.0, 1.2708, 0.0, 0.0, 1.25]
[actuator]
min_length_m = 0.9
max_length_m = 4.0
max_rate_m_s = 5.0
max_force_n = 1e6
[limits]
velocity_m_s = 5.0
velocity_rad_s = 5.0
acceleration_m_s2 = 20.0
acceleration_rad_s2 = 20.0
jerk_m_s3 = 2000.0
jerk_rad_s3 = 2000.0
condition = 60.0
disturbance_step_m_s2 = inf
payload_change_kg = inf
[setpoint]
on_violation = \"limit\"
";

fn weak_poses(recorder: &mut Recorder) {
    recorder.run(20);
    // It is carried down to where the drives cannot hold it, stands, and is carried back.
    let (machine, mut task) = (recorder.config.machine.clone(), TaskState::at_rest(recorder.x().into()));
    recorder.run_with(700, |m| {
        task.x[5] += match m.cycle {
            0..250 => -0.0045,
            250..450 => 0.0,
            _ => 0.0045,
        };
        *m.task() = task;
        m.measured().length_m = leg_lengths(&machine, &task.motion().pose);
        m.measured().rate_m_s = None;
    });
    recorder.run(20);
    recorder.engage();
    recorder.go([0.0, 0.0, 0.0, 0.0, 0.0, -1.2], 0.8);
    recorder.run(500);
    recorder.go([0.1, 0.0, 0.0, 0.2, 0.0, -0.4], 0.5);
}

fn near_singular(recorder: &mut Recorder) {
    recorder.run(20);
    // It is carried across the singular pose, and back.
    let (machine, mut task) = (recorder.config.machine.clone(), TaskState::at_rest(recorder.x().into()));
    recorder.run_with(500, |m| {
        task.x[2] += if m.cycle < 250 { 0.0024 } else { -0.0024 };
        m.measured().length_m = leg_lengths(&machine, &task.motion().pose);
        m.measured().rate_m_s = None;
    });
    recorder.run(20);
    recorder.engage();
    recorder.go([0.0, 0.0, 0.28, 0.0, 0.0, 0.0], 0.8);
    recorder.run(500);
    recorder.go([0.05, 0.0, -0.2, 0.0, 0.1, 0.1], 0.6);
    recorder.run(320);
    recorder.go([-0.05, 0.0, 0.28, 0.0, -0.1, -0.1], 0.6);
    recorder.run(400);
    // Something turns the platform on.
    let start_s = recorder.time_s();
    recorder.drives = Box::new(move |time_s, mut force| {
        let push = 3e4 * (time_s - start_s);
        force.iter_mut().zip([1.0, -1.0].into_iter().cycle()).for_each(|(force, sign)| *force += sign * push);
        Some(force)
    });
    recorder.until(State::Fault);
    recorder.run(30);
    recorder.ask(Request::Clear);
}
