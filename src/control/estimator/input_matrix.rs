//! Input matrix of the error dynamics at home: how the platform really accelerates where the law commands an acceleration.
//!
//! ```text
//! e'' = d - B a        a: acceleration of the law, in the coordinates of the error
//! exact computed torque        B = 1
//! reduced fidelity             B = M^-1 N G      G: leg forces of the fidelity for unit accelerations
//! modes on legs                B = N^T M^-1 N diag(m)
//! ```
//!
//! With it the estimator knows that a fidelity without the mass of the legs accelerates the platform too little, and that the
//! forces of one leg move the others: else both were disturbances as fast as the loop. M and N are those at home; what changes
//! with the pose the disturbance takes.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::control::law::Law;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::machine::{LEGS, Machine};
use crate::model::mass_matrix::MassMatrix;
use crate::model::rigid::{Acceleration, Motion, Twist};

/// Input matrix of one machine and law.
#[derive(Clone, Copy, Debug)]
pub struct InputMatrix {
    /// Acceleration of the error coordinates per force of a leg \[1/kg\] or \[1/(kg m)\].
    by_force: Matrix6<f64>,
    /// B and its inverse; `None` if B is the identity.
    by_command: Option<[Matrix6<f64>; 2]>,
}

impl InputMatrix {
    /// At home. The identity where the machine has no mass matrix.
    pub fn at_home(machine: &Machine, law: &Law, fidelity: Fidelity) -> Self {
        let home = machine.home_pose();
        let wrenches = leg_wrenches(machine, &home);
        let mobility = MassMatrix::new(machine).at(&home).try_inverse().unwrap_or_default();
        let pose_by_force = mobility * wrenches;
        if law.mode.acts_on_legs() {
            let by_force = wrenches.transpose() * pose_by_force;
            let by_command = by_force * Matrix6::from_diagonal(&law.leg_masses.mass);
            return Self { by_force, by_command: with_inverse(by_command) };
        }
        let by_command = match fidelity {
            Fidelity::Exact => None,
            _ => with_inverse(pose_by_force * unit_forces(machine, fidelity)),
        };
        Self { by_force: pose_by_force, by_command }
    }

    /// The acceleration of the platform for one of the law, and forces beside it \[N\].
    pub fn acceleration(&self, commanded: &Vector6<f64>, lost: &Vector6<f64>) -> Vector6<f64> {
        let direct = self.by_command.map_or(*commanded, |[matrix, _]| matrix * commanded);
        if *lost == Vector6::zeros() { direct } else { direct + self.by_force * lost }
    }

    /// The acceleration that the law must command for one of the platform.
    pub fn command(&self, acceleration: &Vector6<f64>) -> Vector6<f64> {
        self.by_command.map_or(*acceleration, |[_, inverse]| inverse * acceleration)
    }
}

fn with_inverse(matrix: Matrix6<f64>) -> Option<[Matrix6<f64>; 2]> {
    matrix.try_inverse().map(|inverse| [matrix, inverse])
}

/// Leg forces of a fidelity at home, a column for each unit acceleration; without gravity.
fn unit_forces(machine: &Machine, fidelity: Fidelity) -> Matrix6<f64> {
    let weightless = InverseDynamics::new(&Machine { gravity: Vector3::zeros(), ..machine.clone() });
    let pose = machine.home_pose();
    let column = |k: usize| {
        let acceleration = Acceleration::from_vector(&Vector6::ith(k, 1.0));
        let motion = Motion { pose, twist: Twist::default(), acceleration };
        Vector6::from(weightless.forces_of(fidelity, &motion).unwrap_or_default())
    };
    Matrix6::from_columns(&core::array::from_fn::<_, LEGS, _>(column))
}
