//! Verified stop: whether the stop from a state keeps every limit along its whole way.
//!
//! In free space one pose is enough: every margin exceeds the length of the way. Near a bound the planar stop is examined at
//! instants ("knots") `dt` apart; between them quantities leave their chords by at most `M dt^2 / 8`, M the largest second
//! derivative. With the arm r of the outermost joint and the peaks v, w of the stop:
//!
//! ```text
//! |L''|     <= A + r (Ar + w^2) + (v + r w)^2 / L                              M of lengths
//! |L'''|    <= J + r (Jr + 3 w Ar + w^3) + 3 (v + r w)(A + r (Ar + w^2)) / L   M of rates, to first order in v / L
//! |angle''| <= Ar / c + w^2 (1 + c + 3 s) / c^2,   s, c = |sin|, cos of beta   M of the Bryan angles
//! |x''|     <= |a . axis|                                                      M of a coordinate of C
//! ```
//!
//! The attitude at the knots is that of the motion that would be played, `R <- exp(W) R` with
//! `W = theta - dt^2/12 w0 x w1`, theta the integral of w (Magnus; the remainder is of order dt^5).
//! Between knots a length may exceed its bound by 2.5e-5 of the stroke, an angle by as much at the outermost joint.
//! An axis of the envelope narrower than four times the bound between knots is examined at the knots only.

use nalgebra::Vector3;
#[cfg(not(feature = "client"))]
use nalgebra::{ComplexField as _, RealField as _};

use super::pose_bounds::PoseBounds;
use super::regularity::RegularBalls;
use super::stop::{Stop, StopExtent, StopState, release_first_extent};
use crate::control::limits::{Limit, Limits};
use crate::control::parameters::{Constants, Envelope};
use crate::model::inverse_geometry::{leg_lengths, leg_lengths_and_rates};
use crate::model::machine::LEGS;
use crate::model::rigid::{Motion, Pose, Twist};
use crate::model::task::task_coordinates;

/// Departure of a length from its chord that decides the number of knots \[m\].
const CHORD_DEPARTURE_M: f64 = 1e-4;
/// Departure of a leg's rate from its chord that does so, over the largest rate.
const RATE_DEPARTURE_RATIO: f64 = 0.01;
/// Bounds on the number of intervals between knots: the last bounds the work of a cycle.
const MIN_INTERVALS: f64 = 3.0;
const MAX_INTERVALS: f64 = 24.0;
/// Part of the stroke by which a length may exceed its bound between knots: else a platform at the bound could not leave
/// it, as the departures from chords are bounded for the worst direction.
const ROOM_RATIO: f64 = 2.5e-5;
/// Relative allowance for rounding.
const ROUNDING: f64 = 1e-9;
/// Part of the width of an axis of the envelope that the bound between knots may use.
const MAX_SLACK_RATIO: f64 = 0.25;

/// Stop that was verified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum StopKind {
    /// See [`super::stop`].
    #[default]
    ReleaseFirst,
    /// See [`super::stop`].
    Planar,
}

/// Stop of orientation and position.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PoseStop {
    orientation: Stop,
    position: Stop,
}

/// Motion parameters of a stop at one instant, relative to its start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PoseStopState {
    pub orientation: StopState,
    pub position: StopState,
}

impl PoseStop {
    /// The stop of a kind from a motion.
    pub fn new(kind: StopKind, motion: &Motion, limits: &Limits) -> Self {
        let of = match kind {
            StopKind::ReleaseFirst => Stop::release_first,
            StopKind::Planar => Stop::planar,
        };
        let Motion { twist, acceleration, .. } = motion;
        Self {
            orientation: of(&twist.angular, &acceleration.angular, &limits.orientation),
            position: of(&twist.linear, &acceleration.linear, &limits.position),
        }
    }

    /// Time to rest \[s\].
    pub fn duration(&self) -> f64 {
        self.orientation.duration.max(self.position.duration)
    }

    /// State `t` seconds after the start.
    pub fn at(&self, t: f64) -> PoseStopState {
        PoseStopState { orientation: self.orientation.at(t), position: self.position.at(t) }
    }
}

/// Pose after the part of a stop from one state to the next, `dt` seconds later.
pub(super) fn advanced(pose: &Pose, from: &PoseStopState, to: &PoseStopState, dt: f64) -> Pose {
    let turn = to.orientation.displacement - from.orientation.displacement;
    let commutator = from.orientation.velocity.cross(&to.orientation.velocity) * (dt * dt / 12.0);
    pose.displaced(&Twist {
        angular: turn - commutator,
        linear: to.position.displacement - from.position.displacement,
    })
}

/// The step of constant jerk that leads to the motion from which a stop is verified.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    /// \[s\]
    pub duration: f64,
    /// Change of the acceleration: angular \[rad/s^2\], linear \[m/s^2\].
    pub change: [f64; 2],
}

impl Step {
    /// Largest velocities within the step beyond those at its ends.
    fn bulge(&self) -> [f64; 2] {
        self.change.map(|change| change * self.duration / 8.0)
    }
}

/// Verifies a step and the stop from the motion at its end. Returns which stop, or the limit that no stop was proved to keep.
pub(super) fn verify(
    constants: &Constants,
    bounds: &PoseBounds,
    balls: &mut RegularBalls,
    motion: &Motion,
    step: &Step,
) -> Result<StopKind, Limit> {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let Motion { pose, twist, acceleration } = motion;
    let turn = release_first_extent(&twist.angular, &acceleration.angular, orientation);
    let shift = release_first_extent(&twist.linear, &acceleration.linear, position);
    let [angular_bulge, linear_bulge] = step.bulge();
    let is_free = shift.peak_velocity + linear_bulge <= position.velocity
        && turn.peak_velocity + angular_bulge <= orientation.velocity
        && shift.peak_velocity + constants.arm * turn.peak_velocity <= constants.machine().actuator.max_rate
        && has_room(constants, bounds, pose, &shift, &turn, step.duration)
        && balls.cover(constants, pose, [shift.length, turn.length]);
    if is_free {
        return Ok(StopKind::ReleaseFirst);
    }
    let examination = Examination::new(constants, bounds, motion, step)?;
    examination.run(balls, pose)?;
    Ok(StopKind::Planar)
}

/// Whether legs and envelope have room for the whole length of a stop, in any direction.
fn has_room(
    constants: &Constants,
    bounds: &PoseBounds,
    pose: &Pose,
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
    let Some(envelope) = &bounds.envelope else { return is_within_stroke };
    let x = task_coordinates(pose, &constants.machine().home);
    let [_, beta, ..] = x;
    let c = (beta.abs() + turn.length).min(core::f64::consts::FRAC_PI_2).cos();
    let turned = turn.length / c + slack / constants.arm;
    let needs = [turned, turned, turned, shift.length + slack, shift.length + slack, shift.length + slack];
    let Envelope { lowest, highest } = envelope;
    is_within_stroke
        && x.iter()
            .zip(needs)
            .zip(lowest.iter().zip(highest))
            .all(|((x, need), (low, high))| (x - low).min(high - x) >= need)
}

/// Largest second derivative of a leg's length at peak velocities.
fn curvature(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let joint = v + constants.arm * w;
    position.acceleration
        + constants.arm * (orientation.acceleration + w * w)
        + joint * joint / constants.machine().actuator.min_length
}

/// Examination of a planar stop at knots.
struct Examination<'a> {
    constants: &'a Constants,
    bounds: &'a PoseBounds,
    stop: PoseStop,
    intervals: f64,
    dt: f64,
    /// Departures of a length \[m\] and of a rate \[m/s\] from their chords, and of C per coordinate \[m\].
    length_slack: f64,
    rate_slack: f64,
    position_slack: Vector3<f64>,
    /// Whether rates could exceed their limit.
    needs_rates: bool,
}

impl<'a> Examination<'a> {
    fn new(
        constants: &'a Constants,
        bounds: &'a PoseBounds,
        motion: &Motion,
        step: &Step,
    ) -> Result<Self, Limit> {
        let limits = &constants.parameters.limits;
        let Limits { orientation, position, .. } = limits;
        let stop = PoseStop::new(StopKind::Planar, motion, limits);
        let (v, w) = (stop.position.peak_velocity, stop.orientation.peak_velocity);
        let allowed = 1.0 + ROUNDING;
        let [angular_bulge, linear_bulge] = step.bulge();
        let is_slow = v <= allowed * position.velocity
            && w <= allowed * orientation.velocity
            && motion.twist.linear.norm() + linear_bulge <= position.velocity
            && motion.twist.angular.norm() + angular_bulge <= orientation.velocity;
        if !is_slow {
            return Err(Limit::Velocity);
        }
        let curvature = curvature(constants, v, w);
        let actuator = &constants.machine().actuator;
        let (arm, joint) = (constants.arm, v + constants.arm * w);
        let needs_rates = joint > actuator.max_rate;
        let joint_acceleration = position.acceleration + arm * (orientation.acceleration + w * w);
        let rate_curvature = position.jerk
            + arm * (orientation.jerk + 3.0 * w * orientation.acceleration + w * w * w)
            + 3.0 * joint * joint_acceleration / actuator.min_length;
        let rates =
            if needs_rates { rate_curvature / (RATE_DEPARTURE_RATIO * actuator.max_rate) } else { 0.0 };
        let density = (curvature / CHORD_DEPARTURE_M).max(rates);
        let knots = (stop.duration() * (density / 8.0).sqrt()).ceil();
        let intervals = knots.max(MIN_INTERVALS).min(MAX_INTERVALS);
        let dt = stop.duration() / intervals;
        let chord = dt.max(step.duration).powi(2) / 8.0;
        let room = ROOM_RATIO * actuator.stroke();
        // Along the velocity and, across it, along the rest of the present acceleration.
        let Motion { twist, acceleration, .. } = motion;
        let u = twist.linear.try_normalize(0.0).unwrap_or_default();
        let e = acceleration.linear.try_normalize(0.0).unwrap_or_default();
        let position_curvature = (u.abs() * 2.0 + e.abs()) * position.acceleration;
        Ok(Self {
            constants,
            bounds,
            intervals,
            dt,
            length_slack: (curvature * chord - room).max(0.0),
            rate_slack: rate_curvature * chord,
            position_slack: position_curvature * chord,
            needs_rates,
            stop,
        })
    }

    /// Examines every knot.
    fn run(&self, balls: &mut RegularBalls, start: &Pose) -> Result<(), Limit> {
        let mut pose = *start;
        let mut state = self.stop.at(0.0);
        self.check(balls, &pose, &state)?;
        for k in 1..=self.intervals as u32 {
            let next = self.stop.at(f64::from(k) * self.dt);
            pose = advanced(&pose, &state, &next, self.dt);
            state = next;
            self.check(balls, &pose, &state)?;
        }
        Ok(())
    }

    fn check(&self, balls: &mut RegularBalls, pose: &Pose, state: &PoseStopState) -> Result<(), Limit> {
        let lengths = self.check_rates(pose, state)?;
        let Self { constants, bounds, length_slack, .. } = self;
        let legs = lengths.iter().zip(bounds.shortest.iter().zip(&bounds.longest));
        for (length, (shortest, longest)) in legs {
            if !((length - shortest).min(longest - length) >= *length_slack) {
                return Err(Limit::Stroke);
            }
        }
        if let Some(envelope) = &bounds.envelope {
            self.check_envelope(envelope, pose, state)?;
        }
        // Half of an interval on either side.
        let (v, w) = (self.stop.position.peak_velocity, self.stop.orientation.peak_velocity);
        let reach = [0.5 * v * self.dt, 0.5 * w * self.dt];
        if balls.cover(constants, pose, reach) { Ok(()) } else { Err(Limit::Condition) }
    }

    /// The lengths at a knot, if the rates keep their limit.
    fn check_rates(&self, pose: &Pose, state: &PoseStopState) -> Result<[f64; LEGS], Limit> {
        let machine = self.constants.machine();
        if !self.needs_rates {
            return Ok(leg_lengths(machine, pose));
        }
        let twist = Twist { angular: state.orientation.velocity, linear: state.position.velocity };
        let (lengths, rates) = leg_lengths_and_rates(machine, pose, &twist);
        let limit = machine.actuator.max_rate - self.rate_slack;
        if rates.iter().all(|rate| rate.abs() <= limit) { Ok(lengths) } else { Err(Limit::LegRate) }
    }

    fn check_envelope(&self, envelope: &Envelope, pose: &Pose, state: &PoseStopState) -> Result<(), Limit> {
        let x = task_coordinates(pose, &self.constants.machine().home);
        let [_, beta, ..] = x;
        let (s, c) = (beta.sin().abs(), beta.cos().abs());
        let w = state.orientation.velocity.norm()
            + self.constants.parameters.limits.orientation.acceleration * self.dt;
        let angular = self.stop.orientation.peak_velocity.min(w);
        let alpha = self.constants.parameters.limits.orientation.acceleration;
        let is_turning = self.stop.orientation.duration > 0.0;
        let curvature = alpha / c + angular * angular * (1.0 + c + 3.0 * s) / (c * c);
        let room = ROOM_RATIO * self.constants.machine().actuator.stroke() / self.constants.arm;
        let turned = if is_turning { (curvature * self.dt * self.dt / 8.0 - room).max(0.0) } else { 0.0 };
        let p = &self.position_slack;
        let slacks = [turned, turned, turned, p.x, p.y, p.z];
        let Envelope { lowest, highest } = envelope;
        for ((x, slack), (low, high)) in x.iter().zip(slacks).zip(lowest.iter().zip(highest)) {
            let slack = slack.min(MAX_SLACK_RATIO * (high - low));
            if !((x - low).min(high - x) >= slack) {
                return Err(Limit::Envelope);
            }
        }
        Ok(())
    }
}
