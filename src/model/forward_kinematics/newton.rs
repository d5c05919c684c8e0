//! Newton's method and the chord method on lanes.

use fearless_simd::Simd;
#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Matrix3;

use super::{LARGEST_CONDITION, MAX_ITERATIONS, Outcome, Report};
use crate::model::balance::{Balance, LaneTwist};
use crate::model::inverse_geometry::LegGeometry;
use crate::model::kinematic_state::{KinematicState, StoredLegs};
use crate::model::lanes::{Eight, Four, Reals};
use crate::model::lanes3::Lanes3;
use crate::model::machine::Joints;
use crate::model::rigid::Pose;
use crate::model::sensitivity::Sensitivity;

/// A step this small (radian, or radius) is the last: the legs are where the pose is, to all practical digits, and
/// the pose, which still takes it, is so to rounding.
const LAST_STEP: f64 = 1e-12;

/// Errors of rounding that add up in a residual, about.
const ROUNDINGS: f64 = 8.0;

/// Newton's method toward some lengths.
pub(super) struct Newton<'a, S: Simd, V: Eight<S>> {
    simd: S,
    joints: &'a Joints,
    target: V,
    inverse_target: V,
}

/// The platform on its way.
#[derive(Clone, Copy)]
struct Iterate<V, F> {
    /// Joints on the platform from their mean M.
    arm: Lanes3<V>,
    /// From the joints on the base to M.
    reach: Lanes3<V>,
    /// R, a column per lane.
    rotation: Lanes3<F>,
}

impl<V: Copy, F: Copy> Iterate<V, F> {
    #[inline(always)]
    fn start<S: Simd>(simd: S, joints: &Joints, pose: &Pose) -> Self
    where
        V: Eight<S, Half = F, Scalar = f64>,
        F: Four<S>,
    {
        let arm = Lanes3::<V>::constant(simd, &joints.around_center)
            .transformed(&pose.rotation, |value| V::spread(simd, value));
        let center = pose.position + pose.rotation * joints.center;
        let splat =
            Lanes3 { x: F::splat(simd, center.x), y: F::splat(simd, center.y), z: F::splat(simd, center.z) };
        let r = &pose.rotation;
        let rotation = Lanes3 {
            x: F::load(simd, [r.m11, r.m12, r.m13, r.m11]),
            y: F::load(simd, [r.m21, r.m22, r.m23, r.m21]),
            z: F::load(simd, [r.m31, r.m32, r.m33, r.m31]),
        };
        Self { arm, reach: splat.doubled() - Lanes3::constant(simd, &joints.base), rotation }
    }

    /// A step further.
    #[inline(always)]
    fn moved<S: Simd>(self, simd: S, step: &LaneTwist<F>) -> Self
    where
        V: Eight<S, Half = F>,
        F: Four<S>,
    {
        let half = F::splat(simd, 0.5);
        let u = step.angular * half;
        let k = F::splat(simd, 2.0) / (F::splat(simd, 1.0) + u.dot(u));
        Self {
            arm: turned(self.arm, u.doubled(), V::join(k, k)),
            reach: self.reach + step.linear.doubled(),
            rotation: turned(self.rotation, u, k),
        }
    }

    /// R brought back to orthonormal columns by one step of Newton's iteration for the polar factor.
    #[inline(always)]
    fn pose<S: Simd>(&self, simd: S, joints: &Joints) -> Pose
    where
        V: Eight<S, Half = F>,
        F: Four<S>,
    {
        let r = self.rotation;
        let next = r.next(simd);
        let previous = r.previous(simd);
        let half = F::splat(simd, 0.5);
        let to_next = r.dot(next) * half;
        let to_previous = r.dot(previous) * half;
        let own = F::splat(simd, 1.5) - r.dot(r) * half;
        let r = (r * own).minus_scaled(to_next, next).minus_scaled(to_previous, previous);
        let ([a, b, c], [d, e, f], [g, h, i]) = (r.x.legs(), r.y.legs(), r.z.legs());
        let rotation = Matrix3::new(a, b, c, d, e, f, g, h, i);
        // The first joint on the base leads back to its frame.
        let first = self.reach + Lanes3::constant(simd, &joints.base);
        let (first, _) = first.halves();
        let center = first.first();
        Pose { rotation, position: center - rotation * joints.center }
    }
}

/// `v` turned by Cayley's rotation of `2 u`: `v + k (u x v + u x (u x v))`, `k = 2 / (1 + u.u)`.
#[inline(always)]
fn turned<V: Reals>(v: Lanes3<V>, u: Lanes3<V>, k: V) -> Lanes3<V> {
    let once = u.cross(v);
    v.plus_scaled(k, once + u.cross(once))
}

impl<'a, S: Simd, V: Eight<S, Scalar = f64>> Newton<'a, S, V> {
    #[inline(always)]
    pub fn new(simd: S, joints: &'a Joints, target: V) -> Self {
        Self { simd, joints, target, inverse_target: V::splat(simd, 1.0) / target }
    }

    #[inline(always)]
    pub fn refine(
        &self,
        kinematic_state: &mut KinematicState,
        mut legs: LegGeometry<V>,
        mut balance: Balance<'a, S, V>,
    ) -> Report {
        let Self { simd, joints, target, inverse_target } = *self;
        // Sizes are squares.
        let last = square(last_step(joints, kinematic_state));
        let linear_weight = V::Half::splat(simd, 1.0 / square(joints.radius));
        let mut at = Iterate::start(simd, joints, &kinematic_state.pose);
        let mut residual = target - legs.length;
        let mut report = Report { outcome: Outcome::NotConverged, iterations: 0, reach: f64::NAN };
        // Steps become shorter: Kantorovich halves them at least.
        let mut longest = square(kinematic_state.sensitivity.trusted_step);
        loop {
            // Of the steps with one factorization.
            let mut first = 0.0;
            let s = loop {
                if report.iterations == MAX_ITERATIONS {
                    return report;
                }
                report.iterations += 1;
                let Some(step) = balance.twist(&legs, residual) else {
                    return Report { outcome: Outcome::NearSingular, ..report };
                };
                let linear = step.linear.dot(step.linear);
                let size = linear.mul_add(linear_weight, step.angular.dot(step.angular)).first();
                if report.iterations == 1 {
                    report.reach = (size / longest).sqrt();
                    // Also where it is not a number.
                    if !(report.reach <= 1.0) {
                        return Report { outcome: Outcome::LeftTrustedRegion, ..report };
                    }
                } else if !(size <= longest) {
                    return report;
                }
                if size <= last && report.iterations == 1 {
                    // Already there. To move on by less than the legs follow would add up over the cycles.
                    let sound = kinematic_state.sensitivity.condition <= LARGEST_CONDITION;
                    report.outcome = if sound { Outcome::Solved } else { Outcome::NearSingular };
                    return report;
                }
                at = at.moved(simd, &step);
                if first == 0.0 {
                    if size <= last {
                        report.outcome = self.arrive(kinematic_state, &at, legs, residual, &balance);
                        return report;
                    }
                    first = size;
                }
                longest = size.max(last);
                let s = at.reach + at.arm;
                residual = self.residual(s);
                let error = first * size;
                if error <= last || first * error > last {
                    break s;
                }
            };
            (legs.arm, legs.direction) = (at.arm, s * inverse_target);
            balance = Balance::new(simd, joints, &legs);
        }
    }

    /// `(L^2 - |s|^2) / 2 L`
    #[inline(always)]
    fn residual(&self, s: Lanes3<V>) -> V {
        self.target.mul_sub(self.target, s.dot(s)) * self.inverse_target * V::splat(self.simd, 0.5)
    }

    /// The last step brings the pose to the target lengths; what was left before it changes the directions of
    /// the legs by rounding only.
    #[inline(always)]
    fn arrive(
        &self,
        kinematic_state: &mut KinematicState,
        at: &Iterate<V, V::Half>,
        mut legs: LegGeometry<V>,
        residual: V,
        balance: &Balance<'a, S, V>,
    ) -> Outcome {
        let Self { simd, joints, target, inverse_target } = *self;
        legs.length = target;
        legs.inverse_length = (residual * inverse_target).mul_add(inverse_target, inverse_target);
        let sensitivity = Sensitivity::new(simd, joints, &legs, balance);
        // That K grows along the step could lead across, if anything could.
        let same_side = sensitivity.determinant * kinematic_state.sensitivity.determinant > 0.0;
        if !(same_side && sensitivity.condition <= LARGEST_CONDITION) {
            return Outcome::NearSingular;
        }
        kinematic_state.pose = at.pose(simd, joints);
        kinematic_state.legs = StoredLegs::new(&legs);
        kinematic_state.factors = balance.store();
        kinematic_state.sensitivity = sensitivity;
        Outcome::Solved
    }
}

/// [`LAST_STEP`], or what rounding makes of the differences of coordinates, whichever is larger.
#[inline(always)]
fn last_step(joints: &Joints, start: &KinematicState) -> f64 {
    let size = start.pose.position.norm() / joints.radius;
    LAST_STEP.max(f64::EPSILON * ROUNDINGS * (1.0 + size) * start.sensitivity.condition)
}

fn square(x: f64) -> f64 {
    x * x
}
