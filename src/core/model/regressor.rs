//! Regressor form of the inverse dynamics: `Gamma = Y(motion) p`, linear in masses, first moments, inertias
//! and friction. For identification and adaptation outside the loop.
//!
//! Geometry, gravity, the reference lengths of the inertias and the smoothing of sign(L') are given; all
//! other constants of the machine form the vector p. Column k of Y is the force of a unit of parameter k:
//!
//! ```text
//! mass of the platform      [ 0 ; v' - g ]
//! its first moment m c      [ R e_k x (v' - g) ; S R e_k ]                      k = x, y, z
//! its inertia about C       [ I omega' + omega x I omega ; 0 ],  I = R E R^T    E one element of six
//! a parameter of the legs   sum_i [ b_i x F_i ; F_i ],  F = (Q - (Q.n) n) / L + along n
//!
//!     m1 e1     Q = -g                                along = 0
//!     m2        Q = L^2 n'' + 2 L L' n' - L g         along = L'' - L |n'|^2 - g.n
//!     m2 e2     Q = -2 L n'' - 2 L' n' + g            along = |n'|^2
//!     J1, J2    Q = n''                               along = 0
//!     q1, q2    Q = (L - l0)^2 n''                    along = 0
//!     Ix1, Ix2  Q = ( wx n' + (un / yy) wx' y ) x n   along = 0
//!
//! Y = N^-1 (these wrenches)      and for the drives   L'' in all rows, L' and sign(L') of leg i in row i
//! ```
//!
//! This is the expansion of [`super::leg`] and [`super::platform`] in the parameters. Both are linear if J1
//! and J2 are taken about the joints and the platform's inertia about C, so that parallel-axis terms are part
//! of the parameters. The code uses n'' and no lanes, and shares only the geometry of the legs with them.
//!
//! The mass of the cylinder is not a parameter: A does not move, so only `m1 e1` and `J1` have an effect.
//!
//! At most 29 of the 32 parameters are identifiable (28 if both links have the same reference length, because
//! q1 and q2 then have the same effect). No motion distinguishes
//!
//! - `J1` from `J2`, and `Ix1` from `Ix2`: the links turn together, so only the sums have an effect;
//! - `m2` from six points of that mass in the platform at the `B_i`: `m2` can be exchanged for mass, first
//!   moment and inertia of the platform.
//!
//! [`INDISTINGUISHABLE_PAIRS`] and [`rod_mass_null_direction`] contain these directions. Slow motions
//! identify less: without velocity neither spin nor friction, at rest only the first moments.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};

use super::LEGS;
use super::inverse_geometry::{LegMotion, leg_directions, leg_motion};
use super::inverse_jacobian::leg_wrenches;
use super::leg::MIN_UNIVERSAL_SINE_SQUARED;
use super::machine::Machine;
use super::platform::acceleration_map;
use super::rigid::Motion;

/// Number of parameters.
pub const DYNAMIC_PARAMETER_COUNT: usize = 32;

/// The drives' reflected mass.
pub const REFLECTED: usize = 19;
/// First of the six parameters of viscous friction.
pub const VISCOUS: usize = 20;
/// First of the six parameters of Coulomb friction.
pub const COULOMB: usize = VISCOUS + LEGS;

/// Inertial and friction parameters p of a machine, in this order:
///
/// | index | parameter | unit |
/// | --- | --- | --- |
/// | 0 | platform: mass m | kg |
/// | 1-3 | first moment m CG about C, platform axes | kg m |
/// | 4-9 | inertia about **C**, platform axes: elements xx, yy, zz, xy, xz, yz of the matrix | kg m^2 |
/// | 10 | cylinder: first moment m1 e1 about A | kg m |
/// | 11 | transverse inertia about A, `J1 = m1 e1^2 + It1` with the constant part of It1 | kg m^2 |
/// | 12 | axial inertia Ix1 | kg m^2 |
/// | 13 | quadratic part q1 of the transverse inertia | kg |
/// | 14 | rod: mass m2 | kg |
/// | 15 | first moment m2 e2 about B, toward A | kg m |
/// | 16 | transverse inertia about B, `J2 = m2 e2^2 + It2` with the constant part of It2 | kg m^2 |
/// | 17 | axial inertia Ix2 | kg m^2 |
/// | 18 | quadratic part q2 of the transverse inertia | kg |
/// | 19 | drive: reflected mass | kg |
/// | 20-25 | viscous friction of leg 1 to 6 | N s/m |
/// | 26-31 | Coulomb friction of leg 1 to 6 | N |
pub type DynamicParameters = SVector<f64, DYNAMIC_PARAMETER_COUNT>;

/// Regressor matrix Y, 6 x 32: one row per leg in the order 1..6, one column per parameter, \[N\] per unit of
/// parameter.
pub type Regressor = SMatrix<f64, 6, DYNAMIC_PARAMETER_COUNT>;

/// Pairs of parameters whose columns are equal at every motion: J1 and J2, Ix1 and Ix2.
pub const INDISTINGUISHABLE_PAIRS: [[usize; 2]; 2] = [[11, 16], [12, 17]];

/// Parameter vector p of a machine.
pub fn dynamic_parameters(machine: &Machine) -> DynamicParameters {
    let (platform, cylinder, rod, actuator) =
        (&machine.platform, &machine.cylinder, &machine.rod, &machine.actuator);
    let moment = platform.center_of_mass_m * platform.mass_kg;
    let inertia = platform.inertia + point_inertia(&platform.center_of_mass_m) * platform.mass_kg;
    let (m1_e1, m2_e2) = (cylinder.mass_kg * cylinder.center_of_mass_m, rod.mass_kg * rod.center_of_mass_m);
    let bodies = [
        platform.mass_kg,
        moment.x,
        moment.y,
        moment.z,
        inertia.m11,
        inertia.m22,
        inertia.m33,
        inertia.m12,
        inertia.m13,
        inertia.m23,
        m1_e1,
        m1_e1 * cylinder.center_of_mass_m + cylinder.transverse_inertia.constant_kg_m2,
        cylinder.axial_inertia_kg_m2,
        cylinder.transverse_inertia.quadratic_kg,
        rod.mass_kg,
        m2_e2,
        m2_e2 * rod.center_of_mass_m + rod.transverse_inertia.constant_kg_m2,
        rod.axial_inertia_kg_m2,
        rod.transverse_inertia.quadratic_kg,
        actuator.reflected_mass_kg,
    ];
    let friction = actuator.viscous_friction_n_s_m.into_iter().chain(actuator.coulomb_friction_n);
    SVector::from_iterator(bodies.into_iter().chain(friction))
}

/// Direction of p in the null space of Y at every motion. Each rod is 1 kg heavier with the same `m2 e2` and
/// `J2`; the platform is lighter by points of 1 kg at the `B_i`.
pub fn rod_mass_null_direction(machine: &Machine) -> DynamicParameters {
    let mut direction = DynamicParameters::zeros();
    for b in machine.joints.triples.unpack_vectors(&machine.joints.platform) {
        let inertia = point_inertia(&b);
        let point = [
            1.0,
            b.x,
            b.y,
            b.z,
            inertia.m11,
            inertia.m22,
            inertia.m33,
            inertia.m12,
            inertia.m13,
            inertia.m23,
        ];
        direction.iter_mut().zip(point).for_each(|(sum, value)| *sum -= value);
    }
    let rod_mass = SVector::from_fn(|k, _| if k == 14 { 1.0 } else { 0.0 });
    direction + rod_mass
}

/// Regressor Y at a motion; `None` at a singular pose.
///
/// ```
/// # use hexad_machine::config::Config;
/// # use hexad_core::{model::{active_forces::inverse_dynamics, fidelity::Exact, regressor::*, task::TaskState}};
/// # let machine = Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let motion = TaskState { xdd: [0.1, 0.0, 0.2, 1.0, 0.0, 2.0].into(), ..TaskState::at_rest(machine.home) }.motion();
/// let forces = regressor(&machine, &motion).unwrap() * dynamic_parameters(&machine);
/// let expected = inverse_dynamics::<Exact>(&machine, &motion).unwrap();
/// assert!((forces - nalgebra::Vector6::from(expected)).amax() < 1e-9 * forces.amax());
/// ```
///
/// `Y dynamic_parameters(machine)` equals the forces of [`Exact`](super::fidelity::Exact), up to rounding
/// times the condition of N (LU with partial pivoting, see [`super::inverse_jacobian::condition`]). The
/// function uses only geometry, gravity, reference lengths and smoothing of `machine`.
pub fn regressor(machine: &Machine, motion: &Motion) -> Option<Regressor> {
    let joints = &machine.joints;
    let [platform, axes] =
        [&joints.platform, &joints.universal_axis].map(|lanes| joints.triples.unpack_vectors(lanes));
    let directions = leg_directions(machine, &motion.pose);
    let LegMotion { length_m, rate_m_s, accel_m_s2 } = leg_motion(machine, motion);
    let map = acceleration_map(&motion.twist, &motion.acceleration);

    let mut wrenches = Regressor::zeros();
    add_platform(&mut wrenches, machine, motion, &map);
    let per_leg = length_m.into_iter().zip(rate_m_s).zip(accel_m_s2);
    for (((joint, n), u), ((length, rate), accel)) in platform.iter().zip(&directions).zip(&axes).zip(per_leg)
    {
        let arm = motion.pose.rotation * joint;
        let joint_velocity = motion.twist.linear + motion.twist.angular.cross(&arm);
        let joint_acceleration = motion.acceleration.linear + map * arm;
        let n_rate = (joint_velocity - n * rate) / length;
        let n_accel = (joint_acceleration - n * accel - n_rate * (2.0 * rate)) / length;
        let leg = LegKinematics { arm, n: *n, n_rate, n_accel, length, rate, accel };
        leg.add(&mut wrenches, machine, u);
    }

    let mut forces = leg_wrenches(machine, &motion.pose).lu().solve(&wrenches)?;
    forces.set_column(REFLECTED, &Vector6::from(accel_m_s2));
    forces.fixed_view_mut::<6, 6>(0, VISCOUS).set_diagonal(&Vector6::from(rate_m_s));
    let signs = Vector6::from(rate_m_s.map(|rate| machine.actuator.sign(rate)));
    forces.fixed_view_mut::<6, 6>(0, COULOMB).set_diagonal(&signs);
    Some(forces)
}

/// Adds columns 0..9, as wrenches about C.
fn add_platform(wrenches: &mut Regressor, machine: &Machine, motion: &Motion, map: &Matrix3<f64>) {
    let rotation = &motion.pose.rotation;
    let (omega, omega_rate) = (&motion.twist.angular, &motion.acceleration.angular);
    let proper_acceleration = motion.acceleration.linear - machine.gravity_m_s2;
    let mut columns = wrenches.column_iter_mut();
    let mut add = |torque: Vector3<f64>, force: Vector3<f64>| {
        if let Some(mut column) = columns.next() {
            column += stack(&torque, &force);
        }
    };
    add(Vector3::zeros(), proper_acceleration);
    for axis in rotation.column_iter() {
        add(axis.cross(&proper_acceleration), map * axis);
    }
    for element in SYMMETRIC_BASIS {
        let inertia = rotation * Matrix3::from(element) * rotation.transpose();
        add(inertia * omega_rate + omega.cross(&(inertia * omega)), Vector3::zeros());
    }
}

/// Basis of the symmetric matrices: elements xx, yy, zz, xy, xz, yz.
const SYMMETRIC_BASIS: [[[f64; 3]; 3]; 6] = [
    [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
];

/// One leg in motion, base axes.
struct LegKinematics {
    /// b
    arm: Vector3<f64>,
    n: Vector3<f64>,
    n_rate: Vector3<f64>,
    n_accel: Vector3<f64>,
    length: f64,
    rate: f64,
    accel: f64,
}

impl LegKinematics {
    /// Adds columns 10..18, as wrenches about C.
    fn add(&self, wrenches: &mut Regressor, machine: &Machine, universal_axis: &Vector3<f64>) {
        let Self { arm, n, n_rate, n_accel, length, rate, accel } = self;
        let g = &machine.gravity_m_s2;
        let turning = n_rate.norm_squared();
        let spin = self.spin(universal_axis);
        let quadratic = |reference: f64| n_accel * (length - reference).powi(2);
        // Q and the force along n of each parameter.
        let terms = [
            (-g, 0.0),
            (*n_accel, 0.0),
            (spin, 0.0),
            (quadratic(machine.cylinder.transverse_inertia.reference_length_m), 0.0),
            ((n_accel * *length + n_rate * (2.0 * rate) - g) * *length, accel - length * turning - g.dot(n)),
            (g - n_accel * (2.0 * length) - n_rate * (2.0 * rate), turning),
            (*n_accel, 0.0),
            (spin, 0.0),
            (quadratic(machine.rod.transverse_inertia.reference_length_m), 0.0),
        ];
        for (mut column, (q, along)) in wrenches.columns_mut(10, 9).column_iter_mut().zip(terms) {
            let force = (q - n * q.dot(n)) / *length + n * along;
            column += stack(&arm.cross(&force), &force);
        }
    }

    /// `( wx n' + (un / yy) wx' y ) x n`, see [`super::leg`].
    fn spin(&self, u: &Vector3<f64>) -> Vector3<f64> {
        let Self { n, n_rate, n_accel, .. } = self;
        let k = u.cross(n);
        let yy = k.norm_squared().max(MIN_UNIVERSAL_SINE_SQUARED);
        let (un, un_rate) = (u.dot(n), u.dot(n_rate));
        let (p, p_rate) = (n_rate.dot(&k), n_accel.dot(&k));
        let wx = un * p / yy;
        let wx_rate = (un_rate * p + un * p_rate + 2.0 * un * un_rate * wx) / yy;
        n_rate.cross(n) * wx + k * (un / yy * wx_rate)
    }
}

/// Inertia of a point of 1 kg about the origin: `|r|^2 - r r^T`.
fn point_inertia(r: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * r.norm_squared() - r * r.transpose()
}

fn stack(torque: &Vector3<f64>, force: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z)
}
