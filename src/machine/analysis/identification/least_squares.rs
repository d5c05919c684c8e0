//! Base parameters by least squares of the equations alone, before any prior.
//!
//! ```text
//! minimise   sum ( (s_i u_i - s_i mu_i |u_i| sign(L'_i) - Y_i beta - Y_i known) / s0_i )^2   over beta, s_i, s_i mu_i
//! ```
//!
//! This is the first problem of [`super::fit`] with its weights: s0 are the force scales of the file. But the prior is left
//! out, and beta, s and s mu are any numbers: nothing keeps them physical. beta are the base parameters, see
//! [`base_parameters`]. Without a known weight all unknowns are zero, so the problem has no meaning.

use nalgebra::{DMatrix, DVector};

use super::equations::{Equation, PAYLOAD, SCALE, UNKNOWNS, triangle};
use crate::analysis::excitation_design::base_parameters;
use hexad_core::model::machine::Machine;

/// Smallest number on the diagonal of the triangle of scaled columns: with a smaller one the value has no digits.
const LEAST_DIAGONAL: f64 = 1e-10;

/// Indices of the unknowns with their values; `None` if the equations do not determine all of them.
pub(super) fn least_squares(file: &Machine, equations: &[Equation]) -> Option<Vec<(usize, f64)>> {
    let weighted: Vec<_> = equations
        .iter()
        .map(|equation| {
            let scale = file.actuator.force_scale.get(equation.leg).copied().unwrap_or(1.0);
            let Equation { coefficients, right, .. } = *equation;
            Equation { coefficients: coefficients / scale, right: right / scale, ..*equation }
        })
        .collect();
    let all = triangle(weighted.iter());
    let mut indices = base_parameters(file);
    indices.extend(SCALE..PAYLOAD);
    // Columns of the payload are zero without one.
    indices.extend((PAYLOAD..UNKNOWNS).filter(|column| all.column(*column).norm() > 0.0));
    let mut columns = all.select_columns(&indices);
    let norms = DVector::from_iterator(indices.len(), columns.column_iter().map(|column| column.norm()));
    columns.column_iter_mut().zip(&norms).for_each(|(mut column, norm)| column /= *norm);
    let decomposed = columns.qr();
    let right: DMatrix<f64> = decomposed.q().tr_mul(&all.columns(UNKNOWNS, 1));
    let r = decomposed.r();
    let is_determined = r.diagonal().iter().all(|diagonal| diagonal.abs() > LEAST_DIAGONAL);
    let values = r.solve_upper_triangular(&right).filter(|_| is_determined)?;
    Some(
        indices
            .into_iter()
            .zip(values.iter().zip(&norms))
            .map(|(k, (value, norm))| (k, value / norm))
            .collect(),
    )
}
