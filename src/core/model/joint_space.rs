//! Each leg in joint coordinates `q = [beta gamma theta]` (paper, eq. 25-27, 37-45, 53-87).
//!
//! The loop does not use them: [`super::leg`] gives the same forces without joint angles. They are for a comparison with the paper
//! or with another program.
//!
//! beta turns the leg about the first axis u of its universal joint, gamma about the second axis, and theta is the length L. Leg
//! axes: x = n, z the second axis of the joint. With `s = n.u`, `c = |n x u|`, all in leg axes:
//!
//! ```text
//! vB    = [ theta'   L gamma'   -L c beta' ] = J_Bv q'                                                  (25)
//! omega = [ s beta'  c beta'  gamma' ]
//! aB    = d/dt (components of vB) + omega x vB, solved for q''                                          (37)-(45)
//! r     = L - e2    mu = m1 e1 + m2 r    Ix = Ix1 + Ix2    Jt = m1 e1^2 + m2 r^2 + It1 + It2
//! M     = diag( Ix s^2 + Jt c^2,  Jt,  m2 )                                                             (55), (73)
//! C + G = [  2 (m2 r c^2 theta' + (Ix - Jt) s c gamma') beta' + mu c gz                                 (74)-(83)
//!            2 m2 r theta' gamma' - (Ix - Jt) s c beta'^2 - mu gy
//!           -m2 r (c^2 beta'^2 + gamma'^2) - m2 gx ]
//! D     = M q'' + C + G
//! phi   = -J_Bv^-T D + n (Gamma - force of the drive's own inertia and friction)                        (87)
//! ```
//!
//! M is the paper's `H^T P^-1 I P^-T H`. It is diagonal, because both links are bodies of revolution about the leg and both axes
//! of the universal joint pass through A. The spin is included, as in `force_*`.
//!
//! Undefined for a leg along u, where c = 0.

use nalgebra::{Matrix3, Vector3};

use super::LEGS;
use super::leg::MIN_UNIVERSAL_SINE_SQUARED;
use super::machine::Machine;
use super::platform::acceleration_map;
use super::rigid::Motion;

/// Dynamics of a leg in joint coordinates, in the order beta, gamma, theta. All but the second and third element of `mass_kg` are NaN for
/// a leg along the first axis of its universal joint.
///
/// ```
/// use hexad_core::model::{active_forces::inverse_dynamics, fidelity::Exact, joint_space::joint_space, task::TaskState};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let home = TaskState::at_rest(machine.home).motion();
/// let legs = joint_space(&machine, &home, &inverse_dynamics::<Exact>(&machine, &home).unwrap());
/// // At rest the legs carry the platform.
/// let carried: nalgebra::Vector3<f64> = legs.iter().map(|leg| leg.contact_force_n).sum();
/// assert!((carried + machine.gravity_m_s2 * machine.platform.mass_kg).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegDynamics {
    /// q'' \[rad/s^2, rad/s^2, m/s^2\].
    pub accel: Vector3<f64>,
    /// Diagonal of M \[kg m^2, kg m^2, kg\].
    pub mass: Vector3<f64>,
    /// C + G \[N m, N m, N\].
    pub bias: Vector3<f64>,
    /// phi, force of the leg on the platform at B, base axes \[N\].
    pub contact_force_n: Vector3<f64>,
}

/// Dynamics of the six legs for a motion and its actuator forces Gamma \[N\].
pub fn joint_space(machine: &Machine, motion: &Motion, forces_n: &[f64; LEGS]) -> [LegDynamics; LEGS] {
    let joints = &machine.joints;
    let [bases, platforms, axes] = [&joints.base, &joints.platform, &joints.universal_axis]
        .map(|lanes| joints.triples.unpack_vectors(lanes));
    let friction = machine.actuator.viscous_friction_n_s_m.iter().zip(&machine.actuator.coulomb_friction_n);
    let mut legs = [LegDynamics::default(); LEGS];
    let places = bases.iter().zip(&platforms).zip(&axes);
    for ((leg, ((base, platform), u)), (force, friction)) in
        legs.iter_mut().zip(places).zip(forces_n.iter().zip(friction))
    {
        *leg = LegDynamics::new(machine, motion, [base, platform, u], *force, friction);
    }
    legs
}

impl LegDynamics {
    fn new(
        machine: &Machine,
        motion: &Motion,
        [base, platform, u]: [&Vector3<f64>; 3],
        force: f64,
        (viscous, coulomb): (&f64, &f64),
    ) -> Self {
        let arm = motion.pose.rotation * platform;
        let span = motion.pose.position + arm - base;
        let length = span.norm();
        let n = span / length;
        let normal = n.cross(u);
        let is_defined = normal.norm_squared() >= MIN_UNIVERSAL_SINE_SQUARED;
        let (s, c) = (n.dot(u), if is_defined { normal.norm() } else { f64::NAN });
        let z = normal / c;
        let axes = Matrix3::from_columns(&[n, z.cross(&n), z]);

        let (twist, acceleration) = (&motion.twist, &motion.acceleration);
        let velocity = axes.tr_mul(&(twist.linear + twist.angular.cross(&arm)));
        let joint_accel = axes.tr_mul(&(acceleration.linear + acceleration_map(twist, acceleration) * arm));
        let rate = Vector3::new(-velocity.z / (length * c), velocity.y / length, velocity.x);
        let relative = joint_accel - Vector3::new(s * rate.x, c * rate.x, rate.y).cross(&velocity);
        let accel = Vector3::new(
            -(relative.z + (c * rate.z - length * s * rate.y) * rate.x) / (length * c),
            (relative.y - rate.z * rate.y) / length,
            relative.x,
        );

        let (cylinder, rod, actuator) = (&machine.cylinder, &machine.rod, &machine.actuator);
        let (m2, r) = (rod.mass_kg, length - rod.center_of_mass_m);
        let moment = cylinder.mass_kg * cylinder.center_of_mass_m + m2 * r;
        let axial = cylinder.axial_inertia_kg_m2 + rod.axial_inertia_kg_m2;
        let transverse = cylinder.mass_kg * cylinder.center_of_mass_m * cylinder.center_of_mass_m
            + m2 * r * r
            + cylinder.transverse_inertia.at(length)
            + rod.transverse_inertia.at(length);
        let mass = Vector3::new(axial * s * s + transverse * c * c, transverse, m2);
        let (g, turn) = (axes.tr_mul(&machine.gravity_m_s2), (axial - transverse) * s * c);
        let bias = Vector3::new(
            2.0 * (m2 * r * c * c * rate.z + turn * rate.y) * rate.x + moment * c * g.z,
            2.0 * m2 * r * rate.z * rate.y - turn * rate.x * rate.x - moment * g.y,
            -m2 * r * (c * c * rate.x * rate.x + rate.y * rate.y) - m2 * g.x,
        );

        let d = mass.component_mul(&accel) + bias;
        let end_load = Vector3::new(d.z, d.y / length, -d.x / (length * c));
        let drive = actuator.reflected_mass_kg * accel.z + viscous * rate.z + coulomb * actuator.sign(rate.z);
        Self { accel, mass, bias, contact_force_n: n * (force - drive) - axes * end_load }
    }
}
