//! Excitation: exactly periodic, within every limit, and better than chance.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use hexad::analysis::excitation_design::{Sensitivities, base_parameter_values, base_parameters, design};
use hexad::analysis::identification::expected_deviations;
use hexad::commands::r#move::trajectory::Trajectory;
use hexad::config::Config;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::regressor::{dynamic_parameters, regressor};
use hexad::model::task::TaskState;
use hexad::motion::excitation::{Excitation, FourierSeries, PERIOD_S};
use nalgebra::{DMatrix, Vector6};

const MACHINES: [&str; 3] = ["motion_base", "fried2008", "tsai2000"];

fn shipped(name: &str) -> Config {
    Config::load(format!("config/{name}.toml").as_ref()).unwrap()
}

fn excitation(config: &Config, periods: u32, amplitude: f64) -> Excitation {
    Trajectory::excitation(config, periods, amplitude, 1).unwrap()
}

/// Its instants, so far apart \[s\].
fn samples(excitation: &Excitation, step_s: f64) -> impl Iterator<Item = (f64, TaskState)> {
    let count = (excitation.duration() / step_s).round() as u32;
    (0..=count).map(move |k| (f64::from(k) * step_s, excitation.at(f64::from(k) * step_s)))
}

/// Largest displacement from home.
fn reach(config: &Config, excitation: &Excitation) -> f64 {
    let home = Vector6::from(config.machine.home);
    samples(excitation, 0.05).map(|(_, state)| (state.x - home).amax()).fold(0.0, f64::max)
}

#[test]
#[ignore = "second tier: takes long"]
fn an_excitation_keeps_every_limit_of_the_machine() {
    for name in MACHINES {
        let config = shipped(name);
        let (machine, actuator) = (&config.machine, &config.machine.actuator);
        let excitation = excitation(&config, 1, 1.0);
        for (t, state) in samples(&excitation, 0.01) {
            let (motion, place) = (state.motion(), format!("{name} at {t}"));
            let legs = leg_motion(machine, &motion);
            assert!(legs.length_m.iter().all(|length| actuator.contains(*length)), "{place}");
            assert!(legs.rate_m_s.iter().all(|rate| rate.abs() < actuator.max_rate_m_s), "{place}");
            let force = inverse_dynamics::<Exact>(machine, &motion).unwrap();
            assert!(
                force.iter().all(|force| force.abs() < actuator.weakest_available_force_n()),
                "{place}: {force:?}"
            );
        }
        assert!(reach(&config, &excitation) > 0.1, "{name}: too small to see");
    }
}

/// Strokes from 0.1 mm to a metre, and drives of 1 mm/s.
#[test]
#[ignore = "second tier: takes long"]
fn machines_of_every_size_are_excited() {
    for name in ["mirror_unknown_friction", "piezo", "hobby", "telescope_m2", "plate_3m"] {
        let config = Config::load(format!("tests/data/{name}.toml").as_ref()).unwrap();
        let actuator = &config.machine.actuator;
        let stroke = (actuator.max_length_m - actuator.min_length_m).min(actuator.max_rate_m_s * 1.0);
        let reach = reach(&config, &excitation(&config, 1, 1.0));
        println!("{name}: {reach:.1e} of a stroke, or of a second at the largest rate, {stroke:.1e} m");
        assert!(reach > 0.02 * stroke, "{name}: {reach} m or rad");
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn counted_periods_repeat_and_derivatives_belong_to_the_motion() {
    let config = shipped("fried2008");
    let excitation = excitation(&config, 3, 1.0);
    let home = TaskState::at_rest(config.machine.home);
    let ends = [excitation.at(0.0), excitation.at(excitation.duration())];
    assert!(ends.iter().all(|end| (end.x - home.x).amax() < 1e-12 && end.xd.amax() < 1e-12));
    assert!(ends.iter().all(|end| end.xdd.amax() < 1e-11));
    let [begin, end] = excitation.counted_interval_s();
    assert_eq!(end - begin, 3.0 * PERIOD_S);
    let h = 1e-4;
    for (t, state) in samples(&excitation, 0.037) {
        let (before, after) = (excitation.at(t - h), excitation.at(t + h));
        // A jump of the jerk at the ends of a fade is an error of h X'''.
        assert!(((after.x - before.x) / (2.0 * h) - state.xd).amax() < 1e-5, "{t}");
        assert!(((after.xd - before.xd) / (2.0 * h) - state.xdd).amax() < 1e-2, "{t}");
        if (begin..=end - PERIOD_S).contains(&t) {
            let again = excitation.at(t + PERIOD_S);
            let change = [again.x - state.x, again.xd - state.xd, again.xdd - state.xdd];
            assert!(change.iter().all(|change| change.amax() < 1e-12), "{t}: {change:?}");
        }
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn the_design_is_repeatable_and_gentle_on_request() {
    let config = shipped("fried2008");
    let series = |seed| design(&config.machine, 0.05, seed, |_| true).unwrap().series;
    assert_eq!(series(7), series(7));
    assert_ne!(series(7), series(8));
    assert!(
        reach(&config, &excitation(&config, 1, 0.05)) < 0.1 * reach(&config, &excitation(&config, 1, 1.0))
    );
}

#[test]
#[ignore = "second tier: takes long"]
fn the_design_beats_random_motions() {
    for seed in 0..2 {
        let found = design(&shipped("motion_base").machine, 1.0, seed, |_| true).unwrap();
        let median = found.random_conditions[found.random_conditions.len() / 2];
        println!("seed {seed}: condition {:.1}, median of random motions {median:.1}", found.condition);
        assert!(5.0 * found.condition < median, "{} of {median}", found.condition);
    }
}

/// By the inverse of the normal matrix of all instants at 100 Hz, and of what is known before.
#[test]
fn predicted_deviations_are_those_of_least_squares() {
    for name in MACHINES {
        let machine = &shipped(name).machine;
        let mut series = FourierSeries::default();
        for (k, coefficient) in series.0.iter_mut().enumerate() {
            *coefficient = 0.02 * (2.0 + 1.7 * k as f64).sin();
        }
        let (base, values) = (base_parameters(machine), base_parameter_values(machine));
        let mut normal = DMatrix::zeros(base.len(), base.len());
        for k in 0..1000 {
            let displacement = series.at(0.01 * f64::from(k));
            let state = TaskState { x: displacement.x + Vector6::from(machine.home), ..displacement };
            let full = regressor(machine, &state.motion()).unwrap();
            let columns = full.select_columns(&base);
            let by_base = &columns * DMatrix::from_iterator(base.len(), 1, base.iter().map(|k| values[*k]));
            let by_all = full * dynamic_parameters(machine);
            assert!((by_base - by_all).amax() < 1e-9 * by_all.amax(), "{name}");
            normal += columns.transpose() * columns;
        }
        normal /= 9.0;
        let before = expected_deviations(machine);
        for (place, k) in base.iter().enumerate() {
            normal[(place, place)] += before[*k].powi(-2);
        }
        let covariance = normal.try_inverse().unwrap();
        let sensitivities = Sensitivities::new(machine, &series).unwrap();
        let deviations = sensitivities.deviations(&before, 3.0, 1000.0).unwrap();
        for (place, (k, deviation)) in deviations.into_iter().enumerate() {
            let expected = covariance[(place, place)].sqrt();
            assert!(
                (deviation - expected).abs() <= 0.05 * expected,
                "{name} {k}: {deviation} for {expected}"
            );
        }
    }
}
