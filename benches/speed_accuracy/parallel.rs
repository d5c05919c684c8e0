//! The parallel algorithm: the legs one, two, four or eight at once, many poses over threads, and the cost of a thread per leg.
//!
//! The legs' part is the load of the legs and the platform; the rest, the balance of the 6 x 6 matrix N, waits for all legs.

use std::iter;
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread::{available_parallelism, scope};
use std::time::Instant;

use fearless_simd::Level;
use hexad::analysis::batch;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::{Exact, Fidelity};
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::inverse_jacobian::leg_wrenches;
use hexad::model::rigid::Motion;
use hexad::output::charts::LineStyle;
use indicatif::ProgressBar;
use serde::Deserialize;

use super::AGREEMENT;
use super::chart::written;
use super::leg_by_leg::LegByLeg;
use super::methods::instruction_sets;
use super::scenes::Scene;
use super::support::charts::Charts;
use super::support::omissions::Omissions;
use super::support::scatter::{Grid, Label, Line, Mark, Point, Sample, Scatter, Width};
use super::support::{Failure, cells, log_axis::log_range};
use super::timing::{Samples, sample};

const FILE: &str = "parallel.csv";

/// The scene that is measured.
const SCENE: &str = "motion_base_fast";

/// Length of one sample \[s\].
const SAMPLE_S: f64 = 0.3e-3;

/// Poses that the threads share: 16 tasks of the batch form.
const POSES: usize = 16 * 8192;

/// Poses and hand-overs, which last longer than a sample, are run once in so many rounds.
const ROUNDS_PER_RUN: usize = 5;

/// Round trips between two threads in one run.
const ROUND_TRIPS: usize = 1000;

/// Instruction sets by the legs that fit into a vector.
const LEGS_AT_ONCE: [(&str, usize); 3] = [("sse4_2", 2), ("avx2", 4), ("avx512", 8)];

/// One figure: `evaluation` and `legs` by legs at once, `poses` by threads, `spinning` and `sleeping` of one hand-over.
#[derive(Deserialize)]
struct Row {
    part: String,
    isa: String,
    count: usize,
    ns: f64,
}

impl Row {
    fn new(part: &str, isa: &str, count: usize, ns: f64) -> Self {
        Self { part: part.into(), isa: isa.into(), count, ns }
    }
}

pub fn measure(
    charts: &Charts,
    scenes: &[Scene],
    rounds: usize,
    omissions: &mut Omissions,
) -> Result<(), Failure> {
    let scene = scenes.iter().find(|scene| scene.name == SCENE).ok_or("no scene")?;
    let mut rows = legs_at_once(scene, rounds, omissions)?;
    let processors = available_parallelism()?.get();
    let runs = rounds.div_ceil(ROUNDS_PER_RUN);
    rows.extend(poses_over_threads(scene, processors, runs));
    if processors > 1 {
        rows.extend(hand_overs(runs));
    } else {
        omissions.lacking("hand-over between threads", "it needs two processors");
    }
    for row in &rows {
        println!("{:<12}{:<8}{:>4}{:>10.1} ns", row.part, row.isa, row.count, row.ns);
    }
    let table = rows.iter().map(|row| cells([&row.part, &row.isa, &row.count, &format!("{:.1}", row.ns)]));
    charts.write_csv(FILE, &["part", "isa", "count", "ns"], table)
}

/// Time of one evaluation \[ns\], by passes over the motions and whether a fence separates them.
type Timer<'a> = Box<dyn Fn(usize, bool) -> f64 + 'a>;

/// A way to evaluate some legs at once.
struct Contender<'a> {
    isa: &'static str,
    legs: usize,
    whole: (Timer<'a>, Samples),
    /// The sum of these times, each with its sign, is that of the legs' part.
    part: Vec<(f64, Timer<'a>, Samples)>,
}

impl<'a> Contender<'a> {
    /// One leg at once.
    fn leg_by_leg(scene: &'a Scene) -> Result<Self, Failure> {
        let model = Rc::new(LegByLeg::new(&scene.machine));
        let error = scene.errors(scene.motions.iter().map(|motion| model.forces(motion))).max;
        if !(error <= 10.0 * AGREEMENT) {
            return Err(format!(
                "leg by leg: error {error:e} exceeds {:e} of the largest force",
                10.0 * AGREEMENT
            )
            .into());
        }
        let legs = Rc::clone(&model);
        let part = vec![(1.0, timer(scene, move |motion| legs.load(motion)), Samples::default())];
        let whole = timer(scene, move |motion| model.forces(motion));
        Ok(Self { isa: "scalar", legs: 1, whole: (whole, Samples::default()), part })
    }

    /// The lanes of an instruction set. `load_of` also writes N to memory, which is taken off: it is what `leg_wrenches` does
    /// beyond the geometry of the legs, with which `leg_lengths` begins too.
    fn lanes(scene: &'a Scene, isa: &'static str, legs: usize, level: Level) -> Self {
        let model = Rc::new(InverseDynamics::new(&scene.machine_on(level)));
        let [load, wrenches, lengths] = [(); 3].map(|()| Rc::clone(&model));
        let load = timer(scene, move |motion| load.load_of::<Exact>(motion));
        let wrenches = timer(scene, move |motion| leg_wrenches(wrenches.machine(), &motion.pose));
        let lengths = timer(scene, move |motion| leg_lengths(lengths.machine(), &motion.pose));
        let part = [(1.0, load), (-1.0, wrenches), (1.0, lengths)];
        let part = part.into_iter().map(|(sign, timer)| (sign, timer, Samples::default())).collect();
        let whole = timer(scene, move |motion| model.forces::<Exact>(motion));
        Self { isa, legs, whole: (whole, Samples::default()), part }
    }

    /// Time of the whole and of the legs' part, each alone \[ns\].
    fn rows(&self) -> [Row; 2] {
        let part = self.part.iter().map(|(sign, _, samples)| sign * samples.latency()).sum();
        let whole = self.whole.1.latency();
        [("evaluation", whole), ("legs", part)].map(|(name, ns)| Row::new(name, self.isa, self.legs, ns))
    }
}

fn timer<'a, O>(scene: &'a Scene, evaluate: impl Fn(&Motion) -> O + 'a) -> Timer<'a> {
    Box::new(move |passes, fenced| sample(&scene.motions, passes, fenced, &evaluate))
}

fn legs_at_once(scene: &Scene, rounds: usize, omissions: &mut Omissions) -> Result<Vec<Row>, Failure> {
    let mut contenders = vec![Contender::leg_by_leg(scene)?];
    let levels = instruction_sets();
    for (isa, legs) in LEGS_AT_ONCE {
        match levels.iter().find(|(name, _)| *name == isa) {
            Some((_, level)) => contenders.push(Contender::lanes(scene, isa, legs, *level)),
            None => omissions
                .add(format!("{legs} legs at once"), format!("no {} on this processor", written(isa))),
        }
    }
    for _ in 0..rounds {
        for Contender { whole: (whole, samples), part, .. } in &mut contenders {
            samples.take(scene.motions.len(), SAMPLE_S, &*whole);
            for (_, timer, samples) in part {
                samples.take(scene.motions.len(), SAMPLE_S, &*timer);
            }
        }
    }
    Ok(contenders.iter().flat_map(Contender::rows).collect())
}

/// The fastest of some runs, as others use the processors too.
fn fastest(runs: usize, run: impl FnMut() -> f64) -> f64 {
    iter::repeat_with(run).take(runs).fold(f64::INFINITY, f64::min)
}

fn poses_over_threads(scene: &Scene, processors: usize, runs: usize) -> Vec<Row> {
    let model = InverseDynamics::new(&scene.machine);
    let motions: Vec<Motion> = scene.motions.iter().cycle().take(POSES).copied().collect();
    let mut forces = vec![None; POSES];
    let counts =
        iter::successors(Some(1), |count| (*count < processors).then_some(processors.min(2 * count)));
    let rows = counts.map(|threads| {
        let ns = fastest(runs, || {
            let start = Instant::now();
            batch::forces(&model, Fidelity::Exact, &motions, &mut forces, threads, &ProgressBar::hidden());
            start.elapsed().as_secs_f64() * 1e9 / POSES as f64
        });
        Row::new("poses", "", threads, ns)
    });
    rows.collect()
}

/// One hand-over between two threads: half of a round trip, of threads that spin and of threads that sleep.
fn hand_overs(runs: usize) -> [Row; 2] {
    let spinning = fastest(runs, || {
        let turn = AtomicUsize::new(0);
        let pass = |to| turn.store(to, Ordering::Release);
        let wait = |until| {
            while turn.load(Ordering::Acquire) != until {
                core::hint::spin_loop();
            }
        };
        half_round_trip(pass, wait)
    });
    let sleeping = fastest(runs, || {
        let (turn, changed) = (Mutex::new(0), Condvar::new());
        let lock = || turn.lock().unwrap_or_else(PoisonError::into_inner);
        let pass = |to| {
            *lock() = to;
            changed.notify_one();
        };
        half_round_trip(pass, |until| drop(changed.wait_while(lock(), |turn| *turn != until)))
    });
    [("spinning", spinning), ("sleeping", sleeping)].map(|(part, ns)| Row::new(part, "", 2, ns))
}

/// Time from one thread to the other \[ns\]; the first round trip, in which the other thread starts, does not count.
fn half_round_trip(pass: impl Fn(usize) + Sync, wait: impl Fn(usize) + Sync) -> f64 {
    scope(|scope| {
        scope.spawn(|| {
            for trip in 0..=ROUND_TRIPS {
                wait(2 * trip + 1);
                pass(2 * trip + 2);
            }
        });
        let go_and_return = |trip| {
            pass(2 * trip + 1);
            wait(2 * trip + 2);
        };
        go_and_return(0);
        let start = Instant::now();
        (1..=ROUND_TRIPS).for_each(go_and_return);
        start.elapsed().as_secs_f64() * 1e9 / (2 * ROUND_TRIPS) as f64
    })
}

/// Legs at once on the left, poses over threads on the right.
pub fn draw(charts: &Charts) -> Result<(), Failure> {
    let figures = charts.read::<Row>(FILE)?;
    let of = |part: &str| -> Vec<(f64, f64)> {
        let rows = figures.rows.iter().filter(|row| row.part == part);
        rows.map(|row| (row.count as f64, row.ns)).collect()
    };
    let [whole, legs, poses] = ["evaluation", "legs", "poses"].map(of);
    let balance: Vec<_> = whole.iter().zip(&legs).map(|(whole, legs)| (whole.0, whole.1 - legs.1)).collect();
    let curve = |points: &[(f64, f64)], color| Line {
        points: points.into(),
        style: LineStyle::Solid,
        color,
        width: Width::Curve,
    };
    let disc = |color| move |at: &(f64, f64)| Point { at: *at, mark: Mark::Disc, color, label: Label::None };
    let names = figures.rows.iter().filter(|row| row.part == "evaluation").map(|row| written(&row.isa));
    let names: Vec<_> = names.collect();
    let mut points: Vec<_> = whole.iter().map(disc(0)).collect();
    for (point, name) in points.iter_mut().zip(&names) {
        point.label = Label::Flag(name);
    }
    points.extend(legs.iter().map(disc(1)).chain(balance.iter().map(disc(3))));
    let ends = [0.8, 10.0];
    let hand_over = of("spinning").iter().flat_map(|(_, ns)| ends.map(|x| (x, *ns))).collect::<Vec<_>>();
    let dashed = |points| Line { points, style: LineStyle::Dashed, color: 0, width: Width::Curve };
    let ideal = poses.first().map_or(0.0, |(_, ns)| *ns);
    let ideal = poses.iter().map(|(threads, _)| (*threads, ideal / threads)).collect::<Vec<_>>();
    let of_legs = whole.iter().chain(&balance).chain(&hand_over).map(|at| at.1);
    let drawn = vec![
        Scatter {
            title: "one pose",
            x_label: "legs at once",
            y_label: "time [ns]",
            x: 0.8..10.0,
            y: log_range(of_legs.chain([2.0 * whole.first().map_or(1.0, |at| at.1)])),
            points,
            lines: vec![curve(&whole, 0), curve(&legs, 1), curve(&balance, 3), dashed(hand_over)],
        },
        Scatter {
            title: "many poses",
            x_label: "threads",
            y_label: "time per pose [ns]",
            x: log_range(poses.iter().map(|at| at.0)),
            y: log_range(poses.iter().chain(&ideal).map(|at| at.1)),
            points: poses.iter().map(disc(2)).collect(),
            lines: vec![curve(&poses, 2), dashed(ideal)],
        },
    ];
    let line = |color| Sample::Line(LineStyle::Solid, Width::Curve, color);
    let grey = Sample::Line(LineStyle::Dashed, Width::Curve, 0);
    let legend = vec![
        (line(0), "whole evaluation"),
        (line(1), "legs"),
        (line(3), "balance of 6 x 6"),
        (line(2), "poses over threads"),
        (grey, "left: one hand-over between spinning threads; right: shared without loss"),
    ];
    let title = figures.titled("The parallel algorithm: legs in lanes, poses over threads");
    Grid { title: &title, legend, columns: 2, charts: drawn }.write_svg(&charts.path("parallel.svg"))?;
    Ok(())
}
