//! Proof that a box of poses around home is within all limits of the workspace, or a pose of it that is not.
//!
//! Corners and spread poses are tried first: a box that is too large nearly always fails there. Then the box is cut into cells, each
//! proved as a whole by the bounds of [`Clearance`], or cut again. The method is that of [`super::region_search`], for one size.

use crate::analysis::clearance::{Clearance, WorkspaceLimit};
use crate::analysis::envelope::{EnvelopeBounds, MotionEnvelope};
use crate::analysis::region_shape::{PoseCell, RegionShape};
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;

/// Corners of a box of poses.
const POSE_CORNERS: u32 = 64;
/// Poses spread over the inside: with the corners a few milliseconds.
const SPREAD_POSES: u32 = 4096;
/// Cells of one proof: about a second.
const MAX_CELLS: usize = 1 << 16;

/// Result of a proof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RegionProof {
    /// No pose violates a limit.
    Clear,
    /// A pose violates a limit: its offsets of X from home.
    Violated([f64; 6], WorkspaceLimit),
    /// No violation was found, and no proof within so many cells.
    Open(usize),
}

/// Corners of the box, then poses spread over it: states at rest.
pub fn poses(machine: &Machine, bounds: &EnvelopeBounds) -> impl Iterator<Item = TaskState> {
    let envelope = MotionEnvelope::new(&machine.home, *bounds);
    let corner = |k: u32| move |axis: usize| f64::from((k >> axis) & 1);
    let corners = (0..POSE_CORNERS).map(move |k| {
        let mut point = envelope.rest();
        let ends = corner(k);
        point.iter_mut().take(6).enumerate().for_each(|(axis, share)| *share = ends(axis));
        envelope.at(&point)
    });
    let spread = (0..SPREAD_POSES).map(move |k| envelope.at(&MotionEnvelope::spread(k)));
    corners.chain(spread).map(|state| TaskState::at_rest(state.x.into()))
}

/// Proves a box, or finds a pose in it that violates a limit.
pub fn prove(machine: &Machine, clearance: &Clearance, bounds: &EnvelopeBounds) -> RegionProof {
    let offsets = |x: &TaskState| {
        let mut offsets: [f64; 6] = x.x.into();
        offsets.iter_mut().zip(machine.home).for_each(|(x, home)| *x -= home);
        offsets
    };
    for state in poses(machine, bounds) {
        if let Some(limit) = clearance.violation_at(&state.motion().pose) {
            return RegionProof::Violated(offsets(&state), limit);
        }
    }
    let shape = RegionShape::Box { low: bounds.pose_min, high: bounds.pose_max };
    let is_clear = |cell: &PoseCell| {
        clearance.is_regular(&shape, cell) && clearance.least_stroke_margin(&shape, cell) >= 0.0
    };
    // The last first, so that the queue stays short. On one thread: a daemon at its start has no others to spare.
    let (mut queue, mut examined) = (vec![shape.cell(1.0)], 0);
    while let Some(cell) = queue.pop() {
        examined += 1;
        if examined > MAX_CELLS {
            return RegionProof::Open(MAX_CELLS);
        }
        if is_clear(&cell) {
            continue;
        }
        if let Some((_, limit)) = clearance.violation(&shape, &cell) {
            return RegionProof::Violated(cell.middle, limit);
        }
        queue.extend(cell.halves(machine.joints.radius_m));
    }
    RegionProof::Clear
}
