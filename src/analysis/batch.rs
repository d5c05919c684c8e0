//! Inverse dynamics of many motions, on all processors.
//!
//! For trajectories, sweeps and Monte Carlo. Motions are independent: the cost grows linearly, and the
//! result does not depend on the number of processors.

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::model::LEGS;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::rigid::Motion;

/// Motions per task: half a millisecond of work, long against the cost of handing it to a thread.
const MOTIONS_PER_TASK: usize = 8192;

/// Writes the forces of every motion \[N\] to the same place in `forces`, `None` at singular poses. Elements
/// beyond the shorter slice are left as they are. The bar advances by motions.
pub fn forces(
    model: &InverseDynamics,
    fidelity: Fidelity,
    motions: &[Motion],
    forces: &mut [Option<[f64; LEGS]>],
    bar: &ProgressBar,
) {
    forces.par_chunks_mut(MOTIONS_PER_TASK).zip(motions.par_chunks(MOTIONS_PER_TASK)).for_each(
        |(forces, motions)| {
            model.forces_of_all(fidelity, motions, forces);
            bar.inc(motions.len() as u64);
        },
    );
}
