//! Delay of the drives from a motion under control, which does not know it.

use hexad::analysis::drive_delay::{DriveDelay, RecordedStretch, drive_delay};
use hexad::config::Config;
use hexad::control::signals::state::State;
use hexad::motion::built_in::{BuiltInMotion, fit};
use hexad::plant::imperfections::{BuildErrors, DriveErrors, Friction, Imperfections, SensorErrors};

use rayon::prelude::*;

use hexad_support::certificate::cases;
use hexad_support::edited::configured;
use hexad_support::rig::{Rig, SENDING, record};

/// Duration of the motion \[s\].
const MOTION_S: f64 = 20.0;
/// From the start to the motion \[s\].
const SETTLING_S: f64 = 1.0;

/// A cautious loop that does not know its delay.
fn config(machine: &str, rate_hz: f64) -> Config {
    configured(
        machine,
        &format!(
            "[realtime]\nrate_hz = {rate_hz:?}\n[control]\nposition_bandwidth_hz = 3.0\norientation_bandwidth_hz = 3.0"
        ),
    )
}

/// Moves the platform and measures the delay of its drives.
fn measured(config: &Config, imperfections: &Imperfections) -> Option<DriveDelay> {
    drive_delay(&config.machine, &[recorded(config, imperfections, BuiltInMotion::Sines)])
}

fn recorded(config: &Config, imperfections: &Imperfections, motion: BuiltInMotion) -> RecordedStretch {
    let mut control = Rig::imperfect(config, &config.machine, imperfections);
    let motion = fit(&config.machine, motion, MOTION_S);
    let mut stretch = RecordedStretch::default();
    while control.time_s() < SETTLING_S + MOTION_S {
        let input = control.waiting_input(&motion.at(control.time_s() - SETTLING_S));
        let output = control.cycle(&input);
        if control.time_s() > SETTLING_S {
            assert_eq!(output.state, State::Active, "{:?}", output.diagnostic);
        }
        if output.state == State::Active {
            record(&mut stretch, &input, &output);
        }
    }
    stretch
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_the_delay_of_the_drives_is_measured() {
    // Friction as a share of the largest force, which on the light machine is many times its weight.
    let loops = [("motion_base", 1000.0, 0.01), ("fried2008", 1000.0, 0.001), ("motion_base", 250.0, 0.003)];
    let drives = [0.0, 2.0, 5.0, 10.0].into_iter().flat_map(|dead_ms| [(dead_ms, false), (dead_ms, true)]);
    let all = loops.into_iter().flat_map(|control| drives.clone().map(move |drive| (control, drive)));
    cases(all, 3).into_par_iter().for_each(|((machine, rate_hz, friction), (dead_ms, is_imperfect))| {
        let config = config(machine, rate_hz);
        let most = config.machine.actuator.max_force_n;
                let drive = DriveErrors { dead_time_ns: (1e6 * dead_ms) as u64, ..DriveErrors::default() };
                let mut imperfections = Imperfections { seed: 1, drive, ..Imperfections::default() };
                if is_imperfect {
                    imperfections.sensor =
                        SensorErrors { length_noise_m: 2e-6, length_step_m: 1e-6, ..SensorErrors::default() };
                    imperfections.friction = Friction {
                        coulomb_n: friction * most,
                        viscous_n_s_m: friction * most,
                        ..Friction::default()
                    };
                    imperfections.build = BuildErrors {
                        payload_kg: 0.1 * config.machine.platform.mass_kg,
                        payload_at_m: config.machine.platform.center_of_mass_m
                            + nalgebra::Vector3::new(0.1, 0.05, 0.0),
                        ..BuildErrors::default()
                    };
                }
                let expected_s = 1e-3 * dead_ms + SENDING / rate_hz;
                let DriveDelay { mean, legs, .. } = measured(&config, &imperfections).unwrap();
                let error_s = (mean.delay_s - expected_s).abs();
                println!(
                    "{machine} {rate_hz} Hz, {dead_ms} ms, imperfect {is_imperfect}: {:.3} of {:.3} ms, deviation {:.3}; {:?}",
                    1e3 * mean.delay_s,
                    1e3 * expected_s,
                    1e3 * mean.deviation_s,
                    legs.map(|leg| (1e6 * leg.delay_s) as i64)
                );
                let bound_s = if is_imperfect { (0.1 * expected_s).max(1e-4) } else { 2e-5 };
                assert!(error_s < bound_s, "{machine} {dead_ms} ms: {mean:?}");
                assert!(error_s < 2e-5 + 3.0 * mean.deviation_s && mean.deviation_s < 2.5e-4, "{mean:?}");
    });
}

/// A platform that stands shows no delay: no wrong number either.
#[test]
fn without_motion_there_is_no_delay() {
    let config = config("motion_base", 1000.0);
    let sensor = SensorErrors { length_noise_m: 2e-6, ..SensorErrors::default() };
    let imperfections = Imperfections { seed: 1, sensor, ..Imperfections::default() };
    let found = recorded(&config, &imperfections, BuiltInMotion::Settle);
    let found = drive_delay(&config.machine, &[found]);
    assert!(found.is_none_or(|found| !(found.mean.deviation_s < 2.5e-4)), "{found:?}");
    assert_eq!(drive_delay(&config.machine, &[]), None);
}
