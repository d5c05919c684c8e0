//! Forward dynamics: the acceleration that six actuator forces cause.
//!
//! ```text
//! M(X) [omega'; v'] + h(X, twist) = N Gamma
//! ```
//!
//! Columns of M and the bias h are inverse dynamics at chosen accelerations, so plant and controller
//! share every equation: column k is the load of unit acceleration k at rest without gravity (no
//! cancellation), h the load at zero acceleration. M is symmetric and positive definite; torque and
//! angular parts first, about C, in base axes.
//!
//! What it does not do: links whose inertia varies with length keep their instantaneous value, as in the
//! inverse model, so energy is conserved only for constant link inertias.

use nalgebra::{Cholesky, Matrix6, U6, Vector3, Vector6};

use crate::model::active_forces::{InverseDynamics, TaskLoad};
use crate::model::ladder::Exact;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Forward dynamics of one machine.
#[derive(Clone, Debug)]
pub struct ForwardDynamics {
    model: InverseDynamics,
    /// The same machine without gravity, for M.
    weightless: InverseDynamics,
}

impl ForwardDynamics {
    /// Derives the constants.
    pub fn new(machine: &Machine) -> Self {
        let weightless = Machine { gravity: Vector3::zeros(), ..machine.clone() };
        Self { model: InverseDynamics::new(machine), weightless: InverseDynamics::new(&weightless) }
    }

    /// The machine it stands for.
    pub fn machine(&self) -> &Machine {
        self.model.machine()
    }

    /// M, 6 x 6, drives included.
    pub fn mass_matrix(&self, pose: &Pose) -> Matrix6<f64> {
        let mut mass = Matrix6::zeros();
        for (k, mut column) in mass.column_iter_mut().enumerate() {
            let unit = Vector6::ith(k, 1.0);
            let motion = Motion {
                pose: *pose,
                twist: Twist::default(),
                acceleration: Acceleration::from_vector(&unit),
            };
            column.copy_from(&total_load(&self.weightless.load_of::<Exact>(&motion)));
        }
        mass
    }

    /// Acceleration under these forces; `None` if M is not positive definite (a pose that is not one).
    pub fn acceleration(&self, pose: &Pose, twist: &Twist, force: &[f64; LEGS]) -> Option<Acceleration> {
        let coasting = Motion { pose: *pose, twist: *twist, acceleration: Acceleration::default() };
        let load = self.model.load_of::<Exact>(&coasting);
        let unbalanced = load.leg_wrenches * Vector6::from(*force) - total_load(&load);
        let mass: Cholesky<f64, U6> = Cholesky::new(self.mass_matrix(pose))?;
        Some(Acceleration::from_vector(&mass.solve(&unbalanced)))
    }

    /// Smallest moving mass an actuator can feel \[kg\]: 1 / largest eigenvalue of `N^T M^-1 N`. It bounds
    /// how fast friction can act, hence the step of the integrator.
    pub fn smallest_leg_mass(&self, pose: &Pose) -> Option<f64> {
        let n = crate::model::inverse_jacobian::leg_wrenches(self.machine(), pose);
        let mass: Cholesky<f64, U6> = Cholesky::new(self.mass_matrix(pose))?;
        let mobility = n.transpose() * mass.solve(&n);
        Some(1.0 / mobility.symmetric_eigenvalues().max())
    }
}

/// `W + N along`: everything the actuators have to balance, as a wrench.
fn total_load(load: &TaskLoad) -> Vector6<f64> {
    load.wrench + load.leg_wrenches * load.along
}
