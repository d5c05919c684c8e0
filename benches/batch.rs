//! Cost of the batch form against its size: nanoseconds per pose up to ten million poses, `cargo bench --bench batch`.
//!
//! Forces of motions, and of rows of X, X' and X'' as in C and Python; beside them one motion after the other with its legs in lanes,
//! and the peers of `benches/peers` where they are built. Then forward kinematics and regressors, beside one pose after the other.
//! A size for which the memory is too small is named and left out. `-- --quick` ends at a hundred thousand poses.

#[allow(dead_code, reason = "a part is for the bench speed_accuracy")]
#[path = "speed_accuracy/peers.rs"]
mod peers;
mod support;

use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use hexad::analysis::batch::{self, Row};
use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::forward_kinematics::{Outcome, refine};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::machine::Machine;
use hexad::model::regressor::regressor;
use hexad::model::rigid::{Motion, Pose, Twist};
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};
use indicatif::ProgressBar;

use peers::{BUILD, PEERS};
use support::omissions::Omissions;
use support::{Extent, Failure, exit_code};

const LARGEST: usize = 10_000_000;
const SIZES: [usize; 5] = [1_000, 10_000, 100_000, 1_000_000, LARGEST];
const QUICK_SIZES: usize = 3;

/// Memory of a pose: its state, its motion and its forces, and the same in rows \[bytes\].
const POSE_BYTES: usize =
    size_of::<TaskState>() + size_of::<Motion>() + size_of::<Option<Row>>() + 4 * size_of::<Row>();

/// Poses of the other functions, and regressors of 1.5 kB each.
const POSES: usize = 100_000;
const REGRESSORS: usize = 10_000;

/// Distance of the starts of forward kinematics \[m\], \[rad\].
const START_DISTANCE: f64 = 1e-3;

/// Goal on one thread \[ns\], with 512 and with 256 bits.
const GOALS_NS: [f64; 2] = [30.0, 45.0];

/// Samples of a peer and their length \[s\].
const PEER_SAMPLES: usize = 15;
const PEER_SAMPLE_S: f64 = 1e-3;

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
    let model = batch::model(&Config::load(&path)?.machine);
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
    let scene = fit(model.machine(), BuiltInMotion::Sines, 60.0);
    let largest = sizes.last().copied().unwrap_or(0);
    let states = (0..largest).map(|k| scene.at(60.0 * k as f64 / largest as f64));
    let states: Vec<_> = ProgressBar::new(largest as u64).wrap_iter(states).collect();
    println!("{}", support::provenance());
    inverse_dynamics(&model, &sizes, &states);
    let motions: Vec<_> = states.iter().take(POSES).map(TaskState::motion).collect();
    other_functions(model.machine(), &motions);
    others(&mut omissions);
    omissions.finish()
}

fn inverse_dynamics(model: &InverseDynamics, sizes: &[usize], states: &[TaskState]) {
    let motions: Vec<_> = states.iter().map(TaskState::motion).collect();
    let rows = |of: fn(&TaskState) -> Row| states.iter().map(of).collect::<Vec<_>>();
    let (x, x_rate, x_accel) = (rows(|s| s.x.into()), rows(|s| s.xd.into()), rows(|s| s.xdd.into()));
    let mut forces = vec![None; motions.len()];
    let mut force_rows = vec![[0.0; LEGS]; motions.len()];
    let [goal_512, goal_256] = GOALS_NS;
    let goal = if model.machine().level.as_avx512().is_some() { goal_512 } else { goal_256 };
    println!("\nInverse dynamics, exact model: ns per pose; the goal is {goal} on one thread");
    let titles = ["all threads", "one thread", "rows, all", "rows, one", "legs in lanes"];
    println!("{:>9}{}", "poses", titles.map(|title| format!("{title:>14}")).concat());
    for &size in sizes {
        let motions = motions.get(..size).unwrap_or_default();
        let rows = [&x, &x_rate, &x_accel].map(|rows| rows.get(..size).unwrap_or_default());
        let bar = ProgressBar::hidden();
        let mut forces_in = |threads: usize| {
            ns_per_pose(size, || {
                batch::forces(model, Fidelity::Exact, motions, &mut forces, threads, &bar);
            })
        };
        let [all, one] = [forces_in(0), forces_in(1)];
        let mut rows_in = |threads: usize| {
            ns_per_pose(size, || {
                batch::forces_of_rows(model, Fidelity::Exact, rows, &mut force_rows, threads);
            })
        };
        let [rows_all, rows_one] = [rows_in(0), rows_in(1)];
        let legs_in_lanes = ns_per_pose(size, || {
            for (force, motion) in forces.iter_mut().zip(motions) {
                *force = model.forces_of(Fidelity::Exact, motion);
            }
        });
        let cells = [all, one, rows_all, rows_one, legs_in_lanes].map(|ns| format!("{ns:>14.1}"));
        println!("{size:>9}{}", cells.concat());
    }
}

/// Forward kinematics and regressors.
fn other_functions(machine: &Machine, motions: &[Motion]) {
    let start = |pose: &Pose| {
        let step = [START_DISTANCE; 3].into();
        pose.displaced(&Twist { angular: step, linear: step })
    };
    let starts: Vec<_> = motions.iter().map(|motion| start(&motion.pose)).collect();
    let lengths: Vec<_> = motions.iter().map(|motion| leg_lengths(machine, &motion.pose)).collect();
    let mut poses = vec![None; motions.len()];
    let mut in_lanes = |threads: usize| {
        ns_per_pose(motions.len(), || batch::poses(machine, &starts, &lengths, &mut poses, threads))
    };
    let [all, one] = [in_lanes(0), in_lanes(1)];
    let alone = ns_per_pose(motions.len(), || {
        for (pose, (start, lengths)) in poses.iter_mut().zip(starts.iter().zip(&lengths)) {
            let mut state = KinematicState::new(machine, *start);
            let outcome = refine(machine, &mut state, lengths).outcome;
            *pose = (outcome == Outcome::Solved).then_some(*state.pose());
        }
    });
    println!("\nOther functions: ns per pose");
    let titles = ["poses", "all threads", "one thread", "legs in lanes"].map(|title| format!("{title:>14}"));
    println!("{:>30}{}", "", titles.concat());
    println!("{:>30}{:>14}{all:>14.1}{one:>14.1}{alone:>14.1}", "forward kinematics", motions.len());

    let motions = motions.get(..REGRESSORS).unwrap_or_default();
    let mut found = vec![None; motions.len()];
    let mut in_threads = |threads: usize| {
        ns_per_pose(motions.len(), || batch::regressors(machine, motions, &mut found, threads))
    };
    let [all, one] = [in_threads(0), in_threads(1)];
    let alone = ns_per_pose(motions.len(), || {
        for (found, motion) in found.iter_mut().zip(motions) {
            *found = regressor(machine, motion);
        }
    });
    println!("{:>30}{:>14}{all:>14.1}{one:>14.1}{alone:>14.1}", "regressor", motions.len());
}

/// The peers' inverse dynamics on their own inputs.
fn others(omissions: &mut Omissions) {
    println!(
        "\nInverse dynamics by others on one thread, one of a thousand poses after the other: ns per pose"
    );
    for peer in &PEERS {
        if !peer.is_built() {
            omissions.add(peer.name, format!("not built; {BUILD}"));
        } else if let Some(report) =
            omissions.attempt("peers", peer.name, peer.run(PEER_SAMPLES, PEER_SAMPLE_S))
        {
            println!("{:>30}{:>14.1}", peer.name, report.throughput);
        }
    }
}

/// Shortest of several runs: other processes only make a run longer.
fn ns_per_pose(poses: usize, mut evaluate: impl FnMut()) -> f64 {
    let mut run_s = || {
        let started = Instant::now();
        evaluate();
        started.elapsed().as_secs_f64()
    };
    let runs = (LARGEST / poses.max(1)).clamp(5, 20);
    (0..runs).map(|_| run_s()).fold(f64::INFINITY, f64::min) * 1e9 / poses as f64
}

/// Memory that can be used without swapping \[bytes\].
fn available_bytes() -> Result<usize, Failure> {
    let text = fs::read_to_string("/proc/meminfo")?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kib = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<usize>().ok());
    Ok(1024 * kib.ok_or("/proc/meminfo has no MemAvailable")?)
}
