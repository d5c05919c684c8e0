//! Six linear equations by LU with partial pivoting, the right-hand sides carried along.
//!
//! ```text
//! step k: the row with the largest |a_kk| goes first; below, a_ij -= (a_ik / a_kk) a_kj
//! then:   x_k = (b_k - sum_j>k a_kj x_j) / a_kk,   last to first
//! ```
//!
//! A row holds its coefficients, its right-hand sides and zeros. All of it is changed in each step, in lanes, also the columns
//! that are cleared already: without a branch that is faster. Nothing is found by an index that could be
//! out of range, and so nothing could panic. That is why it is not nalgebra's.

use fearless_simd::{Level, Simd, dispatch, f64x4, prelude::*};

use super::machine::LEGS;

/// Numbers in a vector of lanes.
const LANES: usize = 4;

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
    dispatch!(level, simd => {
        if R <= 2 { solved::<_, R, 2>(simd, a, b) } else { solved::<_, R, 3>(simd, a, b) }
    })
}

/// A row in memory.
type Row<const V: usize> = [[f64; LANES]; V];

/// With rows of V vectors, which hold `LEGS + R` numbers.
#[inline(always)]
fn solved<S: Simd, const R: usize, const V: usize>(
    simd: S,
    a: &[[f64; LEGS]; LEGS],
    b: &[[f64; R]; LEGS],
) -> Option<[[f64; R]; LEGS]> {
    let mut rows = [[[0.0; LANES]; V]; LEGS];
    for (row, (left, right)) in rows.iter_mut().zip(a.iter().zip(b)) {
        row.as_flattened_mut().iter_mut().zip(left.iter().chain(right)).for_each(|(slot, x)| *slot = *x);
    }
    // Each column is a constant of its own code, so that every place in the rows is known.
    eliminate::<_, V, 0>(simd, &mut rows)?;
    eliminate::<_, V, 1>(simd, &mut rows)?;
    eliminate::<_, V, 2>(simd, &mut rows)?;
    eliminate::<_, V, 3>(simd, &mut rows)?;
    eliminate::<_, V, 4>(simd, &mut rows)?;
    substitute::<_, V, 5>(simd, &mut rows)?;
    substitute::<_, V, 4>(simd, &mut rows)?;
    substitute::<_, V, 3>(simd, &mut rows)?;
    substitute::<_, V, 2>(simd, &mut rows)?;
    substitute::<_, V, 1>(simd, &mut rows)?;
    substitute::<_, V, 0>(simd, &mut rows)?;
    let right = |row: Row<V>| {
        let mut x = [0.0; R];
        x.iter_mut().zip(row.as_flattened().iter().skip(LEGS)).for_each(|(x, number)| *x = *number);
        x
    };
    Some(rows.map(right))
}

/// Clears a column below its row, the one with the largest number first.
#[inline(always)]
fn eliminate<S: Simd, const V: usize, const COLUMN: usize>(simd: S, rows: &mut [Row<V>; LEGS]) -> Option<()> {
    let (_, rest) = rows.split_at_mut(COLUMN);
    let (top, below) = rest.split_first_mut()?;
    for row in below.iter_mut() {
        if number::<V, COLUMN>(row).abs() > number::<V, COLUMN>(top).abs() {
            // Vector by vector: of a whole row it would be a call.
            row.iter_mut().zip(top.iter_mut()).for_each(|(a, b)| core::mem::swap(a, b));
        }
    }
    let pivot = number::<V, COLUMN>(top);
    if pivot == 0.0 {
        return None;
    }
    for row in below.iter_mut() {
        subtract(simd, row, number::<V, COLUMN>(row) / pivot, top);
        // Without what rounding leaves: the substitution changes whole rows.
        if let Some(cleared) = row.as_flattened_mut().get_mut(COLUMN) {
            *cleared = 0.0;
        }
    }
    Some(())
}

/// The unknown of a column, in place of the right-hand side of its row, and out of the rows above.
#[inline(always)]
fn substitute<S: Simd, const V: usize, const COLUMN: usize>(
    simd: S,
    rows: &mut [Row<V>; LEGS],
) -> Option<()> {
    let (above, rest) = rows.split_at_mut(COLUMN);
    let (row, _) = rest.split_first_mut()?;
    let pivot = number::<V, COLUMN>(row);
    if pivot == 0.0 {
        return None;
    }
    for vector in row.iter_mut() {
        *vector = (f64x4::load_array(simd, *vector) / f64x4::splat(simd, pivot)).to_array();
    }
    for other in above.iter_mut() {
        let factor = number::<V, COLUMN>(other);
        subtract(simd, other, factor, row);
    }
    Some(())
}

/// `row -= factor other`
#[inline(always)]
fn subtract<S: Simd, const V: usize>(simd: S, row: &mut Row<V>, factor: f64, other: &Row<V>) {
    for (vector, other) in row.iter_mut().zip(other) {
        let product = f64x4::load_array(simd, *other) * f64x4::splat(simd, factor);
        *vector = (f64x4::load_array(simd, *vector) - product).to_array();
    }
}

#[inline(always)]
fn number<const V: usize, const COLUMN: usize>(row: &Row<V>) -> f64 {
    row.as_flattened().get(COLUMN).copied().unwrap_or_default()
}
