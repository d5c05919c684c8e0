//! The control modes, all measured alike: what each leaves of the fast scene, with a right model and a wrong one,
//! and what compensation makes of it.

use hexad::config::Config;
use hexad::control::law::ControlMode;
use hexad::control::law::leg_masses::LegMasses;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::task::TaskState;
use nalgebra::Vector6;
use rayon::prelude::*;

use super::answer::answer;
use hexad_support::certificate::cases;
use hexad_support::deployed;
use hexad_support::edited::configured;
use hexad_support::fast::Fast;
use hexad_support::rig::{Rig, Tracking, parameters};

/// Expected errors may be off by a fifth either way.
const BAND: (f64, f64) = (0.8, 1.25);

/// With the delay of the drives configured, as the loop of these tests has it.
fn in_mode(name: &str, mode: ControlMode, is_compensating: bool) -> Config {
    let mode = mode.name();
    configured(
        name,
        &format!(
            "[control]\nmode = \"{mode}\"\ncompensate_disturbances = {is_compensating}\n[drive]\ndelay_us = 100"
        ),
    )
}

/// The fast scene on a platform whose mass is `share` of the modelled one, once control has settled.
fn fast(config: &Config, share: f64) -> Tracking {
    let mut platform = config.machine.clone();
    platform.platform.mass_kg *= share;
    let scene = Fast::new(config);
    let mut rig = Rig::new(config, &platform);
    let home = scene.at(0.0);
    rig.engage(&home);
    for _ in 0..1000 {
        rig.cycle(&rig.input(&home));
    }
    let mut tracking = Tracking::default();
    for cycle in 0..(scene.duration() * 1e3) as u32 {
        let task = scene.at(1e-3 * f64::from(cycle));
        let (desired, actual) = (task.motion().pose, rig.simulator().state().pose);
        tracking.position.add((desired.position - actual.position).norm());
        let output = rig.cycle(&rig.input(&task));
        assert_eq!(
            (output.state, output.diagnostic.code),
            (State::Active, DiagnosticCode::None),
            "cycle {cycle}"
        );
        assert_eq!(output.active_limits.0 & 3, 0, "a force is limited in cycle {cycle}");
    }
    tracking
}

/// RMS of the position error \[um\]: the right model; a fifth too light, without compensation and with.
const EXPECTED: [(ControlMode, [f64; 3]); 4] = [
    (ControlMode::ComputedTorque, [0.0339, 260.6, 5.618]),
    (ControlMode::FeedforwardJointPd, [0.0339, 303.5, 7.777]),
    (ControlMode::GravityJointPd, [674.3, 835.8, 97.71]),
    (ControlMode::JointPd, [1913.0, 2214.0, 76.34]),
];

fn measured(name: &str, mode: ControlMode) -> [f64; 3] {
    [(false, 1.0), (false, 1.2), (true, 1.2)].map(|(is_compensating, share)| {
        1e6 * fast(&in_mode(name, mode, is_compensating), share).position.rms()
    })
}

#[test]
#[ignore = "second tier: takes long"]
fn every_mode_leaves_what_it_does_not_know() {
    println!("speed {:.2}", Fast::new(&deployed("motion_base")).speed);
    let found = EXPECTED.map(|(mode, expected)| (mode, expected, measured("motion_base", mode)));
    for (mode, _, found) in &found {
        println!("{}: RMS {found:.3?} um", mode.name());
    }
    for (mode, expected, found) in found {
        for (expected, found) in expected.into_iter().zip(found) {
            let band = BAND.0 * expected..=BAND.1 * expected;
            assert!(band.contains(&found), "{}: {found} um, not {expected}", mode.name());
        }
    }
}

/// A platform a fifth heavier takes the advantage away; compensation gives it back.
#[test]
#[ignore = "second tier: takes long"]
fn computed_torque_is_twenty_times_better_than_joint_pd() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let rms =
            |mode, is_compensating, share| fast(&in_mode(name, mode, is_compensating), share).position.rms();
        let pd = rms(ControlMode::JointPd, false, 1.0);
        let [exact, heavy, compensated] = [(false, 1.0), (false, 1.2), (true, 1.2)]
            .map(|(is_compensating, share)| rms(ControlMode::ComputedTorque, is_compensating, share));
        println!("{name}: {exact:e} m, heavy {heavy:e} m, compensated {compensated:e} m, joint PD {pd:e} m");
        assert!(pd > 20.0 * exact && pd > 20.0 * compensated, "{name}: {pd} {exact} {compensated}");
        // Compensation leaves more than there was without the payload: it follows its force no faster than the estimator.
        let ratio = compensated / exact;
        assert!(pd < 40.0 * heavy && (50.0..300.0).contains(&ratio), "{name}: {heavy} {compensated} {exact}");
    }
}

/// Also where each leg is controlled for itself.
#[test]
#[ignore = "second tier: takes long"]
fn compensated_a_payload_leaves_nothing_at_rest() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        for mode in ControlMode::ALL {
            let [without, with] = [false, true].map(|is_compensating| {
                let config = in_mode(name, mode, is_compensating);
                let mut heavy = config.machine.clone();
                heavy.platform.mass_kg *= 1.2;
                let mut rig = Rig::new(&config, &heavy);
                let home = TaskState::at_rest(config.machine.home);
                rig.engage(&home);
                for _ in 0..5000 {
                    assert_eq!(rig.cycle(&rig.input(&home)).state, State::Active);
                }
                (rig.simulator().state().pose.position - home.motion().pose.position).norm()
            });
            println!("{name}, {}: {without:e} m, compensated {with:e} m", mode.name());
            assert!(without > 1e-4 && with < 1e-6, "{name}, {}: {without} {with}", mode.name());
        }
    }
}

/// The mean of the modes' loop gains is that of the law, on every machine.
#[test]
fn legs_that_move_together_have_the_gain_of_the_law_on_average() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let legs = LegMasses::at_home(&deployed(name).machine);
        println!("{name}: {legs:?}");
        assert!(
            0.0 < legs.softest_mode_gain_ratio
                && legs.softest_mode_gain_ratio < 1.0
                && 1.0 < legs.stiffest_mode_gain_ratio
                && legs.stiffest_mode_gain_ratio < 6.0
        );
    }
}

/// At its limit of bandwidth each mode still has its gain margin: what a push leaves fades also where forces
/// answer to errors a quarter more than they should.
#[test]
#[ignore = "second tier: takes long"]
fn certificate_the_largest_bandwidth_is_stable_in_every_mode() {
    let all = ["fried2008", "motion_base", "tsai2000"]
        .into_iter()
        .flat_map(|name| ControlMode::ALL.map(|mode| (name, mode)));
    cases(all, 3).into_par_iter().for_each(|(name, mode)| {
        let text = std::fs::read_to_string(format!("{}/config/{name}.toml", env!("CARGO_MANIFEST_DIR")));
        let with = |hertz: f64| {
            let mode = mode.name();
            let control = format!("\n[control]\nmode = \"{mode}\"\nposition_bandwidth_hz = {hertz}\n");
            Config::parse(&(text.as_ref().unwrap().clone() + &control), name)
        };
        let refusal = with(1e3).unwrap_err().to_string();
        let largest = refusal.split("must be at most ").nth(1).unwrap().split(' ').next().unwrap();
        let largest: f64 = largest.parse().unwrap();
        assert!(with(1.01 * largest).is_err());
        let mut config = with(largest).unwrap();
        config.deployment.control.orientation_bandwidth_hz = largest;
        let mut rig = Rig::new(&config, &config.machine);
        let home = TaskState::at_rest(config.machine.home);
        rig.engage(&home);
        (0..2000).for_each(|_| assert_eq!(rig.cycle(&rig.input(&home)).state, State::Active));
        let (settled, holds) = (rig.simulator().state().pose.position, rig.force.unwrap());
        let mut away = |cycles: u32, push: f64| {
            for _ in 0..cycles {
                let output = rig.controller.step(&rig.input(&home));
                assert_eq!(
                    output.state,
                    State::Active,
                    "{name} {}: {:?}",
                    mode.name(),
                    output.diagnostic.code
                );
                let answers = |leg: usize| holds[leg] + 1.25 * (output.command_n[leg] - holds[leg]);
                let mut force: [f64; 6] = core::array::from_fn(answers);
                force[0] += push;
                rig.pass(Some(force));
            }
            (rig.simulator().state().pose.position - settled).norm()
        };
        let pushed = away(20, 0.01 * config.machine.actuator.max_force_n);
        let left = away(2000, 0.0);
        println!("{name}, {}: to {largest} Hz, {pushed:e} m, {left:e} m are left", mode.name());
        assert!(pushed > 1e-7 && left < 1e-3 * pushed, "{name} {}: {left} of {pushed}", mode.name());
    });
}

/// Every second measurement is lost: the loop goes on with what becomes of the last error, and hardly worse.
#[test]
fn every_mode_rides_through_missing_measurements() {
    for mode in ControlMode::ALL {
        let config = in_mode("motion_base", mode, true);
        let scene = Fast::new(&config);
        let rms = [1, 2].map(|every| {
            let mut rig = Rig::new(&config, &config.machine);
            rig.engage(&scene.at(0.0));
            let mut tracking = Tracking::default();
            let mut last = rig.input(&scene.at(0.0)).measurement;
            for cycle in 0..(scene.duration() * 1e3) as u32 {
                let task = scene.at(1e-3 * f64::from(cycle));
                tracking
                    .position
                    .add((task.motion().pose.position - rig.simulator().state().pose.position).norm());
                let mut input = rig.input(&task);
                if cycle % every == 0 {
                    last = input.measurement;
                }
                input.measurement = last;
                assert_eq!(rig.cycle(&input).state, State::Active);
            }
            tracking.position.rms()
        });
        println!("{}: {rms:?}", mode.name());
        assert!(rms[1] < 1.2 * rms[0], "{}: {rms:?}", mode.name());
    }
}

/// The forces of a law on legs come from the measured lengths and the setpoint, and change with no other pose.
#[test]
fn a_leg_pushes_for_its_own_error() {
    let config = in_mode("motion_base", ControlMode::JointPd, false);
    let law = parameters(&config).law;
    let home = TaskState::at_rest(config.machine.home);
    let mut rig = Rig::new(&config, &config.machine);
    rig.engage(&home);
    (0..1000).for_each(|_| assert_eq!(rig.cycle(&rig.input(&home)).state, State::Active));
    let forces = |leg: usize, off: f64| {
        let mut input = rig.input(&home);
        input.measurement.as_mut().unwrap().length_m[leg] += off;
        rig.controller.clone().step(&input).command_n
    };
    for leg in 0..6 {
        let (with, without) = (forces(leg, 1e-5), forces(leg, 0.0));
        for other in 0..6 {
            let answered = answer(&config, &Vector6::ith(leg, -1e-5))[other];
            let expected = answered * law.leg_masses.mass_kg[other];
            assert_eq!(answered == 0.0, other != leg);
            let found = with[other] - without[other];
            assert!(
                (found - expected).abs() < 1e-6 * law.leg_masses.mass_kg[leg],
                "{leg} {other}: {found} {expected}"
            );
        }
    }
}
