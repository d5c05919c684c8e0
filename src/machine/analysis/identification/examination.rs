//! Examination of the residuals: whether they are noise, and what the model lacks otherwise.
//!
//! ```text
//! r = J d + H c + noise          residuals at the fit, over sigma. J: parameters and delay, with their prior; H: a hypothesis
//! K = H - J A,  A = (J^T J)^-1 J^T H,  c = (K^T K)^-1 K^T r          what the parameters cannot take
//! T = (K^T r)^T V^-1 (K^T r),  V = sum over blocks b of (K_b^T e_b)(K_b^T e_b)^T,  e = r - K c
//! ```
//!
//! T (B - k) / (k B) has nearly the F distribution of k and B - k degrees of freedom: k columns, B blocks of a second. Within a block
//! residuals may be alike and differ in size (Liang, Zeger, 1986). Of a hypothesis with many columns the directions with the largest
//! effect K count. Hypotheses are ranked by what they explain, less what as many random columns would (Schwarz, 1978).
//!
//! A hypothesis with c changes the parameters by `-A c`. Where it is significant, that much may be wrong with them: their covariance
//! becomes larger by its square. So it does by the deviation of the delay, which is itself as large as the equations are against it.

use nalgebra::{DMatrix, DVector, Vector6};
use serde::Serialize;

use super::equations::{BODY_PARAMETER_COUNT, Equation, PAYLOAD, SAMPLES_PER_EQUATION, SCALE, UNKNOWNS};
use super::fit::{DIFFERENCE_RATIO, Fit, GAUGE_DEVIATION_RATIO, autocorrelation, residual};
use super::hypotheses::{Cause, Column, Hypotheses, delay_column, stops};
use super::parameters::{FREE_PARAMETER_COUNT, Free, LOG_SCALE_INDEX, Parameters};
use super::{Load, Run};
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use hexad_core::model::regressor::dynamic_parameters;

/// Time over which residuals are alike at most \[s\].
const BLOCK_S: f64 = 1.0;
/// Most directions of a hypothesis, and least number of blocks for each.
const MAX_DIRECTIONS: usize = 8;
const BLOCKS_PER_DIRECTION: usize = 3;
/// Least effect of a direction, as a sum of squares of residuals over their sigma: less does not show.
const LEAST_EFFECT: f64 = 1.0;
/// Significance from which a hypothesis counts, in deviations of a normal distribution: one of a thousand and a half, as 21 are tested.
const SIGNIFICANT: f64 = 3.3;
/// Share of the squares of the residuals that a hypothesis explains from which the model does not hold. The samples' smoothing alone
/// gives up to 2 %; what explains less is contained in the deviations.
const MATERIAL: f64 = 0.05;
/// Least force that it explains, over the RMS command, for the same: less comes from the smoothing of the samples, too.
const MATERIAL_FORCE: f64 = 1e-4;
/// Lags over which residuals of a leg must not be alike, in groups: noise and its feedback have ended.
const LAGS: core::ops::Range<usize> = 6..30;
/// Least mean correlation over them from which the model does not hold.
const MATERIAL_CORRELATION: f64 = 0.05;
/// Hypotheses whose changes of the parameters widen the deviations.
const WIDENING: usize = 4;
/// How far the delay may be off before the equations show it, over its deviation: friction in proportion to the load biases it.
const DELAY_RATIO: f64 = 5.0;
/// The parameters and the delay.
const ALL: usize = FREE_PARAMETER_COUNT + 1;

/// A hypothesis, and what the residuals say of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What the model would lack.
    pub cause: Cause,
    /// Significance, in deviations of a normal distribution.
    pub significance: f64,
    /// Share of the squares of the residuals that it explains; of [`Cause::Correlation`] the correlation.
    pub explained: f64,
    /// Whether it is significant, and large enough that the model does not hold.
    pub is_material: bool,
    /// Order of what is explained.
    #[serde(skip)]
    rank: f64,
}

/// Result of an examination.
#[derive(Clone, Debug, Default)]
pub struct Examination {
    /// Findings, the most likely cause first; those that are not significant are left out.
    pub findings: Vec<Finding>,
    /// Standard deviation of the delay with what these equations say against it \[s\].
    pub delay_deviation_s: f64,
}

impl Examination {
    /// Whether the model holds.
    pub fn holds(&self) -> bool {
        !self.findings.iter().any(|finding| finding.is_material)
    }
}

/// All equations over sigma, a row each.
struct Rows {
    /// Derivatives by the parameters and the delay, in deviations of their prior.
    j: DMatrix<f64>,
    h: DMatrix<f64>,
    r: DVector<f64>,
    blocks: Vec<usize>,
    causes: Vec<Cause>,
    /// Sum of the squares of the commands over sigma.
    commands: f64,
}

impl Rows {
    fn new(
        (machine, parameters, fit): (&Machine, &Parameters, &Fit),
        runs: &[(&Run, Vec<Equation>)],
        delay_deviation_s: f64,
    ) -> Option<Self> {
        let unknowns = parameters.unknowns(&fit.free);
        let mut slopes = DMatrix::zeros(UNKNOWNS, FREE_PARAMETER_COUNT);
        for (index, mut column) in slopes.column_iter_mut().enumerate() {
            let size = DIFFERENCE_RATIO * parameters.deviation.row(index).x;
            let step = Free::from_fn(|row, _| if row == index { size } else { 0.0 });
            let [more, less] = [fit.free + step, fit.free - step].map(|free| parameters.unknowns(&free));
            column.copy_from(&((more - less) / (2.0 * DIFFERENCE_RATIO)));
        }
        let hypotheses = Hypotheses::new(machine);
        let (mut j, mut h, mut r, mut blocks, mut causes) = (vec![], vec![], vec![], vec![], vec![]);
        let mut commands = 0.0;
        for (run, equations) in runs {
            let mut with_load = dynamic_parameters(machine);
            let payload =
                unknowns.fixed_rows::<BODY_PARAMETER_COUNT>(PAYLOAD) * f64::from(run.load == Load::Payload);
            let mut body = with_load.fixed_rows_mut::<BODY_PARAMETER_COUNT>(0);
            body += run.load.parameters() + payload;
            let stops = stops(machine, &run.samples);
            let (begin_s, duration_s) = (run.samples.first()?.time_s, run.duration_s());
            let first_block = blocks.last().map_or(0, |last| last + 1);
            let mut group: Option<(usize, Vec<Column>, Vector6<f64>)> = None;
            for equation in equations {
                let (since_s, leg) = (equation.time_s - begin_s, equation.leg);
                if group.as_ref().is_none_or(|(first, ..)| *first != equation.first) {
                    let samples = run.samples.get(equation.first..equation.first + SAMPLES_PER_EQUATION)?;
                    let columns = hypotheses.columns(
                        samples,
                        &with_load,
                        (2.0 * since_s / duration_s - 1.0, stops.get(equation.first)?),
                    )?;
                    group = Some((equation.first, columns, delay_column(samples)?));
                }
                let (_, columns, delay) = group.as_ref()?;
                let scale = unknowns.row(SCALE + leg).x;
                let value = residual(equation, &unknowns) / fit.sigma_n;
                let slope = slopes.tr_mul(&equation.coefficients) / (scale * fit.sigma_n)
                    - slopes.row(SCALE + leg).transpose() * (value / scale);
                j.extend(
                    slope
                        .iter()
                        .copied()
                        .chain([delay.row(leg).x * DELAY_RATIO * delay_deviation_s / fit.sigma_n]),
                );
                h.extend(columns.iter().map(|(_, forces)| forces.row(leg).x / (scale * fit.sigma_n)));
                r.push(value);
                commands += (equation.coefficients.row(SCALE + leg).x / fit.sigma_n).powi(2);
                blocks.push(first_block + (since_s / BLOCK_S) as usize);
                if causes.is_empty() {
                    causes = columns.iter().map(|(cause, _)| *cause).collect();
                }
            }
        }
        let (j, h) =
            (DMatrix::from_row_slice(r.len(), ALL, &j), DMatrix::from_row_slice(r.len(), causes.len(), &h));
        Some(Self { j, h, r: r.into(), blocks, causes, commands })
    }
}

/// Examines a fit, and widens its covariance. `delay_deviation_s`: of the delay with which the samples were made.
pub(super) fn examine(
    (machine, parameters, fit): (&Machine, &Parameters, &mut Fit),
    runs: &[(&Run, Vec<Equation>)],
    is_scale_known: bool,
    delay_deviation_s: f64,
) -> Option<Examination> {
    let rows = Rows::new((machine, parameters, fit), runs, delay_deviation_s)?;
    let Rows { j, h, r, .. } = &rows;
    let legs = LOG_SCALE_INDEX..LOG_SCALE_INDEX + LEGS;
    let gauge = DVector::from_fn(ALL, |row, _| {
        let deviation = parameters.deviation.get(row).copied().unwrap_or_default();
        if legs.contains(&row) && !is_scale_known {
            deviation / (LEGS as f64 * GAUGE_DEVIATION_RATIO)
        } else {
            0.0
        }
    });
    let normal = (j.tr_mul(j) + DMatrix::identity(ALL, ALL) + &gauge * gauge.transpose()).cholesky()?;
    let prior = (parameters.prior - fit.free).component_div(&parameters.deviation).push(0.0);
    // The fit has not moved the delay.
    let score = j.tr_mul(r) - DVector::from_iterator(ALL, prior.iter().copied());
    let off_s = normal.solve(&score).row(FREE_PARAMETER_COUNT).x * DELAY_RATIO * delay_deviation_s;
    let widened_s = delay_deviation_s.hypot(off_s);
    let by_delay =
        normal.solve(&DVector::from_fn(ALL, |row, _| if row == FREE_PARAMETER_COUNT { 1.0 } else { 0.0 }));
    let by_delay = &by_delay / by_delay.row(FREE_PARAMETER_COUNT).x;
    let deviations = DVector::from_iterator(FREE_PARAMETER_COUNT, parameters.deviation.iter().copied());
    let mut widen = |change: &DVector<f64>| {
        let change = change.rows(0, FREE_PARAMETER_COUNT).component_mul(&deviations);
        fit.covariance += &change * change.transpose();
    };
    widen(&(by_delay * (widened_s / (DELAY_RATIO * delay_deviation_s).max(f64::MIN_POSITIVE))));

    let a = normal.solve(&j.tr_mul(h));
    let mut findings: Vec<_> = rows
        .tested()
        .into_iter()
        .filter_map(|cause| rows.finding(cause, (&a, &score), fit.inflation_ratio))
        .collect();
    findings.sort_by(|(x, _), (y, _)| y.rank.total_cmp(&x.rank));
    findings.iter().take(WIDENING).for_each(|(_, change)| widen(change));
    let findings = findings
        .into_iter()
        .map(|(finding, _)| finding)
        .chain(correlated(
            runs,
            fit,
            parameters,
            rows.r.norm_squared() > MATERIAL_FORCE.powi(2) * rows.commands,
        ))
        .collect();
    Some(Examination { findings, delay_deviation_s: widened_s })
}

impl Rows {
    /// Each cause once.
    fn tested(&self) -> Vec<Cause> {
        let mut tested: Vec<Cause> = vec![];
        self.causes.iter().for_each(|cause| {
            if !tested.contains(cause) {
                tested.push(*cause)
            }
        });
        tested
    }

    /// What the residuals say of a hypothesis, and by how much it changes the parameters; `None` if it is not significant.
    fn finding(
        &self,
        cause: Cause,
        (a, gradient): (&DMatrix<f64>, &DVector<f64>),
        inflation: f64,
    ) -> Option<(Finding, DVector<f64>)> {
        let Self { j, h, r, blocks, causes, commands } = self;
        let indices: Vec<_> = (0..causes.len()).filter(|index| causes.get(*index) == Some(&cause)).collect();
        let (a, h) = (a.select_columns(&indices), h.select_columns(&indices));
        let k = &h - j * &a;
        let block_count = blocks.last()? + 1;
        let eigen = (k.tr_mul(&k) + a.tr_mul(&a)).symmetric_eigen();
        let mut order: Vec<_> =
            eigen.eigenvalues.iter().copied().enumerate().filter(|(_, x)| *x > LEAST_EFFECT).collect();
        order.sort_by(|(_, x), (_, y)| y.total_cmp(x));
        order.truncate(MAX_DIRECTIONS.min(block_count / BLOCKS_PER_DIRECTION));
        let directions = eigen.eigenvectors.select_columns(order.iter().map(|(index, _)| index));
        let effects = DVector::from_iterator(order.len(), order.iter().map(|(_, effect)| *effect));
        let (a, k) = (a * &directions, k * &directions);
        // The gradient is not zero where friction is at its bound.
        let score = directions.tr_mul(&h.tr_mul(r)) - a.tr_mul(gradient);
        let c = score.component_div(&effects);
        let rest = r - &k * &c;
        let mut sums = DMatrix::zeros(block_count, order.len());
        for ((block, rest), row) in blocks.iter().zip(&rest).zip(k.row_iter()) {
            let mut sum = sums.row_mut(*block);
            sum += row * *rest;
        }
        let variance = (sums.tr_mul(&sums) + a.tr_mul(&a)).cholesky()?;
        let statistic = score.dot(&variance.solve(&score));
        let [k, b] = [order.len(), block_count].map(|count| count as f64);
        let significance = normal_score(statistic * (b - k) / (k * b), k, b - k);
        let explained = (score.dot(&c) / r.norm_squared()).min(1.0);
        let is_material = explained > MATERIAL && score.dot(&c) > MATERIAL_FORCE.powi(2) * commands;
        let count = r.len() as f64 / inflation;
        let rank = -count * (1.0 - explained).max(f64::MIN_POSITIVE).ln() - k * count.ln();
        (significance > SIGNIFICANT)
            .then(|| (Finding { cause, significance, explained, is_material, rank }, -(a * c)))
    }
}

/// The leg whose residuals are most alike over [`LAGS`], if they are.
fn correlated(
    runs: &[(&Run, Vec<Equation>)],
    fit: &Fit,
    parameters: &Parameters,
    is_large: bool,
) -> Option<Finding> {
    let unknowns = parameters.unknowns(&fit.free);
    let of_leg = |leg: usize| {
        let equations =
            runs.iter().flat_map(|(_, equations)| equations).filter(|equation| equation.leg == leg);
        let values: Vec<_> = equations.map(|equation| residual(equation, &unknowns)).collect();
        let mean = LAGS.map(|lag| autocorrelation(&values, lag)).sum::<f64>() / LAGS.len() as f64;
        let near: f64 = (1..LAGS.start).map(|lag| autocorrelation(&values, lag).powi(2)).sum();
        // Bartlett, 1946.
        let deviation = ((1.0 + 2.0 * near) / (values.len() * LAGS.len()).max(1) as f64).sqrt();
        (mean, mean / deviation)
    };
    let (explained, significance) = (0..LEGS).map(of_leg).max_by(|(_, x), (_, y)| x.total_cmp(y))?;
    let is_material = is_large && explained > MATERIAL_CORRELATION;
    let finding = Finding { cause: Cause::Correlation, significance, explained, is_material, rank: 0.0 };
    (significance > SIGNIFICANT).then_some(finding)
}

/// Normal deviate of a number of the F distribution with k and `rest` degrees of freedom (Paulson, 1942).
fn normal_score(f: f64, k: f64, rest: f64) -> f64 {
    let (a, b, root) = (2.0 / (9.0 * k), 2.0 / (9.0 * rest), f.max(0.0).cbrt());
    ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt()
}
