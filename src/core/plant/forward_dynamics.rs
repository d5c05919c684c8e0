//! Forward dynamics: the acceleration that six actuator forces cause.
//!
//! ```text
//! M(X) [omega'; v'] + h(X, twist) = N Gamma + external wrench
//! ```
//!
//! M is the model's [`MassMatrix`], the bias h the load of inverse dynamics at zero acceleration, so plant
//! and controller share every equation. Torque and angular parts first, about C, in base axes.
//!
//! What it does not do: links whose inertia varies with length keep their instantaneous value, as in the
//! inverse model, so energy is conserved only for constant link inertias.

use nalgebra::{Cholesky, Matrix6, U6, Vector6};

use crate::model::LEGS;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Exact;
use crate::model::machine::Machine;
use crate::model::mass_matrix::MassMatrix;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench};

/// Largest element of `N^T M^-1 N` \[1/kg\] that counts as valid.
const MAX_MOBILITY: f64 = 1e100;

/// Forward dynamics of one machine: actuator forces to acceleration.
///
/// ```
/// use hexad_core::model::{active_forces::inverse_dynamics, fidelity::Exact, task::TaskState};
/// use hexad_core::plant::forward_dynamics::ForwardDynamics;
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// // It inverts the inverse dynamics.
/// let motion = TaskState { xdd: [0.1, 0.0, 0.2, 1.0, 0.0, 2.0].into(), ..TaskState::at_rest(machine.home) }.motion();
/// let force = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
/// let found = ForwardDynamics::new(&machine).acceleration(&motion.pose, &motion.twist, &force).unwrap();
/// assert!((found.vector() - motion.acceleration.vector()).amax() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct ForwardDynamics {
    model: InverseDynamics,
    mass: MassMatrix,
}

impl ForwardDynamics {
    /// Derives the constants.
    pub fn new(machine: &Machine) -> Self {
        Self { model: InverseDynamics::new(machine), mass: MassMatrix::new(machine) }
    }

    /// The machine whose dynamics these are.
    pub fn machine(&self) -> &Machine {
        self.model.machine()
    }

    /// M, see [`MassMatrix::at`].
    pub fn mass_matrix(&self, pose: &Pose) -> Matrix6<f64> {
        self.mass.at(pose)
    }

    /// Acceleration under six actuator forces \[N\]; `None` if M is not positive definite (a pose that is not one).
    pub fn acceleration(&self, pose: &Pose, twist: &Twist, force_n: &[f64; LEGS]) -> Option<Acceleration> {
        self.acceleration_under(pose, twist, force_n, &Wrench::default())
    }

    /// Acceleration under six actuator forces and an `external` wrench on the platform.
    pub fn acceleration_under(
        &self,
        pose: &Pose,
        twist: &Twist,
        force_n: &[f64; LEGS],
        external: &Wrench,
    ) -> Option<Acceleration> {
        let coasting = Motion { pose: *pose, twist: *twist, acceleration: Acceleration::default() };
        let load = self.model.load_of::<Exact>(&coasting);
        let unbalanced = load.leg_wrenches * Vector6::from(*force_n) - load.total() + external.vector();
        let mass: Cholesky<f64, U6> = Cholesky::new(self.mass_matrix(pose))?;
        Some(Acceleration::from_vector(&mass.solve(&unbalanced)))
    }

    /// Smallest moving mass an actuator can feel \[kg\]: 1 / largest eigenvalue of `N^T M^-1 N`. It bounds
    /// how fast friction can act, hence the step of the integrator.
    pub fn smallest_effective_leg_mass_kg(&self, pose: &Pose) -> Option<f64> {
        let mobility = self.mass.leg_mobility(pose)?;
        // The search for eigenvalues squares, and does not end where that overflows.
        let is_valid = mobility.iter().all(|element| element.abs() < MAX_MOBILITY);
        is_valid.then(|| 1.0 / mobility.symmetric_eigenvalues().max())
    }
}
