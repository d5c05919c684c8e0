//! Masses for control leg by leg.
//!
//! ```text
//! L'' = P Gamma + ...        P = N^T M^-1 N, the mobility of the legs        m_i = 1 / P_ii
//! ```
//!
//! `m_i` is what drive i moves while the others push as before. With forces `-m_i (Kp e_i + Kd e_i')` the
//! machine has six modes of its own, in which the legs move together, and not one: the loop gain of each is that
//! of the law times an eigenvalue of `diag(m) P`. Their mean is 1, so the mean square of the six natural
//! frequencies is the configured one; the softest and the stiffest say how far they are apart. That is
//! what control leg by leg costs on a machine whose legs are coupled, at home already.

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix6, Vector6};

use crate::model::machine::Machine;
use crate::model::mass_matrix::MassMatrix;
use crate::model::task::TaskState;

/// What each drive moves at home, and what that makes of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegMasses {
    /// \[kg\]
    pub mass: Vector6<f64>,
    /// Least and greatest loop gain of a mode, times that of the law.
    pub softest: f64,
    pub stiffest: f64,
}

impl LegMasses {
    /// At the home pose; not a number where the machine has no mass.
    pub fn at_home(machine: &Machine) -> Self {
        let home = TaskState::at_rest(machine.home).motion().pose;
        let mobility = MassMatrix::new(machine).leg_mobility(&home).unwrap_or(Matrix6::repeat(f64::NAN));
        let mass = mobility.diagonal().map(f64::recip);
        let roots = Matrix6::from_diagonal(&mass.map(f64::sqrt));
        let coupled = roots * mobility * roots;
        // The search for eigenvalues does not end where there are none.
        if !coupled.iter().all(|element| element.is_finite()) {
            return Self { mass, softest: f64::NAN, stiffest: f64::NAN };
        }
        let gains = coupled.symmetric_eigenvalues();
        Self { mass, softest: gains.min(), stiffest: gains.max() }
    }
}
