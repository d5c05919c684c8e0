//! Balls of poses in SIMD lanes: distances of a pose from all centres, and which balls cover it. All are tried at
//! once, without a branch. So the effort does not depend on the ball that covers the pose.

use fearless_simd::{Simd, f64x4, mask64x4, prelude::*};
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::reference::proof::drive_forces::CenterDistance;
use crate::control::reference::proof::regularity::{CenterConditioning, Reach, Regularity};
use crate::model::rigid::Pose;
use crate::model::sensitivity::MAX_LEG_WRENCHES_NORM;

/// Balls in a group, one in each lane.
pub(super) const LANES: usize = 4;
/// Largest chord `|R - R0| / sqrt 2` for which the angle is bounded, and the ratio of the angle's bound to
/// the chord: `2 asin(1/2)`.
const MAX_CHORD: f64 = 1.0;
const ANGLE_PER_CHORD: f64 = core::f64::consts::FRAC_PI_3;

/// Balls in SIMD lanes: each column holds one quantity of all balls. An unused lane has a leg length of 0 and
/// covers nothing.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct BallGroup {
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
    pub fn set(&mut self, lane: usize, center: &Pose, ball: &CenterConditioning) {
        let put = |column: &mut [f64; LANES], number: f64| {
            if let Some(lane) = column.get_mut(lane) {
                *lane = number;
            }
        };
        self.position.iter_mut().zip(center.position.as_slice()).for_each(|(column, x)| put(column, *x));
        self.rotation.iter_mut().zip(center.rotation.as_slice()).for_each(|(column, r)| put(column, *r));
        put(&mut self.norm, ball.norm);
        put(&mut self.inverse_norm, ball.inverse_norm);
        put(&mut self.shortest, ball.shortest_m);
        put(&mut self.universal_sine, ball.regularity.universal_sine);
    }

    /// Distances of a pose from each centre.
    #[inline(always)]
    pub fn center_distances<S: Simd>(&self, simd: S, pose: &Pose) -> CenterDistances<S> {
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
    pub fn coverage<S: Simd>(
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
        let moved = distances.shift + splat(reach.linear) + splat(constants.arm_m) * turn;
        let left = shortest - moved;
        let turned_squared = moved * moved / (shortest * left);
        let turned_leg = turned_squared.sqrt();
        let turned_arm = turn + turned_leg;
        let change = (splat(6.0) * (turned_squared + turned_arm * turned_arm)).sqrt();
        let largest_norm = (norm + change).min(splat(MAX_LEG_WRENCHES_NORM));
        let Regularity { condition, universal_sine: least_sine } = *required;
        let is_covered = left.simd_gt(splat(0.0))
            & distances.chord.simd_le(splat(MAX_CHORD))
            & (universal_sine - turned_leg).simd_ge(splat(least_sine))
            & (largest_norm * inverse_norm).simd_le(splat(condition) * (splat(1.0) - inverse_norm * change));
        Coverage { is_covered, turn, turned_leg, change }
    }
}

/// Balls of a group that cover poses, and t, q and D of these poses.
pub(super) struct Coverage<S: Simd> {
    pub is_covered: mask64x4<S>,
    turn: f64x4<S>,
    turned_leg: f64x4<S>,
    change: f64x4<S>,
}

impl<S: Simd> Coverage<S> {
    /// The lane of the ball that covers the poses with the least change of N.
    #[inline(always)]
    pub fn nearest(&self, simd: S) -> Option<(usize, CenterDistance)> {
        if !self.is_covered.any_true() {
            return None;
        }
        let changes = self.is_covered.select(self.change, f64x4::splat(simd, f64::INFINITY)).to_array();
        let lanes = changes.into_iter().enumerate();
        let (lane, change) =
            lanes.fold((0, f64::INFINITY), |least, lane| if lane.1 < least.1 { lane } else { least });
        let of_lane = |lanes: f64x4<S>| lanes.to_array().get(lane).copied().unwrap_or(f64::INFINITY);
        let distance =
            CenterDistance { turn_rad: of_lane(self.turn), turned_leg: of_lane(self.turned_leg), change };
        Some((lane, distance))
    }
}

/// Bounds on the distance of a pose from each centre: shift \[m\] and turn \[rad\], and the chord of the
/// turn.
pub(super) struct CenterDistances<S: Simd> {
    shift: f64x4<S>,
    turn: f64x4<S>,
    chord: f64x4<S>,
}
