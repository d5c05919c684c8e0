//! Outlines of the part of a grid in which given numbers are not negative, by marching squares.
//!
//! A node belongs to the part if all its numbers are at least 0. Between a node inside and a node outside,
//! the outline is where the first of the linearly interpolated numbers is zero. Everything beyond the grid is
//! outside.

use std::collections::BTreeMap;

/// Corner of an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position along both axes, in nodes.
    pub at: (f64, f64),
    /// Index of the number that is zero there; `None` at the edge of the grid.
    pub cause: Option<usize>,
}

/// Indices of a node, raised by one: 0 is beyond the edge of the grid.
type Node = (usize, usize);

/// Step from a node of the part to a neighbour outside.
type Crossing = (Node, Node);

/// Closed outlines, with the part on their left. The grid has `count` by `count` nodes.
pub fn outlines<const N: usize>(
    count: usize,
    numbers: impl Fn([usize; 2]) -> Option<[f64; N]>,
) -> Vec<Vec<Corner>> {
    let at = |(i, j): Node| numbers([i.checked_sub(1)?, j.checked_sub(1)?]);
    let inside = |node: Node| at(node).is_some_and(|numbers| numbers.iter().all(|number| *number >= 0.0));
    let mut next = BTreeMap::<Crossing, Crossing>::new();
    for (i, j) in (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j))) {
        let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        // Once around the square, counterclockwise. Each crossing outwards is followed by the next crossing
        // inwards.
        let around = || corners.into_iter().zip(corners.into_iter().cycle().skip(1));
        let out = around().enumerate().filter(|(_, (from, to))| inside(*from) && !inside(*to));
        for (k, leaves) in out {
            let ahead = around().cycle().skip(k + 1).take(corners.len());
            let enters = ahead.into_iter().find(|(from, to)| !inside(*from) && inside(*to));
            next.extend(enters.map(|(from, to)| (leaves, (to, from))));
        }
    }
    let mut outlines = Vec::new();
    while let Some((start, _)) = next.first_key_value() {
        let (mut crossing, mut outline) = (*start, Vec::new());
        while let Some(follower) = next.remove(&crossing) {
            outline.push(corner(crossing, &at));
            crossing = follower;
        }
        outlines.push(outline);
    }
    outlines
}

/// Corner where an outline crosses a step.
fn corner<const N: usize>((from, to): Crossing, at: &impl Fn(Node) -> Option<[f64; N]>) -> Corner {
    let ((i, j), (k, l)) = (from, to);
    let first = match (at(from), at(to)) {
        (Some(from), Some(to)) => from
            .into_iter()
            .zip(to)
            .enumerate()
            .filter(|(_, (_, to))| !(*to >= 0.0))
            .map(|(cause, (from, to))| (share(from, to), Some(cause)))
            .min_by(|a, b| a.0.total_cmp(&b.0)),
        _ => None,
    };
    let (share, cause) = first.unwrap_or((0.0, None));
    let between = |from: usize, to: usize| from as f64 + share * (to as f64 - from as f64) - 1.0;
    Corner { at: (between(i, k), between(j, l)), cause }
}

/// Share of the distance from a number that is not negative to one that is, at which the linear interpolation
/// is zero.
fn share(from: f64, to: f64) -> f64 {
    let share = from / (from - to);
    if share.is_finite() { share } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 21;

    fn area(outline: &[Corner]) -> f64 {
        let next = outline.iter().cycle().skip(1);
        outline.iter().zip(next).map(|(a, b)| 0.5 * (a.at.0 * b.at.1 - b.at.0 * a.at.1)).sum()
    }

    #[test]
    fn a_ring_has_two_outlines_of_opposite_sense() {
        let ring = |[i, j]: [usize; 2]| {
            let distance = (i as f64 - 10.0).hypot(j as f64 - 10.0);
            (i < COUNT && j < COUNT).then_some([8.0 - distance, distance - 3.0])
        };
        let found = outlines(COUNT, ring);
        let mut areas: Vec<_> = found.iter().map(|outline| area(outline)).collect();
        areas.sort_by(f64::total_cmp);
        assert_eq!(areas.len(), 2);
        let [hole, disc] = [areas[0], areas[1]];
        let pi = core::f64::consts::PI;
        assert!((disc / 64.0 / pi - 1.0).abs() < 0.02 && (hole / -9.0 / pi - 1.0).abs() < 0.03, "{areas:?}");
        for outline in &found {
            let cause = Some(usize::from(area(outline) < 0.0));
            assert!(outline.iter().all(|corner| corner.cause == cause));
            let radius = if area(outline) < 0.0 { 3.0 } else { 8.0 };
            assert!(outline.iter().all(|c| ((c.at.0 - 10.0).hypot(c.at.1 - 10.0) - radius).abs() < 0.06));
        }
    }

    #[test]
    fn a_part_that_fills_the_grid_ends_at_its_edge() {
        let found = outlines(COUNT, |[i, j]: [usize; 2]| (i < COUNT && j < COUNT).then_some([1.0]));
        assert_eq!(found.len(), 1);
        assert!((area(&found[0]) - 400.0).abs() < 1e-12 && found[0].iter().all(|c| c.cause.is_none()));
        // Two squares that touch at a corner give closed outlines, too.
        let checkered =
            outlines(2, |[i, j]: [usize; 2]| (i < 2 && j < 2).then_some([[1.0, -1.0][(i + j) % 2]]));
        assert_eq!(checkered.iter().map(Vec::len).sum::<usize>(), 8);
    }
}
