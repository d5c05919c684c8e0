//! What others do in the place of our forward kinematics, to see where it fails.

use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::inverse_jacobian::leg_wrenches;
use hexad::model::machine::Machine;
use hexad::model::task::TaskState;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// The bound of LinuxCNC's genhexkins, and a tolerance like its own \[m\].
const MAX_ITERATIONS: u32 = 128;
const TOLERANCE: f64 = 1e-9;

/// How steps change the angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// Rotation vectors are added to Bryan angles, as in genhexkins: right only where these are zero.
    RotationAdded,
    /// Newton's method on the Bryan angles: the step goes through the inverse of E.
    Angles,
}

/// X with these lengths from a start, and the iterations; `None` where the method itself says that it failed.
pub fn solve(
    machine: &Machine,
    update: Update,
    start: &[f64; 6],
    lengths: &[f64; 6],
) -> Option<([f64; 6], u32)> {
    let mut x = Vector6::from(*start);
    for iteration in 0..=MAX_ITERATIONS {
        let pose = TaskState::at_rest(x.into()).motion().pose;
        let rest = Vector6::from(*lengths) - Vector6::from(leg_lengths(machine, &pose));
        if rest.amax() < TOLERANCE {
            return Some((x.into(), iteration));
        }
        let mut rows: Matrix6<f64> = leg_wrenches(machine, &pose).transpose();
        if update == Update::Angles {
            let turned = rows.fixed_columns::<3>(0) * omega_of_rates(&x);
            rows.fixed_columns_mut::<3>(0).copy_from(&turned);
        }
        x += rows.lu().solve(&rest)?;
        if x.iter().any(|value| !value.is_finite()) {
            return None;
        }
    }
    None
}

/// E, a column per angle.
fn omega_of_rates(x: &Vector6<f64>) -> Matrix3<f64> {
    let column = |k: usize| -> Vector3<f64> {
        let mut state = TaskState { x: *x, ..TaskState::default() };
        state.xd[k] = 1.0;
        state.motion().twist.angular
    };
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}
