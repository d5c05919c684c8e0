//! Cost of the batch form against its size: nanoseconds per pose up to ten million poses.

#![allow(clippy::expect_used, reason = "a bench that cannot load its machine has nothing to measure")]

mod support;

use std::path::Path;
use std::time::Instant;

use hexad::analysis::batch;
use hexad::config::Config;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::motion::built_in::{BuiltInMotion, fit};
use indicatif::ProgressBar;

const LARGEST: usize = 10_000_000;

fn main() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/motion_base.toml");
    let machine = Config::load(&path).expect("a machine of the project").machine;
    let model = InverseDynamics::new(&machine);
    let scene = fit(&machine, BuiltInMotion::Sines, 60.0);
    let bar = ProgressBar::new(LARGEST as u64);
    let motions: Vec<_> = (0..LARGEST)
        .map(|k| scene.at(60.0 * k as f64 / LARGEST as f64).motion())
        .inspect(|_| bar.inc(1))
        .collect();
    bar.finish_and_clear();
    let mut forces = vec![None; LARGEST];
    println!("{}", support::provenance());
    println!("{} threads", rayon::current_num_threads());
    for size in [1_000, 10_000, 100_000, 1_000_000, LARGEST] {
        let repetitions = (LARGEST / size).min(1_000);
        let started = Instant::now();
        for _ in 0..repetitions {
            let part = motions.get(..size).unwrap_or_default();
            batch::forces(&model, Fidelity::Exact, part, &mut forces, &ProgressBar::hidden());
        }
        let ns = started.elapsed().as_secs_f64() * 1e9 / (repetitions * size) as f64;
        println!("{size:>9} poses: {ns:>6.1} ns per pose");
    }
}
