//! Forward kinematics: the pose from six leg lengths, by Newton's method on SE(3).
//!
//! ```text
//! residual r_i = L_i - L_i(pose)      J^-1 [dw; dv] = r      R <- turn(dw) R,   M <- M + dv
//! ```
//!
//! M is the mean of the joints on the platform, so that the way to the solution does not depend on where C
//! is; `turn` is Cayley's rotation, which differs from `exp` by a third power. Steps are added to the rotation,
//! not to Bryan angles (which converges only linearly).
//!
//! A factorization costs more than an evaluation of the lengths, so it is used again (the chord method) where a
//! second step of it comes as near as a new one would. With the error e and the first step q the next error is
//! `e^2` with a new factorization, `e q` with the old one. On the way r is `(L_i^2 - |s_i|^2) / 2 L_i`, which
//! has the same zero and needs no root and no division. The last factorization is at the solution and stays
//! for all who need it ([`Stance`]).
//!
//! Lengths do not determine the pose: up to 40 real poses share them (assembly modes), and a small
//! residual says nothing about being on the wrong one. Uniqueness comes from continuity: a step is only
//! taken within Kantorovich's bound ([`Sensitivity::trusted_step`]), where there is a solution nearby and only
//! one. [`refine`] needs a start that near; [`Tracker`] walks toward far lengths in such steps, and cannot leave
//! the assembly mode it started on.
//!
//! Conditioning: errors of the lengths are amplified by the condition of N. Toward a singular pose the
//! trusted steps become shorter and end before it.

use fearless_simd::{Simd, dispatch, f64x8};
use nalgebra::{Matrix3, Vector6};

use super::balance::{Balance, LaneTwist};
use super::inverse_geometry::LegGeometry;
use super::lanes::{Eight, Four, Reals};
use super::lanes3::Lanes3;
use super::machine::{Joints, LEGS, Machine};
use super::rigid::Pose;
use super::stance::{Sensitivity, Stance, StoredLegs};

/// Bound on factorizations. From the edge of the trusted region six suffice to rounding, by Kantorovich.
pub const MAX_ITERATIONS: u32 = 8;

/// A step this small (radian, or radius) is the last: the legs are where the pose is, to all practical digits, and
/// the pose, which still takes it, is so to rounding.
const LAST_STEP: f64 = 1e-12;

/// Errors of rounding that add up in a residual, about.
const ROUNDINGS: f64 = 8.0;

/// How much of a trusted step is taken toward lengths that are further away: rounding must not undo it.
const PART_OF_TRUSTED: f64 = 0.99;

/// Bound on the steps of [`Tracker::find`]: one is some hundredths of the radius, and the steps toward a singular
/// pose end after about fifty.
const MOST_STEPS: u32 = 2000;

/// Beyond this condition a pose counts as singular: an encoder's error of 1 um is up to 1 cm at the platform, and
/// a leg may push 10,000 times the load. Machines that are meant to work have 2 to 100.
pub const LARGEST_CONDITION: f64 = 1e4;

/// How it went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The pose belongs to the lengths, and no other pose in the trusted region does.
    Solved,
    /// The iterations were used up.
    NotConverged,
    /// The lengths are further away than one trusted step.
    LeftTrustedRegion,
    /// The pose would be singular, or worse than [`LARGEST_CONDITION`].
    NearSingular,
}

/// What a call of [`refine`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    pub outcome: Outcome,
    /// Steps of Newton's method.
    pub iterations: u32,
    /// Size of the first step over that of the largest trusted one.
    pub reach: f64,
}

/// Moves a stance to the pose with these leg lengths \[m\], if that is one trusted step away. Otherwise the
/// stance stays where it is.
pub fn refine(machine: &Machine, stance: &mut Stance, lengths: &[f64; LEGS]) -> Report {
    let joints = &machine.joints;
    let target = joints.triples.pack(lengths);
    dispatch!(machine.level, simd => {
        let legs = stance.legs.load::<_, f64x8<_>>(simd);
        let balance = Balance::load(simd, joints, &stance.factors);
        Newton::new(simd, joints, Eight::load(simd, &target)).refine(stance, legs, balance)
    })
}

/// Newton's method toward some lengths.
struct Newton<'a, S: Simd, V: Eight<S>> {
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
    fn new(simd: S, joints: &'a Joints, target: V) -> Self {
        Self { simd, joints, target, inverse_target: V::splat(simd, 1.0) / target }
    }

    #[inline(always)]
    fn refine(
        &self,
        stance: &mut Stance,
        mut legs: LegGeometry<V>,
        mut balance: Balance<'a, S, V>,
    ) -> Report {
        let Self { simd, joints, target, inverse_target } = *self;
        // Sizes are squares.
        let (last, trusted) = (square(last_step(joints, stance)), square(stance.sensitivity.trusted_step));
        let linear_weight = V::Half::splat(simd, 1.0 / square(joints.radius));
        let mut at = Iterate::start(simd, joints, &stance.pose);
        let mut residual = target - legs.length;
        let mut report = Report { outcome: Outcome::NotConverged, iterations: 0, reach: f64::NAN };
        // Steps become shorter: Kantorovich halves them at least.
        let mut longest = trusted;
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
                    report.reach = size / trusted;
                }
                if !(size <= longest) {
                    let reach = report.reach.sqrt();
                    return Report { outcome: Outcome::LeftTrustedRegion, reach, ..report };
                }
                if size <= last && report.iterations == 1 {
                    // Already there. To move on by less than the legs follow would add up over the cycles.
                    let sound = stance.sensitivity.condition <= LARGEST_CONDITION;
                    report.outcome = if sound { Outcome::Solved } else { Outcome::NearSingular };
                    return report;
                }
                at = at.moved(simd, &step);
                if first == 0.0 {
                    if size <= last {
                        report.outcome = self.arrive(stance, &at, legs, residual, &balance);
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
        stance: &mut Stance,
        at: &Iterate<V, V::Half>,
        mut legs: LegGeometry<V>,
        residual: V,
        balance: &Balance<'a, S, V>,
    ) -> Outcome {
        let Self { simd, joints, target, inverse_target } = *self;
        legs.length = target;
        legs.inverse_length = (residual * inverse_target).mul_add(inverse_target, inverse_target);
        let sensitivity = Sensitivity::new(simd, joints, &legs, balance);
        if !(sensitivity.condition <= LARGEST_CONDITION) {
            return Outcome::NearSingular;
        }
        stance.pose = at.pose(simd, joints);
        stance.legs = StoredLegs::new(&legs);
        stance.factors = balance.store();
        stance.sensitivity = sensitivity;
        Outcome::Solved
    }
}

/// [`LAST_STEP`], or what rounding makes of the differences of coordinates, whichever is larger.
#[inline(always)]
fn last_step(joints: &Joints, start: &Stance) -> f64 {
    let size = start.pose.position.norm() / joints.radius;
    LAST_STEP.max(f64::EPSILON * ROUNDINGS * (1.0 + size) * start.sensitivity.condition)
}

fn square(x: f64) -> f64 {
    x * x
}

/// Follows measured lengths without leaving the assembly mode it started on.
#[derive(Clone, Copy, Debug)]
pub struct Tracker {
    /// Pose of the last converged step.
    pub pose: Pose,
    /// The same with its legs and factorization.
    stance: Stance,
    outcome: Outcome,
}

/// What one step of a [`Tracker`] achieved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracked {
    /// The pose belongs to the given lengths.
    Found,
    /// The lengths are further away than one step: the pose is on its way.
    Approaching,
    /// There is no trusted step toward the lengths; the pose is the last good one. [`Tracker::outcome`] says why.
    NotConverged,
}

impl Tracker {
    /// Starts at a known pose.
    pub fn new(machine: &Machine, pose: Pose) -> Self {
        Self { pose, stance: Stance::new(machine, pose), outcome: Outcome::Solved }
    }

    /// The pose with its legs and factorization.
    pub fn stance(&self) -> &Stance {
        &self.stance
    }

    /// Of the last step.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// One trusted step toward the pose with these lengths; also the iterations it took.
    pub fn advance(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> (Tracked, u32) {
        let mut iterations = 0;
        let mut tracked = Tracked::Found;
        let mut report = self.step(machine, lengths, &mut iterations);
        if report.outcome == Outcome::LeftTrustedRegion {
            tracked = Tracked::Approaching;
            let here = Vector6::from(self.stance.lengths(machine));
            let part = here + (Vector6::from(*lengths) - here) * (PART_OF_TRUSTED / report.reach);
            report = self.step(machine, &part.into(), &mut iterations);
        }
        (if report.outcome == Outcome::Solved { tracked } else { Tracked::NotConverged }, iterations)
    }

    fn step(&mut self, machine: &Machine, lengths: &[f64; LEGS], iterations: &mut u32) -> Report {
        let report = refine(machine, &mut self.stance, lengths);
        *iterations += report.iterations;
        (self.pose, self.outcome) = (*self.stance.pose(), report.outcome);
        report
    }

    /// Steps until the pose is found: for use off line, where nobody waits. Also the iterations it took.
    pub fn find(&mut self, machine: &Machine, lengths: &[f64; LEGS]) -> (Tracked, u32) {
        let mut iterations = 0;
        for _ in 0..MOST_STEPS {
            let (tracked, spent) = self.advance(machine, lengths);
            iterations += spent;
            if tracked != Tracked::Approaching {
                return (tracked, iterations);
            }
        }
        self.outcome = Outcome::NotConverged;
        (Tracked::NotConverged, iterations)
    }
}
