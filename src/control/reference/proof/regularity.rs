//! Balls of poses that are proved regular: no pose is singular, no condition exceeds the limit, and no leg
//! comes near the first axis of its universal joint. In line with this axis the joint loses a degree of
//! freedom, and the leg's spin is unbounded.
//!
//! At the centre of a ball, N holds the wrenches of the legs, with torques about the mean of the joints and
//! divided by the radius r. `F = |N|` and `B = |N^-1|` are Frobenius norms, L is the length of the shortest
//! leg. The joints have the arms `a` from C and `a'` from their mean. A pose of the ball is displaced by at
//! most d and turned by at most t:
//!
//! ```text
//! s = d + a t                           displacement of a joint
//! q = s / sqrt(L (L - s))               change of a leg's direction
//! |N - N0| <= D = sqrt(6 q^2 + 6 (t + q)^2)                      as the mean of (a'/r)^2 is 1
//! condition <= min(F + D, sqrt 12) B / (1 - B D)                 where B D < 1
//! sine of the angle between a leg and that axis >= sine at the centre - q
//! ```
//!
//! The search for the workspace bounds its cells in the same way. A ball holds for many cycles once it is
//! found. All balls of a group are tried at once, one in each lane and without a branch. So the effort does
//! not depend on the ball that covers the pose.

use fearless_simd::{Simd, dispatch, f64x4, mask64x4, prelude::*};
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::reference::proof::drive_forces::{BallLoads, CenterDistance, ForceProof};
use crate::control::reference::proof::refusal::Refusal;
use crate::control::signals::limits::Limit;
use crate::control::signals::pair::Pair;
use crate::model::conditioning::Conditioning;
use crate::model::rigid::Pose;
use crate::model::sensitivity::{MAX_WRENCH_NORM, Sensitivity};

/// Balls in a group, one in each lane.
const LANES: usize = 4;
/// Number of groups that are kept: enough for the balls along one stop.
const GROUPS: usize = 3;

/// Largest chord `|R - R0| / sqrt 2` for which the angle is bounded, and the ratio of the angle's bound to
/// the chord: `2 asin(1/2)`.
const MAX_CHORD: f64 = 1.0;
const ANGLE_PER_CHORD: f64 = core::f64::consts::FRAC_PI_3;

/// Effort for the regularity of a pose, in knots of an [examination](super::examination), and the additional
/// effort if its factorization has pivots.
pub(in crate::control::reference) const REGULARITY_EFFORT: u32 = 1;
const PIVOTING_EFFORT: u32 = 2;

/// Least sine between knots as a ratio of the reference's least sine, whatever the limits of the condition.
const LEAST_SINE_SHARE: f64 = 0.5;

/// Regularity of a pose, or bounds on it.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Regularity {
    /// Condition; as a bound, the largest.
    condition: f64,
    /// Sine of the angle between a leg and the first axis of its universal joint; as a bound, the least.
    universal_sine: f64,
}

impl Regularity {
    /// Regularity of a pose. It is refused if the effort does not suffice.
    pub fn at(constants: &Constants, pose: &Pose, effort: &mut u32) -> Result<Self, Refusal> {
        Ball::new(constants, pose, effort).map(|ball| ball.regularity)
    }

    /// Bounds that the reference must keep.
    pub fn reference_bounds(constants: &Constants) -> Self {
        Self { condition: constants.max_reference_condition, universal_sine: constants.universal_sine }
    }

    /// Bounds that poses between knots must keep: the platform's limit of the condition, and a sine that is
    /// smaller in the same ratio.
    pub fn between_knots_bounds(constants: &Constants) -> Self {
        let condition = constants.parameters.condition;
        let share = (constants.max_reference_condition / condition).clamp(LEAST_SINE_SHARE, 1.0);
        Self { condition, universal_sine: constants.universal_sine * share }
    }

    /// The looser of both bounds, for each quantity.
    pub fn looser_of(&self, other: &Self) -> Self {
        Self {
            condition: self.condition.max(other.condition),
            universal_sine: self.universal_sine.min(other.universal_sine),
        }
    }

    /// Whether another regularity keeps both bounds.
    pub fn is_kept_by(&self, other: &Self) -> bool {
        other.condition <= self.condition && other.universal_sine >= self.universal_sine
    }
}

/// Balls in SIMD lanes: each column holds one quantity of all balls. An unused lane has a leg length of 0 and
/// covers nothing.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct BallGroup {
    /// Centre: position, and rotation column by column.
    position: [[f64; LANES]; 3],
    rotation: [[f64; LANES]; 9],
    /// F, B, and the length of the shortest leg \[m\].
    norm: [f64; LANES],
    inverse_norm: [f64; LANES],
    shortest: [f64; LANES],
    /// Least sine of the angle between a leg and the first axis of its universal joint, at the centre.
    universal_sine: [f64; LANES],
}

impl BallGroup {
    /// Puts a ball around a pose into a lane.
    fn set(&mut self, lane: usize, center: &Pose, ball: &Ball) {
        let put = |column: &mut [f64; LANES], number: f64| {
            if let Some(lane) = column.get_mut(lane) {
                *lane = number;
            }
        };
        self.position.iter_mut().zip(center.position.as_slice()).for_each(|(column, x)| put(column, *x));
        self.rotation.iter_mut().zip(center.rotation.as_slice()).for_each(|(column, r)| put(column, *r));
        put(&mut self.norm, ball.norm);
        put(&mut self.inverse_norm, ball.inverse_norm);
        put(&mut self.shortest, ball.shortest);
        put(&mut self.universal_sine, ball.regularity.universal_sine);
    }

    /// Distances of a pose from each centre.
    #[inline(always)]
    fn center_distances<S: Simd>(&self, simd: S, pose: &Pose) -> CenterDistances<S> {
        let squared = |columns: &[[f64; LANES]], numbers: &[f64]| {
            let columns = columns.iter().zip(numbers);
            let differences = columns
                .map(|(center, number)| f64x4::splat(simd, *number) - f64x4::load_array(simd, *center));
            differences.fold(f64x4::splat(simd, 0.0), |sum, difference| sum + difference * difference)
        };
        let shift = squared(&self.position, pose.position.as_slice()).sqrt();
        let half = f64x4::splat(simd, 0.5);
        let chord = (squared(&self.rotation, pose.rotation.as_slice()) * half).sqrt();
        let turn = chord * f64x4::splat(simd, ANGLE_PER_CHORD);
        CenterDistances { shift, turn, chord }
    }

    /// Which balls prove that every pose within a reach of a displaced pose is as regular as required.
    #[inline(always)]
    fn coverage<S: Simd>(
        &self,
        simd: S,
        constants: &Constants,
        distances: &CenterDistances<S>,
        reach: Reach,
        required: &Regularity,
    ) -> Coverage<S> {
        let splat = |number: f64| f64x4::splat(simd, number);
        let load = |column: &[f64; LANES]| f64x4::load_array(simd, *column);
        let (norm, inverse_norm) = (load(&self.norm), load(&self.inverse_norm));
        let (shortest, universal_sine) = (load(&self.shortest), load(&self.universal_sine));
        let turn = distances.turn + splat(reach.angular);
        let moved = distances.shift + splat(reach.linear) + splat(constants.arm) * turn;
        let left = shortest - moved;
        let turned_squared = moved * moved / (shortest * left);
        let turned_leg = turned_squared.sqrt();
        let turned_arm = turn + turned_leg;
        let change = (splat(6.0) * (turned_squared + turned_arm * turned_arm)).sqrt();
        let largest_norm = (norm + change).min(splat(MAX_WRENCH_NORM));
        let Regularity { condition, universal_sine: least_sine } = *required;
        let is_covered = left.simd_gt(splat(0.0))
            & distances.chord.simd_le(splat(MAX_CHORD))
            & (universal_sine - turned_leg).simd_ge(splat(least_sine))
            & (largest_norm * inverse_norm).simd_le(splat(condition) * (splat(1.0) - inverse_norm * change));
        Coverage { is_covered, turn, turned_leg, change }
    }
}

/// Balls of a group that cover poses, and t, q and D of these poses.
struct Coverage<S: Simd> {
    is_covered: mask64x4<S>,
    turn: f64x4<S>,
    turned_leg: f64x4<S>,
    change: f64x4<S>,
}

impl<S: Simd> Coverage<S> {
    /// The lane of the ball that covers the poses with the least change of N.
    #[inline(always)]
    fn nearest(&self, simd: S) -> Option<(usize, CenterDistance)> {
        if !self.is_covered.any_true() {
            return None;
        }
        let changes = self.is_covered.select(self.change, f64x4::splat(simd, f64::INFINITY)).to_array();
        let lanes = changes.into_iter().enumerate();
        let (lane, change) =
            lanes.fold((0, f64::INFINITY), |least, lane| if lane.1 < least.1 { lane } else { least });
        let of_lane = |lanes: f64x4<S>| lanes.to_array().get(lane).copied().unwrap_or(f64::INFINITY);
        let distance =
            CenterDistance { turn: of_lane(self.turn), turned_leg: of_lane(self.turned_leg), change };
        Some((lane, distance))
    }
}

/// Bounds on the distance of a pose from each centre: shift \[m\] and turn \[rad\], and the chord of the
/// turn.
struct CenterDistances<S: Simd> {
    shift: f64x4<S>,
    turn: f64x4<S>,
    chord: f64x4<S>,
}

/// Ball without its centre.
struct Ball {
    norm: f64,
    inverse_norm: f64,
    shortest: f64,
    /// Regularity of the centre.
    regularity: Regularity,
    loads: BallLoads,
}

impl Ball {
    /// Ball around a pose, refused if the effort does not suffice. Only the factorization shows whether
    /// pivots are needed: their effort is subtracted afterwards.
    fn new(constants: &Constants, center: &Pose, effort: &mut u32) -> Result<Self, Refusal> {
        *effort = effort.checked_sub(REGULARITY_EFFORT).ok_or(Refusal::Effort)?;
        let Conditioning { sensitivity, largest_row, shortest, universal_sine, is_pivoted } =
            Conditioning::new(constants.machine(), center);
        if is_pivoted {
            *effort = effort.saturating_sub(PIVOTING_EFFORT);
        }
        let Sensitivity { condition, norm, .. } = sensitivity;
        let regularity = Regularity { condition, universal_sine };
        let inverse_norm = condition / norm;
        let loads = BallLoads::new(center, inverse_norm, largest_row);
        Ok(Self { norm, inverse_norm, shortest, regularity, loads })
    }
}

/// Distances around a pose: shift \[m\] and turn \[rad\].
pub(in crate::control::reference) type Reach = Pair<f64>;

/// Poses around one pose, and the regularity that is required of them.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct RegularityQuery<'a> {
    pub pose: &'a Pose,
    pub reach: Reach,
    pub required: Regularity,
}

/// The balls that were found last.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct RegularBalls {
    groups: [BallGroup; GROUPS],
    /// Loads of the drives at the centres, group by group.
    loads: [BallLoads; GROUPS * LANES],
    /// Index of the group that covered the last pose.
    recent: usize,
    /// Number of balls that were kept, modulo the capacity. The next ball replaces the oldest.
    next_slot: usize,
}

impl RegularBalls {
    /// Whether all poses of a query are proved regular, and strong enough for a stop: by the balls that are
    /// kept, or by a new one if the effort suffices. `false` is no proof of the contrary.
    pub fn prove(
        &mut self,
        constants: &Constants,
        around: &RegularityQuery<'_>,
        forces: &mut ForceProof,
        effort: &mut u32,
    ) -> bool {
        self.prove_from_kept(constants, around, forces)
            || self.prove_from_new(constants, around, forces, effort).is_ok()
    }

    /// Whether the balls that are kept prove all poses of a query.
    fn prove_from_kept(
        &mut self,
        constants: &Constants,
        around: &RegularityQuery<'_>,
        forces: &mut ForceProof,
    ) -> bool {
        let RegularityQuery { pose, reach, required } = around;
        dispatch!(constants.machine().level, simd => {
            for index in self.recent_first() {
                if let Some(group) = self.groups.get(index) {
                    let distances = group.center_distances(simd, pose);
                    let coverage = group.coverage(simd, constants, &distances, *reach, required);
                    if are_strong(simd, constants, &mut self.loads, index, &coverage, forces) {
                        self.recent = index;
                        return true;
                    }
                }
            }
            false
        })
    }

    /// Indices of the groups. The group that covered the last pose comes first, because the next pose is
    /// usually near.
    #[inline(always)]
    fn recent_first(&self) -> impl Iterator<Item = usize> + use<> {
        let recent = self.recent;
        (0..GROUPS).map(move |k| (recent + k) % GROUPS)
    }

    /// Whether the balls that are kept prove a knot and the poses around it. The knot must keep the
    /// reference's bounds; poses around it need only the platform's looser bounds. Otherwise a reference at
    /// its limit could never move away.
    #[inline(always)]
    pub fn prove_knot_from_kept<S: Simd>(
        &mut self,
        simd: S,
        constants: &Constants,
        pose: &Pose,
        reach: Reach,
        forces: &mut ForceProof,
    ) -> bool {
        let [at_knot, around] =
            [Regularity::reference_bounds(constants), Regularity::between_knots_bounds(constants)];
        let mut are_surroundings_covered = false;
        for index in self.recent_first() {
            let Some(group) = self.groups.get(index) else { continue };
            let distances = group.center_distances(simd, pose);
            if !are_surroundings_covered {
                let coverage = group.coverage(simd, constants, &distances, reach, &around);
                are_surroundings_covered =
                    are_strong(simd, constants, &mut self.loads, index, &coverage, forces);
            }
            // Without covered surroundings the knot becomes the centre of a new ball.
            if !are_surroundings_covered {
                continue;
            }
            let coverage = group.coverage(simd, constants, &distances, Reach::default(), &at_knot);
            let Some((_, ball, distance)) = nearest(simd, &mut self.loads, index, &coverage) else {
                continue;
            };
            if forces.is_held(constants, ball, &distance) {
                self.recent = index;
                return true;
            }
        }
        false
    }

    /// Covers the poses of a query by a new ball. Returns the regularity of the pose at its centre.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    pub fn prove_from_new(
        &mut self,
        constants: &Constants,
        around: &RegularityQuery<'_>,
        forces: &mut ForceProof,
        effort: &mut u32,
    ) -> Result<Regularity, Refusal> {
        let RegularityQuery { pose, reach, required } = around;
        let ball = Ball::new(constants, pose, effort)?;
        let (slot, index) = (self.next_slot, self.next_slot / LANES);
        let group = self.groups.get_mut(index).ok_or(Refusal::Effort)?;
        group.set(slot % LANES, pose, &ball);
        *self.loads.get_mut(slot).ok_or(Refusal::Effort)? = ball.loads;
        forces.forget();
        // Another ball of the group may cover the poses as well. A new ball that is too small for the reach
        // may still prove a knot: it stays until the next new ball.
        let Some(group) = self.groups.get(index) else { return Err(Refusal::Effort) };
        dispatch!(constants.machine().level, simd => {
            let distances = group.center_distances(simd, pose);
            let coverage = group.coverage(simd, constants, &distances, *reach, required);
            if !coverage.is_covered.any_true() {
                Err(Limit::Condition)
            } else if !are_strong(simd, constants, &mut self.loads, index, &coverage, forces)
                || !self.loads.get_mut(slot).is_some_and(|ball| {
                    forces.is_held(constants, ball, &CenterDistance::default())
                })
            {
                Err(Limit::Force)
            } else {
                Ok(())
            }
        })?;
        self.recent = index;
        self.next_slot = (self.next_slot + 1) % (GROUPS * LANES);
        Ok(ball.regularity)
    }
}

/// Whether a ball of a group proves that the drives are strong enough for a stop among covered poses.
#[inline(always)]
fn are_strong<S: Simd>(
    simd: S,
    constants: &Constants,
    loads: &mut [BallLoads],
    group: usize,
    coverage: &Coverage<S>,
    forces: &mut ForceProof,
) -> bool {
    let Some((index, ball, distance)) = nearest(simd, loads, group, coverage) else { return false };
    forces.holds(simd, constants, (index, ball), &distance)
}

/// The nearest ball of a group that covers poses, its index, and the distance of the poses from its centre.
#[inline(always)]
fn nearest<'a, S: Simd>(
    simd: S,
    loads: &'a mut [BallLoads],
    group: usize,
    coverage: &Coverage<S>,
) -> Option<(usize, &'a mut BallLoads, CenterDistance)> {
    let (lane, distance) = coverage.nearest(simd)?;
    let index = group * LANES + lane;
    Some((index, loads.get_mut(index)?, distance))
}
