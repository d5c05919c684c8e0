//! Inverse geometric model (paper, eq. 3-5) and its first two time derivatives.
//!
//! ```text
//! b   = R CB                    s = C + b - A          L = |s|,   n = s / L
//! vB  = v + omega x b           L'  = n . vB                      n'  = (vB - L' n) / L
//! aB  = v' + S b                L'' = n . aB + L |n'|^2           n'' = (aB - L'' n - 2 L' n') / L
//! ```
//!
//! with `S b = omega' x b + omega x (omega x b)`; n'' itself is not evaluated here.
//!
//! Valid for L > 0. No leg angles appear, hence no joint-angle singularity.

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, Vector3};

use super::LEGS;
use super::lanes::{LaneArithmetic as _, least_of_legs};
use super::lanes3::Lanes3;
use super::machine::{Joints, Machine};
use super::platform::acceleration_map;
use super::rigid::{Acceleration, Motion, Pose, Twist};
use super::triples::LegLanes;

/// Geometry of the six legs at one pose, in lanes.
#[derive(Clone, Copy)]
pub(super) struct LegGeometry<S: Simd> {
    /// b, from C or the mean of the joints to the joint on the platform.
    pub arm: Lanes3<f64x8<S>>,
    /// n, unit vector from base to platform.
    pub direction: Lanes3<f64x8<S>>,
    /// L
    pub length_m: f64x8<S>,
    /// 1 / L
    pub inverse_length_per_m: f64x8<S>,
}

/// First time derivatives of length and direction, in lanes.
#[derive(Clone, Copy)]
pub(super) struct LegVelocity<S: Simd> {
    /// L'
    pub rate_m_s: f64x8<S>,
    /// n'
    pub direction: Lanes3<f64x8<S>>,
}

impl<S: Simd> LegGeometry<S> {
    /// Geometry with arms from C.
    #[inline(always)]
    pub fn new(simd: S, joints: &Joints, pose: &Pose) -> Self {
        Self::of(simd, &joints.platform, joints, pose)
    }

    /// Geometry with arms from the mean of the joints on the platform, independent of C.
    #[inline(always)]
    pub fn around_center(simd: S, joints: &Joints, pose: &Pose) -> Self {
        let position = pose.position + pose.rotation * joints.center_m;
        Self::of(simd, &joints.around_center, joints, &Pose { rotation: pose.rotation, position })
    }

    #[inline(always)]
    fn of(simd: S, platform: &[LegLanes; 3], joints: &Joints, pose: &Pose) -> Self {
        let arm = Lanes3::load(simd, platform).transformed(simd, &pose.rotation);
        Self::between(simd, Lanes3::load(simd, &joints.base), Lanes3::splat(simd, &pose.position), arm)
    }

    /// Geometry of legs from the joints on the base to the arms at a position.
    #[inline(always)]
    pub fn between(
        simd: S,
        base: Lanes3<f64x8<S>>,
        position: Lanes3<f64x8<S>>,
        arm: Lanes3<f64x8<S>>,
    ) -> Self {
        let s = position + arm - base;
        let length_m = s.dot(s).sqrt();
        let inverse_length_per_m = f64x8::splat(simd, 1.0) / length_m;
        Self { arm, direction: s * inverse_length_per_m, length_m, inverse_length_per_m }
    }

    /// Smallest sine of a leg's angle to its universal joint, see [`universal_sine`].
    #[inline(always)]
    pub fn universal_sine(&self, simd: S, joints: &Joints) -> f64 {
        let normal = self.direction.cross(Lanes3::load(simd, &joints.universal_axis));
        least_of_legs(normal.dot(normal)).min(1.0).sqrt()
    }

    /// Rates L' and n' for a twist.
    #[inline(always)]
    pub fn velocity(&self, simd: S, twist: &Twist) -> LegVelocity<S> {
        self.velocity_in_lanes(Lanes3::splat(simd, &twist.angular), Lanes3::splat(simd, &twist.linear))
    }

    /// Rates L' and n' for the angular velocity and the velocity of C in each lane.
    #[inline(always)]
    pub fn velocity_in_lanes(&self, angular: Lanes3<f64x8<S>>, linear: Lanes3<f64x8<S>>) -> LegVelocity<S> {
        let joint = linear + angular.cross(self.arm);
        let rate_m_s = self.direction.dot(joint);
        let direction = joint.plus_scaled(-rate_m_s, self.direction) * self.inverse_length_per_m;
        LegVelocity { rate_m_s, direction }
    }

    /// Joint accelerations aB, with `acceleration_map` from [`super::platform::acceleration_map`].
    #[inline(always)]
    pub fn joint_acceleration(
        &self,
        simd: S,
        acceleration: &Acceleration,
        acceleration_map: &Matrix3<f64>,
    ) -> Lanes3<f64x8<S>> {
        Lanes3::splat(simd, &acceleration.linear) + self.arm.transformed(simd, acceleration_map)
    }

    /// Accelerations L''.
    #[inline(always)]
    pub fn accel(&self, velocity: &LegVelocity<S>, joint_acceleration: Lanes3<f64x8<S>>) -> f64x8<S> {
        let turn = velocity.direction;
        self.length_m.fused_mul_add(turn.dot(turn), self.direction.dot(joint_acceleration))
    }
}

/// Lengths of the six legs and their time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegMotion {
    /// L \[m\]
    pub length_m: [f64; LEGS],
    /// L' \[m/s\]
    pub rate_m_s: [f64; LEGS],
    /// L'' \[m/s^2\]
    pub accel_m_s2: [f64; LEGS],
}

/// Lengths, rates and accelerations of the six legs for a motion of the platform.
///
/// ```
/// use hexad_core::model::{inverse_geometry::{leg_lengths, leg_motion}, task::TaskState};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let state = TaskState { xd: [0.1, 0.2, 0.0, 0.0, 0.3, 0.1].into(), ..TaskState::at_rest(machine.home) };
/// // A rate is the derivative of the length.
/// let [before, after] = [-1e-6, 1e-6].map(|dt| leg_lengths(&machine, &state.after(dt).motion().pose)[0]);
/// assert!(((after - before) / 2e-6 - leg_motion(&machine, &state.motion()).rate_m_s[0]).abs() < 1e-8);
/// ```
pub fn leg_motion(machine: &Machine, motion: &Motion) -> LegMotion {
    let unpack = |lane: LegLanes| machine.joints.triples.unpack(&lane);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, &motion.pose);
        let velocity = legs.velocity(simd, &motion.twist);
        let map = acceleration_map(&motion.twist, &motion.acceleration);
        let accel = legs.accel(&velocity, legs.joint_acceleration(simd, &motion.acceleration, &map));
        LegMotion {
            length_m: unpack(legs.length_m.into()),
            rate_m_s: unpack(velocity.rate_m_s.into()),
            accel_m_s2: unpack(accel.into()),
        }
    })
}

/// Lengths `L_i` of the six legs at a pose \[m\].
pub fn leg_lengths(machine: &Machine, pose: &Pose) -> [f64; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        machine.joints.triples.unpack(&legs.length_m.into())
    })
}

/// Lengths `L_i` \[m\] and rates `L_i'` \[m/s\] of the six legs at a pose, for a twist.
pub fn leg_lengths_and_rates(machine: &Machine, pose: &Pose, twist: &Twist) -> ([f64; LEGS], [f64; LEGS]) {
    let unpack = |lane: LegLanes| machine.joints.triples.unpack(&lane);
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        let velocity = legs.velocity(simd, twist);
        (unpack(legs.length_m.into()), unpack(velocity.rate_m_s.into()))
    })
}

/// Lengths and rates of [`leg_lengths_and_rates`] in lanes, for loops over poses that are compiled as one
/// function per instruction set.
#[inline(always)]
pub fn length_and_rate_lanes<S: Simd>(
    simd: S,
    machine: &Machine,
    pose: &Pose,
    twist: &Twist,
) -> (f64x8<S>, f64x8<S>) {
    let legs = LegGeometry::new(simd, &machine.joints, pose);
    (legs.length_m, legs.velocity(simd, twist).rate_m_s)
}

/// Directions `n_i` of the six legs at a pose: unit vectors from base to platform, base axes.
pub fn leg_directions(machine: &Machine, pose: &Pose) -> [Vector3<f64>; LEGS] {
    dispatch!(machine.level, simd => {
        let legs = LegGeometry::new(simd, &machine.joints, pose);
        machine.joints.triples.unpack_vectors(&legs.direction.store())
    })
}

/// Angles \[rad\] of the universal joint of each leg at a pose, about its first axis u, then about its second axis `u x n / |u x n|`;
/// both are 0 at home. Undefined where a leg is aligned with its first axis, see [`universal_sine`].
pub fn universal_joint_angles(machine: &Machine, pose: &Pose) -> [[f64; 2]; LEGS] {
    let joints = &machine.joints;
    let mut axes = joints.triples.unpack_vectors(&joints.universal_axis).into_iter();
    let mut legs =
        leg_directions(machine, &machine.home_pose()).into_iter().zip(leg_directions(machine, pose));
    core::array::from_fn(|_| {
        let (u, (home, n)) = axes.next().zip(legs.next()).unwrap_or_default();
        let [second_at_home, second] = [u.cross(&home), u.cross(&n)];
        let about_u = libm::atan2(u.dot(&second_at_home.cross(&second)), second_at_home.dot(&second));
        let from_u = |second: &Vector3<f64>, leg: &Vector3<f64>| libm::atan2(second.norm(), u.dot(leg));
        [about_u, from_u(&second, &n) - from_u(&second_at_home, &home)]
    })
}

/// Smallest sine of the angle between a leg and the first axis of its universal joint, over the six legs. It
/// is 0 if a leg is aligned with its axis.
pub fn universal_sine(machine: &Machine, pose: &Pose) -> f64 {
    let joints = &machine.joints;
    dispatch!(machine.level, simd => LegGeometry::new(simd, joints, pose).universal_sine(simd, joints))
}
