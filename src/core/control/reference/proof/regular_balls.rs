//! The balls of regular poses that were found last. A ball holds for many cycles once it is found.

use fearless_simd::{Simd, dispatch, prelude::*};
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::reference::proof::ball_group::{BallGroup, Coverage, LANES};
use crate::control::reference::proof::drive_forces::{BallLoads, CenterDistance, ForceProof};
use crate::control::reference::proof::refusal::Refusal;
use crate::control::reference::proof::regularity::{CenterConditioning, Reach, Regularity, RegularityQuery};
use crate::control::signals::limits::Limit;
use crate::model::rigid::Pose;

/// Number of groups that are kept: enough for the balls along one stop.
const GROUPS: usize = 3;

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
        let ball = CenterConditioning::new(constants, pose, effort)?;
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
