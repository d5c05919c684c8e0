//! Design of an excitation: the Fourier series with which least squares determines the parameters best.
//!
//! The forces are `Gamma = Y p` ([regressor](hexad_core::model::regressor)). Y of the instants of one period, each column
//! divided by its norm, has a condition: the factor by which relative errors of the forces can grow in p. The design
//! draws random series and improves them by differential evolution (Storn, Price, 1997). Hill climbing from the best
//! one ends where the active limit changes. Each series is as large as the limits allow.
//!
//! The condition is over the *base parameters*, whose effects differ. Of each indistinguishable pair the first one
//! stands for the sum. The rods' masses are points of the platform at the `B_i`. A quadratic part of the transverse
//! inertia is a parameter only where the machine has one.
//!
//! Source: Swevers et al. (1997), "Optimal robot excitation and identification"; Gautier (1991), base parameters.

use nalgebra::{DMatrix, DVector, Vector6};

use super::sampled_loop::bisect_in_steps;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::machine::Machine;
use hexad_core::model::random::Random;
use hexad_core::model::regressor::{
    DynamicParameters, INDISTINGUISHABLE_PAIRS, dynamic_parameters, regressor, rod_mass_null_direction,
};
use hexad_core::model::task::TaskState;
use hexad_core::motion::built_in::keeps_reserve;
use hexad_core::motion::excitation::{BLEND_S, Coefficients, FourierSeries, PERIOD_S};
use hexad_core::motion::minimum_jerk::{scaled_by_profile, window};

/// Instants of one period at which the regressor is evaluated: 12 per period of the highest harmonic.
const INSTANTS: u32 = 60;
/// Number of random series, and of generations. Of `motion_base`, the last fifth of them gains 4 %
/// (2026-11-27).
const POPULATION: usize = 40;
const GENERATIONS: usize = 80;
/// Best series of a generation; a change pulls a series towards one of them.
const GUIDES: usize = 4;
/// Weights of that pull and of the difference of two series, and share of the coefficients that change.
const GUIDE_WEIGHT: f64 = 0.7;
const DIFFERENCE_WEIGHT: f64 = 0.5;
const CROSSOVER: f64 = 0.7;
/// Largest growth of a series in one change; halvings until it keeps the limits: a stroke may be a millionth of the radius of the
/// joints; bisections to a thousandth from there.
const MAX_GROWTH: f64 = 2.0;
const MAX_HALVINGS: i32 = 30;
const AMPLITUDE_STEPS: u32 = 10;

/// Most iterations of a singular value decomposition: ten times the usual number.
const MAX_SVD_STEPS: usize = 1000;

/// Index of the rod's mass in the parameters.
const ROD_MASS: usize = 14;
/// Indices of the quadratic parts of the transverse inertia.
const QUADRATIC: [usize; 2] = [13, 18];

/// A designed series.
#[derive(Clone, Debug)]
pub struct ExcitationDesign {
    /// Displacement from home.
    pub series: FourierSeries,
    /// Condition of its regressor.
    pub condition: f64,
    /// Condition of each random series, ascending.
    pub random_conditions: Vec<f64>,
}

/// Series with a small condition, `amplitude` times as large as drives and `is_allowed` permit, also while it blends in
/// and out. The same seed gives the same series. `None` if they permit no motion.
pub fn design(
    machine: &Machine,
    amplitude: f64,
    seed: u64,
    is_allowed: impl Fn(&TaskState) -> bool,
) -> Option<ExcitationDesign> {
    let model = InverseDynamics::new(machine);
    let keeps_limits = |series: &FourierSeries| {
        blended(machine, series).all(|state| keeps_reserve(&model, &state) && is_allowed(&state))
    };
    // The largest series of this shape, and the condition of the share of it that moves the platform.
    let rated = |shape: FourierSeries| {
        let keeps_limits = |share: f64| keeps_limits(&shape.scaled(share));
        let share = (1..=MAX_HALVINGS)
            .map(|halvings| MAX_GROWTH * 0.5_f64.powi(halvings))
            .find(|share| keeps_limits(*share))?;
        let share = bisect_in_steps(AMPLITUDE_STEPS, share, 2.0 * share, keeps_limits);
        let largest = shape.scaled(share);
        Some((largest, Sensitivities::new(machine, &largest.scaled(amplitude))?.condition))
    };
    let mut random = Random::new(seed);
    let mut population: Vec<_> =
        (0..POPULATION).filter_map(|_| rated(random_series(machine, &mut random))).collect();
    let sort = |population: &mut Vec<(FourierSeries, f64)>| population.sort_by(|a, b| a.1.total_cmp(&b.1));
    sort(&mut population);
    let random_conditions = population.iter().map(|(_, condition)| *condition).collect();
    for _ in 0..GENERATIONS {
        for index in 0..population.len() {
            let mut drawn = |among: usize| {
                let number = (random.uniform() * among.min(population.len()) as f64) as usize;
                population.get(number).map(|(series, _)| series.0)
            };
            let (guide, a, b) = (drawn(GUIDES)?, drawn(POPULATION)?, drawn(POPULATION)?);
            let (series, condition) = population.get_mut(index)?;
            let change = (guide - series.0) * GUIDE_WEIGHT + (a - b) * DIFFERENCE_WEIGHT;
            let changed = change.map(|change| if random.uniform() < CROSSOVER { change } else { 0.0 });
            let better = rated(FourierSeries(series.0 + changed)).filter(|(_, new)| *new < *condition);
            (*series, *condition) = better.unwrap_or((*series, *condition));
        }
        sort(&mut population);
    }
    let (largest, condition) = *population.first()?;
    Some(ExcitationDesign { series: largest.scaled(amplitude), condition, random_conditions })
}

/// States of one period with its blends, at the spacing of the instants.
fn blended(machine: &Machine, series: &FourierSeries) -> impl Iterator<Item = TaskState> {
    let end = PERIOD_S + 2.0 * BLEND_S;
    let count = (end / PERIOD_S * f64::from(INSTANTS)) as u32;
    (0..=count).map(move |k| {
        let t = end * f64::from(k) / f64::from(count);
        about_home(machine, &scaled_by_profile(&series.at(t - BLEND_S), &window(t, end, BLEND_S)))
    })
}

fn about_home(machine: &Machine, displacement: &TaskState) -> TaskState {
    TaskState { x: displacement.x + Vector6::from(machine.home), ..*displacement }
}

/// Independent coefficients of mean square 1, angles in radians and positions in radii of the joints.
fn random_series(machine: &Machine, random: &mut Random) -> FourierSeries {
    let mut coefficients = Coefficients::from_fn(|_, _| random.near_gaussian());
    coefficients.fixed_rows_mut::<3>(3).scale_mut(machine.joints.radius_m);
    FourierSeries(coefficients)
}

/// Parameters of which only the sum has an effect.
fn pairs(machine: &Machine) -> impl Iterator<Item = [usize; 2]> {
    let [cylinder, rod] =
        [&machine.cylinder, &machine.rod].map(|link| link.transverse_inertia.reference_length_m);
    INDISTINGUISHABLE_PAIRS.into_iter().chain((cylinder == rod).then_some(QUADRATIC))
}

/// Value of each parameter as a base parameter: sums of pairs, and the rods' masses as points of the platform at the
/// `B_i`.
pub fn base_parameter_values(machine: &Machine) -> DynamicParameters {
    let mut values = dynamic_parameters(machine);
    let rod_mass = values.get(ROD_MASS).copied().unwrap_or_default();
    values -= rod_mass_null_direction(machine) * rod_mass;
    for [first, second] in pairs(machine) {
        let moved = values.get_mut(second).map(core::mem::take).unwrap_or_default();
        values.row_mut(first).add_scalar_mut(moved);
    }
    values
}

/// Indices of the base parameters of a machine.
pub fn base_parameters(machine: &Machine) -> Vec<usize> {
    let has_no_effect = |(k, value): (usize, f64)| {
        k == ROD_MASS
            || pairs(machine).any(|[_, second]| second == k)
            || QUADRATIC.contains(&k) && value == 0.0
    };
    let values = base_parameter_values(machine);
    let indices = values.iter().copied().enumerate().filter(|indexed| !has_no_effect(*indexed));
    indices.map(|(k, _)| k).collect()
}

/// Sensitivity of the forces to the base parameters over one period of a series about home.
#[derive(Clone, Debug)]
pub struct Sensitivities {
    /// Ratio of the largest to the smallest singular value of the scaled regressor.
    pub condition: f64,
    parameters: Vec<usize>,
    /// Norms of the columns, and the scaled columns.
    norms: DVector<f64>,
    scaled: DMatrix<f64>,
}

impl Sensitivities {
    /// Sensitivities along a series; `None` if it crosses a singular pose.
    pub fn new(machine: &Machine, series: &FourierSeries) -> Option<Self> {
        let parameters = base_parameters(machine);
        let mut scaled = DMatrix::zeros(LEGS * INSTANTS as usize, parameters.len());
        for k in 0..INSTANTS {
            let t = PERIOD_S * f64::from(k) / f64::from(INSTANTS);
            let regressor = regressor(machine, &about_home(machine, &series.at(t)).motion())?;
            scaled.rows_mut(LEGS * k as usize, LEGS).copy_from(&regressor.select_columns(&parameters));
        }
        let norms =
            DVector::from_iterator(parameters.len(), scaled.column_iter().map(|column| column.norm()));
        scaled
            .column_iter_mut()
            .zip(&norms)
            .for_each(|(mut column, norm)| column /= norm.max(f64::MIN_POSITIVE));
        let singular =
            scaled.clone().try_svd_unordered(false, false, f64::EPSILON, MAX_SVD_STEPS)?.singular_values;
        // With a larger condition the inverse has no digits.
        let condition = singular.max() / singular.min().max(f64::EPSILON * singular.max());
        condition.is_finite().then_some(Self { condition, parameters, norms, scaled })
    }

    /// Standard deviation of each base parameter after `count` instants whose forces have white noise of the standard
    /// deviation `noise_n` \[N\], as pairs with the index of the parameter: `sqrt diag (Y^T Y / noise^2 + D^-2)^-1`, D: the
    /// deviations before.
    pub fn deviations(
        &self,
        before: &DynamicParameters,
        noise_n: f64,
        count: f64,
    ) -> Option<Vec<(usize, f64)>> {
        let noise = noise_n * (f64::from(INSTANTS) / count).sqrt();
        let before = before.select_rows(&self.parameters);
        let weight = DMatrix::from_diagonal(&(self.norms.component_mul(&before) / noise));
        let mut rows = (&self.scaled * weight).resize_vertically(self.scaled.nrows() + before.len(), 0.0);
        rows.rows_mut(self.scaled.nrows(), before.len()).fill_with_identity();
        let inverse = rows.qr().unpack_r().try_inverse()?;
        let deviations = inverse.row_iter().zip(&before).map(|(row, before)| row.norm() * before);
        Some(self.parameters.iter().copied().zip(deviations).collect())
    }
}
