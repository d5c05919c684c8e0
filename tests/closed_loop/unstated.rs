//! What the machine file does not state, on a built-in motion: friction with stiction, delay of the drives, steps of the sensors. None of
//! it is a fault.

use core::f64::consts::TAU;

use hexad::commands::r#move::trajectory::Trajectory;
use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::random::Random;
use hexad::motion::built_in::BuiltInMotion;
use hexad::plant::imperfections::{DriveErrors, Friction, Imperfections, SensorErrors};
use rayon::prelude::*;

use hexad_support::certificate::Certificate;
use hexad_support::data;
use hexad_support::edited::configured;
use hexad_support::rig::Rig;

const MACHINES: [&str; 4] = ["motion_base", "fried2008", "tsai2000", "reference"];
/// Time to engage and to estimate the disturbance \[s\].
const SETTLED_S: f64 = 2.0;
/// Duration of the motion, as in `hexad demo` \[s\].
const MOTION_S: f64 = 8.0;
const EPISODES: u64 = 12;
const LONG_EPISODES: u64 = 400;

/// One world by chance; why control ended.
fn episode(seed: u64) -> Result<(), String> {
    let machine = MACHINES[seed as usize % MACHINES.len()];
    let motion = BuiltInMotion::ALL[seed as usize / MACHINES.len() % BuiltInMotion::ALL.len()];
    let mut random = Random::new(seed);
    let mut between = |least: f64, most: f64| least + (most - least) * random.uniform();
    let config = configured(machine, "");
    let dry = between(0.0, 1.0) * config.machine.actuator.friction_uncertainty_n;
    let (stiction_n, lag) = (between(0.0, 0.5), between(0.01, 0.99));
    let (delay_us, step) = (between(0.0, 3000.0).round(), 10.0_f64.powf(between(-8.0, -4.7)));
    let imperfections = Imperfections {
        seed,
        drive: DriveErrors {
            dead_time_ns: (1e3 * delay_us * (1.0 - lag)) as u64,
            bandwidth_hz: Some(1e6 / (TAU * lag * delay_us)),
            ..DriveErrors::default()
        },
        friction: Friction {
            coulomb_n: (1.0 - stiction_n) * dry,
            stiction_n: stiction_n * dry,
            stribeck_speed_m_s: 10.0_f64.powf(between(-3.3, -2.0)),
            ..Friction::default()
        },
        sensor: SensorErrors {
            length_step_m: step,
            length_noise_m: 10.0_f64.powf(between(-8.0, -6.0)),
            ..SensorErrors::default()
        },
        ..Imperfections::default()
    };
    play(&config, &imperfections, motion).map_err(|ended| {
        format!(
            "{machine} {motion:?}, seed {seed}, {ended}; {dry:.1} N of dry friction, {stiction_n:.2} of it stiction, delay {delay_us} us, \
             {lag:.2} of it lag, step {step:.1e} m"
        )
    })
}

/// Plays a motion; why control ended.
fn play(config: &Config, imperfections: &Imperfections, motion: BuiltInMotion) -> Result<(), String> {
    let Ok(Trajectory::BuiltIn(scene)) = Trajectory::built_in(config, motion, MOTION_S) else {
        return Err("no motion".into());
    };
    let mut control = Rig::imperfect(config, &config.machine, imperfections);
    while control.time_s() < SETTLED_S + MOTION_S {
        let input = control.waiting_input(&scene.at((control.time_s() - SETTLED_S).max(0.0)));
        let Output { state, diagnostic, .. } = control.cycle(&input);
        let is_settled = control.time_s() > SETTLED_S;
        if is_settled && (state, diagnostic.code) != (State::Active, DiagnosticCode::None) {
            return Err(format!("after {:.3} s: {state:?}, {diagnostic:?}", control.time_s()));
        }
    }
    Ok(())
}

/// A telescope's mirror, 200 kg on drives of 2 kN: 40 N of dry friction are not in its file.
#[test]
#[ignore = "second tier: takes long"]
fn friction_of_a_mirror_is_no_fault() {
    let config = Config::load(&data("mirror_unknown_friction", "toml")).unwrap();
    for motion in BuiltInMotion::ALL {
        assert_eq!(play(&config, &config.deployment.plant.imperfections, motion), Ok(()), "{motion:?}");
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_what_is_not_stated_gives_no_alarm() {
    let certificate = Certificate::new("unstated", EPISODES, LONG_EPISODES);
    let run = |seed| {
        let ended = episode(seed);
        certificate.advance(1);
        ended.err()
    };
    let alarms: Vec<_> = (0..certificate.total()).into_par_iter().filter_map(run).collect();
    certificate.finish(format_args!("{} alarms", alarms.len()));
    assert!(alarms.is_empty(), "{} alarms:\n{}", alarms.len(), alarms.join("\n"));
}
