//! The largest region of a family around home within all limits of the workspace: branch and bound.
//!
//! Cells are queued by the size at which the family reaches them. The nearest are taken; one that is proved clear is done,
//! another is cut in two. At any time every region smaller than the nearest queued cell is proved clear, and the nearest
//! violation found is an upper bound. The search returns both; sizes in between are undecided.
//!
//! Method: best-first branch and bound, Land and Doig (1960). It ends at a gap of 1 % or after [`MAX_CELLS`] cells.

use core::cmp::Ordering;
use std::collections::BinaryHeap;

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::analysis::clearance::{Clearance, WorkspaceLimit};
use crate::analysis::envelope::MotionEnvelope;
use crate::analysis::region_shape::{PoseCell, RegionShape};
use hexad_core::model::machine::Machine;

/// Gap between the proved size and the nearest violation that ends the search, as a share of the latter.
const RELATIVE_GAP: f64 = 0.01;
/// Most cells of one search: some seconds on two processors.
pub const MAX_CELLS: u64 = 1 << 20;
/// Cells examined at a time, on all processors. The result does not depend on their number.
const CELLS_PER_BATCH: usize = 1 << 12;
/// Rays outward that are tried first, beginning with all corners of a box.
const RAY_COUNT: u32 = 8192;
const CORNER_RAYS: u32 = 64;
/// Then rays beside the best one, in refinements that are each narrower by a factor.
const RAYS_PER_REFINEMENT: u32 = 128;
const REFINEMENTS: u32 = 24;
const REFINEMENT_FACTOR: f64 = 0.7;
/// Largest size searched: a box 1000 times its nominal size counts as unbounded.
const MAX_BOX_SIZE: f64 = 1024.0;

/// Bounds on the largest clear region of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionBounds {
    /// Every smaller region is proved clear.
    pub guaranteed: f64,
    /// Size of the nearest violation found, and the limit violated; `None` if no violation was found.
    pub violation: Option<(f64, WorkspaceLimit)>,
}

/// Searches for the largest clear region. The bar advances by cells, of [`MAX_CELLS`] at most.
pub fn largest_region(
    machine: &Machine,
    clearance: &Clearance,
    shape: &RegionShape,
    bar: &ProgressBar,
) -> RegionBounds {
    let arm = machine.joints.radius_m;
    let violation = |cell: &PoseCell| clearance.violation(shape, cell);
    let start = first_violation(clearance, shape);
    let RegionShape::Ball { .. } = shape else {
        let is_clear = |cell: &PoseCell| {
            clearance.is_regular(shape, cell) && clearance.least_stroke_margin(shape, cell) >= 0.0
        };
        let examine = |cell: &PoseCell| (shape.size(cell).filter(|_| !is_clear(cell)), violation(cell));
        return search(shape.cell(start.0), start, arm, examine, bar);
    };
    // Within the stroke, the largest ball of an orientation is known: only the orientations are searched.
    let stroke = |cell: &PoseCell| {
        let of_family = |cell: &PoseCell| shape.size(cell).is_some();
        let middle = PoseCell { half: [0.0; 6], ..*cell };
        let found = of_family(&middle).then(|| clearance.margin(shape, &middle));
        (of_family(cell).then(|| clearance.least_stroke_margin(shape, cell)), found)
    };
    let within_stroke = search(shape.cell(0.0), start, arm, stroke, bar);
    let start = within_stroke.violation.map_or(start, |found| (found.0.max(0.0), Some(found)));
    let examine =
        |cell: &PoseCell| (shape.size(cell).filter(|_| !clearance.is_regular(shape, cell)), violation(cell));
    let regular = search(shape.cell(start.0), start, arm, examine, bar);
    RegionBounds { guaranteed: regular.guaranteed.min(within_stroke.guaranteed), ..regular }
}

/// Bounds on the smallest size at which a cell violates a limit: from below, by cells; from above, by poses. Starts with a
/// bound from above; `examine` returns the size from which on a cell is not proved clear, if it is not, and a violation
/// found in it.
fn search(
    cell: PoseCell,
    (size, mut violation): (f64, Option<(f64, WorkspaceLimit)>),
    arm: f64,
    examine: impl Fn(&PoseCell) -> (Option<f64>, Option<(f64, WorkspaceLimit)>) + Sync,
    bar: &ProgressBar,
) -> RegionBounds {
    let mut queue = BinaryHeap::from([QueuedCell { size: 0.0, cell }]);
    let (mut guaranteed, mut examined) = (0.0, 0);
    loop {
        let bound = violation.map_or(size, |(size, _)| size);
        guaranteed = f64::max(guaranteed, queue.peek().map_or(bound, |cell| cell.size).min(bound));
        if guaranteed >= (1.0 - RELATIVE_GAP) * bound || examined >= MAX_CELLS {
            return RegionBounds { guaranteed, violation };
        }
        // Cells beyond the bound cannot improve it.
        let nearest = core::iter::from_fn(|| queue.pop()).take_while(|cell| cell.size < bound);
        let halves: Vec<_> = nearest.take(CELLS_PER_BATCH).flat_map(|queue| queue.cell.halves(arm)).collect();
        let results: Vec<_> = halves.into_par_iter().map(|cell| (cell, examine(&cell))).collect();
        examined += results.len() as u64;
        bar.inc(results.len() as u64);
        for (cell, (nearest, found)) in results {
            let nearer = |found: &(f64, _)| violation.is_none_or(|(size, _)| found.0 < size);
            violation = found.filter(nearer).or(violation);
            queue.extend(nearest.filter(|size| *size < bound).map(|size| QueuedCell { size, cell }));
        }
    }
}

/// Size up to which to search, and the violation there if any: the nearest violation on many rays outward, then on rays
/// beside the one where it was found.
fn first_violation(clearance: &Clearance, shape: &RegionShape) -> (f64, Option<(f64, WorkspaceLimit)>) {
    let (mut size, mut violation) = match shape {
        RegionShape::Ball { .. } => {
            let margin = clearance.margin(shape, &shape.cell(0.0));
            (margin.0, Some(margin))
        }
        RegionShape::Box { .. } => (MAX_BOX_SIZE, None),
    };
    let (mut best, mut spread) = ([0.0; 6], 1.0);
    for k in 0..RAY_COUNT + REFINEMENTS * RAYS_PER_REFINEMENT {
        if k >= RAY_COUNT && (k - RAY_COUNT).is_multiple_of(RAYS_PER_REFINEMENT) {
            spread *= REFINEMENT_FACTOR;
        }
        let numbers = ray(k, &best, spread);
        let edge = shape.edge(&numbers);
        if let Some(nearer) = nearer_violation(clearance, shape, &edge, size) {
            (size, violation, best) = (nearer.0, Some(nearer), numbers);
        }
    }
    (size, violation)
}

/// Direction of the k-th ray, six numbers in \[-1, 1\]: first all corners, then any, then those beside the best.
fn ray(k: u32, best: &[f64; 6], spread: f64) -> [f64; 6] {
    let shares = MotionEnvelope::spread(k);
    let mut numbers = [0.0; 6];
    for (axis, (number, (share, best))) in numbers.iter_mut().zip(shares.iter().zip(best)).enumerate() {
        let any = 2.0 * share - 1.0;
        *number = match k {
            _ if k < CORNER_RAYS => {
                if (k >> axis) & 1 == 0 {
                    -1.0
                } else {
                    1.0
                }
            }
            _ if k < RAY_COUNT => any,
            _ => (best + spread * any).clamp(-1.0, 1.0),
        };
    }
    numbers
}

/// A violation on one ray, nearer than `size`: the first one if the ray does not leave the violation again.
fn nearer_violation(
    clearance: &Clearance,
    shape: &RegionShape,
    edge: &[f64; 6],
    size: f64,
) -> Option<(f64, WorkspaceLimit)> {
    let at = |size: f64| clearance.violation(shape, &shape.towards(edge, size));
    // Boxes are tried from the inside out: far away their angles have gone around.
    let start = if let RegionShape::Box { .. } = shape { size.min(1.0) } else { size };
    let doubled = core::iter::successors(Some(start), |tried| (*tried < size).then(|| size.min(2.0 * tried)));
    let mut nearest = doubled.into_iter().find_map(at)?;
    let mut free = 0.0;
    while nearest.0 - free > 1e-6 * size {
        let middle = 0.5 * (free + nearest.0);
        match at(middle) {
            Some(nearer) => nearest = nearer,
            None => free = middle,
        }
    }
    (nearest.0 < size).then_some(nearest)
}

/// Queued cell, and the size from which on the family may contain its poses.
struct QueuedCell {
    size: f64,
    cell: PoseCell,
}

/// The nearest is the greatest, which the heap returns first.
impl Ord for QueuedCell {
    fn cmp(&self, other: &Self) -> Ordering {
        other.size.total_cmp(&self.size)
    }
}

impl PartialOrd for QueuedCell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for QueuedCell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for QueuedCell {}
