//! Forces that a pose takes from the drives: to hold the platform, and to accelerate it from rest.
//!
//! ```text
//! Gamma = Gamma_g + K [omega'; v']            N Gamma_g = W at rest,  N K = M
//! ```
//!
//! Valid at regular poses. Relative errors grow with the condition of N.

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::LEGS;
use super::active_forces::InverseDynamics;
use super::factorization::{Factorization, LaneWrench};
use super::fidelity::Gravity;
use super::inverse_geometry::LegGeometry;
use super::lanes3::Lanes3;
use super::machine::Machine;
use super::rigid::{Acceleration, Motion, Pose, Twist};
use super::triples::LegLanes;

/// Forces of the six legs at a pose, without friction, in lanes; zero in the lanes of padding.
///
/// ```
/// use hexad_core::model::{active_forces::{InverseDynamics, inverse_dynamics}, drive_loads::DriveLoads, fidelity::Exact};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let loads = DriveLoads::new(&InverseDynamics::new(&machine), &machine.home_pose()).unwrap();
/// let mut motion = hexad_core::model::task::TaskState::at_rest(machine.home).motion();
/// motion.acceleration.linear.z = 2.0;
/// let forces = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
/// let (still, [.., by_z]) = (loads.holding(&machine), loads.by_acceleration(&machine));
/// assert!((0..6).all(|i| (still[i] + 2.0 * by_z[i] - forces[i]).abs() < 1e-12));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveLoads {
    /// Gamma_g \[N\].
    pub holding: LegLanes,
    /// Columns of K: per unit of the angular acceleration, then of the acceleration of C.
    pub by_acceleration: [LegLanes; LEGS],
}

impl DriveLoads {
    /// Loads at a pose; `None` where it is singular.
    pub fn new(dynamics: &InverseDynamics, pose: &Pose) -> Option<Self> {
        dispatch!(dynamics.machine().level, simd => {
            let joints = dynamics.joints();
            let legs = LegGeometry::around_center(simd, joints, pose);
            Self::of_legs(simd, dynamics, &legs, &Factorization::new(simd, joints, &legs), pose)
        })
    }

    /// Loads of legs with arms from the mean of the joints.
    #[inline(always)]
    pub(super) fn of_legs<S: Simd>(
        simd: S,
        dynamics: &InverseDynamics,
        legs: &LegGeometry<S>,
        factorization: &Factorization<S>,
        pose: &Pose,
    ) -> Option<Self> {
        let of_legs = f64x8::load_array(simd, [1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0]);
        let rest = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
        let gravity = &dynamics.machine().gravity_m_s2;
        let (wrench, axial) = dynamics.load::<_, Gravity>(simd, &rest, gravity, legs);
        let holding = factorization.forces(legs, &wrench, axial)?.load(simd) * of_legs;
        let [x, y, z] = dynamics.joint_masses(simd, legs);
        let [mx, my, mz] = [&x, &y, &z].map(|column| column.transverse);
        let arm = legs.arm + Lanes3::splat(simd, &(pose.rotation * dynamics.joints().center_m));
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        let [tx, ty, tz] = dynamics.axes().inertia(simd, &pose.rotation);
        let turning = [tx, ty, tz, zero, zero, zero];
        // Forces at the joints for `e x b` with each axis e, then for each axis.
        let transverse =
            [mz * arm.y - my * arm.z, mx * arm.z - mz * arm.x, my * arm.x - mx * arm.y, mx, my, mz];
        let [ax, ay, az] = [x.axial_n, y.axial_n, z.axial_n];
        let axial = [az * arm.y - ay * arm.z, ax * arm.z - az * arm.x, ay * arm.x - ax * arm.y, ax, ay, az];
        let mut by_acceleration = [LegLanes::default(); LEGS];
        let columns = by_acceleration.iter_mut().zip(turning).zip(transverse.into_iter().zip(axial));
        for ((column, turning), (transverse, axial)) in columns {
            let wrench = LaneWrench {
                torque: legs.arm.cross(transverse).folded() + turning,
                force: transverse.folded(),
            };
            *column = (factorization.forces(legs, &wrench, axial)?.load(simd) * of_legs).into();
        }
        Some(Self { holding: holding.into(), by_acceleration })
    }

    /// Forces at rest per unit of gravity along each base axis, leg after leg \[kg\]: `Gamma_g = [row . g]`; `None` where the pose is
    /// singular.
    pub fn holding_rows(dynamics: &InverseDynamics, pose: &Pose) -> Option<[Vector3<f64>; LEGS]> {
        let rest = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
        let [x, y, z] = dispatch!(dynamics.machine().level, simd => {
            let joints = dynamics.joints();
            let legs = LegGeometry::around_center(simd, joints, pose);
            let factorization = Factorization::new(simd, joints, &legs);
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
                let (wrench, axial) = dynamics.load::<_, Gravity>(simd, &rest, &axis, &legs);
                factorization.forces(&legs, &wrench, axial).map(|lane| joints.triples.unpack(&lane))
            })
        });
        let mut rows = [Vector3::zeros(); LEGS];
        for (row, ((x, y), z)) in rows.iter_mut().zip(x?.into_iter().zip(y?).zip(z?)) {
            *row = Vector3::new(x, y, z);
        }
        Some(rows)
    }

    /// Forces at rest, in the order of the legs \[N\].
    pub fn holding(&self, machine: &Machine) -> [f64; LEGS] {
        machine.joints.triples.unpack(&self.holding)
    }

    /// Columns of K, in the order of the legs \[N s^2\], \[kg\].
    pub fn by_acceleration(&self, machine: &Machine) -> [[f64; LEGS]; LEGS] {
        self.by_acceleration.map(|column| machine.joints.triples.unpack(&column))
    }
}
