//! Forward kinematics of many poses: eight at once, one per lane.
//!
//! Newton's method of [`super::newton`], but with a new factorization in each step, as lanes differ in where an old one would do.
//! A lane for which the trusted region does not prove the outcome is solved alone by [`refine`].

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use nalgebra::{Matrix3, Vector3};

use super::newton::{CONVERGED_STEP, rounding};
use super::{MAX_CONDITION, MAX_NEWTON_STEPS, Outcome, refine};
use crate::model::LEGS;
use crate::model::factorization::are_regular_blocks;
use crate::model::kinematic_state::KinematicState;
use crate::model::lanes::LaneArithmetic as _;
use crate::model::lanes3::Lanes3;
use crate::model::machine::{Joints, Machine};
use crate::model::pose_factorization::{Column, LANES, Matrix, PoseFactorization, vectors};
use crate::model::rigid::Pose;
use crate::model::sensitivity::MAX_KANTOROVICH_H;
use crate::model::triples::Triples;

/// Largest ratio of the condition at a solution to that at its start: `1 / sqrt(1 - 2 h)` by Kantorovich's theorem, times the
/// ratio of the norms of N, at most `sqrt 2`.
const MAX_CONDITION_GROWTH: f64 = 3.2;

/// Share of the trusted step and of [`MAX_CONDITION`] within which rounding does not decide.
const CLEAR_SHARE: f64 = 0.99;

/// What differs from leg to leg.
#[derive(Clone, Copy, Default)]
struct Leg {
    base: Vector3<f64>,
    platform: Vector3<f64>,
    arm_share: f64,
    arm_curvature: f64,
}

/// Eight poses, one per lane: R, and the mean of the joints on the platform.
struct Poses<S: Simd> {
    rotation: Matrix<S>,
    center: Lanes3<f64x8<S>>,
}

/// Pose at which the legs have these lengths \[m\], for each pair of a start and lengths, to the same place in `poses`; `None` where
/// [`refine`] from that start is not [`Outcome::Solved`]. Elements beyond the shortest slice are left as they are.
///
/// ```
/// use hexad_core::model::{forward_kinematics::poses_near, inverse_geometry::leg_lengths};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mut pose = machine.home_pose();
/// pose.position.z += 1e-3;
/// let mut found = [None; 3];
/// poses_near(&machine, &[machine.home_pose(); 3], &[leg_lengths(&machine, &pose); 3], &mut found);
/// assert!((found[2].unwrap().position - pose.position).norm() < 1e-14);
/// ```
pub fn poses_near(machine: &Machine, starts: &[Pose], lengths_m: &[[f64; LEGS]], poses: &mut [Option<Pose>]) {
    let joints = &machine.joints;
    let legs = in_lane_order(joints);
    let mut tasks = starts.chunks(LANES).zip(lengths_m.chunks(LANES)).zip(poses.chunks_mut(LANES));
    dispatch!(machine.level, simd => {
        for ((starts, lengths), poses) in &mut tasks {
            let (Some(first_start), Some(first_lengths)) = (starts.first(), lengths.first()) else { continue };
            let padded_starts = core::array::from_fn(|lane| *starts.get(lane).unwrap_or(first_start));
            let padded_lengths = core::array::from_fn(|lane| *lengths.get(lane).unwrap_or(first_lengths));
            let (found, is_proved) = solved(simd, joints, &legs, &padded_starts, &padded_lengths);
            let found = found.into_iter().zip(is_proved);
            for ((pose, (start, lengths)), (found, is_proved)) in
                poses.iter_mut().zip(starts.iter().zip(lengths)).zip(found)
            {
                *pose = if is_proved { Some(found) } else { solved_alone(machine, start, lengths) };
            }
        }
    });
}

fn solved_alone(machine: &Machine, start: &Pose, lengths: &[f64; LEGS]) -> Option<Pose> {
    let mut state = KinematicState::new(machine, *start);
    (refine(machine, &mut state, lengths).outcome == Outcome::Solved).then_some(*state.pose())
}

fn in_lane_order(joints: &Joints) -> [Leg; LEGS] {
    let [base, platform] =
        [&joints.base, &joints.around_center].map(|v| Triples::LANE_ORDER.unpack_vectors(v));
    let [shares, curvatures] =
        [&joints.arm_share, &joints.arm_curvature].map(|lanes| Triples::LANE_ORDER.unpack(lanes));
    let mut legs = [Leg::default(); LEGS];
    let places = base.into_iter().zip(platform).zip(shares.into_iter().zip(curvatures));
    for (leg, ((base, platform), (arm_share, arm_curvature))) in legs.iter_mut().zip(places) {
        *leg = Leg { base, platform, arm_share, arm_curvature };
    }
    legs
}

/// Poses after the last step, and whether each is proved to be the outcome of [`refine`].
#[inline(always)]
fn solved<S: Simd>(
    simd: S,
    joints: &Joints,
    legs: &[Leg; LEGS],
    starts: &[Pose; LANES],
    lengths: &[[f64; LEGS]; LANES],
) -> ([Pose; LANES], [bool; LANES]) {
    let linear_weight = f64x8::splat(simd, 1.0 / square(joints.radius_m));
    let mut at = Poses::load(simd, joints, starts);
    let targets = load_lengths(simd, joints, lengths);
    let (step, certificate) = first_step(simd, joints, legs, &at, &targets);
    at = at.moved(simd, &step);
    let one = f64x8::splat(simd, 1.0);
    let [l0, l1, l2, l3, l4, l5] = targets;
    let inverses = [one / l0, one / l1, one / l2, one / l3, one / l4, one / l5];
    let mut columns = [Column::zero(simd); LEGS];
    let mut residuals = targets;
    let mut error = [f64::INFINITY; LANES];
    for _ in 1..MAX_NEWTON_STEPS {
        for (leg, ((column, residual), (target, inverse))) in
            legs.iter().zip(columns.iter_mut().zip(&mut residuals).zip(targets.iter().zip(&inverses)))
        {
            let [arm, s] = at.arm_and_leg(simd, leg);
            *residual = target.fused_mul_sub(*target, s.dot(s)) * *inverse * f64x8::splat(simd, 0.5);
            *column = Column::new(arm, s * *inverse);
        }
        let step = PoseFactorization::new(simd, columns.each_ref()).twist(residuals);
        at = at.moved(simd, &step);
        error = (size_squared(&step, linear_weight) * certificate.curvature).to_array();
        if error.into_iter().all(is_rounding) {
            break;
        }
    }
    let mut is_proved = certificate.holds(joints, starts);
    for (is_proved, error) in is_proved.iter_mut().zip(error) {
        *is_proved &= is_rounding(error);
    }
    (at.poses(simd, joints), is_proved)
}

/// What is known of the solution in each lane before the second step.
struct Certificate<S: Simd> {
    /// `|K| |N^-1|`, by which the square of a step is the next error.
    curvature: f64x8<S>,
    /// Square of the first step.
    first: f64x8<S>,
    condition: f64x8<S>,
    determinants: [f64x8<S>; 2],
}

/// First step, from the lengths at the start.
#[inline(always)]
fn first_step<S: Simd>(
    simd: S,
    joints: &Joints,
    legs: &[Leg; LEGS],
    at: &Poses<S>,
    targets: &[f64x8<S>; LEGS],
) -> ([Lanes3<f64x8<S>>; 2], Certificate<S>) {
    let [zero, one] = [0.0, 1.0].map(|value| f64x8::splat(simd, value));
    let linear_weight = f64x8::splat(simd, 1.0 / square(joints.radius_m));
    let mut columns = [Column::zero(simd); LEGS];
    let mut residuals = *targets;
    let (mut curvature, mut wrench) = (zero, zero);
    for (leg, (column, residual)) in legs.iter().zip(columns.iter_mut().zip(&mut residuals)) {
        let [arm, s] = at.arm_and_leg(simd, leg);
        let length = s.dot(s).sqrt();
        let inverse = one / length;
        *residual -= length;
        *column = Column::new(arm, s * inverse);
        let share = f64x8::splat(simd, leg.arm_share);
        let lipschitz = f64x8::splat(simd, leg.arm_curvature).fused_mul_add(inverse, share);
        curvature = lipschitz.fused_mul_add(lipschitz, curvature);
        wrench += column.moment.dot(column.moment).fused_mul_add(linear_weight, one);
    }
    let factorization = PoseFactorization::new(simd, columns.each_ref());
    let inverse = factorization.inverse_norm_squared(f64x8::splat(simd, square(joints.radius_m)));
    let step = factorization.twist(residuals);
    let certificate = Certificate {
        curvature: (curvature * inverse).sqrt(),
        first: size_squared(&step, linear_weight),
        condition: (wrench * inverse).sqrt(),
        determinants: [factorization.d_a, factorization.d_s],
    };
    (step, certificate)
}

impl<S: Simd> Certificate<S> {
    /// Whether the outcome is [`Outcome::Solved`], clear of all bounds; not for NaN.
    #[inline(always)]
    fn holds(&self, joints: &Joints, starts: &[Pose; LANES]) -> [bool; LANES] {
        let [d_a, d_s] = [self.determinants[0].to_array(), self.determinants[1].to_array()];
        let numbers = self.curvature.to_array().into_iter().zip(self.first.to_array());
        let numbers = numbers.zip(self.condition.to_array()).zip(d_a.into_iter().zip(d_s));
        let mut holds = [false; LANES];
        for ((holds, start), (((curvature, first), condition), (d_a, d_s))) in
            holds.iter_mut().zip(starts).zip(numbers)
        {
            // After a first step this short `refine` ends, or it omits the step as rounding.
            let shortest = CONVERGED_STEP.max(rounding(joints, start, condition));
            *holds = first * square(curvature) <= square(CLEAR_SHARE * MAX_KANTOROVICH_H)
                && condition <= CLEAR_SHARE * MAX_CONDITION / MAX_CONDITION_GROWTH
                && first > square(shortest / CLEAR_SHARE)
                && are_regular_blocks(d_a, d_s, joints.radius_cubed_m3);
        }
        holds
    }
}

impl<S: Simd> Poses<S> {
    #[inline(always)]
    fn load(simd: S, joints: &Joints, poses: &[Pose; LANES]) -> Self {
        let rotation = Matrix([
            vectors(simd, poses, |pose| pose.rotation.column(0).into()),
            vectors(simd, poses, |pose| pose.rotation.column(1).into()),
            vectors(simd, poses, |pose| pose.rotation.column(2).into()),
        ]);
        let position = vectors(simd, poses, |pose| pose.position);
        Self { rotation, center: position + rotation.times_vector(simd, &joints.center_m) }
    }

    /// Arm of a leg from the mean of the joints, and the vector along the leg.
    #[inline(always)]
    fn arm_and_leg(&self, simd: S, leg: &Leg) -> [Lanes3<f64x8<S>>; 2] {
        let arm = self.rotation.times_vector(simd, &leg.platform);
        [arm, self.center - Lanes3::splat(simd, &leg.base) + arm]
    }

    /// Poses after one more step.
    #[inline(always)]
    fn moved(&self, simd: S, [angular, linear]: &[Lanes3<f64x8<S>>; 2]) -> Self {
        let u = *angular * f64x8::splat(simd, 0.5);
        let k = f64x8::splat(simd, 2.0) / (f64x8::splat(simd, 1.0) + u.dot(u));
        let Matrix([x, y, z]) = self.rotation;
        Self {
            rotation: Matrix([x.cayley_rotated(u, k), y.cayley_rotated(u, k), z.cayley_rotated(u, k)]),
            center: self.center + *linear,
        }
    }

    /// The poses. One step of Newton's iteration for the polar factor makes R orthonormal.
    #[inline(always)]
    fn poses(&self, simd: S, joints: &Joints) -> [Pose; LANES] {
        let Matrix([x, y, z]) = self.rotation;
        let half = f64x8::splat(simd, 0.5);
        let three_halves = f64x8::splat(simd, 1.5);
        let [xy, yz, zx] = [x.dot(y) * half, y.dot(z) * half, z.dot(x) * half];
        let rotation = Matrix([
            (x * (three_halves - x.dot(x) * half)).minus_scaled(xy, y).minus_scaled(zx, z),
            (y * (three_halves - y.dot(y) * half)).minus_scaled(yz, z).minus_scaled(xy, x),
            (z * (three_halves - z.dot(z) * half)).minus_scaled(zx, x).minus_scaled(yz, y),
        ]);
        let position = self.center - rotation.times_vector(simd, &joints.center_m);
        let Matrix([x, y, z]) = rotation;
        let mut poses = [Pose { rotation: Matrix3::identity(), position: Vector3::zeros() }; LANES];
        store(x, &mut poses, |pose, v| pose.rotation.set_column(0, &v));
        store(y, &mut poses, |pose, v| pose.rotation.set_column(1, &v));
        store(z, &mut poses, |pose, v| pose.rotation.set_column(2, &v));
        store(position, &mut poses, |pose, v| pose.position = v);
        poses
    }
}

/// Writes one vector of each pose.
#[inline(always)]
fn store<S: Simd>(v: Lanes3<f64x8<S>>, poses: &mut [Pose; LANES], write: impl Fn(&mut Pose, Vector3<f64>)) {
    let numbers = v.x.to_array().into_iter().zip(v.y.to_array()).zip(v.z.to_array());
    for (pose, ((x, y), z)) in poses.iter_mut().zip(numbers) {
        write(pose, Vector3::new(x, y, z));
    }
}

/// Length of each leg in each lane.
#[inline(always)]
fn load_lengths<S: Simd>(simd: S, joints: &Joints, lengths: &[[f64; LEGS]; LANES]) -> [f64x8<S>; LEGS] {
    let mut lanes = [[0.0; LANES]; LEGS];
    for (k, lengths) in lengths.iter().enumerate() {
        let ordered = Triples::LANE_ORDER.unpack(&joints.triples.pack(lengths));
        for (lane, length) in lanes.iter_mut().zip(ordered) {
            if let Some(slot) = lane.get_mut(k) {
                *slot = length;
            }
        }
    }
    let [a, b, c, d, e, f] = lanes;
    [
        f64x8::load_array(simd, a),
        f64x8::load_array(simd, b),
        f64x8::load_array(simd, c),
        f64x8::load_array(simd, d),
        f64x8::load_array(simd, e),
        f64x8::load_array(simd, f),
    ]
}

/// Weighted square of a twist, as of one pose.
#[inline(always)]
fn size_squared<S: Simd>([angular, linear]: &[Lanes3<f64x8<S>>; 2], linear_weight: f64x8<S>) -> f64x8<S> {
    linear.dot(*linear).fused_mul_add(linear_weight, angular.dot(*angular))
}

/// Whether the error after a step is below rounding; not for NaN.
fn is_rounding(error: f64) -> bool {
    error <= 0.25 * f64::EPSILON
}

fn square(x: f64) -> f64 {
    x * x
}
