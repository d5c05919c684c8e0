//! Balls of poses in which no pose is singular and none has a condition beyond the limit, and no leg comes near the first
//! axis of its universal joint: in line with it the joint has lost a freedom, and the leg's spin is unbounded.
//!
//! With N the wrenches of the legs at the centre of a ball, `F = |N|`, `B = |N^-1|` (Frobenius norms, torques about the mean
//! of the joints and divided by the radius r), a pose displaced by at most d and turned by at most t, the arms `a` of the
//! joints from C and `a'` from their mean:
//!
//! ```text
//! s = d + a t                           displacement of a joint
//! q = s / sqrt(L (L - s))               change of a leg's direction, L the shortest leg at the centre
//! |N - N0| <= D = sqrt(6 q^2 + 6 (t + q)^2)                      as the mean of (a'/r)^2 is 1
//! condition <= min(F + D, sqrt 12) B / (1 - B D)                 where B D < 1
//! sine of the angle between a leg and that axis >= that at the centre - q
//! ```
//!
//! The same bounds as those of a cell in the search for the workspace. A ball found once holds for many cycles.

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;

use crate::control::parameters::Constants;
use crate::model::inverse_geometry::universal_sine;
use crate::model::kinematic_state::KinematicState;
use crate::model::rigid::Pose;
use crate::model::sensitivity::Sensitivity;

/// Balls kept: those along one stop.
const BALL_COUNT: usize = 16;

/// Square of the largest Frobenius norm of N: six directions, and six arms whose mean square is 1.
const MAX_WRENCH_NORM_SQUARED: f64 = 12.0;

/// Largest `|R - R0| / sqrt 2` for which an angle is bounded, and its ratio to the angle's bound: `2 asin(1/2)`.
const MAX_CHORD: f64 = 1.0;
const ANGLE_PER_CHORD: f64 = core::f64::consts::FRAC_PI_3;

/// How regular a pose is, or must be at least.
#[derive(Clone, Copy, Debug)]
pub(super) struct Regularity {
    /// Condition, at most.
    condition: f64,
    /// Sine of the angle between a leg and the first axis of its universal joint, at least.
    universal_sine: f64,
}

impl Regularity {
    /// That of a pose.
    pub fn at(constants: &Constants, pose: &Pose) -> Self {
        Ball::new(constants, pose).regularity()
    }

    /// What the reference must keep.
    pub fn of_reference(constants: &Constants) -> Self {
        Self { condition: constants.reference_condition, universal_sine: constants.universal_sine }
    }

    /// The looser bounds of both.
    pub fn or_less(&self, other: &Self) -> Self {
        Self {
            condition: self.condition.max(other.condition),
            universal_sine: self.universal_sine.min(other.universal_sine),
        }
    }

    /// Whether another keeps both bounds.
    pub fn is_kept_by(&self, other: &Self) -> bool {
        other.condition <= self.condition && other.universal_sine >= self.universal_sine
    }
}

/// Centre of a ball.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
struct Ball {
    center: Pose,
    /// F, B, and the length of the shortest leg \[m\].
    norm: f64,
    inverse_norm: f64,
    shortest: f64,
    /// Least sine of the angle between a leg and the first axis of its universal joint.
    universal_sine: f64,
    /// Square of the largest D for the loosest limit of the condition, times `L^2 / 6`.
    largest_change: f64,
}

impl Ball {
    fn new(constants: &Constants, center: &Pose) -> Self {
        let machine = constants.machine();
        let kinematic_state = KinematicState::new(machine, *center);
        let Sensitivity { condition, norm, .. } = *kinematic_state.sensitivity();
        let shortest = kinematic_state.lengths(machine).into_iter().fold(f64::INFINITY, f64::min);
        let universal_sine = universal_sine(machine, center);
        let inverse_norm = condition / norm;
        let limit = constants.parameters.condition.max(constants.reference_condition);
        let change = ((limit - condition) / (inverse_norm * (1.0 + limit)))
            .max(1.0 / inverse_norm - MAX_WRENCH_NORM_SQUARED.sqrt() / limit);
        let largest_change = change.max(0.0).powi(2) * shortest * shortest / 6.0;
        Self { center: *center, norm, inverse_norm, shortest, universal_sine, largest_change }
    }

    /// Of the centre.
    fn regularity(&self) -> Regularity {
        Regularity { condition: self.norm * self.inverse_norm, universal_sine: self.universal_sine }
    }

    /// How a pose differs from the centre; `None` if the ball does not cover it.
    #[inline(always)]
    fn displacement(&self, constants: &Constants, pose: &Pose) -> Option<Displacement> {
        // D at least, times L / sqrt 6, as q >= s / L: most balls are elsewhere. First without roots, which leaves out the
        // turn or the products of shift and turn.
        let shift_squared = (pose.position - self.center.position).norm_squared();
        if 2.0 * shift_squared > self.largest_change {
            return None;
        }
        let (lever, reach) = (constants.arm, self.shortest + constants.arm);
        let chord_squared = (pose.rotation - self.center.rotation).norm_squared() * 0.5;
        let turn_squared = ANGLE_PER_CHORD * ANGLE_PER_CHORD * chord_squared;
        if 2.0 * shift_squared + (lever * lever + reach * reach) * turn_squared > self.largest_change {
            return None;
        }
        let chord = chord_squared.sqrt();
        let (shift, turn) = (shift_squared.sqrt(), ANGLE_PER_CHORD * chord);
        let joint = shift + constants.arm * turn;
        let arm = turn * self.shortest + joint;
        let is_elsewhere = joint * joint + arm * arm > self.largest_change;
        (!is_elsewhere && chord <= MAX_CHORD).then_some(Displacement { shift, turn })
    }

    /// Whether every pose within a reach of a displaced one is regular and has at most a condition.
    #[inline(always)]
    fn covers(&self, constants: &Constants, displacement: &Displacement, reach: Reach, limit: f64) -> bool {
        let Self { norm, inverse_norm, shortest, universal_sine, .. } = self;
        let [shift, turn] = reach;
        let turn = displacement.turn + turn;
        let moved = displacement.shift + shift + constants.arm * turn;
        let left = shortest - moved;
        let turned_squared = moved * moved / (shortest * left);
        let turned_leg = turned_squared.sqrt();
        let turned_arm = turn + turned_leg;
        let change = (6.0 * (turned_squared + turned_arm * turned_arm)).sqrt();
        let largest_norm = (norm + change).min(MAX_WRENCH_NORM_SQUARED.sqrt());
        let least_sine = least_universal_sine(constants, limit);
        left > 0.0
            && universal_sine - turned_leg >= least_sine
            && largest_norm * inverse_norm <= limit * (1.0 - inverse_norm * change)
    }

    fn covers_pose(&self, constants: &Constants, pose: &Pose, reach: Reach, limit: f64) -> bool {
        self.displacement(constants, pose)
            .is_some_and(|displacement| self.covers(constants, &displacement, reach, limit))
    }

    /// Adds what of a knot it covers.
    #[inline(always)]
    fn add_cover(&self, constants: &Constants, pose: &Pose, reach: Reach, cover: &mut KnotCover) {
        let Some(displacement) = self.displacement(constants, pose) else { return };
        let covers = |reach, limit| self.covers(constants, &displacement, reach, limit);
        cover.knot = cover.knot || covers([0.0; 2], constants.reference_condition);
        cover.surroundings = cover.surroundings || covers(reach, constants.parameters.condition);
    }
}

/// Poses around one: a shift \[m\] and a turn \[rad\].
pub(super) type Reach = [f64; 2];

/// Bounds on how far a pose is from the centre of a ball: shift \[m\] and turn \[rad\].
#[derive(Clone, Copy, Debug)]
struct Displacement {
    shift: f64,
    turn: f64,
}

/// What of a knot is proved to be regular.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KnotCover {
    /// The pose itself, and within the condition of the reference.
    pub knot: bool,
    /// The poses around it, within the condition of the platform: else a reference at its own limit could not leave it.
    pub surroundings: bool,
}

impl KnotCover {
    /// Whether nothing is missing.
    pub fn is_complete(&self) -> bool {
        self.knot && self.surroundings
    }
}

/// The balls found last.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RegularBalls {
    balls: [Option<Ball>; BALL_COUNT],
    /// Around the pose that was tried last, if it was too small for its reach.
    too_small: Option<Ball>,
}

impl RegularBalls {
    /// Whether every pose within a reach of a pose is regular and has at most a condition. `false` is no proof of the contrary.
    pub fn cover(&mut self, constants: &Constants, pose: &Pose, reach: Reach, limit: f64) -> bool {
        self.cover_by_known(constants, pose, reach, limit)
            || self.cover_by_new(constants, pose, reach, limit).is_some()
    }

    /// The same by the balls that are kept.
    fn cover_by_known(&mut self, constants: &Constants, pose: &Pose, reach: Reach, limit: f64) -> bool {
        let [last, others @ ..] = &mut self.balls;
        let covers = |ball: &Option<Ball>| {
            ball.as_ref().is_some_and(|ball| ball.covers_pose(constants, pose, reach, limit))
        };
        if covers(last) {
            return true;
        }
        // The next pose is near this one: its ball is tried first.
        if let Some(ball) = others.iter_mut().find(|ball| covers(ball)) {
            core::mem::swap(last, ball);
            return true;
        }
        false
    }

    /// What of a knot the balls that are kept cover. `first` is the index of the ball that covered the knot before: the search
    /// begins there and goes on to newer ones, as they were found along the way.
    #[inline(always)]
    pub fn knot_cover(
        &self,
        constants: &Constants,
        pose: &Pose,
        reach: Reach,
        first: &mut usize,
    ) -> KnotCover {
        let mut cover = KnotCover::default();
        let begin = *first + BALL_COUNT;
        for age in 0..BALL_COUNT {
            let index = (begin - age) % BALL_COUNT;
            if let Some(Some(ball)) = self.balls.get(index) {
                ball.add_cover(constants, pose, reach, &mut cover);
                if cover.is_complete() {
                    *first = index;
                    return cover;
                }
            }
        }
        if let Some(ball) = &self.too_small {
            ball.add_cover(constants, pose, reach, &mut cover);
        }
        cover
    }

    /// Covers by a new ball around the pose. Returns the regularity of the pose.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn cover_by_new(
        &mut self,
        constants: &Constants,
        pose: &Pose,
        reach: Reach,
        limit: f64,
    ) -> Option<Regularity> {
        let ball = Ball::new(constants, pose);
        if !ball.covers_pose(constants, pose, reach, limit) {
            self.too_small = Some(ball);
            return None;
        }
        self.balls.rotate_right(1);
        if let Some(first) = self.balls.first_mut() {
            *first = Some(ball);
        }
        Some(ball.regularity())
    }
}

/// Least part of the sine of the reference that is allowed between knots, whatever the limits of the condition.
const LEAST_SINE_SHARE: f64 = 0.5;

/// The least sine that goes with a limit of the condition: that of the reference, or as much less as the limit is looser.
fn least_universal_sine(constants: &Constants, condition: f64) -> f64 {
    constants.universal_sine * (constants.reference_condition / condition).clamp(LEAST_SINE_SHARE, 1.0)
}
