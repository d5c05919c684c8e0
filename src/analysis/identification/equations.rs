//! Linear equations of a recorded motion, one for each leg and sample:
//!
//! ```text
//! s_i u_i - s_i mu_i |u_i| sign(L'_i) = Y_i (p + payload) + Y_i known
//! ```
//!
//! u command, s force scale, mu load friction, Y p the [regressor](crate::model::regressor) and its parameters. They are
//! linear in s, s mu and p. A leg that nearly stands has no equation: the sign of its friction is not known there, and
//! friction is larger than at speed (Stribeck). A QR decomposition of the equations of a leg keeps what they say.

use nalgebra::{DMatrix, SVector};

use super::samples::MotionSample;
use crate::model::LEGS;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::Machine;
use crate::model::regressor::{PARAMETER_COUNT, regressor};

/// Parameters of a rigid body: mass, first moments, inertia about C.
pub(super) const BODY: usize = 10;
/// First of the force scales s, of their products with the load friction, and of the parameters of the payload.
pub(super) const SCALE: usize = PARAMETER_COUNT;
pub(super) const LOSS: usize = SCALE + LEGS;
pub(super) const PAYLOAD: usize = LOSS + LEGS;
pub(super) const UNKNOWNS: usize = PAYLOAD + BODY;

/// Unknowns of the equations.
pub(super) type Unknowns = SVector<f64, UNKNOWNS>;

/// Rate below which a leg nearly stands \[m/s\]: three times the Stribeck speed of a usual drive; or this share of the
/// leg's root mean square rate, if that is less.
const STANDING_M_S: f64 = 0.03;
const STANDING_RATIO: f64 = 0.2;
/// Time before and after a sample in which its leg must not turn around \[s\].
const TURNING_S: f64 = 0.04;

/// Body on the platform in a recording, beside the platform itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// None.
    Empty,
    /// A point mass \[kg\] at a place in platform axes \[m\].
    Known {
        /// \[kg\]
        mass: f64,
        /// \[m\]
        at: [f64; 3],
    },
    /// A body that is to be identified.
    Payload,
}

impl Load {
    /// Parameters of the body, as those of the platform in the regressor.
    fn parameters(&self) -> SVector<f64, BODY> {
        let Self::Known { mass, at: [x, y, z] } = *self else { return SVector::zeros() };
        SVector::from([1.0, x, y, z, y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
            * mass
    }
}

/// Equation of a leg: coefficients of the unknowns, and the known side \[N\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation {
    pub leg: usize,
    pub coefficients: Unknowns,
    pub right: f64,
}

/// Equations of samples of one recording, in their order.
pub(super) fn equations(machine: &Machine, samples: &[MotionSample], load: &Load) -> Vec<Equation> {
    let legs: Vec<_> = samples.iter().map(|sample| leg_motion(machine, &sample.motion)).collect();
    let mut standing = [0.0; LEGS];
    for legs in &legs {
        standing.iter_mut().zip(legs.rate).for_each(|(sum, rate)| *sum += rate * rate / samples.len() as f64);
    }
    let standing = standing.map(|square| STANDING_M_S.min(STANDING_RATIO * square.sqrt()));
    let known = load.parameters();
    let mut found = vec![];
    for (sample, motion) in samples.iter().zip(&legs) {
        let Some(y) = regressor(machine, &sample.motion) else { continue };
        let of_legs = motion.rate.iter().zip(&motion.accel).zip(&sample.command).zip(&standing);
        for (leg, ((((rate, accel), command), standing), row)) in of_legs.zip(y.row_iter()).enumerate() {
            if !(rate.abs() > standing + TURNING_S * accel.abs()) {
                continue;
            }
            let body = row.fixed_columns::<BODY>(0);
            let mut coefficients = Unknowns::zeros();
            coefficients.fixed_rows_mut::<PARAMETER_COUNT>(0).copy_from(&-row.transpose());
            coefficients.fixed_rows_mut::<1>(SCALE + leg).fill(*command);
            coefficients.fixed_rows_mut::<1>(LOSS + leg).fill(-command.abs() * rate.signum());
            if *load == Load::Payload {
                coefficients.fixed_rows_mut::<BODY>(PAYLOAD).copy_from(&-body.transpose());
            }
            found.push(Equation { leg, coefficients, right: (body * known).x });
        }
    }
    found
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
