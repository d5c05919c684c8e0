//! Inverse dynamics of many motions: eight at once, one per lane, leg after leg.
//!
//! The legs are evaluated by the same code as in one motion: [`super::inverse_geometry`] and [`super::leg`] do not know whether
//! a lane is a leg or a motion. Here no lane is padding and none waits for another. The platform and the factorization of N, which
//! exchange values between the lanes of one motion, are written out:
//!
//! ```text
//! torque = R (I_G a + w x I_G w) + c x f        w = R^T omega,  a = R^T omega',  f = m (v' + S c - g)
//! N = [ M_A  M_B ; D_A  D_B ]                   blocks as in `super::factorization`, columns in lane order
//! ```
//!
//! A motion whose blocks are nearly singular is evaluated alone, by LU.
//!
//! Measured (2026-11-27, AMD EPYC, AVX2, exact model): 0.71 to 0.78 of the time with legs in lanes, 690 instead of 980 instructions.
//! Vectors of four motions, which fill one register of AVX2, took as long: fewer values leave the registers, but the
//! divisions of one half no longer hide behind the other.

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
use super::triples::{LegLanes, Triples};

/// Motions that are evaluated at once.
const LANES: usize = 8;

/// What differs from leg to leg.
#[derive(Clone, Copy, Default)]
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

impl<S: Simd> Column<S> {
    #[inline(always)]
    fn zero(simd: S) -> Self {
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        Self { moment: zero, direction: zero, axial: zero.x }
    }
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
    /// [`InverseDynamics::forces_of`] differs by rounding.
    pub fn forces_of_all(&self, fidelity: Fidelity, motions: &[Motion], forces: &mut [Option<[f64; LEGS]>]) {
        with_terms!(fidelity, M => self.write_forces::<M>(motions, forces));
    }

    fn write_forces<M: ModelTerms>(&self, motions: &[Motion], forces: &mut [Option<[f64; LEGS]>]) {
        let constants = self.leg_constants().of_one_leg();
        let joints = self.joints_in_lane_order();
        dispatch!(self.machine().level, simd => {
            let mut columns = [Column::zero(simd); LEGS];
            for (motions, forces) in motions.chunks(LANES).zip(forces.chunks_mut(LANES)) {
                let Some(first) = motions.first() else { continue };
                let padded: [Motion; LANES];
                let eight = if let Some(eight) = motions.first_chunk() {
                    eight
                } else {
                    padded = core::array::from_fn(|lane| *motions.get(lane).unwrap_or(first));
                    &padded
                };
                let ([a, b, c, d, e, f], [d_a, d_s]) =
                    self.forces_in_lanes::<_, M>(simd, &constants, &joints, eight, &mut columns);
                let lanes = a.into_iter().zip(b).zip(c).zip(d.into_iter().zip(e).zip(f));
                let lanes = lanes.zip(d_a.into_iter().zip(d_s));
                for ((force, motion), ((((a, b), c), ((d, e), f)), (d_a, d_s))) in forces.iter_mut().zip(motions).zip(lanes) {
                    *force = if are_regular_blocks(d_a, d_s, self.joints().radius_cubed) {
                        Some(self.joints().triples.unpack(&LegLanes([a, b, c, 0.0, d, e, f, 0.0])))
                    } else {
                        self.forces::<M>(motion)
                    };
                }
            }
        });
    }

    /// Legs in the order of their lanes.
    fn joints_in_lane_order(&self) -> [Joint; LEGS] {
        let joints = &self.machine().joints;
        let [base, platform, axis] = [&joints.base, &joints.platform, &joints.universal_axis]
            .map(|lanes| Triples::LANE_ORDER.unpack_vectors(lanes));
        let [viscous, coulomb] = self.friction().map(|lanes| Triples::LANE_ORDER.unpack(lanes));
        let places = base.into_iter().zip(platform).zip(axis);
        let friction = viscous.into_iter().zip(coulomb);
        let mut found = [Joint::default(); LEGS];
        for (joint, (((base, platform), universal_axis), (viscous_friction, coulomb_friction))) in
            found.iter_mut().zip(places.zip(friction))
        {
            *joint = Joint { base, platform, universal_axis, viscous_friction, coulomb_friction };
        }
        found
    }

    /// Forces in lane order, and the determinants of the blocks.
    #[inline(always)]
    fn forces_in_lanes<S: Simd, M: ModelTerms>(
        &self,
        simd: S,
        constants: &LegConstants,
        joints: &[Joint; LEGS],
        motions: &[Motion; LANES],
        columns: &mut [Column<S>; LEGS],
    ) -> ([[f64; LANES]; LEGS], [[f64; LANES]; 2]) {
        let motions = Motions::load(simd, motions);
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        // Terms that the fidelity omits are evaluated as for a platform at rest.
        let omega = if M::VELOCITY { motions.angular_velocity } else { zero };
        let [turning, linear] =
            if M::ACCELERATION { [motions.angular_acceleration, motions.acceleration] } else { [zero, zero] };
        let map = acceleration_map(omega, turning);

        let platform = &self.machine().platform;
        let arm = motions.rotation.times_vector(simd, &platform.center_of_mass);
        let gravity = Lanes3::splat(simd, &self.machine().gravity);
        let mut force = (linear + map.times(arm) - gravity) * f64x8::splat(simd, platform.mass);
        let mut torque = arm.cross(force);
        if M::ACCELERATION {
            let (w, a) =
                (motions.rotation.transposed_times(omega), motions.rotation.transposed_times(turning));
            let torque_of_turning = a.transformed(simd, &platform.inertia);
            let momentum = w.transformed(simd, &platform.inertia);
            torque = torque + motions.rotation.times(torque_of_turning + w.cross(momentum));
        }

        for (joint, column) in joints.iter().zip(columns.iter_mut()) {
            let arm = motions.rotation.times_vector(simd, &joint.platform);
            let leg = LegGeometry::between(simd, Lanes3::splat(simd, &joint.base), motions.position, arm);
            let velocity = leg.velocity_in_lanes(motions.angular_velocity, motions.velocity);
            let joint_acceleration = linear + map.times(arm);
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
                    [f64x8::splat(simd, joint.viscous_friction), f64x8::splat(simd, joint.coulomb_friction)];
                axial += self.drive_force(simd, friction, velocity.rate, accel);
            }
            *column = Column { moment: arm.cross(leg.direction), direction: leg.direction, axial };
        }
        balanced(simd, columns, torque, force)
    }
}

/// Returns `Gamma + axial` with `N Gamma = W`, and the determinants of the blocks.
#[inline(always)]
fn balanced<S: Simd>(
    simd: S,
    columns: &[Column<S>; LEGS],
    torque: Lanes3<f64x8<S>>,
    force: Lanes3<f64x8<S>>,
) -> ([[f64; LANES]; LEGS], [[f64; LANES]; 2]) {
    let one = f64x8::splat(simd, 1.0);
    let [a0, a1, a2, b0, b1, b2] = columns;
    let adjugate = adjugate([a0.direction, a1.direction, a2.direction]);
    let d_a = a0.direction.dot(adjugate[0]);
    let inverse_d_a = one / d_a;
    let [i0, i1, i2] = [adjugate[0] * inverse_d_a, adjugate[1] * inverse_d_a, adjugate[2] * inverse_d_a];
    let a = [a0.moment, a1.moment, a2.moment];
    let inverse = [i0, i1, i2];
    let [x0, x1, x2] = [
        products(&inverse, b0.direction),
        products(&inverse, b1.direction),
        products(&inverse, b2.direction),
    ];
    let [s0, s1, s2] =
        [eliminated(b0.moment, &x0, &a), eliminated(b1.moment, &x1, &a), eliminated(b2.moment, &x2, &a)];
    let [c0, c1, c2] = self::adjugate([s0, s1, s2]);
    let d_s = s0.dot(c0);
    let inverse_d_s = one / d_s;

    let [g0, g1, g2] = products(&inverse, force);
    let rest = eliminated(torque, &[g0, g1, g2], &a);
    let [h0, h1, h2] = [c0.dot(rest) * inverse_d_s, c1.dot(rest) * inverse_d_s, c2.dot(rest) * inverse_d_s];
    let forces = [
        g0 - h0 * x0[0] - h1 * x1[0] - h2 * x2[0] + a0.axial,
        g1 - h0 * x0[1] - h1 * x1[1] - h2 * x2[1] + a1.axial,
        g2 - h0 * x0[2] - h1 * x1[2] - h2 * x2[2] + a2.axial,
        h0 + b0.axial,
        h1 + b1.axial,
        h2 + b2.axial,
    ];
    let [f0, f1, f2, f3, f4, f5] = forces;
    let forces = [f0.to_array(), f1.to_array(), f2.to_array(), f3.to_array(), f4.to_array(), f5.to_array()];
    (forces, [d_a.to_array(), d_s.to_array()])
}

/// Dot products with three vectors.
#[inline(always)]
fn products<S: Simd>([a, b, c]: &[Lanes3<f64x8<S>>; 3], v: Lanes3<f64x8<S>>) -> [f64x8<S>; 3] {
    [a.dot(v), b.dot(v), c.dot(v)]
}

/// A vector less multiples of three others.
#[inline(always)]
fn eliminated<S: Simd>(
    v: Lanes3<f64x8<S>>,
    [x, y, z]: &[f64x8<S>; 3],
    [a, b, c]: &[Lanes3<f64x8<S>>; 3],
) -> Lanes3<f64x8<S>> {
    v.minus_scaled(*x, *a).minus_scaled(*y, *b).minus_scaled(*z, *c)
}

/// Cross products of the two other vectors, in cyclic order.
#[inline(always)]
fn adjugate<S: Simd>([a, b, c]: [Lanes3<f64x8<S>>; 3]) -> [Lanes3<f64x8<S>>; 3] {
    [b.cross(c), c.cross(a), a.cross(b)]
}

/// Matrix S of each motion, see [`super::platform::acceleration_map`].
#[inline(always)]
fn acceleration_map<S: Simd>(w: Lanes3<f64x8<S>>, a: Lanes3<f64x8<S>>) -> Matrix<S> {
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
    Matrix([
        Lanes3 { x: -yy - zz, y: xy + a.z, z: xz - a.y },
        Lanes3 { x: xy - a.z, y: -xx - zz, z: yz + a.x },
        Lanes3 { x: xz + a.y, y: yz - a.x, z: -xx - yy },
    ])
}

/// One vector of each motion.
#[inline(always)]
fn vectors<S: Simd>(
    simd: S,
    motions: &[Motion; LANES],
    of: impl Fn(&Motion) -> Vector3<f64>,
) -> Lanes3<f64x8<S>> {
    Lanes3 {
        x: f64x8::load_array(simd, motions.each_ref().map(|motion| of(motion).x)),
        y: f64x8::load_array(simd, motions.each_ref().map(|motion| of(motion).y)),
        z: f64x8::load_array(simd, motions.each_ref().map(|motion| of(motion).z)),
    }
}

impl<S: Simd> Motions<S> {
    #[inline(always)]
    fn load(simd: S, motions: &[Motion; LANES]) -> Self {
        Self {
            rotation: Matrix([
                vectors(simd, motions, |m| m.pose.rotation.column(0).into()),
                vectors(simd, motions, |m| m.pose.rotation.column(1).into()),
                vectors(simd, motions, |m| m.pose.rotation.column(2).into()),
            ]),
            position: vectors(simd, motions, |m| m.pose.position),
            angular_velocity: vectors(simd, motions, |m| m.twist.angular),
            velocity: vectors(simd, motions, |m| m.twist.linear),
            angular_acceleration: vectors(simd, motions, |m| m.acceleration.angular),
            acceleration: vectors(simd, motions, |m| m.acceleration.linear),
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
