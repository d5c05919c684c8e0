//! Most probable free parameters: Levenberg-Marquardt on the compressed equations and the prior.
//!
//! ```text
//! minimise   sum_i |R_i [phi(theta); -1]|^2 / (s_i sigma)^2  +  |(theta - theta0) / deviation|^2
//! ```
//!
//! phi: unknowns of the equations by [`super::parameters`]. Divided by the force scale s_i the equations of leg i explain
//! its command: without that, noise of the commands would favour small scales. sigma: root mean square residual, found in turns with theta.
//! Residuals that follow each other are alike, because samples overlap and the model is not complete. So an equation
//! counts less for the deviations, by the sum of the autocorrelation (Geyer, 1992, initial positive sequence).

use nalgebra::{DMatrix, DVector};

use super::equations::{Equation, SCALE, UNKNOWNS, Unknowns, triangle};
use super::parameters::{FREE_PARAMETER_COUNT, Free, LOG_SCALE_INDEX, Parameters};
use hexad_core::model::LEGS;

/// Turns of theta and sigma, steps of each, and the smallest change of the cost in deviations that counts.
const TURNS: u32 = 4;
const MAX_STEPS: u32 = 200;
const CONVERGED: f64 = 1e-10;
/// Damping with which a step is nearly a Gauss-Newton step, and damping at which the search ends.
const SMALL_DAMPING: f64 = 0.1;
const MAX_DAMPING: f64 = 1e12;
/// Residual before the first fit, over the largest force.
const FIRST_RESIDUAL_RATIO: f64 = 0.01;
/// Step of the differences, over the deviation of a parameter.
pub(super) const DIFFERENCE_RATIO: f64 = 1e-4;
/// Deviation of the mean logarithm of the force scales, where no known weight shows it.
pub(super) const GAUGE_DEVIATION_RATIO: f64 = 1e-5;
/// What is squared and added up: equations of all legs, prior, gauge.
const DATA_TERMS: usize = LEGS * (UNKNOWNS + 1);
const TERMS: usize = DATA_TERMS + FREE_PARAMETER_COUNT + 1;
/// Most equations over which residuals count as correlated.
const MAX_LAG: usize = 50;

/// Result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub free: Free,
    /// RMS residual \[N\], and how many equations say as much as one that is independent of the others.
    pub sigma_n: f64,
    pub inflation_ratio: f64,
    /// Covariance of the free parameters.
    pub covariance: DMatrix<f64>,
    /// Number of directions that the equations show better than the prior, and of those that the prior leaves free.
    pub shown: usize,
    pub unknown: usize,
    /// RMS residual of each leg \[N\], and the autocorrelation of successive residuals.
    pub residual_n: [f64; LEGS],
    pub correlation: [f64; LEGS],
}

/// Fits the parameters to equations. `is_scale_known` says whether a known weight shows the force scales.
pub(super) fn fit(
    parameters: &Parameters,
    equations: &[Equation],
    max_force: f64,
    is_scale_known: bool,
) -> Option<Fit> {
    let count = equations.len().checked_sub(FREE_PARAMETER_COUNT).filter(|rest| *rest > 0)? as f64;
    let triangles =
        core::array::from_fn(|leg| triangle(equations.iter().filter(|equation| equation.leg == leg)));
    let problem = Problem { parameters, triangles, is_scale_known };
    let (mut free, mut sigma_n) = (parameters.prior, FIRST_RESIDUAL_RATIO * max_force);
    for _ in 0..TURNS {
        free = problem.minimise(free, sigma_n)?;
        let unknowns = parameters.unknowns(&free);
        let squares: f64 = equations.iter().map(|equation| residual(equation, &unknowns).powi(2)).sum();
        sigma_n = (squares / count).sqrt().max(f64::MIN_POSITIVE);
    }
    let unknowns = parameters.unknowns(&free);
    let of_legs: [Vec<f64>; LEGS] = core::array::from_fn(|leg| {
        equations.iter().filter(|each| each.leg == leg).map(|each| residual(each, &unknowns)).collect()
    });
    let square = |values: &Vec<f64>| values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64;
    let inflation = of_legs.iter().map(|leg| square(leg) * correlated_count(leg)).sum::<f64>()
        / of_legs.iter().map(square).sum::<f64>();
    let inflation_ratio = inflation.max(1.0);
    let (covariance, shown, unknown) = problem.covariance(&free, sigma_n * inflation_ratio.sqrt())?;
    Some(Fit {
        free,
        sigma_n,
        inflation_ratio,
        covariance,
        shown,
        unknown,
        residual_n: of_legs.each_ref().map(|leg| square(leg).sqrt()),
        correlation: of_legs.each_ref().map(|leg| autocorrelation(leg, 1)),
    })
}

/// Command that an equation does not explain \[N\].
pub(super) fn residual(equation: &Equation, unknowns: &Unknowns) -> f64 {
    (equation.coefficients.dot(unknowns) - equation.right) / unknowns.row(SCALE + equation.leg).x
}

/// Correlation of values with those `lag` later.
pub(super) fn autocorrelation(values: &[f64], lag: usize) -> f64 {
    let products: f64 = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| a * b).sum();
    products / values.iter().map(|x| x * x).sum::<f64>().max(f64::MIN_POSITIVE)
}

/// How many successive values say as much as one that is independent of the others.
fn correlated_count(values: &[f64]) -> f64 {
    let later = (1..MAX_LAG).map(|lag| autocorrelation(values, lag)).take_while(|share| *share > 0.0);
    1.0 + 2.0 * later.sum::<f64>()
}

struct Problem<'a> {
    parameters: &'a Parameters,
    triangles: [DMatrix<f64>; LEGS],
    is_scale_known: bool,
}

impl Problem<'_> {
    /// What is squared and added up, without unit.
    fn terms(&self, free: &Free, sigma: f64) -> DVector<f64> {
        let Self { parameters, triangles, is_scale_known } = self;
        let unknowns = parameters.unknowns(free).push(-1.0);
        let scales = unknowns.fixed_rows::<LEGS>(SCALE);
        let data = triangles
            .iter()
            .zip(&scales)
            .flat_map(|(r, scale)| (r * unknowns / (scale * sigma)).iter().copied().collect::<Vec<_>>());
        let departure = free - parameters.prior;
        let prior = departure.component_div(&parameters.deviation);
        let scales = departure.fixed_rows::<LEGS>(LOG_SCALE_INDEX).sum() / LEGS as f64;
        let gauge = if *is_scale_known { 0.0 } else { scales / GAUGE_DEVIATION_RATIO };
        DVector::from_iterator(TERMS, data.chain(prior.iter().copied()).chain([gauge]))
    }

    /// Derivatives of the terms by the parameters, each in deviations of its prior.
    fn jacobian(&self, free: &Free, sigma: f64) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(TERMS, FREE_PARAMETER_COUNT);
        for (index, mut column) in jacobian.column_iter_mut().enumerate() {
            let deviation = self.parameters.deviation.row(index).x;
            let step = Free::from_fn(|row, _| if row == index { DIFFERENCE_RATIO * deviation } else { 0.0 });
            let difference = self.terms(&(free + step), sigma) - self.terms(&(free - step), sigma);
            column.copy_from(&(difference / (2.0 * DIFFERENCE_RATIO)));
        }
        jacobian
    }

    fn minimise(&self, mut free: Free, sigma: f64) -> Option<Free> {
        let mut terms = self.terms(&free, sigma);
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let jacobian = self.jacobian(&free, sigma);
            let normal = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&terms);
            let before = terms.norm_squared();
            let mut change = 0.0;
            while damping < MAX_DAMPING {
                let mut damped = normal.clone();
                damped.set_diagonal(&(normal.diagonal() * (1.0 + damping)));
                let step = damped.cholesky()?.solve(&gradient);
                let step =
                    Free::from_iterator(step.iter().copied()).component_mul(&self.parameters.deviation);
                let next = self.parameters.within_bounds(free - step);
                let next_terms = self.terms(&next, sigma);
                change = before - next_terms.norm_squared();
                if change >= 0.0 {
                    (free, terms, damping) = (next, next_terms, damping * 0.1);
                    break;
                }
                damping *= 10.0;
            }
            // A damped step that changes little says nothing: the valley may be long.
            let is_stuck = !(damping < MAX_DAMPING);
            if is_stuck || !(change > CONVERGED * before) && damping < SMALL_DAMPING {
                break;
            }
        }
        Some(free)
    }

    /// Covariance of the parameters; numbers of directions in which the equations alone, and the prior alone, decide.
    fn covariance(&self, free: &Free, sigma: f64) -> Option<(DMatrix<f64>, usize, usize)> {
        let jacobian = self.jacobian(free, sigma);
        let of_data = jacobian.rows(0, DATA_TERMS).into_owned();
        let information = of_data.tr_mul(&of_data).symmetric_eigenvalues();
        let shown = information.iter().filter(|value| **value > 1.0).count();
        let scaled = jacobian.tr_mul(&jacobian).cholesky()?.inverse();
        let by = DMatrix::from_diagonal(&DVector::from_iterator(
            FREE_PARAMETER_COUNT,
            self.parameters.deviation.iter().copied(),
        ));
        Some((&by * scaled * &by, shown, FREE_PARAMETER_COUNT - shown))
    }
}
