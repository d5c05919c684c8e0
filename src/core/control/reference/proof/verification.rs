//! Verified stop: whether a step, and the stop from its end, keep every limit over their whole length.
//!
//! In free space one pose is enough, because every margin exceeds the length of the stop in any direction.
//! Near a bound the stop is examined knot by knot, see [`super::examination`].

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::parameters::Envelope;
use crate::control::reference::proof::cubic_departure::length_acceleration_bound;
use crate::control::reference::proof::drive_forces::{ForceProof, StopDemand};
use crate::control::reference::proof::examination::{MAX_STEP_EFFORT, StopExamination};
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::refusal::Refusal;
use crate::control::reference::proof::regular_balls::RegularBalls;
use crate::control::reference::proof::regularity::{Regularity, RegularityQuery};
use crate::control::reference::proof::step::Step;
use crate::control::reference::proof::tolerances::VELOCITY_ROUNDING_RATIO;
use crate::control::reference::stop::acceleration_ranges::AccelerationRanges;
use crate::control::reference::stop::pose_stop::{PoseStop, StopKind};
use crate::control::reference::stop::vector_stop::{StopExtent, release_first_extent};
use crate::control::signals::limits::Limits;
use crate::control::signals::pair::Pair;
use crate::model::inverse_geometry::leg_lengths;
use crate::model::rigid::{Motion, Pose};
use crate::model::task::task_coordinates;

/// Verifier of stops. It keeps the balls that were found for the next verification.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control::reference) struct Verifier {
    pub balls: RegularBalls,
}

impl Verifier {
    /// Verifies a step, and the stop from the motion at its end. Returns the kind of the stop, or why none
    /// was proved. A stop that brakes at once is planned in `brake_at_once`.
    pub fn verify(
        &mut self,
        constants: &Constants,
        bounds: &PoseBounds,
        motion: &Motion,
        step: &Step<'_>,
        brake_at_once: &mut PoseStop,
    ) -> Result<StopKind, Refusal> {
        let Limits { orientation, position, .. } = &constants.parameters.limits;
        let Motion { pose, twist, acceleration } = motion;
        let limits = constants.parameters.limits.scaled_at_equal_stopping_distance(step.strength_share);
        let turn = release_first_extent(&twist.angular, &acceleration.angular, &limits.orientation);
        let shift = release_first_extent(&twist.linear, &acceleration.linear, &limits.position);
        let (inner, allowed) = (&step.inner_speeds, 1.0 + VELOCITY_ROUNDING_RATIO);
        let x = bounds.envelope.as_ref().map(|_| task_coordinates(pose, &constants.machine().home));
        let around = RegularityQuery {
            pose,
            reach: Pair { angular: turn.distance_bound, linear: shift.distance_bound },
            required: Regularity::reference_bounds(constants),
        };
        let forces = |kind, speeds, limits: &Limits| {
            let accelerations = AccelerationRanges::of_stop(kind, motion, limits);
            ForceProof::new(constants, StopDemand { accelerations, speeds }, bounds.forces, kind)
        };
        let speeds = Pair { angular: turn.peak_velocity, linear: shift.peak_velocity };
        let mut free = forces(StopKind::ReleaseFirst, speeds, &limits);
        let mut effort = MAX_STEP_EFFORT.saturating_sub(step.effort);
        let is_free = shift.peak_velocity <= position.velocity
            && turn.peak_velocity <= orientation.velocity
            && inner.linear <= allowed * position.velocity
            && inner.angular <= allowed * orientation.velocity
            && shift.peak_velocity + constants.arm_m * turn.peak_velocity
                <= constants.machine().actuator.max_rate_m_s
            && has_room(constants, bounds, pose, x.as_ref(), &shift, &turn, step.duration_s)
            && self.balls.prove(constants, &around, &mut free, &mut effort);
        if is_free {
            return Ok(StopKind::ReleaseFirst);
        }
        let step = Step { effort: MAX_STEP_EFFORT.saturating_sub(effort), ..*step };
        let limits = limits.containing(acceleration);
        brake_at_once.plan(constants.machine().level, StopKind::BrakeAtOnce, motion, &limits);
        let PoseStop { orientation, position } = &*brake_at_once;
        let speeds = Pair { angular: orientation.peak_velocity, linear: position.peak_velocity };
        let forces = forces(StopKind::BrakeAtOnce, speeds, &limits);
        StopExamination::new(constants, bounds, brake_at_once, motion, x.as_ref(), &step, forces)?
            .check_knots(&mut self.balls, motion)?;
        Ok(StopKind::BrakeAtOnce)
    }
}

/// Whether legs and envelope have room for the whole length of a stop, in any direction.
fn has_room(
    constants: &Constants,
    bounds: &PoseBounds,
    pose: &Pose,
    x: Option<&[f64; 6]>,
    shift: &StopExtent,
    turn: &StopExtent,
    step_s: f64,
) -> bool {
    let margin =
        length_acceleration_bound(constants, shift.peak_velocity, turn.peak_velocity) * step_s * step_s / 8.0;
    let need = shift.distance_bound + constants.arm_m * turn.distance_bound + margin;
    let lengths = leg_lengths(constants.machine(), pose);
    let legs = lengths.iter().zip(bounds.shortest_m.iter().zip(&bounds.longest_m));
    let is_within_stroke = legs
        .map(|(length, (shortest, longest))| (length - shortest).min(longest - length))
        .fold(f64::INFINITY, f64::min)
        >= need;
    let Some((envelope, x)) = bounds.envelope.as_ref().zip(x).filter(|_| is_within_stroke) else {
        return is_within_stroke;
    };
    let [_, beta, ..] = x;
    let c = libm::cos((beta.abs() + turn.distance_bound).min(core::f64::consts::FRAC_PI_2));
    let turned = turn.distance_bound / c + margin / constants.arm_m;
    let needs = [
        turned,
        turned,
        turned,
        shift.distance_bound + margin,
        shift.distance_bound + margin,
        shift.distance_bound + margin,
    ];
    let Envelope { lowest, highest } = envelope;
    x.iter()
        .zip(needs)
        .zip(lowest.iter().zip(highest))
        .all(|((x, need), (low, high))| (x - low).min(high - x) >= need)
}
