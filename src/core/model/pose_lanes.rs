//! Inverse dynamics of many motions: eight at once, one per lane, leg after leg.
//!
//! The legs are evaluated by the same code as in one motion: [`super::inverse_geometry`] and [`super::leg`] do not know whether
//! a lane is a leg or a motion. Here no lane is padding and none waits for another. The factorization of N, which exchanges values
//! between the lanes of one motion, is in [`super::pose_factorization`]; the platform is written out:
//!
//! ```text
//! torque = R (I_G a + w x I_G w) + c x f        w = R^T omega,  a = R^T omega',  f = m (v' + S c - g)
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
use super::leg::{ForceOnLeg, LegConstants};
use super::pose_factorization::{Column, LANES, Matrix, PoseFactorization, vectors};
use super::rigid::Motion;
use super::triples::{LegLanes, Triples};

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
struct LoadedColumn<S: Simd> {
    column: Column<S>,
    axial: f64x8<S>,
}

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
    /// Actuator forces Gamma \[N\] of each motion, to the same place in `forces_n`; `None` at singular poses. Elements
    /// beyond the shorter slice are left as they are.
    ///
    /// [`InverseDynamics::forces_of`] differs by rounding.
    pub fn forces_of_all(
        &self,
        fidelity: Fidelity,
        motions: &[Motion],
        forces_n: &mut [Option<[f64; LEGS]>],
    ) {
        self.forces_of_all_under(fidelity, motions, &self.machine().gravity_m_s2, forces_n);
    }

    /// Actuator forces as by [`InverseDynamics::forces_of_all`] with another gravity, in base axes.
    pub fn forces_of_all_under(
        &self,
        fidelity: Fidelity,
        motions: &[Motion],
        gravity_m_s2: &Vector3<f64>,
        forces_n: &mut [Option<[f64; LEGS]>],
    ) {
        with_terms!(fidelity, M => self.write_forces::<M>(motions, gravity_m_s2, forces_n));
    }

    fn write_forces<M: ModelTerms>(
        &self,
        motions: &[Motion],
        gravity: &Vector3<f64>,
        forces: &mut [Option<[f64; LEGS]>],
    ) {
        let constants = self.leg_constants().of_one_leg();
        let joints = self.joints_in_lane_order();
        dispatch!(self.machine().level, simd => {
            let mut columns = [LoadedColumn { column: Column::zero(simd), axial: f64x8::splat(simd, 0.0) }; LEGS];
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
                    self.forces_in_lanes::<_, M>(simd, &constants, &joints, (eight, gravity), &mut columns);
                let lanes = a.into_iter().zip(b).zip(c).zip(d.into_iter().zip(e).zip(f));
                let lanes = lanes.zip(d_a.into_iter().zip(d_s));
                for ((force, motion), ((((a, b), c), ((d, e), f)), (d_a, d_s))) in forces.iter_mut().zip(motions).zip(lanes) {
                    *force = if are_regular_blocks(d_a, d_s, self.joints().radius_cubed_m3) {
                        Some(self.joints().triples.unpack(&LegLanes([a, b, c, 0.0, d, e, f, 0.0])))
                    } else {
                        self.forces_under::<M>(motion, gravity)
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
        (motions, gravity): (&[Motion; LANES], &Vector3<f64>),
        columns: &mut [LoadedColumn<S>; LEGS],
    ) -> ([[f64; LANES]; LEGS], [[f64; LANES]; 2]) {
        let motions = Motions::load(simd, motions);
        let zero = Lanes3::splat(simd, &Vector3::zeros());
        // Terms that the fidelity omits are evaluated as for a platform at rest.
        let omega = if M::VELOCITY { motions.angular_velocity } else { zero };
        let [turning, linear] =
            if M::ACCELERATION { [motions.angular_acceleration, motions.acceleration] } else { [zero, zero] };
        let map = acceleration_map(omega, turning);

        let platform = &self.machine().platform;
        let arm = motions.rotation.times_vector(simd, &platform.center_of_mass_m);
        let gravity = Lanes3::splat(simd, gravity);
        let mut force = (linear + map.times(arm) - gravity) * f64x8::splat(simd, platform.mass_kg);
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
            let accelerations = [joint_acceleration, gravity];
            let reaction =
                ForceOnLeg::new::<M>(simd, constants, universal_axis, &leg, &velocity, accelerations);
            if M::LEGS != LegInertia::Massless {
                force = force + reaction.transverse;
                torque = torque + arm.cross(reaction.transverse);
            }
            let mut axial = reaction.axial_n;
            if M::ACCELERATION {
                let mut accel = leg.direction.dot(joint_acceleration);
                if M::VELOCITY {
                    accel = leg.accel(&velocity, joint_acceleration);
                }
                let friction =
                    [f64x8::splat(simd, joint.viscous_friction), f64x8::splat(simd, joint.coulomb_friction)];
                axial += self.drive_force(simd, friction, velocity.rate_m_s, accel);
            }
            *column = LoadedColumn { column: Column::new(arm, leg.direction), axial };
        }
        balanced(simd, columns, torque, force)
    }
}

/// Returns `Gamma + axial_n` with `N Gamma = W`, and the determinants of the blocks.
#[inline(always)]
fn balanced<S: Simd>(
    simd: S,
    [a0, a1, a2, b0, b1, b2]: &[LoadedColumn<S>; LEGS],
    torque: Lanes3<f64x8<S>>,
    force: Lanes3<f64x8<S>>,
) -> ([[f64; LANES]; LEGS], [[f64; LANES]; 2]) {
    let columns = [&a0.column, &a1.column, &a2.column, &b0.column, &b1.column, &b2.column];
    let factorization = PoseFactorization::new(simd, columns);
    let [f0, f1, f2, f3, f4, f5] = factorization.forces(torque, force);
    let forces = [
        (f0 + a0.axial).to_array(),
        (f1 + a1.axial).to_array(),
        (f2 + a2.axial).to_array(),
        (f3 + b0.axial).to_array(),
        (f4 + b1.axial).to_array(),
        (f5 + b2.axial).to_array(),
    ];
    (forces, [factorization.d_a.to_array(), factorization.d_s.to_array()])
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
