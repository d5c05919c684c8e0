//! Newton's method and the chord method on lanes.

use fearless_simd::{Simd, f64x4, f64x8, prelude::*};
#[cfg(not(feature = "client"))]
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

/// A step this small (radian, or radius) is the last: the legs are where the pose is, to all practical digits, and
/// the pose, which still takes it, is so to rounding.
const CONVERGED_STEP: f64 = 1e-12;

/// Errors of rounding that add up in a residual, about.
const ROUNDING_ERRORS_PER_RESIDUAL: f64 = 8.0;

/// Newton's method toward some lengths.
pub(super) struct Newton<'a, S: Simd> {
    simd: S,
    joints: &'a Joints,
    target: f64x8<S>,
    inverse_target: f64x8<S>,
}

/// The platform after some steps, in lanes.
#[derive(Clone, Copy)]
struct Iterate<S: Simd> {
    /// Joints on the platform from their mean M.
    arm: Lanes3<f64x8<S>>,
    /// From the joints on the base to M.
    reach: Lanes3<f64x8<S>>,
    /// R, a column per lane.
    rotation: Lanes3<f64x4<S>>,
}

impl<S: Simd> Iterate<S> {
    #[inline(always)]
    fn start(simd: S, joints: &Joints, pose: &Pose) -> Self {
        let arm = Lanes3::load(simd, &joints.around_center).transformed(simd, &pose.rotation);
        let center = pose.position + pose.rotation * joints.center;
        let r = &pose.rotation;
        let rotation = Lanes3 {
            x: f64x4::load_array(simd, [r.m11, r.m12, r.m13, r.m11]),
            y: f64x4::load_array(simd, [r.m21, r.m22, r.m23, r.m21]),
            z: f64x4::load_array(simd, [r.m31, r.m32, r.m33, r.m31]),
        };
        let center: Lanes3<f64x4<S>> = Lanes3::splat(simd, &center);
        Self { arm, reach: center.doubled() - Lanes3::load(simd, &joints.base), rotation }
    }

    /// One step further.
    #[inline(always)]
    fn moved(self, simd: S, step: &LaneTwist<S>) -> Self {
        let half = f64x4::splat(simd, 0.5);
        let u = step.angular * half;
        let k = f64x4::splat(simd, 2.0) / (f64x4::splat(simd, 1.0) + u.dot(u));
        Self {
            arm: self.arm.turned(u.doubled(), k.combine(k)),
            reach: self.reach + step.linear.doubled(),
            rotation: self.rotation.turned(u, k),
        }
    }

    /// R brought back to orthonormal columns by one step of Newton's iteration for the polar factor.
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
        // The first joint on the base leads back to its frame.
        let first = self.reach + Lanes3::load(simd, &joints.base);
        let (first, _) = first.split();
        let center = first.first();
        Pose { rotation, position: center - rotation * joints.center }
    }
}

impl<'a, S: Simd> Newton<'a, S> {
    #[inline(always)]
    pub fn new(simd: S, joints: &'a Joints, target: f64x8<S>) -> Self {
        Self { simd, joints, target, inverse_target: f64x8::splat(simd, 1.0) / target }
    }

    #[inline(always)]
    pub fn refine(
        &self,
        kinematic_state: &mut KinematicState,
        mut legs: LegGeometry<S>,
        mut factorization: Factorization<'a, S>,
    ) -> NewtonReport {
        let Self { simd, joints, target, inverse_target } = *self;
        let rounding = rounding(joints, kinematic_state);
        let last = square(rounding.max(CONVERGED_STEP)); // All sizes are squares.
        let linear_weight = f64x4::splat(simd, 1.0 / square(joints.radius));
        let mut at = Iterate::start(simd, joints, &kinematic_state.pose);
        let mut residual = target - legs.length;
        let mut report = NewtonReport { outcome: Outcome::NotConverged, iterations: 0, step_ratio: f64::NAN };
        // Steps become shorter: Kantorovich halves them at least.
        let mut longest = square(kinematic_state.sensitivity.trusted_step);
        loop {
            // Size of the first step with this factorization.
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
                    // Also where it is not a number.
                    if !(report.step_ratio <= 1.0) {
                        return NewtonReport { outcome: Outcome::LeftTrustedRegion, ..report };
                    }
                } else if !(size <= longest) {
                    return report;
                }
                if size <= square(rounding) && report.iterations == 1 {
                    // Already at the pose. Steps smaller than rounding in the legs would add up over the cycles. Longer ones are taken:
                    // whether a step is just below a bound is a matter of rounding, and an instruction set must not decide what is left out.
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

    /// `(L^2 - |s|^2) / 2 L`
    #[inline(always)]
    fn residual(&self, s: Lanes3<f64x8<S>>) -> f64x8<S> {
        self.target.fused_mul_sub(self.target, s.dot(s)) * self.inverse_target * f64x8::splat(self.simd, 0.5)
    }

    /// Stores the last step, which brings the pose to the target lengths and changes the directions of the legs by rounding
    /// only.
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
        legs.length = target;
        legs.inverse_length = (residual * inverse_target).fused_mul_add(inverse_target, inverse_target);
        let sensitivity = Sensitivity::new(simd, joints, &legs, factorization);
        // That K grows along the step could lead across, if anything could.
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

/// Size of a step by the rounding of differences of coordinates.
#[inline(always)]
fn rounding(joints: &Joints, start: &KinematicState) -> f64 {
    let size = start.pose.position.norm() / joints.radius;
    f64::EPSILON * ROUNDING_ERRORS_PER_RESIDUAL * (1.0 + size) * start.sensitivity.condition
}

fn square(x: f64) -> f64 {
    x * x
}
