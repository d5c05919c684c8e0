//! Identification of machines from motions whose samples are exact but for noise of the forces.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use hexad::analysis::identification::{Load, MotionSample, Run, identify, prediction_errors};
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::transmission::Transmission;
use nalgebra::Vector3;

use crate::common::identified::{Series, drawn, loaded, report};
use crate::common::machine;

fn run(truth: &Machine, series: &Series, seconds: f64, noise: f64, load: Load, random: &mut Random) -> Run {
    let sample = |k: u32| {
        let time_s = 0.02 * f64::from(k);
        let motion = series.at(truth, time_s).motion();
        let forces = inverse_dynamics::<Exact>(truth, &motion).unwrap();
        let command = Transmission::of_motion(truth, &motion).commands(&forces);
        (time_s, motion, command)
    };
    let samples = (0..(seconds / 0.02) as u32).map(sample).map(|(time_s, motion, command)| MotionSample {
        time_s,
        motion,
        command: command.map(|force| force + noise * random.gaussian()),
    });
    Run { samples: samples.collect(), load }
}

#[test]
fn a_machine_is_identified() {
    let mut random = Random::new(41);
    for name in ["motion_base"] {
        let file = machine(name);
        let truth = drawn(&file, &mut random);
        let series = Series::new(&file, 1.0, &mut random);
        let noise = 0.001 * file.actuator.max_force;
        let (mass, at) = (0.15 * file.platform.mass, [0.3, -0.2, 0.8]);
        let empty = run(&truth, &series, 60.0, noise, Load::Empty, &mut random);
        let with = run(
            &loaded(&truth, mass, Vector3::from(at)),
            &series,
            60.0,
            noise,
            Load::Known { mass, at },
            &mut random,
        );
        let other = Series::new(&file, 1.0, &mut random);
        let test = run(&truth, &other, 10.0, 0.0, Load::Empty, &mut random);
        let began = std::time::Instant::now();
        let found = identify(&file, &[empty, with], false).unwrap();
        println!(
            "{:?} for {} equations, shown {} of {}",
            began.elapsed(),
            found.equations,
            found.shown,
            found.shown + found.unknown
        );
        println!("residual {:?} correlation {:?}", found.residual, found.correlation);
        println!("before {:?}", prediction_errors(&file, &[test.clone()]));
        println!("after {:?}", prediction_errors(&found.machine, &[test.clone()]));
        report(&found, &truth);
    }
}
