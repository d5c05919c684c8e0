//! Whether measurements can be trusted: sensors that freeze, drives with friction, stamps, and messages that are old.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::LEGS;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::task::TaskState;
use hexad::plant::imperfections::{Imperfections, SensorErrors};
use nalgebra::Vector6;
use rayon::prelude::*;

use hexad_support::certificate::cases;
use hexad_support::edited::configured;
use hexad_support::fast::Fast;
use hexad_support::rig::Rig;

const MACHINES: [&str; 2] = ["motion_base", "fried2008"];
/// Share of the fast scene's speed at which a motion is slow.
const SLOW: f64 = 0.05;
/// Slower legs are crawling \[m/s\].
const CRAWLING_M_S: f64 = 2e-3;

fn config(machine: &str) -> Config {
    configured(machine, "[drive]\ndelay_us = 100")
}

/// The fast scene played at a share of its speed, from rest.
pub fn scene(config: &Config, share: f64) -> impl Fn(f64) -> TaskState {
    let fast = Fast::new(config);
    move |t: f64| {
        // Two seconds at rest to engage, then the speed rises within one.
        let (t, rise) = ((t - 2.0).max(0.0), 1.0);
        let part = (t / rise).min(1.0);
        let (speed, slope) =
            (share * part * part * (3.0 - 2.0 * part), share * 6.0 * part * (1.0 - part) / rise);
        let way = share * (if t < rise { rise * part.powi(3) * (1.0 - 0.5 * part) } else { t - 0.5 * rise });
        let TaskState { x, xd, xdd } = fast.at(way);
        TaskState { x, xd: xd * speed, xdd: xdd * (speed * speed) + xd * slope }
    }
}

/// Plays a scene; from an instant on the readings of some legs are those of that instant. Returns the last output, the time until
/// forces ended \[s\] and the largest distance of the true platform from its setpoint until then \[m\].
fn freeze(config: &Config, share: f64, legs: &[usize], noise: f64, from_s: f64) -> (Output, f64, f64) {
    let mut config = config.clone();
    if noise > 0.0 {
        (config.deployment.noise.length_m, config.deployment.noise.length_step_m) = (noise, 1e-6);
    }
    // The machine has no friction, and its file states that: a leg that sticks would look like a frozen sensor.
    config.machine.actuator.friction_uncertainty_n = 0.0;
    let config = &config;
    let sensor = SensorErrors { length_noise_m: noise, length_step_m: 1e-6, ..SensorErrors::default() };
    let mut control = Rig::imperfect(
        config,
        &config.machine,
        &Imperfections { seed: 1, sensor, ..Imperfections::default() },
    );
    let scene = scene(config, share);
    let (mut frozen, mut farthest, mut output) = (None::<[f64; LEGS]>, 0.0_f64, Output::default());
    while control.time_s() < from_s + 4.0 {
        let task = scene(control.time_s());
        let mut input = control.waiting_input(&task);
        if control.time_s() >= from_s {
            let measured = input.measurement.as_mut().unwrap();
            let frozen = frozen.get_or_insert(measured.length_m);
            legs.iter().for_each(|leg| measured.length_m[*leg] = frozen[*leg]);
            let apart = control.hardware.simulator().state().pose.position - task.motion().pose.position;
            farthest = farthest.max(apart.norm());
        }
        output = control.cycle(&input);
        if frozen.is_some() && output.state != State::Active {
            break;
        }
        assert!(frozen.is_some() || control.time_s() < 1.9 || output.state == State::Active, "{output:?}");
    }
    (output, control.time_s() - from_s, farthest)
}

/// Speed, noise, legs that freeze, and the phase of the motion with its number.
fn freezes() -> impl Iterator<Item = (f64, f64, &'static [usize], f64)> {
    const LEGS_FROZEN: [&[usize]; 3] = [&[0, 1, 2, 3, 4, 5], &[0], &[3]];
    let speeds = [1.0, SLOW].into_iter().flat_map(|share| [0.0, 5e-6].map(|noise| (share, noise)));
    let kinds = speeds.flat_map(|(share, noise)| LEGS_FROZEN.map(|legs| (share, noise, legs)));
    kinds.flat_map(|(share, noise, legs)| {
        // One quiet leg of a slow platform may be anywhere near its turnaround.
        let is_slow_leg = legs.len() == 1 && share < 1.0 && noise == 0.0;
        let (phases, step_s) = if is_slow_leg { (24, 0.0325) } else { (6, 0.13) };
        (0..phases).map(move |phase| (share, noise, legs, 3.5 + step_s * f64::from(phase) / share.sqrt()))
    })
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_sensors_that_freeze_in_motion_end_the_forces_before_the_platform_is_off_its_path() {
    let all = MACHINES.into_iter().flat_map(|machine| freezes().map(move |freeze| (machine, freeze)));
    cases(all, 5).into_par_iter().for_each(|(machine, (share, noise, legs, from_s))| {
        let config = config(machine);
        let (output, time_s, farthest) = freeze(&config, share, legs, noise, from_s);
        println!(
            "{machine}, speed {share}, noise {noise:e}, legs {legs:?}: {:?} leg {} after {:.0} ms, {:.3} mm",
            output.diagnostic.code,
            output.diagnostic.index,
            1e3 * time_s,
            1e3 * farthest
        );
        let code = output.diagnostic.code;
        assert!(
            matches!(code, DiagnosticCode::SensorFrozen | DiagnosticCode::MeasurementImplausible),
            "{machine} {share} {legs:?}: {:?}",
            output.diagnostic
        );
        assert!(legs.contains(&(output.diagnostic.index as usize - 1)) || legs.len() == 1);
        // One leg near its own turnaround is crawling, however fast the platform is: the others do not show its fault.
        let rates = leg_motion(&config.machine, &scene(&config, share)(from_s).motion()).rate_m_s;
        let is_crawling = legs.len() == 1 && rates[legs[0]].abs() < CRAWLING_M_S;
        let bound = if is_crawling { 2e-3 } else { 0.5e-3 };
        assert!(farthest < bound, "{machine} {share} {legs:?}, {rates:?} m/s: {farthest} m");
    });
}

/// Largest distance from the pose at rest in the last second \[m\], after a motion; friction in the model and in the plant.
fn settled(model: f64, plant: f64, stiction: f64) -> f64 {
    let mut config = config("motion_base");
    let force = config.machine.actuator.max_force_n;
    config.machine.actuator.coulomb_friction_n = [model * force; 6];
    let mut platform = config.machine.clone();
    platform.actuator.coulomb_friction_n = [0.0; 6];
    let mut imperfections = Imperfections::default();
    (imperfections.friction.coulomb_n, imperfections.friction.stiction_n) = (plant * force, stiction * force);
    let mut control = Rig::imperfect(&config, &platform, &imperfections);
    // Up and across by 0.1 m within two seconds, with minimum jerk.
    let way = Vector6::new(0.0, 0.05, 0.0, 0.1, 0.0, 0.1);
    let scene = |t: f64| {
        let (p, seconds) = (((t - 2.0) / 2.0).clamp(0.0, 1.0), 2.0);
        let [s, v, a] = [
            p * p * p * (10.0 - 15.0 * p + 6.0 * p * p),
            30.0 * p * p * (1.0 - p) * (1.0 - p) / seconds,
            60.0 * p * (1.0 - p) * (1.0 - 2.0 * p) / (seconds * seconds),
        ];
        TaskState { x: Vector6::from(config.machine.home) + way * s, xd: way * v, xdd: way * a }
    };
    let mut farthest = 0.0_f64;
    let mut output = Output::default();
    while control.time_s() < 8.0 {
        let task = scene(control.time_s());
        let input = control.waiting_input(&task);
        output = control.cycle(&input);
        if control.time_s() > 7.0 {
            let apart = control.hardware.simulator().state().pose.position - task.motion().pose.position;
            farthest = farthest.max(apart.norm());
        }
    }
    assert_eq!(output.state, State::Active, "{output:?}");
    farthest
}

#[test]
fn friction_shakes_no_platform_at_rest() {
    for (model, plant, stiction, bound) in
        [(0.05, 0.05, 0.0, 1e-6), (0.04, 0.05, 0.0, 10e-6), (0.05, 0.035, 0.015, 10e-6)]
    {
        let found = settled(model, plant, stiction);
        println!(
            "friction {model} in the model, {plant} + {stiction} in the plant: {:.3} um at rest",
            1e6 * found
        );
        assert!(found < bound, "{model} {plant} {stiction}: {found} m");
    }
}
