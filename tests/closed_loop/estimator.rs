//! The estimator: what it leaves of noise, payloads and dead times, with lengths alone and with rates.

use hexad::config::Config;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::plant::imperfections::{DriveErrors, Imperfections, SensorErrors};

use hexad_support::edited::configured;
use hexad_support::rig::{Rates, Rig, SENDING};

/// Delay of the drives beside sending, told and true \[ms\].
#[derive(Clone, Copy)]
struct Delay {
    told: Option<f64>,
    truth: f64,
}

const TOLD: Delay = Delay { told: Some(0.0), truth: 0.0 };

fn config(machine: &str, rate_hz: f64, delay: Delay) -> Config {
    let drive = delay
        .told
        .map_or_else(String::new, |told| format!("delay_us = {:?}", 1e3 * told + 1e6 * SENDING / rate_hz));
    configured(machine, &format!("[realtime]\nrate_hz = {rate_hz:?}\n[drive]\n{drive}\n"))
}

/// RMS of the true position error over the fast scene \[um\].
fn rms_um(
    config: &Config,
    mass: f64,
    imperfections: &Imperfections,
    rates: Rates,
) -> Result<f64, DiagnosticCode> {
    let mut platform = config.machine.clone();
    platform.platform.mass_kg *= mass;
    let mut control = Rig::imperfect(config, &platform, imperfections);
    control.rates = rates;
    control.play_fast(config).map(|tracking| 1e6 * tracking.position.rms())
}

fn with_noise(metres: f64) -> Imperfections {
    let sensor =
        SensorErrors { length_noise_m: metres, rate_noise_m_s: 1e2 * metres, ..SensorErrors::default() };
    Imperfections { seed: 1, sensor, ..Imperfections::default() }
}

fn with_dead_time(milliseconds: f64) -> Imperfections {
    let drive = DriveErrors { dead_time_ns: (1e6 * milliseconds) as u64, ..DriveErrors::default() };
    Imperfections { drive, ..Imperfections::default() }
}

#[test]
#[ignore = "second tier: takes long"]
fn with_the_models_parameters_sampling_leaves_next_to_nothing() {
    for (machine, rate_hz, bound_um) in [
        ("motion_base", 1000.0, 0.05),
        ("motion_base", 250.0, 0.5),
        ("fried2008", 1000.0, 0.05),
        ("fried2008", 250.0, 0.5),
    ] {
        let config = config(machine, rate_hz, TOLD);
        for rates in Rates::ALL {
            println!("{:.2} Hz", config.deployment.control.position_bandwidth_hz);
            let found = rms_um(&config, 1.0, &Imperfections::default(), rates).unwrap();
            println!("{machine} {rate_hz} Hz, rates {rates:?}: {found:.4} um");
            assert!(found < bound_um, "{machine} at {rate_hz} Hz: {found} um");
        }
    }
}

#[test]
fn noise_of_the_sensors_is_filtered() {
    let mut config = config("motion_base", 1000.0, TOLD);
    config.deployment.noise.length_m = 1e-5;
    let quiet = rms_um(&config, 1.0, &with_noise(1e-5), Rates::Never).unwrap();
    println!("10 um of noise: {quiet:.2} um");
    assert!((4.0..7.0).contains(&quiet), "{quiet}");
}

#[test]
fn a_payload_is_compensated() {
    let config = config("motion_base", 1000.0, TOLD);
    let moving = rms_um(&config, 1.2, &Imperfections::default(), Rates::Never).unwrap();
    println!("a fifth more mass: {moving:.2} um");
    assert!((4.0..6.0).contains(&moving), "{moving}");
}

#[test]
fn dead_time_that_is_told_costs_next_to_nothing() {
    for (milliseconds, bound_um) in [(5.0, 1.0), (7.0, 1.5), (10.0, 2.5)] {
        let delay = Delay { told: Some(milliseconds), truth: milliseconds };
        let config = config("motion_base", 1000.0, delay);
        let found = rms_um(&config, 1.0, &with_dead_time(delay.truth), Rates::Never).unwrap();
        println!("{milliseconds} ms told: {found:.3} um");
        assert!(found < bound_um, "{milliseconds} ms: {found}");
    }
}

#[test]
fn dead_time_that_is_not_told_is_stable() {
    let delay = Delay { told: None, truth: 5.0 };
    let config = config("motion_base", 1000.0, delay);
    let found = rms_um(&config, 1.0, &with_dead_time(delay.truth), Rates::Never).unwrap();
    println!("5 ms not told: {found:.2} um");
    assert!(found < 12.0, "{found}");
}
