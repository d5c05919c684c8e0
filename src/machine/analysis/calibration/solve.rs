//! Most probable geometry: the method of Levenberg and Marquardt on all rows, the pose of each eliminated by a Schur complement.
//!
//! ```text
//! cost = sum over rows of rho(|r|^2) + |values - nominal|^2 / tolerance^2
//! rho(s) = s up to k^2, 2 k sqrt(s) - k^2 beyond          Huber's loss of a whole row
//! ```
//!
//! The joints have a prior: the drawing with its tolerance. It fixes what measurements cannot show, above all where base and platform
//! are in the frames of the drawing. As all joints have the same tolerance, both lie on the drawing as a least-squares fit would put them.
//!
//! The crate `levenberg-marquardt` 0.15 needs another version of nalgebra and knows neither blocks nor a loss.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Matrix6xX, Vector6};

use super::model::{GEOMETRY_VALUES, Geometry, Noise, Row, RowTerms, Unknowns};

/// Most steps; most problems need ten.
const MAX_STEPS: usize = 100;
/// Precision of a minimum that is reached to rounding.
pub const FINE_PRECISION: f64 = 1e-13;
/// First damping as a share of the diagonal; its factor after each step that succeeds or fails; damping at which no step succeeds.
const FIRST_DAMPING: f64 = 1e-4;
const DAMPING_DECREASE: f64 = 0.1;
const DAMPING_INCREASE: f64 = 10.0;
const MAX_DAMPING: f64 = 1e12;
/// Standard normal quantiles of the squared residual from which a row counts less (99.9 %), and of the median.
const HUBER_QUANTILE: f64 = 3.09;
const MEDIAN_QUANTILE: f64 = 0.0;
/// The same from which a row is suspected: one of 30,000 without an error.
pub const OUTLIER_QUANTILE: f64 = 4.0;
/// Equations beyond the values that they determine from which on residuals show the noise.
const MIN_EQUATIONS_LEFT: f64 = 20.0;

/// Measurements, their noise, and what is known before.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// At least one.
    pub rows: &'a [Row],
    /// By the drawing.
    pub nominal: &'a Geometry,
    /// Standard deviation of each value of the drawing.
    pub tolerance_m: f64,
    /// Of the measurements.
    pub noise: Noise,
    /// Decrease of the cost, over it, below which the minimum is reached.
    pub precision: f64,
}

/// Minimum of the cost.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Where it is.
    pub unknowns: Unknowns,
    /// Sum of the losses and of the prior.
    pub cost: f64,
    /// Covariance of the shared values.
    pub covariance: DMatrix<f64>,
    /// Each row at the minimum, with its weight.
    pub rows: Vec<(RowTerms, f64)>,
}

/// Quantile of chi-square from a quantile of the normal distribution (Wilson and Hilferty): to 1 % from three degrees of freedom on.
pub fn chi_square(degrees: usize, normal: f64) -> f64 {
    let n = degrees as f64;
    n * (1.0 - 2.0 / (9.0 * n) + normal * (2.0 / (9.0 * n)).sqrt()).powi(3)
}

/// Degrees of freedom of a row: measurements beyond the six that its pose takes.
pub fn degrees(terms: &RowTerms) -> usize {
    (terms.residual.len().saturating_sub(6)).max(1)
}

/// Loss of a row, and its weight.
fn loss(terms: &RowTerms) -> (f64, f64) {
    let (square, bound) = (terms.residual.norm_squared(), chi_square(degrees(terms), HUBER_QUANTILE));
    if square <= bound {
        return (square, 1.0);
    }
    (2.0 * (bound * square).sqrt() - bound, (bound / square).sqrt())
}

/// Normal equations. Products are written as `A^T B`, which nalgebra computes column by column without a library.
struct Normal {
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
    rows: Vec<RowNormal>,
}

/// Equations of the pose of a row.
struct RowNormal {
    block: Matrix6<f64>,
    cross: Matrix6xX<f64>,
    gradient: Vector6<f64>,
}

impl Problem<'_> {
    /// The minimum next to a start; `None` if the equations have no solution there.
    pub fn minimum(&self, start: Unknowns) -> Option<Minimum> {
        let (mut unknowns, mut damping) = (start, FIRST_DAMPING);
        let (mut terms, mut cost) = self.evaluate(&unknowns);
        for _ in 0..MAX_STEPS {
            let normal = self.normal(&unknowns, &terms);
            let mut is_last = false;
            while damping < MAX_DAMPING {
                let next = normal.step(damping).map(|(shared, poses)| unknowns.displaced(&shared, &poses));
                let found = next.map(|next| (self.evaluate(&next), next));
                let Some(((new_terms, new_cost), next)) = found.filter(|((_, new), _)| *new <= cost) else {
                    damping *= DAMPING_INCREASE;
                    continue;
                };
                is_last = cost - new_cost <= self.precision * cost;
                (unknowns, terms, cost) = (next, new_terms, new_cost);
                damping = (damping * DAMPING_DECREASE).max(1e-15);
                break;
            }
            if is_last || damping >= MAX_DAMPING {
                break;
            }
        }
        let covariance = self.normal(&unknowns, &terms).reduced(0.0)?.0.inverse();
        let rows = terms.into_iter().map(|terms| (loss(&terms).1, terms)).map(|(w, terms)| (terms, w));
        Some(Minimum { unknowns, cost, covariance, rows: rows.collect() })
    }

    fn evaluate(&self, unknowns: &Unknowns) -> (Vec<RowTerms>, f64) {
        let pairs = self.rows.iter().zip(&unknowns.poses);
        let terms: Vec<_> = pairs.map(|(row, pose)| unknowns.terms(row, pose, &self.noise)).collect();
        let prior = (unknowns.geometry.values() - self.nominal.values()).norm_squared();
        let cost = terms.iter().map(|terms| loss(terms).0).sum::<f64>() + prior / self.tolerance_m.powi(2);
        (terms, cost)
    }

    fn normal(&self, unknowns: &Unknowns, terms: &[RowTerms]) -> Normal {
        let count = unknowns.shared_count();
        let weight = self.tolerance_m.powi(-2);
        let mut normal =
            Normal { shared: DMatrix::zeros(count, count), gradient: DVector::zeros(count), rows: vec![] };
        let change = unknowns.geometry.values() - self.nominal.values();
        normal.gradient.rows_mut(0, GEOMETRY_VALUES).copy_from(&(change * weight));
        normal.shared.view_mut((0, 0), (GEOMETRY_VALUES, GEOMETRY_VALUES)).fill_diagonal(weight);
        for terms in terms {
            let (_, weight) = loss(terms);
            normal.shared += terms.shared.tr_mul(&terms.shared) * weight;
            normal.gradient += terms.shared.tr_mul(&terms.residual) * weight;
            normal.rows.push(RowNormal {
                cross: terms.pose.tr_mul(&terms.shared) * weight,
                block: terms.pose.tr_mul(&terms.pose) * weight,
                gradient: terms.pose.tr_mul(&terms.residual) * weight,
            });
        }
        normal
    }
}

/// Equations without the poses: factorized matrix, right side, and each row over the factor of its block.
type Reduced = (Cholesky<f64, Dyn>, DVector<f64>, Vec<RowNormal>);

impl Normal {
    fn reduced(&self, damping: f64) -> Option<Reduced> {
        let (mut matrix, mut right) = (self.shared.clone(), -&self.gradient);
        matrix.set_diagonal(&(matrix.diagonal() * (1.0 + damping)));
        let rows: Vec<_> = self.rows.iter().map(|row| row.factorized(damping)).collect::<Option<_>>()?;
        for row in &rows {
            matrix -= row.cross.tr_mul(&row.cross);
            right += row.cross.tr_mul(&row.gradient);
        }
        Some((matrix.cholesky()?, right, rows))
    }

    fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<Vector6<f64>>)> {
        let (matrix, right, rows) = self.reduced(damping)?;
        let shared = matrix.solve(&right);
        let pose = |row: &RowNormal| -> Option<Vector6<f64>> {
            row.block.tr_solve_lower_triangular(&-(row.gradient + &row.cross * &shared))
        };
        let poses = rows.iter().map(pose).collect::<Option<_>>()?;
        Some((shared, poses))
    }
}

impl RowNormal {
    /// With the block `B = L L^T`: L, and `L^-1` times the others.
    fn factorized(&self, damping: f64) -> Option<Self> {
        let mut block = self.block;
        block.set_diagonal(&(block.diagonal() * (1.0 + damping)));
        let factor = block.cholesky()?.l();
        let cross = factor.solve_lower_triangular(&self.cross)?;
        Some(Self { block: factor, cross, gradient: factor.solve_lower_triangular(&self.gradient)? })
    }
}

impl Minimum {
    /// Real over stated noise; 1 if the rows are too few to show it.
    pub fn noise_factor(&self, tolerance_m: f64) -> f64 {
        let equations: usize = self.rows.iter().map(|(terms, _)| degrees(terms)).sum();
        // Of the values, what the rows know better than the prior.
        let from_prior = self.covariance.diagonal().rows(0, GEOMETRY_VALUES).sum() / tolerance_m.powi(2);
        let left = equations as f64 - (self.covariance.nrows() as f64 - from_prior);
        if left < MIN_EQUATIONS_LEFT {
            return 1.0;
        }
        let pair = |(terms, _): &(RowTerms, f64)| (terms.residual.norm_squared(), degrees(terms));
        let inliers =
            self.rows.iter().map(pair).filter(|(square, n)| *square < chi_square(*n, OUTLIER_QUANTILE));
        let (squares, counted) = inliers.fold((0.0, 0), |(sum, all), (square, n)| (sum + square, all + n));
        let ratio = if 2 * counted > equations {
            squares / counted as f64
        } else {
            // Most rows seem to be outliers: the stated noise is far too small.
            median(self.rows.iter().map(pair).map(|(square, n)| square / chi_square(n, MEDIAN_QUANTILE)))
        };
        (ratio * equations as f64 / left).sqrt()
    }
}

/// Median.
pub fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<_> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |index: usize| sorted.get(index).copied().unwrap_or(f64::NAN);
    0.5 * (at(sorted.len() / 2) + at(sorted.len().saturating_sub(1) / 2))
}
