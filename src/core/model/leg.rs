//! Leg as a serial robot (paper, eq. 13-33, 53, 73-87); all six legs are alike.
//!
//! The paper writes the dynamics of a leg in joint coordinates, `D_i = M_i Qdd_i + C_i + G_i` (87), and
//! transforms them to the platform by `J_Bv^-T` ([`super::joint_space`]). The vector form below is the same force without joint
//! angles. The moment balance of the leg about A gives the transverse part of F, and the force balance of the
//! rod gives the axial part.
//!
//! ```text
//! r   = L - e2                         Jt = m1 e1^2 + m2 r^2 + It1 + It2
//! Q   = Jt n'' + 2 m2 r L' n' - (m1 e1 + m2 r) g  (+ spin)                  moment balance about A
//! F   = (Q - (Q.n) n) / L  +  m2 (L'' - r |n'|^2 - g.n) n
//! ```
//!
//! F is the force of the platform on the leg at B, without the actuator force. In terms of the joint
//! acceleration `aB`, with `proj(w) = w - (w.n) n` and `proj(n'') = (proj(aB) - 2 L' n') / L`:
//!
//! ```text
//! transverse = proj(j aB - mu g) + 2 L' (m2 r / L - j) n' + spin / L       j = Jt / L^2,  mu = (m1 e1 + m2 r) / L
//! axial      = m2 (aB.n + e2 |n'|^2 - g.n)
//! ```
//!
//! Spin: the universal joint, with first axis u, imposes an angular velocity wx about n on the leg.
//!
//! ```text
//! k  = u x n    un = u.n    un' = u.n'    yy = k.k    p = n'.k    p' = n''.k = (aB.k - 2 L' p) / L
//! wx = un p / yy        wx' = (un' p + un p' + 2 un un' wx) / yy
//! spin = (Ix1 + Ix2) ( wx n' x n + (un / yy) wx' k )
//! ```
//!
//! The paper neglects the spin: (74)-(82) give the leg no angular velocity about n. This is exact only for
//! legs without axial inertia. The effect is 1e-5 to 1e-2 of the force. It is larger near `u || n`, where the
//! spin is singular; `MIN_UNIVERSAL_SINE_SQUARED` keeps the arithmetic finite there.

use super::LEGS;
use super::fidelity::{LegInertia, ModelTerms};
use super::inverse_geometry::{LegGeometry, LegVelocity, leg_lengths};
use super::lanes::LaneArithmetic as _;
use super::lanes3::Lanes3;
use super::machine::Machine;
use super::triples::{LegLanes, Triples};
use fearless_simd::{Simd, f64x8, prelude::*};

/// Smallest `|u x n|^2` used as a divisor: a leg within 1e-6 rad of the first axis of its universal joint.
pub(super) const MIN_UNIVERSAL_SINE_SQUARED: f64 = 1e-12;

/// Constants of the legs, in lanes.
///
/// The platform's mass is one more point, in the first lane of padding, with the force `m (aB - g)`. Its arm
/// is the centre of mass, `j` and `mu` equal m, and `legs_only` excludes it from the projection. See
/// [`super::platform`].
#[derive(Clone, Debug)]
pub(super) struct LegConstants {
    /// Coefficients of `Jt = jt[0] L^2 + jt[1] L + jt[2]`; the transverse inertias are quadratic in L as
    /// well.
    jt: [LegLanes; 3],
    /// m2 \[kg\], and `m1 e1 - m2 e2` \[kg m\].
    rod_mass: LegLanes,
    first_moment: LegLanes,
    /// `m2 e2` \[kg m\].
    rod_moment: LegLanes,
    /// `Ix1 + Ix2` \[kg m^2\].
    axial_inertia: LegLanes,
    /// 1 for legs, 0 for padding.
    legs_only: LegLanes,
    /// Mass of a leg at B in the lumped model; the platform's mass in the padding.
    lumped_mass: LegLanes,
    /// The platform's mass in the padding, 0 for legs.
    platform_mass: LegLanes,
}

impl LegConstants {
    pub fn new(machine: &Machine) -> Self {
        let (cylinder, rod) = (&machine.cylinder, &machine.rod);
        let (m1, e1, m2, e2) =
            (cylinder.mass_kg, cylinder.center_of_mass_m, rod.mass_kg, rod.center_of_mass_m);
        let (it1, it2) = (&cylinder.transverse_inertia, &rod.transverse_inertia);
        let legs = Triples::uniform;
        let linear =
            m2 * e2 + it1.quadratic_kg * it1.reference_length_m + it2.quadratic_kg * it2.reference_length_m;
        let constant = m1 * e1 * e1
            + m2 * e2 * e2
            + it1.constant_kg_m2
            + it2.constant_kg_m2
            + it1.quadratic_kg * it1.reference_length_m * it1.reference_length_m
            + it2.quadratic_kg * it2.reference_length_m * it2.reference_length_m;
        let mass = machine.platform.mass_kg;
        Self {
            jt: [
                legs(m2 + it1.quadratic_kg + it2.quadratic_kg, mass),
                legs(-2.0 * linear, 0.0),
                legs(constant, 0.0),
            ],
            rod_mass: legs(m2, mass),
            first_moment: legs(m1 * e1 - m2 * e2, 0.0),
            rod_moment: legs(m2 * e2, 0.0),
            axial_inertia: legs(cylinder.axial_inertia_kg_m2 + rod.axial_inertia_kg_m2, 0.0),
            legs_only: legs(1.0, 0.0),
            lumped_mass: legs(lumped_mass(machine), mass),
            platform_mass: legs(0.0, mass),
        }
    }

    /// Constants of one leg in all lanes, without the platform.
    pub fn of_one_leg(&self) -> Self {
        let leg = |lanes: &LegLanes| LegLanes([lanes.0[0]; 8]);
        Self {
            jt: self.jt.each_ref().map(leg),
            rod_mass: leg(&self.rod_mass),
            first_moment: leg(&self.first_moment),
            rod_moment: leg(&self.rod_moment),
            axial_inertia: leg(&self.axial_inertia),
            legs_only: leg(&self.legs_only),
            lumped_mass: leg(&self.lumped_mass),
            platform_mass: leg(&self.platform_mass),
        }
    }
}

/// Mass at B in the lumped model: `(m1 e1 + m2 (L - e2)) / L`, with the mean leg length at home. With the
/// rest of the leg's mass at A, it has the mass and the centre of mass of the leg.
fn lumped_mass(machine: &Machine) -> f64 {
    let (cylinder, rod) = (&machine.cylinder, &machine.rod);
    let length = leg_lengths(machine, &machine.home_pose()).iter().sum::<f64>() / LEGS as f64;
    (cylinder.mass_kg * cylinder.center_of_mass_m + rod.mass_kg * (length - rod.center_of_mass_m)) / length
}

/// Force F of the platform on each leg \[N\], base axes, split in two parts.
pub(super) struct ForceOnLeg<S: Simd> {
    /// Part normal to the leg.
    pub transverse: Lanes3<f64x8<S>>,
    /// Part along n.
    pub axial_n: f64x8<S>,
}

impl<S: Simd> ForceOnLeg<S> {
    /// Evaluates the force; `[joint_acceleration, gravity]` are aB and g.
    #[inline(always)]
    pub fn new<M: ModelTerms>(
        simd: S,
        constants: &LegConstants,
        universal_axis: Lanes3<f64x8<S>>,
        legs: &LegGeometry<S>,
        velocity: &LegVelocity<S>,
        [joint_acceleration, gravity]: [Lanes3<f64x8<S>>; 2],
    ) -> Self {
        let load = |lanes: &LegLanes| lanes.load(simd);
        if M::LEGS != LegInertia::Links {
            // Points at B, including the platform's point: no projection.
            let mass =
                if M::LEGS == LegInertia::Lumped { &constants.lumped_mass } else { &constants.platform_mass };
            return Self {
                transverse: (joint_acceleration - gravity) * load(mass),
                axial_n: f64x8::splat(simd, 0.0),
            };
        }
        let (n, n_rate, length, inverse_length) =
            (legs.direction, velocity.direction, legs.length_m, legs.inverse_length_per_m);
        let [jt2, jt1, jt0] = constants.jt.each_ref().map(load);
        let (m2, m2_e2) = (load(&constants.rod_mass), load(&constants.rod_moment));

        let j = jt2.fused_mul_add(length, jt1).fused_mul_add(length, jt0) * inverse_length * inverse_length;
        let mu = m2.fused_mul_add(length, load(&constants.first_moment)) * inverse_length;
        let mut transverse = (joint_acceleration * j).minus_scaled(mu, gravity);
        if M::VELOCITY {
            let m2_r_over_l = m2 - m2_e2 * inverse_length;
            let twice_rate = velocity.rate_m_s + velocity.rate_m_s;
            transverse = transverse.plus_scaled(twice_rate * (m2_r_over_l - j), n_rate);
        }
        if M::SPIN {
            let ix_over_l = load(&constants.axial_inertia) * inverse_length;
            transverse = spin(universal_axis, legs, velocity, joint_acceleration, ix_over_l, transverse);
        }
        // n' and the spin are already normal to n: projecting them as well costs nothing.
        transverse = transverse.minus_scaled(transverse.dot(n) * load(&constants.legs_only), n);
        let mut axial_n = m2 * (joint_acceleration - gravity).dot(n);
        if M::VELOCITY {
            axial_n = m2_e2.fused_mul_add(n_rate.dot(n_rate), axial_n);
        }
        Self { transverse, axial_n }
    }
}

/// Forces of the platform on each leg at its joint, in base axes: the part normal to the leg, and along it.
pub(super) struct JointForces<S: Simd> {
    pub transverse: Lanes3<f64x8<S>>,
    pub axial_n: f64x8<S>,
}

impl LegConstants {
    /// Forces per unit of the acceleration of the joint along x, y and z, from rest. With `n' = 0` the force
    /// is `j proj(aB) + Ix / L^2 (un / yy)^2 (aB.k) k` and `m2 aB.n`.
    #[inline(always)]
    pub fn joint_masses<S: Simd>(
        &self,
        simd: S,
        machine: &Machine,
        legs: &LegGeometry<S>,
    ) -> [JointForces<S>; 3] {
        let load = |lanes: &LegLanes| lanes.load(simd);
        let (n, square) = (legs.direction, legs.inverse_length_per_m * legs.inverse_length_per_m);
        let [jt2, jt1, jt0] = self.jt.each_ref().map(load);
        let j = jt2.fused_mul_add(legs.length_m, jt1).fused_mul_add(legs.length_m, jt0) * square;
        let u = Lanes3::load(simd, &machine.joints.universal_axis);
        let k = u.cross(n);
        let un_over_yy = u.dot(n) / k.dot(k).max(f64x8::splat(simd, MIN_UNIVERSAL_SINE_SQUARED));
        let spin = load(&self.axial_inertia) * square * un_over_yy * un_over_yy;
        let (along, m2) = (j * load(&self.legs_only), load(&self.rod_mass));
        let mut x = (k * (spin * k.x)).minus_scaled(along * n.x, n);
        let mut y = (k * (spin * k.y)).minus_scaled(along * n.y, n);
        let mut z = (k * (spin * k.z)).minus_scaled(along * n.z, n);
        (x.x, y.y, z.z) = (x.x + j, y.y + j, z.z + j);
        [
            JointForces { transverse: x, axial_n: m2 * n.x },
            JointForces { transverse: y, axial_n: m2 * n.y },
            JointForces { transverse: z, axial_n: m2 * n.z },
        ]
    }
}

/// Returns `sum + Ix / L ( wx n' x n + (un / yy) wx' k )`.
#[inline(always)]
fn spin<S: Simd>(
    u: Lanes3<f64x8<S>>,
    legs: &LegGeometry<S>,
    velocity: &LegVelocity<S>,
    joint_acceleration: Lanes3<f64x8<S>>,
    ix_over_l: f64x8<S>,
    sum: Lanes3<f64x8<S>>,
) -> Lanes3<f64x8<S>> {
    let (n, n_rate) = (legs.direction, velocity.direction);
    let simd = n.x.simd;
    let k = u.cross(n);
    let inverse_yy = f64x8::splat(simd, 1.0) / k.dot(k).max(f64x8::splat(simd, MIN_UNIVERSAL_SINE_SQUARED));
    let (un, un_rate, p) = (u.dot(n), u.dot(n_rate), n_rate.dot(k));
    let twice_rate = velocity.rate_m_s + velocity.rate_m_s;
    let p_rate = (joint_acceleration.dot(k) - twice_rate * p) * legs.inverse_length_per_m;
    let un_over_yy = un * inverse_yy;
    let wx = un_over_yy * p;
    let wx_un = wx * un;
    let wx_rate = un_rate.fused_mul_add(p + wx_un + wx_un, un * p_rate) * inverse_yy;
    sum.plus_scaled(ix_over_l * wx, n_rate.cross(n)).plus_scaled(ix_over_l * un_over_yy * wx_rate, k)
}
