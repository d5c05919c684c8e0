//! Examination of a stop near a bound: at instants ("knots") `dt` apart.
//!
//! Between knots quantities leave their chords by at most `M dt^2 / 8`, M the largest second derivative. With the arm r of
//! the outermost joint and the peaks v, w of the stop:
//!
//! ```text
//! |L''|     <= A + r (Ar + w^2) + (v + r w)^2 / L                              M of lengths
//! |L'''|    <= J + r (Jr + 3 w Ar + w^3) + 3 (v + r w)(A + r (Ar + w^2)) / L   M of rates, to first order in v / L
//! |angle''| <= Ar / c + w^2 (1 + c + 3 s) / c^2,   s, c = |sin|, cos of beta   M of the Bryan angles
//! |x''|     <= 2 A |u| + |a0|  per axis, u the direction of v                  M of a coordinate of C
//! ```
//!
//! The attitude at the knots is that of the stop that would be followed.
//! Between knots a length may exceed its bound by 2.5e-5 of the stroke, an angle by as much at the outermost joint.
//! An axis of the envelope narrower than four times the bound between knots is examined at the knots only.

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use super::pose_bounds::PoseBounds;
use super::pose_stop::{PoseStop, PoseStopState, StopKind, advanced};
use super::regularity::{RegularBalls, is_regular_or_nearer};
use super::verification::Step;
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

/// Examination of a planar stop at knots.
pub(super) struct Examination<'a> {
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
    /// The pose from which the step leads. Where rounding left it beyond a bound, a stop may be as far beyond: or the
    /// reference could not return.
    from: Option<&'a Pose>,
    length_excess: f64,
}

impl<'a> Examination<'a> {
    pub fn new(
        constants: &'a Constants,
        bounds: &'a PoseBounds,
        motion: &Motion,
        step: &Step<'a>,
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
        let intervals = knots.clamp(MIN_INTERVALS, MAX_INTERVALS);
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
            from: step.from,
            length_excess: step.from.map_or(0.0, |from| bounds.length_excess(constants, from)),
            stop,
        })
    }

    /// Examines every knot.
    pub fn run(&self, balls: &mut RegularBalls, start: &Pose) -> Result<(), Limit> {
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
        let Self { constants, bounds, length_slack, length_excess, .. } = self;
        let legs = lengths.iter().zip(bounds.shortest.iter().zip(&bounds.longest));
        for (length, (shortest, longest)) in legs {
            if !((length - shortest).min(longest - length) >= length_slack - length_excess) {
                return Err(Limit::Stroke);
            }
        }
        if let Some(envelope) = &bounds.envelope {
            self.check_envelope(envelope, pose, state)?;
        }
        // Half of an interval on either side.
        let (v, w) = (self.stop.position.peak_velocity, self.stop.orientation.peak_velocity);
        let reach = [0.5 * v * self.dt, 0.5 * w * self.dt];
        // Between knots up to the limit of the platform: else a reference at its own limit could not leave it.
        let is_conditioned = balls.cover(constants, pose, [0.0; 2], constants.reference_condition)
            || self.from.is_some_and(|from| is_regular_or_nearer(constants, pose, from));
        let is_regular =
            is_conditioned && balls.cover(constants, pose, reach, constants.parameters.condition);
        if is_regular { Ok(()) } else { Err(Limit::Condition) }
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
        let is_within = x.iter().zip(slacks).zip(ranges(envelope)).all(|((x, slack), (low, high))| {
            (x - low).min(high - x) >= slack.min(MAX_SLACK_RATIO * (high - low))
        });
        if is_within || self.is_nearer_than_start(envelope, &x) { Ok(()) } else { Err(Limit::Envelope) }
    }

    /// Whether the start of the step is beyond the envelope, and X no farther beyond it.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn is_nearer_than_start(&self, envelope: &Envelope, x: &[f64; 6]) -> bool {
        let Some(from) = self.from else { return false };
        let from = task_coordinates(from, &self.constants.machine().home);
        let excess = |x: f64, (low, high): (&f64, &f64)| (low - x).max(x - high);
        let mut axes = from.iter().zip(x).zip(ranges(envelope));
        axes.all(|((from, x), range)| excess(*x, range) <= excess(*from, range).max(0.0))
            && from.iter().zip(ranges(envelope)).any(|(from, range)| excess(*from, range) > 0.0)
    }
}

fn ranges(Envelope { lowest, highest }: &Envelope) -> impl Iterator<Item = (&f64, &f64)> {
    lowest.iter().zip(highest)
}

/// Largest second derivative of a leg's length at peak velocities.
pub(super) fn curvature(constants: &Constants, v: f64, w: f64) -> f64 {
    let Limits { orientation, position, .. } = &constants.parameters.limits;
    let joint = v + constants.arm * w;
    position.acceleration
        + constants.arm * (orientation.acceleration + w * w)
        + joint * joint / constants.machine().actuator.min_length
}
