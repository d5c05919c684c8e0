//! The largest region of a family around home in which nothing is in the way: branch and bound.
//!
//! Cells wait in the order of the size at which the family reaches them. The nearest ones are taken; one that is proved
//! clear is done, another is cut in two. So whatever is smaller than the nearest cell still waiting is proved, at any time,
//! and the nearest obstacle that was met bounds what could be. Both are told; what is between them is not known.

use core::cmp::Ordering;
use std::collections::BinaryHeap;

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::analysis::clearance::{Clearance, PoseCell, RegionShape, WorkspaceLimit};
use crate::analysis::envelope::MotionEnvelope;
use crate::model::machine::Machine;

/// What is proved is near enough to what is in the way.
const RELATIVE_GAP: f64 = 0.01;
/// Cells judged at most: some seconds on two processors.
pub const MAX_CELLS: u64 = 1 << 20;
/// Cells judged at a time, on all processors. The result does not depend on their number.
const CELLS_PER_BATCH: usize = 1 << 12;
/// Ways outward that are tried at first, beginning with all corners of a box.
const RAY_COUNT: u32 = 8192;
const CORNER_RAYS: u32 = 64;
/// Then so many beside the best one, nearer and nearer to it.
const RAYS_PER_REFINEMENT: u32 = 128;
const REFINEMENTS: u32 = 24;
const REFINEMENT_FACTOR: f64 = 0.7;
/// Regions are looked for up to this size: a box 1000 times what was asked for has no end.
const MAX_BOX_SIZE: f64 = 1024.0;

/// What is known of a family of regions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionBounds {
    /// Nothing is in the way in any smaller region.
    pub guaranteed: f64,
    /// Something is in the way here; none within the family as far as it was looked at.
    pub obstacle: Option<(f64, WorkspaceLimit)>,
}

/// Looks for the largest region. The bar advances by cells, of [`MAX_CELLS`] at most.
pub fn largest_region(
    machine: &Machine,
    clearance: &Clearance,
    shape: &RegionShape,
    bar: &ProgressBar,
) -> RegionBounds {
    let arm = machine.joints.radius;
    let in_the_way = |cell: &PoseCell| clearance.obstacle(shape, cell);
    let start = first_obstacle(clearance, shape);
    let RegionShape::Ball { .. } = shape else {
        let is_clear =
            |cell: &PoseCell| clearance.is_regular(shape, cell) && clearance.least_margin(shape, cell) >= 0.0;
        let judge = |cell: &PoseCell| (shape.size(cell).filter(|_| !is_clear(cell)), in_the_way(cell));
        return search(shape.cell(start.0), start, arm, judge, bar);
    };
    // Within the stroke, the largest ball of an orientation is known: only the orientations are searched.
    let stroke = |cell: &PoseCell| {
        let of_family = |cell: &PoseCell| shape.size(cell).is_some();
        let middle = PoseCell { half: [0.0; 6], ..*cell };
        let met = of_family(&middle).then(|| clearance.margin(shape, &middle));
        (of_family(cell).then(|| clearance.least_margin(shape, cell)), met)
    };
    let within_stroke = search(shape.cell(0.0), start, arm, stroke, bar);
    let start = within_stroke.obstacle.map_or(start, |met| (met.0.max(0.0), Some(met)));
    let judge =
        |cell: &PoseCell| (shape.size(cell).filter(|_| !clearance.is_regular(shape, cell)), in_the_way(cell));
    let regular = search(shape.cell(start.0), start, arm, judge, bar);
    RegionBounds { guaranteed: regular.guaranteed.min(within_stroke.guaranteed), ..regular }
}

/// The smallest size at which something is in the way in a cell: from below, by cells; from above, by poses. Starts with
/// what is known from above; `judge` says from which size on a cell is not proved clear, if it is not, and what was met
/// in it.
fn search(
    cell: PoseCell,
    (size, mut obstacle): (f64, Option<(f64, WorkspaceLimit)>),
    arm: f64,
    judge: impl Fn(&PoseCell) -> (Option<f64>, Option<(f64, WorkspaceLimit)>) + Sync,
    bar: &ProgressBar,
) -> RegionBounds {
    let mut waiting = BinaryHeap::from([QueuedCell { size: 0.0, cell }]);
    let (mut guaranteed, mut judged) = (0.0, 0);
    loop {
        let bound = obstacle.map_or(size, |(size, _)| size);
        guaranteed = f64::max(guaranteed, waiting.peek().map_or(bound, |cell| cell.size).min(bound));
        if guaranteed >= (1.0 - RELATIVE_GAP) * bound || judged >= MAX_CELLS {
            return RegionBounds { guaranteed, obstacle };
        }
        // Those beyond the bound are of no interest any more.
        let nearest = core::iter::from_fn(|| waiting.pop()).take_while(|cell| cell.size < bound);
        let halves: Vec<_> =
            nearest.take(CELLS_PER_BATCH).flat_map(|waiting| waiting.cell.halves(arm)).collect();
        let judgements: Vec<_> = halves.into_par_iter().map(|cell| (cell, judge(&cell))).collect();
        judged += judgements.len() as u64;
        bar.inc(judgements.len() as u64);
        for (cell, (nearest, met)) in judgements {
            let nearer = |met: &(f64, _)| obstacle.is_none_or(|(size, _)| met.0 < size);
            obstacle = met.filter(nearer).or(obstacle);
            waiting.extend(nearest.filter(|size| *size < bound).map(|size| QueuedCell { size, cell }));
        }
    }
}

/// How far to look, and what is known to be in the way there: the nearest obstacle on many ways outward, then on ways
/// beside the one where it was met.
fn first_obstacle(clearance: &Clearance, shape: &RegionShape) -> (f64, Option<(f64, WorkspaceLimit)>) {
    let (mut size, mut met) = match shape {
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
        let numbers = way(k, &best, spread);
        let edge = shape.edge(&numbers);
        if let Some(nearer) = nearer_obstacle(clearance, shape, &edge, size) {
            (size, met, best) = (nearer.0, Some(nearer), numbers);
        }
    }
    (size, met)
}

/// Six numbers in \[-1, 1\]: first all corners, then any, then those beside the best.
fn way(k: u32, best: &[f64; 6], spread: f64) -> [f64; 6] {
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

/// An obstacle on one way, nearer than `size`: the first one if there is no gap between it and what is beyond.
fn nearer_obstacle(
    clearance: &Clearance,
    shape: &RegionShape,
    edge: &[f64; 6],
    size: f64,
) -> Option<(f64, WorkspaceLimit)> {
    let at = |size: f64| clearance.obstacle(shape, &shape.towards(edge, size));
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

/// A cell, and from which size on it matters.
struct QueuedCell {
    size: f64,
    cell: PoseCell,
}

/// The nearest is the greatest, which a heap gives first.
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
