//! Newton's method and the chord method on lanes.

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Matrix3;

use super::{MAX_CONDITION, MAX_NEWTON_STEPS, NewtonReport, Outcome};
use crate::model::factorization::{Factorization, LaneTwist};
use crate::model::inverse_geometry::LegGeometry;
use crate::model::kinematic_state::{KinematicState, StoredLegs};
use crate::model::lanes::{LaneArithmetic as _, Triple};
use crate::model::lanes3::Lanes3;
use crate::model::machine::Joints;
use crate::model::rigid::Pose;
use crate::model::sensitivity::Sensitivity;

/// Step size (radian, or radius) below which the iteration ends. The legs then agree with the pose to all
/// practical digits. The pose still takes this step, so it is exact to rounding.
pub(super) const CONVERGED_STEP: f64 = 1e-12;

/// Approximate number of rounding errors that add up in a residual.
const ROUNDING_ERRORS_PER_RESIDUAL: f64 = 8.0;

/// Newton's method toward given lengths.
pub(super) struct Newton<'a, S: Simd> {
    simd: S,
    joints: &'a Joints,
    target: f64x8<S>,
    inverse_target: f64x8<S>,
}

/// State of the platform after some steps, in lanes.
#[derive(Clone, Copy)]
struct Iterate<S: Simd> {
    /// Vectors from the mean M of the platform joints to each platform joint.
    arm: Lanes3<f64x8<S>>,
    /// Vectors from the joints on the base to M.
    reach: Lanes3<f64x8<S>>,
    /// R, one column per lane.
    rotation: Lanes3<f64x4<S>>,
}

impl<S: Simd> Iterate<S> {
    #[inline(always)]
    fn start(simd: S, joints: &Joints, pose: &Pose) -> Self {
        let arm = Lanes3::load(simd, &joints.around_center).transformed(simd, &pose.rotation);
        let center = pose.position + pose.rotation * joints.center_m;
        let r = &pose.rotation;
        let rotation = Lanes3 {
            x: f64x4::load_array(simd, [r.m11, r.m12, r.m13, r.m11]),
            y: f64x4::load_array(simd, [r.m21, r.m22, r.m23, r.m21]),
            z: f64x4::load_array(simd, [r.m31, r.m32, r.m33, r.m31]),
        };
        let center: Lanes3<f64x4<S>> = Lanes3::splat(simd, &center);
        Self { arm, reach: center.doubled() - Lanes3::load(simd, &joints.base), rotation }
    }

    /// Iterate after one more step.
    #[inline(always)]
    fn moved(self, simd: S, step: &LaneTwist<S>) -> Self {
        let half = f64x4::splat(simd, 0.5);
        let u = step.angular * half;
        let k = f64x4::splat(simd, 2.0) / (f64x4::splat(simd, 1.0) + u.dot(u));
        Self {
            arm: self.arm.cayley_rotated(u.doubled(), k.combine(k)),
            reach: self.reach + step.linear.doubled(),
            rotation: self.rotation.cayley_rotated(u, k),
        }
    }

    /// Pose of the iterate. One step of Newton's iteration for the polar factor makes R orthonormal.
    #[inline(always)]
    fn pose(&self, simd: S, joints: &Joints) -> Pose {
        let r = self.rotation;
        let next = r.next();
        let previous = r.previous();
        let half = f64x4::splat(simd, 0.5);
        let to_next = r.dot(next) * half;
        let to_previous = r.dot(previous) * half;
        let own = f64x4::splat(simd, 1.5) - r.dot(r) * half;
        let r = (r * own).minus_scaled(to_next, next).minus_scaled(to_previous, previous);
        let ([a, b, c], [d, e, f], [g, h, i]) = (r.x.legs(), r.y.legs(), r.z.legs());
        let rotation = Matrix3::new(a, b, c, d, e, f, g, h, i);
        // The first base joint plus its reach gives M in the base frame.
        let first = self.reach + Lanes3::load(simd, &joints.base);
        let (first, _) = first.split();
        let center = first.first();
        Pose { rotation, position: center - rotation * joints.center_m }
    }
}

impl<'a, S: Simd> Newton<'a, S> {
    #[inline(always)]
    pub fn new(simd: S, joints: &'a Joints, target_m: f64x8<S>) -> Self {
        Self { simd, joints, target: target_m, inverse_target: f64x8::splat(simd, 1.0) / target_m }
    }

    #[inline(always)]
    pub fn refine(
        &self,
        kinematic_state: &mut KinematicState,
        mut legs: LegGeometry<S>,
        mut factorization: Factorization<'a, S>,
    ) -> NewtonReport {
        let Self { simd, joints, target, inverse_target } = *self;
        let rounding = rounding(joints, &kinematic_state.pose, kinematic_state.sensitivity.condition);
        let last = square(rounding.max(CONVERGED_STEP)); // All sizes are squares.
        let linear_weight = f64x4::splat(simd, 1.0 / square(joints.radius_m));
        let mut at = Iterate::start(simd, joints, &kinematic_state.pose);
        let mut residual = target - legs.length_m;
        let mut report = NewtonReport { outcome: Outcome::NotConverged, iterations: 0, step_ratio: f64::NAN };
        // Each step must be shorter than the previous one; by Kantorovich's theorem it is at most half as
        // long.
        let mut longest = square(kinematic_state.sensitivity.trusted_step);
        loop {
            // Square of the first step with this factorization.
            let mut first = 0.0;
            let s = loop {
                if report.iterations == MAX_NEWTON_STEPS {
                    return report;
                }
                report.iterations += 1;
                let Some(step) = factorization.twist(&legs, residual) else {
                    return NewtonReport { outcome: Outcome::NearSingular, ..report };
                };
                let size = step.size_squared(linear_weight);
                if report.iterations == 1 {
                    report.step_ratio = (size / longest).sqrt();
                    // True for NaN as well.
                    if !(report.step_ratio <= 1.0) {
                        return NewtonReport { outcome: Outcome::LeftTrustedRegion, ..report };
                    }
                } else if !(size <= longest) {
                    return report;
                }
                if size <= square(rounding) && report.iterations == 1 {
                    // Already at the pose. Steps below the rounding of the legs are not taken, because they
                    // would add up over the cycles. All longer steps are taken, so that all instruction sets
                    // take the same steps: rounding decides whether a step is just below a bound.
                    let is_regular = kinematic_state.sensitivity.condition <= MAX_CONDITION;
                    report.outcome = if is_regular { Outcome::Solved } else { Outcome::NearSingular };
                    return report;
                }
                at = at.moved(simd, &step);
                if first == 0.0 {
                    if size <= last {
                        report.outcome = self.arrive(kinematic_state, &at, legs, residual, &factorization);
                        return report;
                    }
                    first = size;
                }
                longest = size.max(last);
                let s = at.reach + at.arm;
                residual = self.residual(s);
                if first * size <= last || first * (first * size) > last {
                    break s;
                }
            };
            (legs.arm, legs.direction) = (at.arm, s * inverse_target);
            factorization = Factorization::new(simd, joints, &legs);
        }
    }

    /// Length residual `(L^2 - |s|^2) / 2 L`.
    #[inline(always)]
    fn residual(&self, s: Lanes3<f64x8<S>>) -> f64x8<S> {
        self.target.fused_mul_sub(self.target, s.dot(s)) * self.inverse_target * f64x8::splat(self.simd, 0.5)
    }

    /// Stores the last step. It brings the pose to the target lengths and changes the leg directions only by
    /// rounding.
    #[inline(always)]
    fn arrive(
        &self,
        kinematic_state: &mut KinematicState,
        at: &Iterate<S>,
        mut legs: LegGeometry<S>,
        residual: f64x8<S>,
        factorization: &Factorization<'a, S>,
    ) -> Outcome {
        let Self { simd, joints, target, inverse_target } = *self;
        legs.length_m = target;
        legs.inverse_length_per_m = (residual * inverse_target).fused_mul_add(inverse_target, inverse_target);
        let sensitivity = Sensitivity::new(simd, joints, &legs, factorization);
        // Only growth of K along the step could lead across a singular pose.
        let same_side = sensitivity.determinant * kinematic_state.sensitivity.determinant > 0.0;
        if !(same_side && sensitivity.condition <= MAX_CONDITION) {
            return Outcome::NearSingular;
        }
        kinematic_state.pose = at.pose(simd, joints);
        kinematic_state.legs = StoredLegs::new(&legs);
        kinematic_state.factorization = factorization.store();
        kinematic_state.sensitivity = sensitivity;
        Outcome::Solved
    }
}

/// Size of a step caused by rounding in differences of coordinates.
#[inline(always)]
pub(super) fn rounding(joints: &Joints, start: &Pose, condition: f64) -> f64 {
    let size = start.position.norm() / joints.radius_m;
    f64::EPSILON * ROUNDING_ERRORS_PER_RESIDUAL * (1.0 + size) * condition
}

fn square(x: f64) -> f64 {
    x * x
}
