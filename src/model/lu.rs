//! Six linear equations by LU with partial pivoting, the right-hand sides carried along.
//!
//! ```text
//! step k: the row with the largest |a_kk| goes first; below, a_ij -= (a_ik / a_kk) a_kj
//! then:   x_k = (b_k - sum_j>k a_kj x_j) / a_kk,   last to first
//! ```
//!
//! Each elimination drops the column it cleared, so that the pivot is always in the first place and nothing is
//! found by an index: there is nothing to check, and so nothing that could panic. That is why it is not
//! nalgebra's.

use fearless_simd::{Level, dispatch};

use super::machine::LEGS;

/// Coefficients from the diagonal on, then zeros; and the right-hand sides.
#[derive(Clone, Copy)]
struct Row<const R: usize> {
    left: [f64; LEGS],
    right: [f64; R],
}

/// x of `A x = b`; `None` if a pivot is zero. A is given by rows.
pub(super) fn solve(level: Level, a: &[[f64; LEGS]; LEGS], b: &[f64; LEGS]) -> Option<[f64; LEGS]> {
    solve_columns(level, a, &b.map(|b| [b])).map(|x| x.map(|[x]| x))
}

/// X of `A X = B`; all given by rows. The instruction set changes the time, not one bit of the result.
pub(super) fn solve_columns<const R: usize>(
    level: Level,
    a: &[[f64; LEGS]; LEGS],
    b: &[[f64; R]; LEGS],
) -> Option<[[f64; R]; LEGS]> {
    dispatch!(level, _simd => solved(a, b))
}

#[inline(always)]
fn solved<const R: usize>(a: &[[f64; LEGS]; LEGS], b: &[[f64; R]; LEGS]) -> Option<[[f64; R]; LEGS]> {
    let mut rows = [Row { left: [0.0; LEGS], right: [0.0; R] }; LEGS];
    for (row, (left, right)) in rows.iter_mut().zip(a.iter().zip(b)) {
        *row = Row { left: *left, right: *right };
    }
    triangulate(&mut rows);
    back_substitute(&rows)
}

#[inline(always)]
fn triangulate<const R: usize>(rows: &mut [Row<R>; LEGS]) {
    let mut rest = rows.as_mut_slice();
    while let Some((top, below)) = rest.split_first_mut() {
        for row in below.iter_mut() {
            if leading(row).abs() > leading(top).abs() {
                core::mem::swap(row, top);
            }
        }
        let [_, t1, t2, t3, t4, t5] = top.left;
        for row in below.iter_mut() {
            let factor = leading(row) / leading(top);
            let [_, a1, a2, a3, a4, a5] = row.left;
            row.left = [
                a1 - factor * t1,
                a2 - factor * t2,
                a3 - factor * t3,
                a4 - factor * t4,
                a5 - factor * t5,
                0.0,
            ];
            for (right, top) in row.right.iter_mut().zip(&top.right) {
                *right -= factor * top;
            }
        }
        rest = below;
    }
}

#[inline(always)]
fn back_substitute<const R: usize>(rows: &[Row<R>; LEGS]) -> Option<[[f64; R]; LEGS]> {
    // The unknowns found so far come first.
    let mut x = [[0.0; R]; LEGS];
    for (found, Row { left: [pivot, rest @ ..], right }) in rows.iter().rev().enumerate() {
        if *pivot == 0.0 {
            return None;
        }
        let mut next = *right;
        for (known, a) in x.iter().zip(rest).take(found) {
            for (next, known) in next.iter_mut().zip(known) {
                *next -= a * known;
            }
        }
        for next in &mut next {
            *next /= pivot;
        }
        let [x0, x1, x2, x3, x4, _] = x;
        x = [next, x0, x1, x2, x3, x4];
    }
    Some(x)
}

fn leading<const R: usize>(row: &Row<R>) -> f64 {
    let [first, ..] = row.left;
    first
}
