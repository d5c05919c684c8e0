//! How long one evaluation of the inverse dynamics takes, and how far its forces are from the right ones:
//! `cargo bench --bench speed_accuracy`.
//!
//! Every fidelity on every instruction set of this CPU, the paper's own dense
//! form, and, once `benches/peers/run.sh` has built them, what others would use. On a slow and a fast scene
//! of three machines and on the peers' own (see `scenes.rs`). Writes `benches/charts/speed_accuracy.csv` and
//! `.svg`, and prints how many times faster the exact model is than each peer in the same run.
//!
//! A peer that is not built or fails is named and left out. `-- --quick` takes few samples; `-- --redraw` none, and draws the
//! chart from the CSV file. `-- --count exact` only evaluates, for instruction counts:
//!
//! ```text
//! valgrind --tool=callgrind target/release/deps/speed_accuracy-* --count exact --evaluations 10000
//! ```

mod chart;
mod leg_by_leg;
mod methods;
mod paper;
mod parallel;
mod peers;
mod results;
mod scenes;
#[path = "../support/mod.rs"]
mod support;
mod timing;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use fearless_simd::Level;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use indicatif::{ProgressBar, ProgressStyle};

use methods::{BASELINE, Method, instruction_sets};
use peers::{PEERS, Peer};
use results::{Row, print_ratios, write_csv};
use scenes::Scene;
use support::omissions::Omissions;
use support::{ChartArguments, Failure, exit_code};
use timing::{Samples, sample};

/// Samples of each method on each scene, spread over the run.
const ROUNDS: usize = 101;
const QUICK_ROUNDS: usize = 4;

/// Length of one sample \[s\]: a thousand times what reading the clock takes.
const SAMPLE_S: f64 = 0.3e-3;

/// Every so many rounds the peers run as well; each run of theirs is a median of so many samples of theirs.
const PEER_INTERVAL: usize = 3;
const PEER_REPETITIONS: usize = 15;
const PEER_SAMPLE_S: f64 = 1e-3;

/// Largest error of the exact model against the reference of each scene: on the peers' it does the same work as they do,
/// or the comparison of their times means nothing.
const AGREEMENT: f64 = 1e-14;

/// Speed and accuracy of the inverse dynamics.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    of_all: ChartArguments,
    /// Evaluates one fidelity (its name on the command line of hexad) and nothing else.
    #[arg(long, value_name = "RUNG")]
    count: Option<String>,
    /// Instruction set, the best if absent; with --count.
    #[arg(long, requires = "count")]
    isa: Option<String>,
    /// How many; with --count.
    #[arg(long, requires = "count", default_value_t = 10_000)]
    evaluations: usize,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    exit_code(match &arguments.count {
        Some(fidelity) => count(&arguments, fidelity),
        None => compare(&arguments.of_all),
    })
}

/// Evaluates one method so many times, on the fast scene of the first machine.
fn count(arguments: &Arguments, fidelity: &str) -> Result<(), Failure> {
    let fidelity = Fidelity::by_name(fidelity);
    let fidelity = fidelity.ok_or_else(|| {
        format!("no such fidelity; one of {}", Fidelity::ALL.map(Fidelity::name).join(", "))
    })?;
    let sets = instruction_sets();
    let wanted = |name: &str| arguments.isa.as_ref().is_none_or(|isa| isa == name);
    let names = sets.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let set = sets.into_iter().find(|(name, _)| wanted(name));
    let (isa, level) = set.ok_or_else(|| format!("not on this CPU; one of {names}"))?;
    let method = Method::new(fidelity);
    let scene = Scene::of_machines()?.into_iter().nth(1).ok_or("no scene")?;
    let dynamics = InverseDynamics::new(&scene.machine_on(level));
    let passes = arguments.evaluations.div_ceil(scene.motions.len());
    (method.sample)(&dynamics, &scene.motions, passes, false);
    println!("{} {isa}: {} evaluations", fidelity.name(), passes * scene.motions.len());
    Ok(())
}

/// Everything against everything.
fn compare(arguments: &ChartArguments) -> Result<(), Failure> {
    let charts = arguments.charts();
    if arguments.redraw {
        chart::draw(&charts)?;
        return parallel::draw(&charts);
    }
    let begin = Instant::now();
    let mut omissions = Omissions::default();
    let scenes = scenes(&mut omissions)?;
    let rounds = if arguments.extent.is_quick() { QUICK_ROUNDS } else { ROUNDS };
    parallel::measure(&charts, &scenes, rounds, &mut omissions)?;
    parallel::draw(&charts)?;
    let mut contenders = contenders(&scenes, &mut omissions);
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} rounds, {eta} left")?;
    let bar = ProgressBar::new(rounds as u64).with_style(style);
    for round in 0..rounds {
        contenders.retain_mut(|contender| {
            let sample = contender.take(&scenes, round);
            omissions.attempt(contender.row.method, contender.row.method, sample).is_some()
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    let rows: Vec<Row> = contenders.into_iter().map(|contender| contender.row).collect();

    agree(&rows)?;
    print_ratios(&rows);
    println!("{} methods on scenes, {rounds} rounds, {:.0} s", rows.len(), begin.elapsed().as_secs_f64());
    write_csv(&charts, &rows)?;
    chart::draw(&charts)?;
    omissions.finish()
}

/// Those of the machines, and the peers' where they have been built.
fn scenes(omissions: &mut Omissions) -> Result<Vec<Scene>, Failure> {
    let mut scenes = Scene::of_machines()?;
    if let Some(inputs) = omissions.attempt("peers", "inputs of the peers", peers::inputs()).flatten() {
        scenes.push(Scene::of_peers(&inputs)?);
    }
    let missing: Vec<_> = PEERS.iter().filter(|peer| !peer.is_built()).map(|peer| peer.name).collect();
    if !missing.is_empty() {
        omissions.add(missing.join(", "), format!("not built; {} does it", peers::BUILD));
    }
    Ok(scenes)
}

/// Who takes part, with errors known and times still to be measured.
fn contenders(scenes: &[Scene], omissions: &mut Omissions) -> Vec<Contender> {
    let mut contenders = vec![];
    for (index, scene) in scenes.iter().enumerate() {
        for (isa, level) in instruction_sets() {
            let methods = Fidelity::ALL.map(Method::new);
            contenders.extend(methods.map(|method| Contender::hexad(scene, index, method, isa, level)));
        }
        contenders.extend(Contender::paper(scene, index));
    }
    for peer in PEERS.iter().filter(|peer| peer.is_built()) {
        contenders.extend(omissions.attempt(peer.name, peer.name, Contender::peer(peer)));
    }
    contenders
}

/// A row in the making.
struct Contender {
    row: Row,
    way: Way,
}

/// What is timed.
enum Way {
    Hexad { scene: usize, method: Method, dynamics: Box<InverseDynamics> },
    Paper { scene: usize },
    Peer(&'static Peer),
}

impl Contender {
    fn hexad(scene: &Scene, index: usize, method: Method, isa: &'static str, level: Level) -> Self {
        let dynamics = Box::new(InverseDynamics::new(&scene.machine_on(level)));
        let errors = scene.errors(scene.motions.iter().map(|motion| (method.forces)(&dynamics, motion)));
        let row = Row {
            method: method.fidelity.name(),
            isa,
            scene: scene.name.clone(),
            pace: scene.pace,
            samples: Samples::default(),
            errors,
        };
        Self { row, way: Way::Hexad { scene: index, method, dynamics } }
    }

    /// The dense form: its slow scenes are compared with the exact model, because it is their reference.
    fn paper(scene: &Scene, index: usize) -> Option<Self> {
        let machine = scene.paper_machine.as_ref()?;
        let dynamics = InverseDynamics::new(&scene.machine);
        let exact = Method::new(Fidelity::Exact).forces;
        let errors = match scene.pace {
            scenes::Pace::Slow => scene.errors(scene.motions.iter().map(|motion| exact(&dynamics, motion))),
            _ => scene.errors(scene.states.iter().map(|state| Some(paper::forces(machine, state).into()))),
        };
        let row = Row {
            method: results::PAPER,
            isa: BASELINE,
            scene: scene.name.clone(),
            pace: scene.pace,
            samples: Samples::default(),
            errors,
        };
        Some(Self { row, way: Way::Paper { scene: index } })
    }

    fn peer(peer: &'static Peer) -> Result<Self, Failure> {
        let row = Row {
            method: peer.name,
            isa: "native",
            scene: "peers".into(),
            pace: scenes::Pace::Peers,
            samples: Samples::default(),
            errors: peer.run(1, 0.0)?.errors,
        };
        Ok(Self { row, way: Way::Peer(peer) })
    }

    /// One sample of each kind.
    fn take(&mut self, scenes: &[Scene], round: usize) -> Result<(), Failure> {
        let samples = &mut self.row.samples;
        match &self.way {
            Way::Hexad { scene, method, dynamics } => {
                let Some(Scene { motions, .. }) = scenes.get(*scene) else { return Ok(()) };
                samples.take(motions.len(), SAMPLE_S, |passes, fenced| {
                    (method.sample)(dynamics, motions, passes, fenced)
                });
            }
            Way::Paper { scene } => {
                let Some(Scene { states, paper_machine: Some(machine), .. }) = scenes.get(*scene) else {
                    return Ok(());
                };
                samples.take(states.len(), SAMPLE_S, |passes, fenced| {
                    sample(states, passes, fenced, |state| paper::forces(machine, state))
                });
            }
            Way::Peer(peer) => {
                if round.is_multiple_of(PEER_INTERVAL) {
                    let report = peer.run(PEER_REPETITIONS, PEER_SAMPLE_S)?;
                    samples.add(report.throughput, report.latency);
                }
            }
        }
        Ok(())
    }
}

/// The exact model has the forces of every reference.
fn agree(rows: &[Row]) -> Result<(), Failure> {
    for row in rows.iter().filter(|row| row.is_exact()) {
        let error = row.errors.max;
        if !(error <= AGREEMENT) {
            return Err(format!(
                "{} {}, {}: error {error:e} exceeds {AGREEMENT:e} of the largest force",
                row.method, row.isa, row.scene
            )
            .into());
        }
    }
    Ok(())
}
