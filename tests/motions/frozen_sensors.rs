//! Sensors that go on repeating one reading with new time stamps: feedback pushes on until a fault, and must not push
//! harder than it may.

use super::heave::{FADE_S, Heave, amplitude};
use super::report::{Report, Runs};
use hexad::control::signals::inputs::Measurement;
use hexad_support::deployed;
use hexad_support::extremes::{MOTION_ALLOWANCE, Quantity};
use hexad_support::rig::parameters;

const MACHINES: [&str; 3] = ["reference", "motion_base", "fried2008"];
/// Angular frequencies of the vertical sines \[rad/s\].
const SINES_RAD_S: [f64; 4] = [3.0, 8.0, 20.0, 40.0];
/// Phases of the sine at which the sensors freeze, in quarter turns: at the turnaround and between.
const PHASES: [f64; 4] = [1.0, 1.5, 2.0, 2.5];
/// Until a fault must have come \[s\].
const AFTER_S: f64 = 1.0;

/// Part by which the acceleration may exceed its bound while the platform leaves the pose that the sensors show.
const FROZEN_POSE_ALLOWANCE: f64 = 1.04;

/// With frozen sensors the velocity may leave its limit by as much as the velocity error may reach before the fault, and
/// a leg with it.
fn allowed(quantity: Quantity, following_velocity_ratio: f64) -> f64 {
    match quantity {
        Quantity::Velocity | Quantity::AngularVelocity | Quantity::LegRate => {
            1.0 + MOTION_ALLOWANCE + following_velocity_ratio
        }
        // The forces are those of the pose that the sensors show.
        Quantity::Acceleration | Quantity::AngularAcceleration => FROZEN_POSE_ALLOWANCE,
        // The distance from the reference is what the controller cannot know; its end is the fault.
        Quantity::Following | Quantity::Engaging => f64::INFINITY,
        quantity => quantity.allowed(),
    }
}

#[test]
fn frozen_sensors_lead_to_no_acceleration_beyond_the_limits_and_to_a_fault() {
    let mut report = Report::new("frozen sensors");
    for name in MACHINES {
        let config = deployed(name);
        let parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let mut runs = Runs::default();
        let mut without_fault = 0.0;
        for (omega, phase) in SINES_RAD_S.iter().flat_map(|omega| PHASES.map(|phase| (omega, phase))) {
            let amplitude = amplitude(&parameters, &config.machine, &heave, *omega);
            let sine = |t| heave.sine(heave.middle(), amplitude, *omega, t);
            let quarter_s = 0.25 * core::f64::consts::TAU / omega;
            let turns = (FADE_S / (4.0 * quarter_s)).ceil();
            let frozen_s = (4.0 * turns + phase) * quarter_s;
            let mut frozen: Option<Measurement> = None;
            let last = runs.play((&config, parameters), &sine, frozen_s + AFTER_S, |rig, t| {
                let mut input = rig.input(&sine(t));
                if t >= frozen_s {
                    let frozen = frozen.get_or_insert_with(|| rig.measurement());
                    input.measurement = Some(Measurement { time_ns: rig.now_ns, ..*frozen });
                }
                input
            });
            without_fault +=
                f64::from(u32::from(last.state.has_control() || !last.diagnostic.code.is_fault()));
        }
        let ratio = parameters.following_velocity_m_s / parameters.limits.position.velocity;
        report.add_with(name, &runs, |quantity| allowed(quantity, ratio));
        report.bound(name, "runs without a fault", without_fault, 0.0);
    }
    report.assert();
}
