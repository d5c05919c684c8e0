//! The same setpoints give the same motion at every rate: allowances are per second, not per cycle.

use core::f64::consts::TAU;

use hexad::config::Config;
use hexad::control::constants::Constants;
use hexad::control::reference::ReferenceGenerator;
use hexad::control::setpoint::motion::SetpointMotion;
use hexad::control::setpoint::target::Target;
use hexad::control::signals::inputs::Setpoint;
use hexad::model::rigid::Pose;
use hexad::model::task::TaskState;

use hexad_support::data;
use hexad_support::rig::parameters;

const SECONDS: u64 = 2;
/// Instants at which the motions are compared \[1/s\]: those of the slowest loop.
const COMPARED_HZ: u64 = 100;

/// A jump, then a sine without its derivatives, then a stop of the messages.
fn task(home: &[f64; 6], t: f64) -> Option<TaskState> {
    let mut task = TaskState::at_rest(*home);
    task.x[2] += if t < 1.0 { 0.08 } else { 0.08 + 0.05 * (TAU * (t - 1.0)).sin() };
    task.x[5] += if t < 1.0 { 0.05 } else { 0.05 + 0.04 * (2.0 * TAU * (t - 1.0)).sin() };
    (t < 1.7).then_some(task)
}

fn motion(rate_hz: u64) -> Vec<Pose> {
    let config = Config::load(&data("motion_base", "toml")).unwrap();
    let mut parameters = parameters(&config);
    parameters.period_ns = 1_000_000_000 / rate_hz;
    let constants = Constants::new(&config.machine, parameters);
    let mut reference = ReferenceGenerator::new(&constants);
    let home = *reference.motion();
    reference.verify_start(&constants, &home).ok();
    reference.begin_placed_motion(0);
    let mut poses = Vec::new();
    for k in 1..=SECONDS * rate_hz {
        let end_ns = k * parameters.period_ns;
        // The setpoint of the instant that the slowest loop has just seen, in every loop.
        let seen_ns = (end_ns - 1) / 10_000_000 * 10_000_000;
        let task = task(&config.machine.home, seen_ns as f64 * 1e-9);
        let setpoint = task.map(|task| SetpointMotion::new(Setpoint::motion(seen_ns, task)));
        reference.advance(&constants, end_ns, setpoint.as_ref().map(Target::Motion).as_ref());
        if k % (rate_hz / COMPARED_HZ) == 0 {
            poses.push(reference.motion().pose);
        }
    }
    poses
}

#[test]
fn the_motion_does_not_depend_on_the_rate() {
    let fastest = motion(20_000);
    for rate_hz in [100, 200, 500, 1000, 4000, 10_000] {
        let differences = motion(rate_hz)
            .into_iter()
            .zip(&fastest)
            .map(|(pose, same)| {
                let difference = same.displacement_to(&pose);
                (difference.linear.norm() / 0.09).max(difference.angular.norm() / 0.13)
            })
            .fold(0.0, f64::max);
        println!("{rate_hz} Hz: {differences:.5} of the way");
        assert!(differences < 0.01, "{rate_hz} Hz: {differences}");
    }
}
