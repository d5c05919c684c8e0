//! Search for other poses near the first measured pose that have the same leg lengths. Only a person at the
//! platform can see which pose it is in.
//!
//! The search runs once, in its own thread, on one processor, for some tenths of a second. It covers the same
//! neighbourhood around the measured pose as `hexad check` around home.

use super::cycle::CycleRecord;
use super::threads::STACK_BYTES;
use std::thread::Builder;

use rayon::ThreadPoolBuilder;
use tracing::warn;

use crate::analysis::assembly_modes::other_modes;
use crate::control::sensing::localization::PlatformState;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::rigid::Pose;
use crate::model::task::task_coordinates;

/// Search that begins with the first cycle that has a pose.
pub struct FirstPose(Option<Machine>);

impl FirstPose {
    /// Search for a machine.
    pub fn of(machine: &Machine) -> Self {
        Self(Some(machine.clone()))
    }

    /// Begins the search if this is the first cycle with a pose.
    pub fn add(&mut self, record: &CycleRecord) {
        let Some(PlatformState { pose, .. }) = record.output.platform else { return };
        let Some(machine) = self.0.take() else { return };
        // The daemon does not wait for it to end.
        let search = Builder::new()
            .name("hexad-modes".into())
            .stack_size(STACK_BYTES)
            .spawn(move || warn_of_nearby_modes(&machine, pose));
        if let Err(error) = search {
            warn!("cannot search for other poses with the measured lengths: {error}");
        }
    }
}

/// Logs the nearest other pose, if one is nearby.
fn warn_of_nearby_modes(machine: &Machine, pose: Pose) {
    let Ok(pool) = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build() else { return };
    let others = pool.install(|| other_modes(machine, &KinematicState::new(machine, pose)));
    if let Some(nearest) = others.first().filter(|nearest| nearest.is_nearby()) {
        let x = task_coordinates(&pose, &machine.home);
        warn!(
            "the measured lengths are also those of another pose, {nearest}: see that the platform is where it is \
             taken to be, {x:.6?}, before you engage"
        );
    }
}
