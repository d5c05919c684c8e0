//! Input matrix of the error dynamics at home: true acceleration of the platform for a commanded
//! acceleration.
//!
//! ```text
//! e'' = d - B a        a: acceleration that the law commands, in error coordinates
//! exact computed torque        B = 1
//! reduced fidelity             B = M^-1 N G      G: leg forces of the fidelity for unit accelerations
//! modes on legs                B = N^T M^-1 N diag(m)
//! ```
//!
//! Two causes make B differ from 1: a fidelity without leg masses accelerates the platform too little, and
//! the force of one leg moves the other legs. Without B the estimator would treat both as disturbances that
//! change as fast as the loop. M and N are taken at home; their change with the pose is part of the
//! disturbance.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::control::law::leg_masses::LegMasses;
use crate::control::law::mode::ControlMode;
use crate::control::signals::errors::{CommandedAcceleration, FeedbackAcceleration};
use crate::model::LEGS;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::machine::Machine;
use crate::model::mass_matrix::MassMatrix;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench};

/// Input matrix of one machine and law.
#[derive(Clone, Copy, Debug)]
pub struct InputMatrix {
    /// `M^-1`.
    mobility: Matrix6<f64>,
    acts_on_legs: bool,
    /// B and its inverse; `None` if B is the identity.
    matrix_and_inverse: Option<[Matrix6<f64>; 2]>,
}

impl InputMatrix {
    /// Evaluates the matrix at home. B is the identity if the mass matrix is singular.
    pub fn at_home(machine: &Machine, mode: ControlMode, leg_masses: &LegMasses, fidelity: Fidelity) -> Self {
        let home = machine.home_pose();
        let wrenches = leg_wrenches(machine, &home);
        let mobility = MassMatrix::new(machine).at(&home).try_inverse().unwrap_or_default();
        let by_force = mobility * wrenches;
        let acts_on_legs = mode.acts_on_legs();
        let matrix_and_inverse = if acts_on_legs {
            with_inverse(wrenches.transpose() * by_force * Matrix6::from_diagonal(&leg_masses.mass_kg))
        } else if fidelity == Fidelity::Exact {
            None
        } else {
            with_inverse(by_force * forces_by_unit_acceleration(machine, fidelity))
        };
        Self { mobility, acts_on_legs, matrix_and_inverse }
    }

    /// Acceleration of the error for an acceleration that the law commands: `B a`.
    pub fn feedback_acceleration(
        &self,
        CommandedAcceleration(a): &CommandedAcceleration,
    ) -> FeedbackAcceleration {
        FeedbackAcceleration(self.matrix_and_inverse.map_or(*a, |[matrix, _]| matrix * a))
    }

    /// Largest disturbance of each axis that a law with this acceleration bound can compensate.
    pub fn largest_compensable_disturbance(&self, max_acceleration: &Vector6<f64>) -> Vector6<f64> {
        self.matrix_and_inverse.map_or(*max_acceleration, |[matrix, _]| matrix.abs() * max_acceleration)
    }

    /// Acceleration by an additional wrench at a pose: the forces that limits removed.
    /// N is taken at the pose, because near flat legs a force moves the platform far less than at home.
    // Rarely called, hence out of line: the cycle stays short.
    #[inline(never)]
    pub fn acceleration_by_wrench(
        &self,
        machine: &Machine,
        pose: &Pose,
        wrench: &Wrench,
    ) -> FeedbackAcceleration {
        let acceleration = self.mobility * wrench.vector();
        FeedbackAcceleration(match self.acts_on_legs {
            true => leg_wrenches(machine, pose).tr_mul(&acceleration),
            false => acceleration,
        })
    }

    /// Acceleration by a unit force of each leg at a pose, one column per leg, in error coordinates.
    pub fn acceleration_by_force(&self, machine: &Machine, pose: &Pose) -> Matrix6<f64> {
        let wrenches = leg_wrenches(machine, pose);
        let by_force = self.mobility * wrenches;
        if self.acts_on_legs { wrenches.tr_mul(&by_force) } else { by_force }
    }

    /// Matrix that takes a disturbance in error coordinates to the wrench about C that causes it at home.
    pub fn home_wrench_by_disturbance(&self, machine: &Machine) -> Matrix6<f64> {
        let inertia = self.mobility.try_inverse().unwrap_or_default();
        if !self.acts_on_legs {
            return inertia;
        }
        let of_legs = leg_wrenches(machine, &machine.home_pose()).transpose();
        inertia * of_legs.try_inverse().unwrap_or_default()
    }

    /// Acceleration that the law must command against a disturbance: `B^-1 d`.
    pub fn command(&self, disturbance_acceleration: &Vector6<f64>) -> Vector6<f64> {
        self.matrix_and_inverse
            .map_or(*disturbance_acceleration, |[_, inverse]| inverse * disturbance_acceleration)
    }
}

fn with_inverse(matrix: Matrix6<f64>) -> Option<[Matrix6<f64>; 2]> {
    matrix.try_inverse().map(|inverse| [matrix, inverse])
}

/// Leg forces of a fidelity at home without gravity, one column per unit acceleration.
fn forces_by_unit_acceleration(machine: &Machine, fidelity: Fidelity) -> Matrix6<f64> {
    let weightless = InverseDynamics::new(&Machine { gravity_m_s2: Vector3::zeros(), ..machine.clone() });
    let pose = machine.home_pose();
    let column = |k: usize| {
        let acceleration = Acceleration::from_vector(&Vector6::ith(k, 1.0));
        let motion = Motion { pose, twist: Twist::default(), acceleration };
        Vector6::from(weightless.forces_of(fidelity, &motion).unwrap_or_default())
    };
    Matrix6::from_columns(&core::array::from_fn::<_, LEGS, _>(column))
}
