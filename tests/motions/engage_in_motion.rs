//! `engage` onto a moving setpoint, with all inputs in order, where the platform stands on the setpoint's way.

use hexad::config::Config;
use hexad::control::parameters::Parameters;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::TaskState;

use super::heave::{FADE_S, Heave, amplitude};
use super::report::{Report, Runs};
use hexad_support::certificate::cases;
use hexad_support::deployed;
use hexad_support::fast::Fast;
use hexad_support::rig::{Rig, parameters};

const MACHINES: [&str; 4] = ["reference", "motion_base", "fried2008", "tsai2000"];
/// Part of the engage tolerance in which the setpoint passes the platform.
const WITHIN_TOLERANCE: f64 = 0.9;
/// From one instant at which `engage` is tried to the next \[s\].
const STEP_S: f64 = 0.007;
/// Long enough for the pose to be found from the lengths \[s\].
const BEFORE_S: f64 = 0.3;
/// From the request on \[s\].
const AFTER_S: f64 = 1.5;
/// Angular frequencies of the vertical sines \[rad/s\].
const SINES_RAD_S: [f64; 4] = [3.0, 4.5, 8.0, 20.0];
/// Largest distance from the setpoint over the way in which the platform could stop at all, which is the least that a
/// platform at rest falls behind a setpoint that leaves with full velocity.
const LARGEST_LAG_RATIO: f64 = 2.0;

/// Part of the instants at which `engage` may be refused, though the setpoint is within the tolerance.
const MOST_REFUSED: f64 = 0.2;

/// A setpoint within the limits at every instant.
type Motion<'a> = &'a dyn Fn(f64) -> TaskState;

/// Whether a platform at rest may engage on this setpoint.
fn can_engage(parameters: &Parameters, task: &TaskState) -> bool {
    let twist = task.motion().twist;
    let stiffness = [parameters.law.position.kp_per_s2, parameters.law.orientation.kp_per_s2];
    let [v, omega] = [twist.linear.norm() / stiffness[0].sqrt(), twist.angular.norm() / stiffness[1].sqrt()];
    v < WITHIN_TOLERANCE * parameters.engage_position_m
        && omega < WITHIN_TOLERANCE * parameters.engage_orientation_rad
}

fn engage_at(config: &Config, parameters: Parameters, motion: Motion<'_>, t: f64, runs: &mut Runs) {
    let mut observed = Rig::standing(config, parameters, &motion(t));
    observed.rates = runs.rates();
    let (mut was_asked, mut was_accepted) = (false, false);
    while observed.time_s() < BEFORE_S + AFTER_S {
        if !was_asked && observed.time_s() >= BEFORE_S {
            observed.ask(Request::Engage);
            was_asked = true;
        }
        let task = motion(t - BEFORE_S + observed.time_s());
        let output = observed.cycle(&observed.input(&task));
        if output.state.has_control() {
            was_accepted = true;
            let expected = motion(t - BEFORE_S + observed.time_s()).motion().pose;
            let distance = (observed.simulator().state().pose.position - expected.position).norm();
            runs.distance_m = runs.distance_m.max(distance);
        } else if was_asked {
            break;
        }
    }
    runs.accepted += u32::from(was_accepted);
    runs.add(&observed);
}

fn engage_on(
    config: &Config,
    parameters: Parameters,
    motion: Motion<'_>,
    range_s: [f64; 2],
    runs: &mut Runs,
) {
    let steps = ((range_s[1] - range_s[0]) / STEP_S) as u32;
    for t in cases(0..=steps, 4).into_iter().map(|step| range_s[0] + f64::from(step) * STEP_S) {
        if can_engage(&parameters, &motion(t)) {
            engage_at(config, parameters, motion, t, runs);
        }
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_engaging_onto_a_moving_setpoint_stays_within_the_limits() {
    let mut report = Report::new("engage in motion");
    for name in MACHINES {
        let config = deployed(name);
        let parameters = parameters(&config);
        let mut runs = Runs::default();
        let fast = Fast::new(&config);
        engage_on(&config, parameters, &|t| fast.at(t), [0.5, fast.duration() - 0.5], &mut runs);
        let heave = Heave::new(&config.machine, &parameters);
        for omega in SINES_RAD_S {
            let amplitude = amplitude(&parameters, &config.machine, &heave, omega);
            let turn_s = core::f64::consts::TAU / omega;
            for middle in heave.middles(amplitude) {
                let sine = |t| heave.sine(middle, amplitude, omega, t);
                engage_on(&config, parameters, &sine, [FADE_S, FADE_S + turn_s], &mut runs);
            }
        }
        report.add(name, &runs);
        report.bound(
            name,
            "part of the runs refused",
            f64::from(runs.count - runs.accepted) / f64::from(runs.count),
            MOST_REFUSED,
        );
        let limits = &parameters.limits.position;
        let (v, a, j) = (limits.velocity, limits.acceleration, limits.jerk);
        let lag = parameters.engage_position_m + LARGEST_LAG_RATIO * (0.5 * v * v / a + 0.5 * v * a / j);
        report.bound(name, "distance from the setpoint", runs.distance_m, lag);
    }
    report.assert();
}

/// The state of engaging is reached at all, or the test above says nothing.
#[test]
fn a_setpoint_in_motion_is_engaged() {
    let config = deployed("reference");
    let parameters = parameters(&config);
    let heave = Heave::new(&config.machine, &parameters);
    let start = heave.at([heave.middle(), 0.0, 0.0]);
    let mut observed = Rig::standing(&config, parameters, &start);
    observed.engage(&start);
    assert_eq!(observed.cycle(&observed.input(&start)).state, State::Active);
}
