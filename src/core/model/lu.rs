//! Solver for six linear equations by LU with partial pivoting, and norms of an inverse by Gauss-Jordan
//! elimination.
//!
//! ```text
//! step k: the row with the largest |a_kk| moves to the top; below, a_ij -= (a_ik / a_kk) a_kj
//! LU:     the right-hand side takes part; then x_k = b_k / a_kk, and above b_i -= a_ik x_k,   last to first
//! G.-J.:  also above; column k becomes the inverse's: a_kk <- 1, row k / a_kk; a_ik <- 0, minus a_ik row k
//! ```
//!
//! Gauss-Jordan leaves `A^-1` with its columns in pivot order, which does not affect the norms.
//!
//! Each step changes whole rows in lanes, finished columns included, because this is faster than a branch. No
//! index can be out of range, so the code cannot panic; this is why nalgebra's LU is not used. The
//! instruction set changes the time, but no bit of a result.

use fearless_simd::{Level, Simd, dispatch, f64x4, prelude::*};

use super::LEGS;

/// Values per vector.
const LANES: usize = 4;

/// Row in memory: coefficients, right-hand side, and a zero.
type Row = [[f64; LANES]; 2];

/// Solution x of `A x = b`; `None` if a pivot is zero. A is given by rows.
pub(super) fn solve(level: Level, a: &[[f64; LEGS]; LEGS], b: &[f64; LEGS]) -> Option<[f64; LEGS]> {
    dispatch!(level, simd => solved(simd, a, b))
}

/// Squares of the Frobenius norm of `W A^-1`, and of the norm of its largest column; `None` if a pivot is
/// zero. W is the diagonal matrix of the weights. A is given by rows.
pub(super) fn inverse_norms_squared(
    level: Level,
    a: &[[f64; LEGS]; LEGS],
    weights: &[f64; LEGS],
) -> Option<[f64; 2]> {
    dispatch!(level, simd => weighted_inverse_norms(simd, a, weights))
}

#[inline(always)]
fn solved<S: Simd>(simd: S, a: &[[f64; LEGS]; LEGS], b: &[f64; LEGS]) -> Option<[f64; LEGS]> {
    let mut rows = rows_of(a, b);
    // Each column has its own code with a constant index, so that all positions in the rows are known.
    eliminate::<_, 0>(simd, &mut rows)?;
    eliminate::<_, 1>(simd, &mut rows)?;
    eliminate::<_, 2>(simd, &mut rows)?;
    eliminate::<_, 3>(simd, &mut rows)?;
    eliminate::<_, 4>(simd, &mut rows)?;
    let mut x = rows.map(|row| number::<LEGS>(&row));
    substitute::<5>(&rows, &mut x)?;
    substitute::<4>(&rows, &mut x)?;
    substitute::<3>(&rows, &mut x)?;
    substitute::<2>(&rows, &mut x)?;
    substitute::<1>(&rows, &mut x)?;
    substitute::<0>(&rows, &mut x)?;
    Some(x)
}

#[inline(always)]
fn weighted_inverse_norms<S: Simd>(
    simd: S,
    a: &[[f64; LEGS]; LEGS],
    weights: &[f64; LEGS],
) -> Option<[f64; 2]> {
    let mut rows = rows_of(a, &[0.0; LEGS]);
    exchange::<_, 0>(simd, &mut rows)?;
    exchange::<_, 1>(simd, &mut rows)?;
    exchange::<_, 2>(simd, &mut rows)?;
    exchange::<_, 3>(simd, &mut rows)?;
    exchange::<_, 4>(simd, &mut rows)?;
    exchange::<_, 5>(simd, &mut rows)?;
    let mut sum = f64x4::splat(simd, 0.0);
    let mut columns = [f64x4::splat(simd, 0.0); 2];
    for (row, weight) in rows.iter().zip(weights) {
        for (column, vector) in columns.iter_mut().zip(row) {
            let weighted = f64x4::load_array(simd, *vector) * f64x4::splat(simd, *weight);
            sum += weighted * weighted;
            *column += weighted * weighted;
        }
    }
    let [first, second] = columns;
    let largest = first.max(second).to_array().into_iter().fold(0.0, f64::max);
    Some([sum.to_array().into_iter().sum(), largest])
}

#[inline(always)]
fn rows_of(a: &[[f64; LEGS]; LEGS], b: &[f64; LEGS]) -> [Row; LEGS] {
    let mut rows = [Row::default(); LEGS];
    for ((row, left), right) in rows.iter_mut().zip(a).zip(b) {
        let [a, b, c, d, e, f] = *left;
        *row = [[a, b, c, d], [e, f, *right, 0.0]];
    }
    rows
}

/// Moves the row with the largest value in a column to the top of the remaining rows. Returns the rows above,
/// that row, and the rows below.
#[inline(always)]
fn pivoted<const COLUMN: usize>(rows: &mut [Row; LEGS]) -> Option<(&mut [Row], &mut Row, &mut [Row])> {
    let (above, rest) = rows.split_at_mut(COLUMN);
    let (top, below) = rest.split_first_mut()?;
    for row in below.iter_mut() {
        if number::<COLUMN>(row).abs() > number::<COLUMN>(top).abs() {
            // Vector by vector, because swapping a whole row would be a function call.
            row.iter_mut().zip(top.iter_mut()).for_each(|(a, b)| core::mem::swap(a, b));
        }
    }
    (number::<COLUMN>(top) != 0.0).then_some((above, top, below))
}

/// Clears a column below its pivot row, up to rounding: the column is not read again.
#[inline(always)]
fn eliminate<S: Simd, const COLUMN: usize>(simd: S, rows: &mut [Row; LEGS]) -> Option<()> {
    let (_, top, below) = pivoted::<COLUMN>(rows)?;
    let pivot = number::<COLUMN>(top);
    for row in below.iter_mut() {
        subtract(simd, row, number::<COLUMN>(row) / pivot, top);
    }
    Some(())
}

/// Exchanges a column of the matrix for a column of its inverse.
#[inline(always)]
fn exchange<S: Simd, const COLUMN: usize>(simd: S, rows: &mut [Row; LEGS]) -> Option<()> {
    let (above, top, below) = pivoted::<COLUMN>(rows)?;
    let pivot = number::<COLUMN>(top);
    change_column::<_, COLUMN>(simd, top, 1.0);
    divide(simd, top, pivot);
    above.iter_mut().for_each(|row| exchange_row::<_, COLUMN>(simd, row, top));
    below.iter_mut().for_each(|row| exchange_row::<_, COLUMN>(simd, row, top));
    Some(())
}

#[inline(always)]
fn exchange_row<S: Simd, const COLUMN: usize>(simd: S, row: &mut Row, top: &Row) {
    let factor = number::<COLUMN>(row);
    change_column::<_, COLUMN>(simd, row, 0.0);
    subtract(simd, row, factor, top);
}

/// Computes one unknown in place of its right-hand side, and removes it from the rows above.
#[inline(always)]
fn substitute<const COLUMN: usize>(rows: &[Row; LEGS], x: &mut [f64; LEGS]) -> Option<()> {
    let (rows_above, [row, ..]) = rows.split_at(COLUMN) else { return None };
    let (above, [unknown, ..]) = x.split_at_mut(COLUMN) else { return None };
    let pivot = number::<COLUMN>(row);
    if pivot == 0.0 {
        return None;
    }
    *unknown /= pivot;
    above.iter_mut().zip(rows_above).for_each(|(x, row)| *x -= number::<COLUMN>(row) * *unknown);
    Some(())
}

/// Computes `row /= divisor`.
#[inline(always)]
fn divide<S: Simd>(simd: S, row: &mut Row, divisor: f64) {
    for vector in row {
        *vector = (f64x4::load_array(simd, *vector) / f64x4::splat(simd, divisor)).to_array();
    }
}

/// Computes `row -= factor other`.
#[inline(always)]
fn subtract<S: Simd>(simd: S, row: &mut Row, factor: f64, other: &Row) {
    for (vector, other) in row.iter_mut().zip(other) {
        let product = f64x4::load_array(simd, *other) * f64x4::splat(simd, factor);
        *vector = (f64x4::load_array(simd, *vector) - product).to_array();
    }
}

#[inline(always)]
fn number<const COLUMN: usize>(row: &Row) -> f64 {
    row.as_flattened().get(COLUMN).copied().unwrap_or_default()
}

/// Writes one value by writing its whole lane vector. Writing only the element and reading the vector back
/// would stall.
#[inline(always)]
fn change_column<S: Simd, const COLUMN: usize>(simd: S, row: &mut Row, number: f64) {
    let numbers = core::array::from_fn(|lane| if lane == COLUMN % LANES { number } else { 0.0 });
    let others = core::array::from_fn(|lane| if lane == COLUMN % LANES { 0.0 } else { 1.0 });
    if let Some(vector) = row.get_mut(COLUMN / LANES) {
        let rest = f64x4::load_array(simd, *vector) * f64x4::load_array(simd, others);
        *vector = (rest + f64x4::load_array(simd, numbers)).to_array();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};
    use proptest::array::uniform6;
    use proptest::prelude::*;

    use super::*;
    use crate::model::machine::at_most_256_bits;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// Compares with nalgebra, also with zeros on the diagonal. A singular matrix gives `None`.
        #[test]
        fn solutions_and_norms_of_inverses_are_right(
            numbers in uniform6(uniform6(-1.0..1.0_f64)),
            zero_diagonal: bool,
            b in uniform6(0.0..1.0_f64),
            weights in uniform6(0.0..1.0_f64),
            zero_row in 0..LEGS,
        ) {
            let level = at_most_256_bits(Level::new());
            let mut a = Matrix6::from(numbers);
            if zero_diagonal {
                a.fill_diagonal(0.0);
            }
            let rows: [[f64; LEGS]; LEGS] = a.transpose().into();
            let inverse = a.try_inverse().unwrap();
            let weighted = Matrix6::from_diagonal(&weights.into()) * inverse;
            let largest = weighted.column_iter().map(|column| column.norm()).fold(0.0, f64::max);
            let rounding = 1e-14 * a.norm() * inverse.norm();
            let found = inverse_norms_squared(level, &rows, &weights).unwrap();
            for (found, norm) in found.into_iter().zip([weighted.norm(), largest]) {
                prop_assert!((found.sqrt() / norm - 1.0).abs() < rounding, "{found} {norm} {a}");
            }
            let b = Vector6::from(b);
            let x = Vector6::from(solve(level, &rows, &b.into()).unwrap());
            prop_assert!((x - inverse * b).norm() < rounding * inverse.norm() * b.norm(), "{x} {a}");
            let mut singular = rows;
            singular[zero_row] = [0.0; LEGS];
            prop_assert_eq!(inverse_norms_squared(level, &singular, &weights), None);
            prop_assert_eq!(solve(level, &singular, &b.into()), None);
        }
    }
}
