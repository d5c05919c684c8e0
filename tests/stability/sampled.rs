//! The sampled loop: what the theory says of gains, delays, masses and sensors, and what controller and plant do.

use hexad::analysis::sampled_loop::SampledLoop;
use hexad_support::stability::delayed::{Delayed, PUSH, Setup, boundary};

use super::*;

/// Half of the delay is not known to the estimator.
fn sampled_loop(damping_ratio: f64, delay_periods: f64) -> SampledLoop {
    SampledLoop {
        wn_t: f64::NAN,
        damping_ratio,
        known_delay_periods: 0.5 * delay_periods,
        delay_periods,
        ..SampledLoop::default()
    }
}

const DELAYS: [f64; 4] = [0.0, 0.6, 2.0, 3.3];

/// No gravity: nothing but the push moves the platform.
fn in_space() -> Config {
    let mut config = deployed("fried2008");
    config.machine.gravity_m_s2.fill(0.0);
    config
}

/// The same, with less than a period known. Measurements before the first force do not count: with more the gains would not yet
/// be steady at the push.
fn steady(damping_ratio: f64, delay: f64) -> SampledLoop {
    let sampled = sampled_loop(damping_ratio, delay);
    SampledLoop { known_delay_periods: sampled.known_delay_periods.min(0.9), ..sampled }
}

fn at(share: f64, sampled: SampledLoop) -> SampledLoop {
    SampledLoop { wn_t: share * sampled.largest_wn_t(), ..sampled }
}

#[test]
#[ignore = "second tier: takes long"]
fn the_limit_is_that_of_controller_and_plant() {
    let config = in_space();
    for delay in [0.0, 1.0, 2.0] {
        for (damping_ratio, estimator_ratio, mass_ratio, compensates_disturbance) in [
            (1.0, 1.0, 1.0, true),
            (0.7, 3.0, 1.0, true),
            (1.0, 1.0, 0.6, true),
            (1.0, 3.0, 1.8, true),
            (0.7, 1.0, 1.0, false),
        ] {
            let sampled = SampledLoop {
                estimator_ratio,
                mass_ratio,
                compensates_disturbance,
                ..sampled_loop(damping_ratio, delay)
            };
            let (predicted, found) = (sampled.largest_wn_t(), boundary(&config, &sampled));
            assert!((found / predicted - 1.0).abs() < 0.01, "{sampled:?}: {predicted} {found}");
        }
    }
}

/// The push, run until it has faded or grown by a factor, against what the matrix makes of it, whatever part of the
/// delay is before the release. Why it ended.
fn as_predicted(sampled: SampledLoop, factor: f64) -> [DiagnosticCode; 2] {
    let config = in_space();
    let period_s = config.deployment.realtime.period_s();
    let cycles = (factor.ln() / sampled.spectral_radius().ln().abs()) as usize + 5;
    let predicted = sampled.response(0.0, PUSH * period_s, cycles);
    [0.0, sampled.known_delay_periods].map(|age| {
        let mut delayed = Delayed::new(&config, &Setup { age, ..Setup::of(sampled) });
        let (found, cause) = delayed.run(cycles);
        assert_eq!((cause, found.len()), (DiagnosticCode::None, cycles), "{sampled:?}");
        let mut worst = 0.0_f64;
        for (predicted, found) in predicted.chunks(STRETCH).zip(found.chunks(STRETCH)) {
            let apart = predicted.iter().zip(found).map(|(e, cycle)| cycle.error.add_scalar(-e).amax());
            worst = worst.max(apart.fold(0.0, f64::max) / largest(predicted));
        }
        assert!(worst < 1e-3, "{sampled:?}, age {age}: {worst}");
        delayed.run(1000).1
    })
}

/// The largest difference is compared with the largest error of so many cycles.
const STRETCH: usize = 20;

#[test]
fn below_the_limit_errors_fade_as_predicted() {
    for delay in DELAYS {
        for (share, damping_ratio) in [(0.2, 0.7), (0.2, 1.0), (0.9, 0.7), (0.9, 1.0)] {
            let sampled = at(share, steady(damping_ratio, delay));
            assert_eq!(as_predicted(sampled, 1e3), [DiagnosticCode::None; 2]);
        }
    }
}

/// What is found of a loop that is not stable.
const LETS_GO: [DiagnosticCode; 5] = [
    DiagnosticCode::MeasurementImplausible,
    DiagnosticCode::FollowingError,
    DiagnosticCode::VelocityError,
    DiagnosticCode::RateJumped,
    DiagnosticCode::RateInconsistent,
];

/// Until the path is left, or until rates jump further than a leg can accelerate.
#[test]
fn above_the_limit_errors_grow_as_predicted_until_the_controller_lets_go() {
    for delay in DELAYS {
        for share in [1.1, 2.0] {
            let causes = as_predicted(at(share, steady(1.0, delay)), 10.0);
            assert!(causes.iter().all(|cause| LETS_GO.contains(cause)), "{causes:?}");
        }
    }
}

/// What a configuration may ask for at most is stable with its longest delay, and not by much.
#[test]
fn the_bound_of_the_configuration_is_the_limit_with_the_longest_delay() {
    for release in ["sleep", "external"] {
        let text = |bandwidth: f64| {
            let file = format!("{}/config/fried2008.toml", env!("CARGO_MANIFEST_DIR"));
            let machine = fs::read_to_string(file).unwrap().replace("[-9.81, 0.0, 0.0]", "[0, 0, 0]");
            format!(
                "{machine}\n[realtime]\nrelease = \"{release}\"\n[control]\nposition_bandwidth_hz = {bandwidth}\n"
            )
        };
        let refused = Config::parse(&text(100.0), "much").unwrap_err().to_string();
        let (_, bound) = refused.split_once("must be at most ").unwrap();
        let largest = bound.split_once(' ').unwrap().0.parse().unwrap();
        let config = Config::parse(&text(largest), "most").unwrap();
        let sampled = config.deployment.realtime.sampled_loop(largest, 1.0, 0.0);
        assert_eq!(sampled.delay_periods, if release == "sleep" { 2.1 } else { 1.0 });
        let found = boundary(&config, &sampled);
        assert!((found / sampled.wn_t - 1.0).abs() < 0.01, "{found} {sampled:?}");
    }
}

/// Without compensation: what is missing of the weight, as the law gives it. With it: nothing.
#[test]
fn a_mass_that_is_wrong_is_stable_and_sags_as_predicted() {
    let mut config = deployed("fried2008");
    // With little weight: whatever the mass, the following limits are far.
    config.machine.gravity_m_s2 *= 0.1;
    let home = TaskState::at_rest(config.machine.home).motion();
    let falls = ForwardDynamics::new(&config.machine)
        .acceleration(&home.pose, &home.twist, &[0.0; LEGS])
        .unwrap()
        .vector();
    for compensates_disturbance in [false, true] {
        let model = SampledLoop { compensates_disturbance, wn_t: 0.06, ..sampled_loop(1.0, 1.2) };
        let [lightest, heaviest] = [1.0 / model.gain_margin(), 1.0 / model.least_gain()];
        for mass_ratio in [0.9 * lightest, 1.1 * lightest, 0.7, 0.9, 1.1, 0.9 * heaviest, 1.1 * heaviest] {
            let sampled = SampledLoop { mass_ratio, ..model };
            // Until what is left of the beginning is next to nothing, or everything.
            let most = (12.0 / sampled.spectral_radius().ln().abs()) as usize + 1000;
            let (cycles, cause) = Delayed::new(&config, &Setup::of(sampled)).run(most);
            let stable = (lightest..heaviest).contains(&mass_ratio);
            let at_rest = cycles.last().unwrap().error;
            assert_eq!(cause == DiagnosticCode::None, stable, "{mass_ratio}: {cause:?}");
            if !stable {
                assert!(LETS_GO.contains(&cause), "{cause:?}");
                continue;
            }
            let period_s = config.deployment.realtime.period_s();
            let sag = falls * ((1.0 - mass_ratio) / (sampled.wn_t / period_s).powi(2));
            let predicted = if compensates_disturbance { Vector6::zeros() } else { sag };
            assert!((at_rest - predicted).amax() < 1e-3 * sag.amax() + 1e-9, "{at_rest} {predicted}");
        }
    }
}

/// Root mean square of each axis of the platform's error, from the second second on.
fn noisy(config: &Config, sampled: SampledLoop, sensor: SensorErrors) -> Vector6<f64> {
    let setup = Setup { sensor, ..Setup::of(sampled) };
    let (cycles, cause) = Delayed::new(config, &setup).run(21_000);
    assert_eq!(cause, DiagnosticCode::None);
    let settled = &cycles[1000..];
    let sum: Vector6<f64> = settled.iter().map(|cycle| cycle.error.component_mul(&cycle.error)).sum();
    (sum / settled.len() as f64).map(f64::sqrt)
}

/// What the readings of the legs, of these standard deviations, do to each axis, by Lyapunov's equation.
fn predicted_noise(config: &Config, sampled: &SampledLoop, [length, rate]: [f64; 2]) -> Vector6<f64> {
    let home = config.machine.home_pose();
    let twists = leg_wrenches(&config.machine, &home).transpose().try_inverse().unwrap();
    let period_s = config.deployment.realtime.period_s();
    Vector6::from_fn(|axis, _| {
        let of_legs = twists.row(axis).norm();
        sampled.noise([length * of_legs, rate * of_legs * period_s])
    })
}

const LENGTH_M: f64 = 1e-6;
const RATE_M_S: f64 = 1e-4;

#[test]
#[ignore = "second tier: takes long"]
fn noise_and_steps_of_the_sensors_make_the_error_that_is_predicted() {
    let config = in_space();
    for delay in [0.0, 1.0, 2.0] {
        for share in [0.2, 0.9] {
            let sampled = at(share, sampled_loop(1.0, delay));
            let noise = [LENGTH_M, RATE_M_S];
            // Steps of twice the noise hide it well: their error is as good as noise of its own.
            for steps in [0.0, 2.0] {
                let sensor = SensorErrors {
                    length_noise_m: noise[0],
                    rate_noise_m_s: noise[1],
                    length_step_m: steps * noise[0],
                    rate_step_m_s: steps * noise[1],
                };
                let deviations = noise.map(|noise| noise * (1.0 + steps * steps / 12.0).sqrt());
                let predicted = predicted_noise(&config, &sampled, deviations);
                let found = noisy(&config, sampled, sensor);
                let ratios: [f64; 6] = found.component_div(&predicted).into();
                assert!(ratios.iter().all(|ratio| (0.85..1.15).contains(ratio)), "{sampled:?}: {ratios:?}");
            }
        }
    }
}
