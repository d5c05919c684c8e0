//! Mass matrix of the whole machine in task space.
//!
//! ```text
//! N Gamma = M(R, C) [omega'; v'] + h(R, C, omega, v)           M = d(N Gamma) / d[omega'; v']
//! x^T M x / 2 = kinetic energy of platform, legs and drives at the twist x
//! ```
//!
//! In the paper's notation, M is the platform's matrix plus
//! `sum_i [b_i~ ; U] J_Bv^-T M_i J_Bv^-1 [b_i~ ; U]^T` of the legs (73), (88)-(97). It is not assembled from
//! these matrices: column k is the load of unit acceleration k at rest without gravity, computed by the code
//! of the controller. The two therefore cannot disagree, and nothing cancels.
//!
//! Angular parts come first, about C, in base axes; the blocks are \[kg m^2\], \[kg m\] and \[kg\]. M is
//! symmetric to rounding. If the platform has mass and inertia, M is positive definite at every pose with
//! legs of positive length, even a singular pose, because N is not inverted. M includes the reflected masses:
//! `N diag(reflected) N^T`.
//!
//! Limitation: links whose inertia varies with the length enter with their instantaneous value.
//!
//! Cost: six evaluations of the load, most of the time of the simulated platform. Forces need no mass matrix.

use nalgebra::{Cholesky, Matrix6, U6, Vector3, Vector6};

use super::active_forces::InverseDynamics;
use super::fidelity::Exact;
use super::inverse_jacobian::leg_wrenches;
use super::machine::Machine;
use super::rigid::{Acceleration, Motion, Pose, Twist};

/// Mass matrix M of one machine, as a function of the pose.
///
/// ```
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mass = hexad_core::model::mass_matrix::MassMatrix::new(&machine).at(&machine.home_pose());
/// // Kinetic energy is positive and symmetric, and the legs add to the mass of the platform.
/// assert!((mass - mass.transpose()).amax() < 1e-12 * mass.amax() && mass.cholesky().is_some());
/// assert!(mass[(5, 5)] > machine.platform.mass_kg);
/// ```
#[derive(Clone, Debug)]
pub struct MassMatrix {
    /// Inverse dynamics of the machine without gravity.
    weightless: InverseDynamics,
}

impl MassMatrix {
    /// Computes the constants.
    pub fn new(machine: &Machine) -> Self {
        let weightless = Machine { gravity_m_s2: Vector3::zeros(), ..machine.clone() };
        Self { weightless: InverseDynamics::new(&weightless) }
    }

    /// Mass matrix M at a pose, 6 x 6, drives included.
    pub fn at(&self, pose: &Pose) -> Matrix6<f64> {
        let mut mass = Matrix6::zeros();
        for (k, mut column) in mass.column_iter_mut().enumerate() {
            let unit = Vector6::ith(k, 1.0);
            let motion = Motion {
                pose: *pose,
                twist: Twist::default(),
                acceleration: Acceleration::from_vector(&unit),
            };
            column.copy_from(&self.weightless.load_of::<Exact>(&motion).total());
        }
        mass
    }

    /// Mobility of the legs `N^T M^-1 N` \[1/kg\]: acceleration of each leg under a unit force in each leg.
    /// `None` if M is not positive definite, which means that `pose` is invalid.
    pub fn leg_mobility(&self, pose: &Pose) -> Option<Matrix6<f64>> {
        let n = leg_wrenches(self.weightless.machine(), pose);
        let mass: Cholesky<f64, U6> = Cholesky::new(self.at(pose))?;
        Some(n.transpose() * mass.solve(&n))
    }
}
