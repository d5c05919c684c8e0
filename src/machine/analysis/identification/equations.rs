//! Linear equations of a recorded motion, one for each leg and group of samples, of which it has the means:
//!
//! ```text
//! s_i u_i - s_i mu_i |u_i| sign(L'_i) = Y_i (p + payload) + Y_i known
//! ```
//!
//! u command, s force scale, mu load friction, Y p the [regressor](hexad_core::model::regressor) and its parameters. They are
//! linear in s, s mu and p. A leg that nearly stands has no equation: the sign of its friction is not known there, and
//! friction is larger than at speed (Stribeck). A QR decomposition of the equations of a leg keeps what they say.

use nalgebra::{DMatrix, SVector};

use super::samples::MotionSample;
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::machine::Machine;
use hexad_core::model::regressor::{DYNAMIC_PARAMETER_COUNT, Regressor, regressor};

/// Parameters of a rigid body: mass, first moments, inertia about C.
pub(super) const BODY_PARAMETER_COUNT: usize = 10;
/// First of the force scales s, of their products with the load friction, and of the parameters of the payload.
pub(super) const SCALE: usize = DYNAMIC_PARAMETER_COUNT;
pub(super) const LOSS_INDEX: usize = SCALE + LEGS;
pub(super) const PAYLOAD: usize = LOSS_INDEX + LEGS;
pub(super) const UNKNOWNS: usize = PAYLOAD + BODY_PARAMETER_COUNT;

/// Unknowns of the equations.
pub(super) type Unknowns = SVector<f64, UNKNOWNS>;

/// Rate below which a leg nearly stands \[m/s\]: three times the Stribeck speed of a usual drive; or this share of the
/// leg's root mean square rate, if that is less.
const STANDING_M_S: f64 = 0.03;
const STANDING_RATIO: f64 = 0.2;
/// Successive samples whose means form an equation: 80 ms at 1 kHz, in which noise averages out on both sides alike.
pub(super) const SAMPLES_PER_EQUATION: usize = 16;

/// Body on the platform in a recording, beside the platform itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// None.
    Empty,
    /// A point mass \[kg\] at a place in platform axes \[m\].
    Known {
        /// \[kg\]
        mass_kg: f64,
        /// \[m\]
        at_m: [f64; 3],
    },
    /// A body that is to be identified.
    Payload,
}

impl Load {
    /// Parameters of the body, in the order of the platform's parameters in the regressor.
    pub(super) fn parameters(&self) -> SVector<f64, BODY_PARAMETER_COUNT> {
        let Self::Known { mass_kg, at_m: [x, y, z] } = *self else { return SVector::zeros() };
        SVector::from([1.0, x, y, z, y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
            * mass_kg
    }
}

/// Equation of a leg: coefficients of the unknowns, and the known side \[N\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation {
    pub leg: usize,
    /// First instant of the group, since the first release of the stretch \[s\].
    pub time_s: f64,
    /// Index of its first sample.
    pub first: usize,
    pub coefficients: Unknowns,
    pub right: f64,
}

/// Equations of samples of one recording, in their order.
pub(super) fn equations(machine: &Machine, samples: &[MotionSample], load: &Load) -> Vec<Equation> {
    let legs: Vec<_> = samples.iter().map(|sample| leg_motion(machine, &sample.motion)).collect();
    let mut standing = [0.0; LEGS];
    for legs in &legs {
        standing
            .iter_mut()
            .zip(legs.rate_m_s)
            .for_each(|(sum, rate)| *sum += rate * rate / samples.len() as f64);
    }
    let standing = standing.map(|square| STANDING_M_S.min(STANDING_RATIO * square.sqrt()));
    let known = load.parameters();
    let mut found = vec![];
    for (index, (samples, legs)) in
        samples.chunks_exact(SAMPLES_PER_EQUATION).zip(legs.chunks_exact(SAMPLES_PER_EQUATION)).enumerate()
    {
        if !is_gapless(samples) {
            continue;
        }
        let Some(regressors) =
            samples.iter().map(|sample| regressor(machine, &sample.motion)).collect::<Option<Vec<_>>>()
        else {
            continue;
        };
        let y = regressors.iter().sum::<Regressor>() / SAMPLES_PER_EQUATION as f64;
        let time_s = samples.first().map_or(0.0, |sample| sample.time_s);
        for ((leg, row), standing) in y.row_iter().enumerate().zip(standing) {
            let of_leg = |values: &[f64; LEGS]| values.get(leg).copied().unwrap_or_default();
            let rates = || legs.iter().map(|motion| of_leg(&motion.rate_m_s));
            let sign = rates().next().unwrap_or_default().signum();
            if rates().any(|rate| !(rate * sign > standing)) {
                continue;
            }
            let commands = || samples.iter().map(|sample| of_leg(&sample.command_n));
            let mean = |sum: f64| sum / SAMPLES_PER_EQUATION as f64;
            let body = row.fixed_columns::<BODY_PARAMETER_COUNT>(0);
            let mut coefficients = Unknowns::zeros();
            coefficients.fixed_rows_mut::<DYNAMIC_PARAMETER_COUNT>(0).copy_from(&-row.transpose());
            coefficients.fixed_rows_mut::<1>(SCALE + leg).fill(mean(commands().sum()));
            coefficients
                .fixed_rows_mut::<1>(LOSS_INDEX + leg)
                .fill(-sign * mean(commands().map(f64::abs).sum()));
            if *load == Load::Payload {
                coefficients.fixed_rows_mut::<BODY_PARAMETER_COUNT>(PAYLOAD).copy_from(&-body.transpose());
            }
            found.push(Equation {
                leg,
                time_s,
                first: index * SAMPLES_PER_EQUATION,
                coefficients,
                right: (body * known).x,
            });
        }
    }
    found
}

/// Whether samples follow each other without a gap.
fn is_gapless(samples: &[MotionSample]) -> bool {
    let gaps = || samples.iter().zip(samples.iter().skip(1)).map(|(a, b)| b.time_s - a.time_s);
    gaps().fold(0.0, f64::max) < 1.5 * gaps().fold(f64::INFINITY, f64::min)
}

/// What equations say about the unknowns x and the known side: `|A x - b|^2 = |R [x; -1]|^2`, R triangular.
pub(super) fn triangle<'a>(equations: impl Iterator<Item = &'a Equation> + Clone) -> DMatrix<f64> {
    // At least as many rows as columns.
    let mut all = DMatrix::zeros(equations.clone().count().max(UNKNOWNS + 1), UNKNOWNS + 1);
    for (mut row, equation) in all.row_iter_mut().zip(equations) {
        row.fixed_columns_mut::<UNKNOWNS>(0).copy_from(&equation.coefficients.transpose());
        row.fixed_columns_mut::<1>(UNKNOWNS).fill(equation.right);
    }
    all.qr().unpack_r()
}
