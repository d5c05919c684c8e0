//! Cost of the batch form against its size: nanoseconds per pose up to ten million poses, `cargo bench --bench batch`.
//!
//! Beside it one pose after the other with its legs in lanes, on one thread.
//! A size for which the memory is too small is named and left out. `-- --quick` ends at a hundred thousand poses.

mod support;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use hexad::analysis::batch;
use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::rigid::Motion;
use hexad::motion::built_in::{BuiltInMotion, fit};
use indicatif::ProgressBar;

use support::omissions::Omissions;
use support::{Extent, Failure, exit_code};

const SIZES: [usize; 5] = [1_000, 10_000, 100_000, 1_000_000, 10_000_000];
const QUICK_SIZES: usize = 3;

/// Memory of a pose: its motion and its forces \[bytes\].
const POSE_BYTES: usize = size_of::<Motion>() + size_of::<Option<[f64; LEGS]>>();

/// Cost of the batch form against its size.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    of_all: Extent,
}

fn main() -> ExitCode {
    exit_code(run(Arguments::parse().of_all.is_quick()))
}

fn run(quick: bool) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/motion_base.toml");
    let machine = Config::load(&path)?.machine;
    let model = InverseDynamics::new(&machine);
    let scene = fit(&machine, BuiltInMotion::Sines, 60.0);
    let mut omissions = Omissions::default();
    let mut sizes = SIZES.into_iter().take(if quick { QUICK_SIZES } else { SIZES.len() }).collect::<Vec<_>>();
    let room = available_bytes()? / POSE_BYTES;
    sizes.retain(|size| {
        let fits = *size <= room;
        if !fits {
            omissions.add(format!("{size} poses"), format!("the available memory holds {room}"));
        }
        fits
    });
    let largest = sizes.last().copied().unwrap_or(0);
    let bar = ProgressBar::new(largest as u64);
    let motions: Vec<_> = (0..largest)
        .map(|k| scene.at(60.0 * k as f64 / largest as f64).motion())
        .inspect(|_| bar.inc(1))
        .collect();
    bar.finish_and_clear();
    let mut forces = vec![None; largest];
    println!("{}", support::provenance());
    println!("ns per pose, exact model; {} threads", rayon::current_num_threads());
    println!("{:>9} {:>12} {:>12} {:>14}", "poses", "all threads", "one thread", "legs in lanes");
    for size in sizes {
        let repetitions = (largest / size).min(1_000);
        let part = motions.get(..size).unwrap_or_default();
        let ns = |evaluate: &mut dyn FnMut()| {
            let started = Instant::now();
            (0..repetitions).for_each(|_| evaluate());
            started.elapsed().as_secs_f64() * 1e9 / (repetitions * size) as f64
        };
        let all_threads =
            ns(&mut || batch::forces(&model, Fidelity::Exact, part, &mut forces, &ProgressBar::hidden()));
        let one_thread = ns(&mut || model.forces_of_all(Fidelity::Exact, part, &mut forces));
        let legs_in_lanes = ns(&mut || {
            for (force, motion) in forces.iter_mut().zip(part) {
                *force = model.forces_of(Fidelity::Exact, motion);
            }
        });
        println!("{size:>9} {all_threads:>12.1} {one_thread:>12.1} {legs_in_lanes:>14.1}");
    }
    omissions.finish()
}

/// Memory that can be used without swapping \[bytes\].
fn available_bytes() -> Result<usize, Failure> {
    let text = fs::read_to_string("/proc/meminfo")?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kib = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<usize>().ok());
    Ok(1024 * kib.ok_or("/proc/meminfo has no MemAvailable")?)
}
