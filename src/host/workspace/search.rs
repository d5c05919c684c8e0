//! The largest region of a family around home in which nothing is in the way: branch and bound.
//!
//! Cells wait in the order of the size at which the family reaches them. The nearest ones are taken; one that is proved
//! clear is done, another is cut in two. So whatever is smaller than the nearest cell still waiting is proved, at any time,
//! and the nearest obstacle that was met bounds what could be. Both are told; what is between them is not known.

extern crate std;

use core::cmp::Ordering;
use std::collections::BinaryHeap;
use std::prelude::rust_2024::*;

use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::model::machine::Machine;
use crate::scene::clearance::{Cell, Clearance, Obstacle, Shape};

/// What is proved is near enough to what is in the way.
const PRECISION: f64 = 0.01;
/// Cells judged at most: some seconds on two processors.
pub const BUDGET: u64 = 1 << 20;
/// Cells judged at a time, on all processors. The result does not depend on their number.
const BATCH: usize = 1 << 12;
/// Regions are looked for up to this size: a box 1000 times what was asked for has no end.
const LARGEST_BOX: f64 = 1024.0;

/// What is known of a family of regions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Nothing is in the way in any smaller region.
    pub guaranteed: f64,
    /// Something is in the way here; none within the family as far as it was looked at.
    pub obstacle: Option<(f64, Obstacle)>,
}

/// Looks for the largest region. The bar advances by cells, of [`BUDGET`].
pub fn largest(machine: &Machine, clearance: &Clearance, shape: &Shape, bar: &ProgressBar) -> Found {
    let (size, mut obstacle) = first_obstacle(clearance, shape);
    let radius = machine.joints.radius;
    let mut waiting = BinaryHeap::from([Waiting { size: 0.0, cell: shape.cell(size) }]);
    let (mut guaranteed, mut judged) = (0.0, 0);
    loop {
        let bound = obstacle.map_or(size, |(size, _)| size);
        // Those beyond the bound are of no interest any more.
        let nearest = waiting.peek().map_or(bound, |cell| cell.size).min(bound);
        guaranteed = f64::max(guaranteed, nearest);
        if guaranteed >= (1.0 - PRECISION) * bound || judged >= BUDGET {
            return Found { guaranteed, obstacle };
        }
        let nearest = core::iter::from_fn(|| waiting.pop()).take_while(|cell| cell.size < bound);
        let batch: Vec<_> = nearest.take(BATCH).collect();
        judged += batch.len() as u64;
        bar.inc(batch.len() as u64);
        let judge = |waiting: &Waiting| {
            let cell = &waiting.cell;
            (!clearance.is_clear(shape, cell)).then(|| (clearance.obstacle(shape, cell), cell.halves(radius)))
        };
        let judgements: Vec<_> = batch.par_iter().map(judge).collect();
        for (met, halves) in judgements.into_iter().flatten() {
            let nearer = |met: &(f64, _)| obstacle.is_none_or(|(size, _)| met.0 < size);
            obstacle = met.filter(nearer).or(obstacle);
            let sized =
                halves.into_iter().filter_map(|cell| Some(Waiting { size: shape.size(&cell)?, cell }));
            waiting.extend(sized.filter(|half| half.size < obstacle.map_or(size, |(size, _)| size)));
        }
    }
}

/// How far to look, and what is known to be in the way there.
fn first_obstacle(clearance: &Clearance, shape: &Shape) -> (f64, Option<(f64, Obstacle)>) {
    if let Shape::Ball { .. } = shape {
        // From home, along the leg that is nearest to an end of its stroke, the platform comes to that end.
        let (margin, obstacle) = clearance.home_margin();
        return (margin, Some((margin, obstacle)));
    }
    let mut size = 1.0;
    while size < LARGEST_BOX {
        for corner in 0..64_u32 {
            let cell = shape.cell(size);
            let mut end = Cell { half: [0.0; 6], ..cell };
            for (axis, (x, half)) in end.middle.iter_mut().zip(cell.half).enumerate() {
                *x += if corner >> axis & 1 == 0 { -half } else { half };
            }
            if let Some(obstacle) = clearance.obstacle(shape, &end) {
                return (size, Some(obstacle));
            }
        }
        size *= 2.0;
    }
    (size, None)
}

/// A cell, and from which size on it matters.
struct Waiting {
    size: f64,
    cell: Cell,
}

/// The nearest is the greatest, which a heap gives first.
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.size.total_cmp(&self.size)
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}
