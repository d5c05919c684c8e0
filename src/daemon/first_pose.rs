//! Whether the lengths of the first pose are also those of another one nearby: only somebody who looks at the
//! platform can tell which of them it is.
//!
//! The search is made once, in a thread of its own that ends with it, on one processor and for some tenths of a
//! second. It does not look further than `hexad check` does, and finds what that does not: `check` knows home only.

use super::cycle::CycleRecord;
use std::thread::Builder;

use rayon::ThreadPoolBuilder;
use tracing::warn;

use super::STACK;
use crate::analysis::assembly_modes::other_modes;
use crate::control::localization::PlatformState;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::rigid::Pose;
use crate::model::task::task_coordinates;

/// Waits for the first pose.
pub struct FirstPose(Option<Machine>);

impl FirstPose {
    /// Of this machine.
    pub fn of(machine: &Machine) -> Self {
        Self(Some(machine.clone()))
    }

    /// Takes a cycle in. The search begins with the first that has a pose.
    pub fn add(&mut self, record: &CycleRecord) {
        let Some(PlatformState { pose, .. }) = record.output.platform else { return };
        let Some(machine) = self.0.take() else { return };
        // The daemon does not wait for it to end.
        let search = Builder::new()
            .name("hexad-modes".into())
            .stack_size(STACK)
            .spawn(move || look_around(&machine, pose));
        if let Err(error) = search {
            warn!("nobody looks for other poses with the measured lengths: {error}");
        }
    }
}

/// Says what is nearby. Where there is nothing, there is nothing to say.
fn look_around(machine: &Machine, pose: Pose) {
    let Ok(pool) = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build() else { return };
    let others = pool.install(|| other_modes(machine, &KinematicState::new(machine, pose)));
    if let Some(nearest) = others.first().filter(|nearest| nearest.is_nearby()) {
        let x = task_coordinates(&pose, &machine.home);
        warn!(
            "the measured lengths are also those of another pose, {nearest}: see that the platform is where it is \
             taken to be, {x:.3?}, before you engage"
        );
    }
}
