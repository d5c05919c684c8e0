//! Slow and fast loops, and the control modes.

use hexad::control::signals::state::{Request, State};
use hexad::motion::built_in::BuiltInMotion;

use super::Script;
use super::recorder::Recorder;

pub const SCRIPTS: &[Script] = &[
    (
        "loop_100_hz",
        "ceiling",
        "[realtime]\nrate_hz = 100.0\n[drive]\ndelay_us = 500.0\n[control]\non_setpoint_lost = \"park\"",
        slow,
    ),
    ("loop_250_hz_feedforward", "sideways_x_up", FEEDFORWARD, slow),
    ("loop_5_khz_lengths_only", "scattered", LENGTHS_ONLY, fast),
    ("loop_20_khz", "gimbal", "[realtime]\nrate_hz = 20000.0\n[drive]\ndelay_us = 30.0\nlag_us = 20.0", fast),
    (
        "gravity_joint_pd",
        "tilted",
        "[control]\nmode = \"gravity_joint_pd\"\nfollowing_velocity_m_s = 0.03",
        mode,
    ),
    ("joint_pd", "tsai2000", JOINT_PD, mode),
];

const FEEDFORWARD: &str = "
[realtime]
rate_hz = 250.0
[control]
mode = \"feedforward_joint_pd\"
fidelity = \"no-velocity\"
[setpoint]
on_violation = \"limit\"
";

const LENGTHS_ONLY: &str = "
[realtime]
rate_hz = 5000.0
[control]
fidelity = \"rigid-legs\"
[measured]
length_step_m = 5e-8
length_noise_m = 1e-7
[plant]
sensor = { length_step_m = 5e-8, length_noise_m = 1e-7 }
";

const JOINT_PD: &str = "
[realtime]
rate_hz = 2000.0
[control]
mode = \"joint_pd\"
fidelity = \"massless-legs\"
[setpoint]
on_violation = \"limit\"
";

/// Minutes would fit in: a motion, a stop, the way home, a source that is lost.
fn slow(recorder: &mut Recorder) {
    recorder.run(20);
    recorder.engage();
    recorder.play(BuiltInMotion::Sines, 6.0);
    recorder.run(500);
    recorder.ask(Request::Stop);
    recorder.until(State::Standby);
    recorder.engage();
    recorder.play(BuiltInMotion::MinimumJerk, 5.0);
    recorder.run(200);
    recorder.fall_silent();
    recorder.run(100);
    recorder.engage();
    recorder.go([0.05, 0.05, 0.05, 0.05, 0.05, 0.05], 1.5);
    recorder.run(150);
    recorder.ask(Request::Park);
    recorder.run(300);
    recorder.engage();
    recorder.play(BuiltInMotion::Paper, 4.0);
    recorder.run(200);
    recorder.ask(Request::Estop);
    recorder.run(20);
    recorder.engage();
}

/// Within a tenth of a second or half of one.
fn fast(recorder: &mut Recorder) {
    recorder.run(40);
    recorder.engage();
    recorder.go([0.0005, -0.001, 0.0008, 0.001, 0.0005, 0.0012], 0.06);
    recorder.run(700);
    recorder.ask(Request::Stop);
    recorder.run(300);
    recorder.engage();
    recorder.go([0.001, 0.001, 0.0008, -0.001, 0.0005, -0.0012], 0.05);
    recorder.run(400);
    recorder.ask(Request::Off);
    recorder.run(60);
    recorder.ask(Request::Park);
}

fn mode(recorder: &mut Recorder) {
    recorder.run(20);
    recorder.engage();
    recorder.run(300);
    recorder.go([0.05, -0.04, 0.03, 0.02, 0.02, 0.03], 0.5);
    recorder.run(700);
    recorder.go([-0.05, 0.04, -0.03, -0.02, -0.02, -0.03], 0.4);
    recorder.run(200);
    recorder.fall_silent();
    recorder.run(300);
    recorder.engage();
    recorder.ask(Request::Park);
}
