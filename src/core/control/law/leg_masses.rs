//! Effective leg masses, for control of each leg by itself.
//!
//! ```text
//! L'' = P Gamma + ...        P = N^T M^-1 N, the mobility of the legs        m_i = 1 / P_ii
//! ```
//!
//! `m_i` is the mass that drive i accelerates while the other forces are constant. Under the forces
//! `-m_i (Kp e_i + Kd e_i')` the machine has six modes, in which the legs move together. The loop gain of
//! each mode is the law's loop gain times an eigenvalue of `diag(m) P`. The eigenvalues have the mean 1, so
//! the mean square of the six natural frequencies is the configured one. The spread from the softest to the
//! stiffest mode is the cost of controlling each leg by itself on a machine with coupled legs.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix6, Vector6};

use crate::model::machine::Machine;
use crate::model::mass_matrix::MassMatrix;

/// Effective mass of each drive at the home pose, and loop gains of the softest and the stiffest mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegMasses {
    /// `m_i` \[kg\].
    pub mass_kg: Vector6<f64>,
    /// Smallest loop gain of a mode, relative to the law's loop gain.
    pub softest_mode_gain_ratio: f64,
    /// Largest loop gain of a mode, relative to the law's loop gain; it decides the stability of the loop.
    pub stiffest_mode_gain_ratio: f64,
}

impl LegMasses {
    /// Evaluates the masses at home; NaN if the machine has no mass.
    pub fn at_home(machine: &Machine) -> Self {
        let home = machine.home_pose();
        let mobility = MassMatrix::new(machine).leg_mobility(&home).unwrap_or(Matrix6::repeat(f64::NAN));
        let mass_kg = mobility.diagonal().map(f64::recip);
        let roots = Matrix6::from_diagonal(&mass_kg.map(f64::sqrt));
        let coupled = roots * mobility * roots;
        // The eigenvalue iteration does not end if an element is not finite.
        if !coupled.iter().all(|element| element.is_finite()) {
            return Self { mass_kg, softest_mode_gain_ratio: f64::NAN, stiffest_mode_gain_ratio: f64::NAN };
        }
        let gains = coupled.symmetric_eigenvalues();
        Self { mass_kg, softest_mode_gain_ratio: gains.min(), stiffest_mode_gain_ratio: gains.max() }
    }
}
