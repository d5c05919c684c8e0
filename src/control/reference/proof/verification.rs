//! Verified stop: whether the stop from a state keeps every limit along its whole way.
//!
//! In free space one pose is enough: every margin exceeds the length of the way, in any direction. Near a bound the stop is
//! examined knot by knot, see [`super::examination`].

use crate::control::constants::Constants;
use crate::control::parameters::Envelope;
use crate::control::reference::proof::cubic_departure::curvature;
use crate::control::reference::proof::examination::{Examination, MAX_WORK};
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::regularity::{RegularBalls, Regularity, Surroundings};
use crate::control::reference::proof::step::Step;
use crate::control::reference::stop::pose_stop::{PoseStop, StopKind};
use crate::control::reference::stop::vector_stop::{StopExtent, release_first_extent};
use crate::control::signals::limits::{Limit, Limits};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::rigid::{Motion, Pose};
use crate::model::task::task_coordinates;

/// What verifications leave for the next one.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::control::reference) struct Verifier {
    pub balls: RegularBalls,
}

impl Verifier {
    /// Verifies a step and the stop from the motion at its end. Returns which stop, or the limit that no stop was proved to
    /// keep. A planar one is planned in a given place.
    pub fn verify(
        &mut self,
        constants: &Constants,
        bounds: &PoseBounds,
        motion: &Motion,
        step: &Step<'_>,
        planar: &mut PoseStop,
    ) -> Result<StopKind, Limit> {
        let Limits { orientation, position, .. } = &constants.parameters.limits;
        let Motion { pose, twist, acceleration } = motion;
        let turn = release_first_extent(&twist.angular, &acceleration.angular, orientation);
        let shift = release_first_extent(&twist.linear, &acceleration.linear, position);
        let [angular_bulge, linear_bulge] = step.bulge();
        let x = bounds.envelope.as_ref().map(|_| task_coordinates(pose, &constants.machine().home));
        let around = Surroundings {
            pose,
            reach: [shift.length, turn.length],
            required: Regularity::of_reference(constants),
        };
        let mut work = MAX_WORK.saturating_sub(step.work);
        let is_free = shift.peak_velocity + linear_bulge <= position.velocity
            && turn.peak_velocity + angular_bulge <= orientation.velocity
            && shift.peak_velocity + constants.arm * turn.peak_velocity
                <= constants.machine().actuator.max_rate
            && has_room(constants, bounds, pose, x.as_ref(), &shift, &turn, step.duration)
            && self.balls.cover(constants, &around, &mut work);
        if is_free {
            return Ok(StopKind::ReleaseFirst);
        }
        planar.plan(constants.machine().level, StopKind::Planar, motion, &constants.parameters.limits);
        Examination::new(constants, bounds, planar, motion, x.as_ref(), step, work)?
            .run(&mut self.balls, motion)?;
        Ok(StopKind::Planar)
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
    let slack = curvature(constants, shift.peak_velocity, turn.peak_velocity) * step_s * step_s / 8.0;
    let need = shift.length + constants.arm * turn.length + slack;
    let lengths = leg_lengths(constants.machine(), pose);
    let legs = lengths.iter().zip(bounds.shortest.iter().zip(&bounds.longest));
    let is_within_stroke = legs
        .map(|(length, (shortest, longest))| (length - shortest).min(longest - length))
        .fold(f64::INFINITY, f64::min)
        >= need;
    let Some((envelope, x)) = bounds.envelope.as_ref().zip(x).filter(|_| is_within_stroke) else {
        return is_within_stroke;
    };
    let [_, beta, ..] = x;
    let c = libm::cos((beta.abs() + turn.length).min(core::f64::consts::FRAC_PI_2));
    let turned = turn.length / c + slack / constants.arm;
    let needs = [turned, turned, turned, shift.length + slack, shift.length + slack, shift.length + slack];
    let Envelope { lowest, highest } = envelope;
    x.iter()
        .zip(needs)
        .zip(lowest.iter().zip(highest))
        .all(|((x, need), (low, high))| (x - low).min(high - x) >= need)
}
