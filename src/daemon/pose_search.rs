//! Search for other assembly modes of the measured leg lengths, each time that forward kinematics has found the pose of the platform.
//! While there is one, the controller does not begin control.
//!
//! The lengths alone do not determine the assembly mode. An external pose (`pose_valid = 1`) or an operator selects it. The search for poses that the
//! joints permit takes some milliseconds. A wider one, also among poses that they do not permit, follows once, and only warns.

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::thread::Builder;

use tracing::{info, warn};

use super::cycle::CycleRecord;
use super::pose_gate::PoseGate;
use super::threads::STACK_BYTES;
use hexad_core::control::signals::inputs::Input;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::task::{TaskState, task_coordinates};
use hexad_machine::analysis::assembly_modes::{other_modes, other_permitted_modes};

/// Search in the cycles of the log.
pub struct PoseSearch {
    machine: Arc<Machine>,
    gate: Arc<PoseGate>,
    is_running: Arc<AtomicBool>,
    /// In lock-step the cycles wait for the search, so that each run is the same.
    holds_loop: bool,
    /// Whether the wider search has begun.
    has_warned: bool,
}

impl PoseSearch {
    /// Search for a machine.
    pub fn new(machine: &Machine, gate: Arc<PoseGate>, holds_loop: bool) -> Self {
        let machine = Arc::new(machine.clone());
        Self { machine, gate, is_running: Arc::default(), holds_loop, has_warned: false }
    }

    /// Begins a search if this is a cycle with a pose of which it is not known whether it is the only one.
    pub fn add(&mut self, record: &CycleRecord) {
        let Some((found, others)) = self.gate.present(record.input.release_ns) else { return };
        let (Some(platform), Some(measurement)) = (record.output.platform, record.input.measurement) else {
            return;
        };
        if others == 0 {
            return;
        }
        let here = KinematicState::new(&self.machine, platform.pose);
        if let Some(x) = measurement.pose {
            let seen = TaskState::at_rest(x).motion().pose;
            if self.machine.joints.distance(&platform.pose, &seen) <= here.sensitivity().trusted_step {
                info!("an external pose, or an operator, has confirmed the assembly mode");
                return self.gate.decide(found, 0);
            }
        }
        if others != Input::SEARCHING || self.is_running.swap(true, Ordering::AcqRel) {
            return;
        }
        let (machine, gate, is_running) = (self.machine.clone(), self.gate.clone(), self.is_running.clone());
        let warns = !core::mem::replace(&mut self.has_warned, true);
        let body = move || {
            search(&machine, &gate, &here, found);
            is_running.store(false, Ordering::Release);
            if warns {
                warn_of_other_modes(&machine, &here);
            }
        };
        if self.holds_loop {
            return body();
        }
        // The daemon does not wait for it to end.
        let thread = Builder::new().name("hexad-modes".into()).stack_size(STACK_BYTES).spawn(body);
        if let Err(error) = thread {
            self.is_running.store(false, Ordering::Release);
            warn!(
                "cannot search for other poses with the measured lengths, so control does not begin: {error}"
            );
        }
    }
}

/// Searches, and says what was found.
fn search(machine: &Machine, gate: &PoseGate, here: &KinematicState, found: u32) {
    let others = other_permitted_modes(machine, here);
    let poses = core::iter::once(here).chain(&others.poses).map(|it| *it.pose()).collect();
    let list = gate.list(machine, poses);
    if !others.poses.is_empty() {
        warn!("several poses have the measured leg lengths, so control does not begin: {list}");
    } else if others.is_proved_complete {
        info!("no other permitted pose has the measured leg lengths: proved");
    } else {
        info!(
            "no other pose with the measured leg lengths was found: searched without proof, as a singular pose has nearly these lengths"
        );
    }
    gate.end_search(found, others.poses.len() as u32);
}

/// Logs the nearest other pose where the platform may be instead, although a singular pose is between, or it is turned further than the
/// joints are said to permit.
fn warn_of_other_modes(machine: &Machine, here: &KinematicState) {
    let others = other_modes(machine, here);
    if let Some(nearest) = others.iter().find(|other| other.is_confusable()) {
        let x = task_coordinates(here.pose(), &machine.home);
        warn!(
            "another pose has the measured leg lengths, {nearest}: see that the platform is where it is \
             taken to be, {x:.6?}, before you engage"
        );
    }
}
