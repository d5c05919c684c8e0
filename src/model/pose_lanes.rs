//! Inverse dynamics of many motions: eight at once, one per lane, leg after leg.
//!
//! The formulas are those of one motion, by the same code: [`super::inverse_geometry`] and [`super::leg`] do not know whether a
//! lane is a leg or a motion. Here no lane is padding and none waits for another. The platform and the factorization of N, which
//! exchange values between the lanes of one motion, are written out:
//!
//! ```text
//! torque = R (I_G a + w x I_G w) + c x f        w = R^T omega,  a = R^T omega',  f = m (v' + S c - g)
//! N = [ M_A  M_B ; D_A  D_B ]                   blocks as in `super::factorization`, columns in lane order
//! ```
//!
//! A motion whose blocks are nearly singular is evaluated alone, by LU.

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use nalgebra::Vector3;

use super::LEGS;
use super::active_forces::InverseDynamics;
use super::factorization::are_regular_blocks;
use super::fidelity::{Fidelity, LegInertia, ModelTerms, with_terms};
use super::inverse_geometry::LegGeometry;
use super::lanes3::Lanes3;
use super::leg::{LegConstants, LegReaction};
use super::rigid::Motion;
use super::triples::LegLanes;

/// Motions that are evaluated at once.
const LANES: usize = 8;

/// What differs from leg to leg.
#[derive(Clone, Copy)]
struct Joint {
    base: Vector3<f64>,
    platform: Vector3<f64>,
    universal_axis: Vector3<f64>,
    viscous_friction: f64,
    coulomb_friction: f64,
}

/// Column of N, and the load along the leg.
#[derive(Clone, Copy)]
struct Column<S: Simd> {
    moment: Lanes3<f64x8<S>>,
    direction: Lanes3<f64x8<S>>,
    axial: f64x8<S>,
}

/// Columns of a 3 x 3 matrix in each lane.
#[derive(Clone, Copy)]
struct Matrix<S: Simd>([Lanes3<f64x8<S>>; 3]);

/// Eight motions, one per lane.
struct Motions<S: Simd> {
    rotation: Matrix<S>,
    position: Lanes3<f64x8<S>>,
    angular_velocity: Lanes3<f64x8<S>>,
    velocity: Lanes3<f64x8<S>>,
    angular_acceleration: Lanes3<f64x8<S>>,
    acceleration: Lanes3<f64x8<S>>,
}

impl InverseDynamics {
    /// Actuator forces Gamma \[N\] of each motion, to the same place in `forces`; `None` at singular poses. Elements
    /// beyond the shorter slice are left as they are.
    ///
    /// They differ from those of [`InverseDynamics::forces_of`] by rounding.
    pub fn forces_of_all(&self, fidelity: Fidelity, motions: &[Motion], forces: &mut [Option<[f64; LEGS]>]) {
        with_terms!(fidelity, M => self.write_forces::<M>(motions, forces));
    }

    fn write_forces<M: ModelTerms>(&self, motions: &[Motion], forces: &mut [Option<[f64; LEGS]>]) {
        let constants = self.leg_constants().of_one_leg();
        let joints = self.joints_in_lane_order();
        dispatch!(self.machine().level, simd => {
            for (motions, forces) in motions.chunks(LANES).zip(forces.chunks_mut(LANES)) {
                let eight = core::array::from_fn(|k| motions.get(k).unwrap_or(&motions[0]));
                let (lanes, are_regular) = self.forces_in_lanes::<_, M>(simd, &constants, &joints, &eight);
                let [a, b, c, d, e, f] = lanes.map(|lane| lane.to_array());
                for (k, (force, motion)) in forces.iter_mut().zip(motions).enumerate() {
                    *force = if are_regular[k] {
                        Some(self.joints().triples.unpack(&LegLanes([a[k], b[k], c[k], 0.0, d[k], e[k], f[k], 0.0])))
                    } else {
                        self.forces::<M>(motion)
                    };
                }
            }
        });
    }

    /// Legs in the order of their lanes.
    fn joints_in_lane_order(&self) -> [Joint; LEGS] {
        let order = |LegLanes([a, b, c, _, d, e, f, _]): &LegLanes| [*a, *b, *c, *d, *e, *f];
        let vectors = |[x, y, z]: &[LegLanes; 3]| {
            let (x, y, z) = (order(x), order(y), order(z));
            core::array::from_fn::<_, LEGS, _>(|k| Vector3::new(x[k], y[k], z[k]))
        };
        let joints = &self.machine().joints;
        let [base, platform, axis] = [&joints.base, &joints.platform, &joints.universal_axis].map(vectors);
        let [viscous, coulomb] = self.friction().map(order);
        core::array::from_fn(|k| Joint {
            base: base[k],
            platform: platform[k],
            universal_axis: axis[k],
            viscous_friction: viscous[k],
            coulomb_friction: coulomb[k],
        })
    }

    /// Forces in lane order, and in which lanes they are valid.
    #[inline(always)]
    fn forces_in_lanes<S: Simd, M: ModelTerms>(
        &self,
        simd: S,
        constants: &LegConstants,
        joints: &[Joint; LEGS],
        motions: &[&Motion; LANES],
    ) -> ([f64x8<S>; LEGS], [bool; LANES]) {
        let motions = Motions::load(simd, motions);
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        // Terms that the fidelity omits are evaluated as for a platform at rest.
        let omega = if M::VELOCITY { motions.angular_velocity } else { zero };
        let [turning, linear] =
            if M::ACCELERATION { [motions.angular_acceleration, motions.acceleration] } else { [zero, zero] };
        let acceleration_of =
            |arm: Lanes3<f64x8<S>>| linear + turning.cross(arm) + omega.cross(omega.cross(arm));

        let platform = &self.machine().platform;
        let arm = motions.rotation.times_vector(simd, &platform.center_of_mass);
        let gravity = Lanes3::splat(simd, &self.machine().gravity);
        let mut force = (acceleration_of(arm) - gravity) * f64x8::splat(simd, platform.mass);
        let mut torque = arm.cross(force);
        if M::ACCELERATION {
            let (w, a) =
                (motions.rotation.transposed_times(omega), motions.rotation.transposed_times(turning));
            let inertia = |v: Lanes3<f64x8<S>>| v.transformed(simd, &platform.inertia);
            torque = torque + motions.rotation.times(inertia(a) + w.cross(inertia(w)));
        }

        let mut columns = [Column { moment: zero, direction: zero, axial: f64x8::splat(simd, 0.0) }; LEGS];
        for (joint, column) in joints.iter().zip(&mut columns) {
            let arm = motions.rotation.times_vector(simd, &joint.platform);
            let leg = LegGeometry::between(simd, Lanes3::splat(simd, &joint.base), motions.position, arm);
            let velocity = leg.velocity_in_lanes(motions.angular_velocity, motions.velocity);
            let joint_acceleration = acceleration_of(arm);
            let universal_axis = Lanes3::splat(simd, &joint.universal_axis);
            let reaction =
                LegReaction::new::<M>(simd, constants, universal_axis, &leg, &velocity, joint_acceleration);
            if M::LEGS != LegInertia::Massless {
                force = force + reaction.transverse;
                torque = torque + arm.cross(reaction.transverse);
            }
            let mut axial = reaction.axial;
            if M::ACCELERATION {
                let mut accel = leg.direction.dot(joint_acceleration);
                if M::VELOCITY {
                    accel = leg.accel(&velocity, joint_acceleration);
                }
                let friction =
                    [joint.viscous_friction, joint.coulomb_friction].map(|value| f64x8::splat(simd, value));
                axial += self.drive_force(simd, friction, velocity.rate, accel);
            }
            *column = Column { moment: arm.cross(leg.direction), direction: leg.direction, axial };
        }
        balanced(simd, self.machine().joints.radius_cubed, &columns, torque, force)
    }
}

/// Returns `Gamma + axial` with `N Gamma = W`, and in which lanes the blocks are regular.
#[inline(always)]
fn balanced<S: Simd>(
    simd: S,
    radius_cubed: f64,
    columns: &[Column<S>; LEGS],
    torque: Lanes3<f64x8<S>>,
    force: Lanes3<f64x8<S>>,
) -> ([f64x8<S>; LEGS], [bool; LANES]) {
    let one = f64x8::splat(simd, 1.0);
    let [a0, a1, a2, b0, b1, b2] = columns;
    let adjugate = adjugate([a0.direction, a1.direction, a2.direction]);
    let d_a = a0.direction.dot(adjugate[0]);
    let inverse_d_a = one / d_a;
    let [i0, i1, i2] = [adjugate[0] * inverse_d_a, adjugate[1] * inverse_d_a, adjugate[2] * inverse_d_a];
    // Rows of X for one leg of B, and its column of S.
    let eliminated = |b: &Column<S>| {
        let x = [i0.dot(b.direction), i1.dot(b.direction), i2.dot(b.direction)];
        let s = b
            .moment
            .minus_scaled(x[0], a0.moment)
            .minus_scaled(x[1], a1.moment)
            .minus_scaled(x[2], a2.moment);
        (x, s)
    };
    let ((x0, s0), (x1, s1), (x2, s2)) = (eliminated(b0), eliminated(b1), eliminated(b2));
    let [c0, c1, c2] = self::adjugate([s0, s1, s2]);
    let d_s = s0.dot(c0);
    let inverse_d_s = one / d_s;

    let g = [i0.dot(force), i1.dot(force), i2.dot(force)];
    let rest =
        torque.minus_scaled(g[0], a0.moment).minus_scaled(g[1], a1.moment).minus_scaled(g[2], a2.moment);
    let [h0, h1, h2] = [c0.dot(rest) * inverse_d_s, c1.dot(rest) * inverse_d_s, c2.dot(rest) * inverse_d_s];
    let of_a = |k: usize, column: &Column<S>| g[k] - h0 * x0[k] - h1 * x1[k] - h2 * x2[k] + column.axial;
    let forces = [of_a(0, a0), of_a(1, a1), of_a(2, a2), h0 + b0.axial, h1 + b1.axial, h2 + b2.axial];
    let (d_a, d_s) = (d_a.to_array(), d_s.to_array());
    (forces, core::array::from_fn(|k| are_regular_blocks(d_a[k], d_s[k], radius_cubed)))
}

/// Cross products of the two other vectors, in cyclic order.
#[inline(always)]
fn adjugate<S: Simd>([a, b, c]: [Lanes3<f64x8<S>>; 3]) -> [Lanes3<f64x8<S>>; 3] {
    [b.cross(c), c.cross(a), a.cross(b)]
}

impl<S: Simd> Motions<S> {
    #[inline(always)]
    fn load(simd: S, motions: &[&Motion; LANES]) -> Self {
        let vector = |of: fn(&Motion) -> Vector3<f64>| {
            let vectors = motions.map(of);
            Lanes3 {
                x: f64x8::load_array(simd, vectors.map(|v| v.x)),
                y: f64x8::load_array(simd, vectors.map(|v| v.y)),
                z: f64x8::load_array(simd, vectors.map(|v| v.z)),
            }
        };
        Self {
            rotation: Matrix([
                vector(|m| m.pose.rotation.column(0).into()),
                vector(|m| m.pose.rotation.column(1).into()),
                vector(|m| m.pose.rotation.column(2).into()),
            ]),
            position: vector(|m| m.pose.position),
            angular_velocity: vector(|m| m.twist.angular),
            velocity: vector(|m| m.twist.linear),
            angular_acceleration: vector(|m| m.acceleration.angular),
            acceleration: vector(|m| m.acceleration.linear),
        }
    }
}

impl<S: Simd> Matrix<S> {
    #[inline(always)]
    fn times(&self, v: Lanes3<f64x8<S>>) -> Lanes3<f64x8<S>> {
        let [x, y, z] = self.0;
        (z * v.z).plus_scaled(v.y, y).plus_scaled(v.x, x)
    }

    /// Product with the same vector in all lanes.
    #[inline(always)]
    fn times_vector(&self, simd: S, v: &Vector3<f64>) -> Lanes3<f64x8<S>> {
        self.times(Lanes3::splat(simd, v))
    }

    #[inline(always)]
    fn transposed_times(&self, v: Lanes3<f64x8<S>>) -> Lanes3<f64x8<S>> {
        let [x, y, z] = self.0;
        Lanes3 { x: x.dot(v), y: y.dot(v), z: z.dot(v) }
    }
}
