//! The model at many motions, on several threads.
//!
//! For trajectories, sweeps and Monte Carlo. Motions are independent: the cost grows linearly, and the
//! result does not depend on the number of threads.

use std::num::NonZero;
use std::sync::Mutex;
use std::thread::{self, Builder};

use fearless_simd::Level;
use indicatif::ProgressBar;

use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::forward_kinematics::poses_near;
use hexad_core::model::machine::Machine;
use hexad_core::model::regressor::{Regressor, regressor};
use hexad_core::model::rigid::{Motion, Pose};
use hexad_core::model::task::TaskState;

/// Motions per task: a tenth of a millisecond of work, long against the cost of handing it to a thread.
const MOTIONS_PER_TASK: usize = 1024;

/// Six numbers of a motion, as a row of a table: X, X', X'' or forces.
pub type Row = [f64; LEGS];

/// Model on the widest vectors of this processor. (A daemon uses at most 256 bits, as wider ones may lower the clock.)
pub fn model(machine: &Machine) -> InverseDynamics {
    InverseDynamics::new(&Machine { level: Level::new(), ..machine.clone() })
}

/// Writes the forces of every motion \[N\] to the same place in `forces`, `None` at singular poses. Elements
/// beyond the shorter slice are left as they are. `threads` as in [`in_parallel`]; the bar advances by motions.
pub fn forces(
    model: &InverseDynamics,
    fidelity: Fidelity,
    motions: &[Motion],
    forces: &mut [Option<[f64; LEGS]>],
    threads: usize,
    bar: &ProgressBar,
) {
    let tasks = motions.chunks(MOTIONS_PER_TASK).zip(forces.chunks_mut(MOTIONS_PER_TASK));
    in_parallel(threads, tasks, |(motions, forces)| {
        model.forces_of_all(fidelity, motions, forces);
        bar.inc(motions.len() as u64);
    });
}

/// Writes the forces of every motion \[N\], given by rows of X, X' and X'', to the same row of `forces`: NaN in all six
/// where the pose is singular or a number is not finite. `threads` as in [`in_parallel`].
pub fn forces_of_rows(
    model: &InverseDynamics,
    fidelity: Fidelity,
    motions: [&[Row]; 3],
    forces: &mut [Row],
    threads: usize,
) {
    let [x, x_rate, x_accel] = motions.map(|rows| rows.chunks(MOTIONS_PER_TASK));
    let tasks = x.zip(x_rate).zip(x_accel).zip(forces.chunks_mut(MOTIONS_PER_TASK));
    in_parallel(threads, tasks, |(((x, x_rate), x_accel), rows)| {
        let states = x.iter().zip(x_rate).zip(x_accel).map(|((x, x_rate), x_accel)| TaskState {
            x: (*x).into(),
            xd: (*x_rate).into(),
            xdd: (*x_accel).into(),
        });
        let motions: Vec<_> = states.map(|state| state.motion()).collect();
        let mut forces = vec![None; motions.len()];
        model.forces_of_all(fidelity, &motions, &mut forces);
        for (row, forces) in rows.iter_mut().zip(forces) {
            let is_finite = |forces: &Row| forces.iter().all(|force| force.is_finite());
            *row = forces.filter(is_finite).unwrap_or([f64::NAN; LEGS]);
        }
    });
}

/// Writes the pose of all lengths \[m\] near their starts to the same place in `poses`, see [`poses_near`]. `threads` as in
/// [`in_parallel`].
pub fn poses(
    machine: &Machine,
    starts: &[Pose],
    lengths: &[[f64; LEGS]],
    poses: &mut [Option<Pose>],
    threads: usize,
) {
    let tasks = starts.chunks(MOTIONS_PER_TASK).zip(lengths.chunks(MOTIONS_PER_TASK));
    in_parallel(threads, tasks.zip(poses.chunks_mut(MOTIONS_PER_TASK)), |((starts, lengths), poses)| {
        poses_near(machine, starts, lengths, poses);
    });
}

/// Writes the regressor of every motion to the same place in `regressors`, see [`regressor`]. `threads` as in [`in_parallel`].
/// On each thread one is computed after the other.
pub fn regressors(
    machine: &Machine,
    motions: &[Motion],
    regressors: &mut [Option<Regressor>],
    threads: usize,
) {
    let tasks = motions.chunks(MOTIONS_PER_TASK).zip(regressors.chunks_mut(MOTIONS_PER_TASK));
    in_parallel(threads, tasks, |(motions, regressors)| {
        for (motion, found) in motions.iter().zip(regressors) {
            *found = regressor(machine, motion);
        }
    });
}

/// Performs all tasks on `threads` threads, 0 for one per processor, and waits for them. The calling thread is one of them.
///
/// The others end with the call: unlike a pool, they leave nothing that a child of `fork` would wait for.
pub fn in_parallel<T>(
    threads: usize,
    tasks: impl ExactSizeIterator<Item = T> + Send,
    perform: impl Fn(T) + Sync,
) {
    let threads =
        if threads == 0 { thread::available_parallelism().map_or(1, NonZero::get) } else { threads };
    let threads = threads.min(tasks.len());
    let tasks = Mutex::new(tasks);
    let next = || tasks.lock().ok()?.next();
    let work = || {
        while let Some(task) = next() {
            perform(task);
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            // Without the thread, the others perform its tasks.
            let _ = Builder::new().spawn_scoped(scope, work);
        }
        work();
    });
}
