//! Every request in every state.

use hexad::control::signals::state::{Request, State};

use super::Script;
use super::recorder::Recorder;

const ENVELOPE: &str = "
[drive]
delay_us = 100.0
[measured]
rate_noise_m_s = 1e-4
[envelope]
pose_min = [-0.3, -0.3, -0.3, -0.3, -0.3, -0.3]
pose_max = [0.3, 0.3, 0.3, 0.3, 0.3, 0.3]
velocity = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]
acceleration = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0]
";

pub const SCRIPTS: &[Script] = &[
    ("requests_in_motion", "motion_base", ENVELOPE, in_motion),
    ("requests_in_each_state", "fried2008", "[limits]\nautonomous_scale = 0.5", in_each_state),
];

const UP: [f64; 6] = [0.02, -0.03, 0.05, 0.05, -0.04, 0.1];
const DOWN: [f64; 6] = [-0.02, 0.03, -0.05, -0.05, 0.04, -0.1];

fn in_motion(recorder: &mut Recorder) {
    // Nothing has arrived.
    recorder.run_with(3, |m| (m.input.setpoint, m.input.measurement) = (None, None));
    recorder.run_with(5, |m| m.input.setpoint = None);
    recorder.engage();
    recorder.go(UP, 0.6);
    recorder.run(250);
    recorder.ask(Request::Stop);
    recorder.until(State::Standby);
    recorder.engage();
    recorder.go(DOWN, 0.6);
    recorder.run(200);
    recorder.ask(Request::Park);
    recorder.until(State::Parking);
    recorder.run(100);
    recorder.ask(Request::Stop);
    recorder.until(State::Standby);
    recorder.engage();
    recorder.go(UP, 0.6);
    recorder.run(250);
    // The brakes decelerate the platform when it is engaged again.
    recorder.ask(Request::Off);
    recorder.run(4);
    recorder.ask(Request::Engage);
    recorder.run(370);
    recorder.go(DOWN, 0.7);
    recorder.run(250);
    recorder.ask(Request::Estop);
    recorder.run(5);
    recorder.ask(Request::Clear);
    recorder.run(5);
    recorder.ask(Request::Park);
}

fn in_each_state(recorder: &mut Recorder) {
    let all_in_turn = |recorder: &mut Recorder, but: &[Request]| {
        for request in Request::ALL.into_iter().filter(|request| !but.contains(request)) {
            recorder.ask(request);
            recorder.run(4);
        }
    };
    recorder.run(4);
    all_in_turn(recorder, &[Request::Engage, Request::Park]);
    recorder.engage();
    recorder.go([0.05, 0.0, 0.0, 0.03, 0.05, 0.0], 0.4);
    recorder.run(120);
    all_in_turn(recorder, &[Request::Park, Request::Stop, Request::Off, Request::Estop]);
    recorder.run(250);
    recorder.ask(Request::Stop);
    recorder.run(2);
    all_in_turn(recorder, &[Request::Stop, Request::Off, Request::Estop]);
    recorder.until(State::Parking);
    all_in_turn(recorder, &[Request::Stop, Request::Off, Request::Estop]);
    recorder.ask(Request::Off);
    recorder.run(10);
    // Off by request: engage ends it.
    recorder.stand();
    recorder.run(10);
    recorder.ask(Request::Engage);
    recorder.until(State::Active);
    recorder.go([0.0, 0.05, 0.05, -0.03, 0.0, 0.05], 0.4);
    recorder.run(180);
    recorder.ask(Request::Estop);
    recorder.run(2);
    all_in_turn(recorder, &[Request::Clear]);
    recorder.ask(Request::Clear);
    recorder.run(50);
    recorder.ask(Request::Park);
    recorder.until(State::Parking);
    recorder.run(30);
    recorder.ask(Request::Stop);
    recorder.until(State::Standby);
    recorder.engage();
    // Engaging, and stopped before the setpoint is reached.
    recorder.ask(Request::Stop);
    recorder.until(State::Standby);
    recorder.go([0.0, 0.0, 0.0, 0.0, 0.0015, 0.0], 0.0);
    recorder.ask(Request::Engage);
    recorder.run(6);
    recorder.ask(Request::Park);
    recorder.until(State::Off);
    recorder.stand();
    recorder.run(5);
    recorder.ask(Request::Engage);
    recorder.until(State::Active);
    recorder.go([0.05, 0.05, 0.05, -0.03, 0.02, 0.05], 0.6);
    recorder.run(350);
    recorder.ask(Request::Off);
    recorder.run(10);
    recorder.ask(Request::Park);
}
