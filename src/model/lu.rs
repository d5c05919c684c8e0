//! Six linear equations by LU with partial pivoting, the right-hand side carried along.
//!
//! ```text
//! step k: the row with the largest |a_kk| goes first; below, a_ij -= (a_ik / a_kk) a_kj
//! then:   x_k = (b_k - sum_j>k a_kj x_j) / a_kk,   last to first
//! ```
//!
//! Each elimination drops the column it cleared, so that the pivot is always in the first place and nothing is
//! found by an index: there is nothing to check, and so nothing that could panic. That is why it is not
//! nalgebra's.

use super::machine::LEGS;

/// Coefficients from the diagonal on, then the right-hand side, then zeros.
type Row = [f64; LEGS + 1];

/// x of `A x = b`; `None` if a pivot is zero. A is given by rows.
pub(super) fn solve(a: &[[f64; LEGS]; LEGS], b: &[f64; LEGS]) -> Option<[f64; LEGS]> {
    let mut rows = [[0.0; LEGS + 1]; LEGS];
    for (row, ([c0, c1, c2, c3, c4, c5], right)) in rows.iter_mut().zip(a.iter().zip(b)) {
        *row = [*c0, *c1, *c2, *c3, *c4, *c5, *right];
    }
    triangulate(&mut rows);
    back_substitute(&rows)
}

fn triangulate(rows: &mut [Row; LEGS]) {
    let mut rest = rows.as_mut_slice();
    while let Some((top, below)) = rest.split_first_mut() {
        for row in below.iter_mut() {
            if leading(row).abs() > leading(top).abs() {
                core::mem::swap(row, top);
            }
        }
        for row in below.iter_mut() {
            let factor = leading(row) / leading(top);
            let [_, a1, a2, a3, a4, a5, a6] = *row;
            let [_, t1, t2, t3, t4, t5, t6] = *top;
            *row = [
                a1 - factor * t1,
                a2 - factor * t2,
                a3 - factor * t3,
                a4 - factor * t4,
                a5 - factor * t5,
                a6 - factor * t6,
                0.0,
            ];
        }
        rest = below;
    }
}

fn back_substitute(rows: &[Row; LEGS]) -> Option<[f64; LEGS]> {
    // The unknowns found so far come first.
    let mut x = [0.0; LEGS];
    for (found, row) in rows.iter().rev().enumerate() {
        let [pivot, rest @ ..] = row;
        if *pivot == 0.0 {
            return None;
        }
        let mut rest = rest.iter();
        let sum: f64 = x.iter().take(found).zip(&mut rest).map(|(x, a)| x * a).sum();
        let next = (rest.next()? - sum) / pivot;
        let [x0, x1, x2, x3, x4, _] = x;
        x = [next, x0, x1, x2, x3, x4];
    }
    Some(x)
}

fn leading([first, ..]: &Row) -> f64 {
    *first
}
