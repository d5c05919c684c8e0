//! One leg as a serial robot (paper, eq. 13-33, 53, 73-87), all six alike.
//!
//! The paper writes the leg's dynamics in joint coordinates, `D_i = M_i Qdd_i + C_i + G_i` (87), and takes
//! them to the platform by `J_Bv^-T`. The closed vector form below is the same force without the joint
//! angles: the moment balance of the leg about A, and the force balance of the rod along n.
//!
//! ```text
//! r   = L - e2                         Jt = m1 e1^2 + m2 r^2 + It1 + It2
//! Q   = Jt n'' + 2 m2 r L' n' - (m1 e1 + m2 r) g                            moment balance about A
//! leg spin: u the universal joint's first axis, un = u.n, y = u - un n, Ix = Ix1 + Ix2
//!     p   = (n x n').u           p'  = (n x n'').u                  (the other terms vanish)
//!     yy  = 1 - un^2             yy' = -2 un un'
//!     wx  = un p / yy            wx' = (un' p + un p' + 2 un^2 un' p / yy) / yy
//!     Q  += Ix ( wx n' + (un / yy) wx' y ) x n
//! F   = (Q - (Q.n) n) / L + m2 (L'' - r |n'|^2 - g.n) n
//! ```
//!
//! F is what the platform exerts on the leg at B, without the actuator's force. The paper leaves the spin
//! out: (74)-(82) give the leg no angular velocity about n, though the universal joint forces one on it.
//! That is exact only for `Ix = 0`; the effect is 1e-5 to 1e-2 of the force, larger near `u || n`, where
//! the spin itself is singular. [`YY_MIN`] keeps the arithmetic finite there.

use fearless_simd::Simd;

use super::inverse_geometry::{LegAcceleration, LegGeometry, LegVelocity};
use super::lanes::{Eight, Lanes3};
use super::machine::{Machine, TransverseInertia};

/// What a dynamic model includes; known at compile time, so that a term left out costs nothing.
pub trait Model {
    /// Name on the command line.
    const NAME: &'static str;
    /// Spin of the legs about their own axes.
    const SPIN: bool;
}

/// Every term.
#[derive(Clone, Copy, Debug)]
pub struct Exact;

/// The paper's model: rigid legs that do not spin about their own axes. Allowed for thin legs.
#[derive(Clone, Copy, Debug)]
pub struct RigidLegs;

impl Model for Exact {
    const NAME: &'static str = "exact";
    const SPIN: bool = true;
}

impl Model for RigidLegs {
    const NAME: &'static str = "rigid-legs";
    const SPIN: bool = false;
}

/// Smallest `|u x n|^2`: a leg within 1e-6 rad of its universal joint's first axis.
const YY_MIN: f64 = 1e-12;

/// F per leg \[N\], base axes. `gravity` is g in base axes, one copy per leg.
#[inline(always)]
pub(super) fn leg_reaction<S: Simd, V: Eight<S>, M: Model>(
    simd: S,
    machine: &Machine,
    legs: &LegGeometry<V>,
    velocity: &LegVelocity<V>,
    acceleration: &LegAcceleration<V>,
) -> Lanes3<V> {
    let splat = |value: f64| V::splat(simd, value);
    let (cylinder, rod) = (&machine.cylinder, &machine.rod);
    let gravity = Lanes3::splat(simd, &machine.gravity);
    let (n, n_rate, n_accel) = (legs.direction, velocity.direction, acceleration.direction);
    let m1_e1 = cylinder.mass * cylinder.center_of_mass;
    let m2 = splat(rod.mass);

    let r = legs.length - splat(rod.center_of_mass);
    let m2_r = m2 * r;
    let jt = m2_r.mul_add(r, splat(m1_e1 * cylinder.center_of_mass))
        + transverse_inertia(simd, &cylinder.transverse_inertia, legs.length)
        + transverse_inertia(simd, &rod.transverse_inertia, legs.length);
    let mut q = (n_accel * jt)
        .plus_scaled(m2_r * (velocity.rate + velocity.rate), n_rate)
        .plus_scaled(-(m2_r + splat(m1_e1)), gravity);
    if M::SPIN {
        q = q + spin_moment(simd, machine, n, n_rate, n_accel);
    }
    let q_transverse = q.plus_scaled(-q.dot(n), n);
    let along = m2 * (acceleration.accel - r * n_rate.dot(n_rate) - gravity.dot(n));
    (q_transverse * legs.inverse_length).plus_scaled(along, n)
}

/// `Ix ( wx n' + (un / yy) wx' y ) x n`
#[inline(always)]
fn spin_moment<S: Simd, V: Eight<S>>(
    simd: S,
    machine: &Machine,
    n: Lanes3<V>,
    n_rate: Lanes3<V>,
    n_accel: Lanes3<V>,
) -> Lanes3<V> {
    let ix = V::splat(simd, machine.cylinder.axial_inertia + machine.rod.axial_inertia);
    let u = Lanes3::<V>::load(simd, &machine.joints.universal_axis);
    let un = u.dot(n);
    let un_rate = u.dot(n_rate);
    let y = u.plus_scaled(-un, n);
    let inverse_yy = V::splat(simd, 1.0) / y.dot(y).max(V::splat(simd, YY_MIN));
    let p = n.cross(n_rate).dot(u);
    let p_rate = n.cross(n_accel).dot(u);
    let spin = un * p * inverse_yy;
    let spin_un = spin * un;
    let spin_rate = un_rate.mul_add(p + spin_un + spin_un, un * p_rate) * inverse_yy;
    (n_rate * spin).plus_scaled(un * inverse_yy * spin_rate, y).cross(n) * ix
}

#[inline(always)]
fn transverse_inertia<S: Simd, V: Eight<S>>(simd: S, inertia: &TransverseInertia, length: V) -> V {
    let d = length - V::splat(simd, inertia.reference_length);
    (d * V::splat(simd, inertia.quadratic)).mul_add(d, V::splat(simd, inertia.constant))
}
