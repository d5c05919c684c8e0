//! No false alarm: realistic noise, friction, payload and delays, at rest, slow and fast, by chance.
//!
//! `HEXAD_LONG=1` makes it ten hours of simulated motion.

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::random::Random;
use hexad::plant::imperfections::{BuildErrors, DriveErrors, Friction, Imperfections, SensorErrors};
use rayon::prelude::*;

use super::trust::scene;
use hexad_support::certificate::Certificate;
use hexad_support::edited::configured;
use hexad_support::rig::Rig;

const MACHINES: [&str; 3] = ["motion_base", "fried2008", "tsai2000"];
/// Simulated time of an episode \[s\].
const EPISODE_S: f64 = 8.0;
const LONG_EPISODE_S: f64 = 20.0;
/// One of each machine and speed; in ten hours.
const EPISODES: u64 = 12;
const LONG_EPISODES: u64 = 1800;
/// Those that lead nearest to an alarm: in them legs stick longest.
const NEAREST: [u64; 4] = [68, 776, 1328, 1516];
/// Two seconds to engage and to estimate the disturbance, one more with the setpoint at rest.
const SETTLED_S: f64 = 2.0;

/// A world by chance, played for an episode. The first cycle that was no longer active.
fn episode(seed: u64, duration_s: f64) -> Result<(), String> {
    let mut random = Random::new(seed);
    let mut between = |least: f64, most: f64| least + (most - least) * random.uniform();
    let machine = MACHINES[seed as usize % MACHINES.len()];
    let share = [0.02, 0.05, 0.3, 1.0][(seed / 3) as usize % 4];
    let (noise, step) = (10.0_f64.powf(between(-7.0, -5.0)), 10.0_f64.powf(between(-8.0, -5.3)));
    let delay_us = between(100.0, 5000.0).round();
    // Shares of the largest force: what the model has, and what the drive has. With more stiction than 0.2 % beyond the model a leg of
    // a light machine sticks at a crawl for longer than a sensor may be silent.
    let (modelled, friction, stiction_n) = (between(0.0, 0.005), between(0.8, 1.2), between(0.0, 0.0005));
    let mut config = configured(
        machine,
        &format!(
            "[drive]\ndelay_us = {delay_us}\n[measured]\nlength_noise_m = {noise:e}\nlength_step_m = {step:e}"
        ),
    );
    let most = config.machine.actuator.max_force_n;
    config.machine.actuator.coulomb_friction_n = [modelled * most; 6];
    let mut platform = config.machine.clone();
    platform.actuator.coulomb_friction_n = [0.0; 6];
    let imperfections = Imperfections {
        seed,
        drive: DriveErrors { dead_time_ns: (1e3 * (delay_us - 100.0)) as u64, ..DriveErrors::default() },
        friction: Friction {
            coulomb_n: modelled * friction * most,
            stiction_n: stiction_n * most,
            ..Friction::default()
        },
        sensor: SensorErrors { length_step_m: step, length_noise_m: noise, ..SensorErrors::default() },
        build: BuildErrors {
            payload_kg: between(-0.2, 0.2) * platform.platform.mass_kg,
            payload_at_m: platform.platform.center_of_mass_m,
            ..BuildErrors::default()
        },
        ..Imperfections::default()
    };
    let scene = scene(&config, share);
    let mut control = Rig::imperfect(&config, &platform, &imperfections);
    while control.time_s() < duration_s {
        let input = control.waiting_input(&scene(control.time_s()));
        let Output { state, diagnostic, .. } = control.cycle(&input);
        if control.time_s() > SETTLED_S && (state, diagnostic.code) != (State::Active, DiagnosticCode::None) {
            return Err(format!(
                "{machine}, seed {seed}, speed {share}, after {:.3} s: {state:?}, {diagnostic:?}; noise {noise:.1e} m, step \
                 {step:.1e} m, delay {delay_us} us, friction {modelled:.4} x {friction:.2} + {stiction_n:.4}",
                control.time_s()
            ));
        }
    }
    Ok(())
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_realistic_hardware_gives_no_alarm() {
    let certificate = Certificate::new("false alarms", EPISODES, LONG_EPISODES);
    let episodes = certificate.total();
    let duration_s = if Certificate::is_long() { LONG_EPISODE_S } else { EPISODE_S };
    let alarm = |seed| {
        let ended = episode(seed, duration_s);
        certificate.advance(1);
        ended.err()
    };
    let mut alarms: Vec<String> = (0..episodes).into_par_iter().filter_map(alarm).collect();
    alarms.extend(
        NEAREST.into_par_iter().filter_map(|seed| episode(seed, duration_s).err()).collect::<Vec<_>>(),
    );
    certificate.finish(format_args!("{episodes} episodes of {duration_s} s, {} alarms", alarms.len()));
    let shown: Vec<_> = alarms.iter().take(20).cloned().collect();
    assert!(alarms.is_empty(), "{} of {episodes}:\n{}", alarms.len(), shown.join("\n"));
}
