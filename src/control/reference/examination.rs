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

use fearless_simd::{Simd, dispatch};
#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use super::pose_bounds::PoseBounds;
use super::pose_stop::{PoseStop, PoseStopState, StopKind, advanced_to_knot};
use super::regularity::{RegularBalls, Regularity};
use super::stop::Stop;
use super::verification::Step;
use crate::control::limits::{Limit, Limits};
use crate::control::parameters::{Constants, Envelope};
use crate::model::inverse_geometry::{length_and_rate_lanes, length_lanes};
use crate::model::rigid::{Motion, Pose, Twist};
use crate::model::task::task_coordinates;
use crate::model::triples::LegLanes;

/// Departure of a length from its chord that decides the number of knots \[m\].
const CHORD_DEPARTURE_M: f64 = 1e-4;
/// Departure of a leg's rate from its chord that does so, over the largest rate.
const RATE_DEPARTURE_RATIO: f64 = 0.01;
/// Bounds on the number of intervals between knots: the last bounds the work of a cycle.
const MIN_INTERVALS: f64 = 3.0;
const MAX_INTERVALS: f64 = 20.0;
/// Most knots of a stop for which a pose is factorized: bounds the work of a cycle. The balls that were found remain for the
/// next one.
const MAX_FACTORIZATIONS: u32 = 5;
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
    /// Whether rates could exceed their limit, and angles leave the envelope.
    needs_rates: bool,
    needs_angles: bool,
    /// The pose from which the step leads. Where rounding left it beyond a bound, a stop may be as far beyond: or the
    /// reference could not return.
    from: Option<&'a Pose>,
    length_excess: f64,
    /// Its regularity, once it is needed.
    start_regularity: Option<Regularity>,
    /// Knots so far that no ball of earlier ones covers.
    factorizations: u32,
    /// Index of the ball that covered the last knot.
    ball: usize,
    /// Bounds of the lengths, in lanes.
    shortest: LegLanes,
    longest: LegLanes,
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
            needs_angles: bounds.envelope.as_ref().is_some_and(|envelope| {
                !have_angles_room(constants, envelope, &motion.pose, &stop.orientation)
            }),
            from: step.from,
            length_excess: step.from.map_or(0.0, |from| bounds.length_excess(constants, from)),
            start_regularity: None,
            factorizations: 0,
            ball: 0,
            shortest: constants.machine().joints.triples.pack(&bounds.shortest),
            longest: constants.machine().joints.triples.pack(&bounds.longest),
            stop,
        })
    }

    /// Examines every knot, in one piece of code for each instruction set.
    #[inline(never)]
    pub fn run(&mut self, balls: &mut RegularBalls, start: &Pose) -> Result<(), Limit> {
        dispatch!(self.constants.machine().level, simd => self.run_in_lanes(simd, balls, start))
    }

    #[inline(always)]
    fn run_in_lanes<S: Simd>(
        &mut self,
        simd: S,
        balls: &mut RegularBalls,
        start: &Pose,
    ) -> Result<(), Limit> {
        let mut pose = *start;
        let mut state = self.stop.at(0.0);
        let mut k = 0;
        loop {
            self.check(simd, balls, &pose, &state)?;
            k += 1;
            if k > self.intervals as u32 {
                return Ok(());
            }
            let next = self.stop.at(f64::from(k) * self.dt);
            pose = advanced_to_knot(&pose, &state, &next, self.dt);
            state = next;
        }
    }

    #[inline(always)]
    fn check<S: Simd>(
        &mut self,
        simd: S,
        balls: &mut RegularBalls,
        pose: &Pose,
        state: &PoseStopState,
    ) -> Result<(), Limit> {
        let lengths = self.check_rates(simd, pose, state)?;
        let Self { bounds, length_slack, length_excess, .. } = *self;
        let legs = lengths.0.iter().zip(self.shortest.0.iter().zip(&self.longest.0));
        let room = length_slack - length_excess;
        let has_room = legs.fold(true, |has_room, (length, (shortest, longest))| {
            has_room & ((length - shortest).min(longest - length) >= room)
        });
        if !has_room {
            return Err(Limit::Stroke);
        }
        if let Some(envelope) = &bounds.envelope {
            self.check_envelope(envelope, pose, state)?;
        }
        self.check_condition(balls, pose)
    }

    /// Whether the poses around a knot are regular and keep the limit of the condition.
    #[inline(always)]
    fn check_condition(&mut self, balls: &mut RegularBalls, pose: &Pose) -> Result<(), Limit> {
        let constants = self.constants;
        // Half of an interval on either side.
        let (v, w) = (self.stop.position.peak_velocity, self.stop.orientation.peak_velocity);
        let reach = [0.5 * v * self.dt, 0.5 * w * self.dt];
        let around = constants.parameters.condition;
        let cover = balls.knot_cover(constants, pose, reach, &mut self.ball);
        if cover.is_complete() {
            return Ok(());
        }
        self.factorizations += 1;
        if self.factorizations > MAX_FACTORIZATIONS {
            return Err(Limit::Condition);
        }
        let regularity = balls.cover_by_new(constants, pose, reach, around).ok_or(Limit::Condition)?;
        self.ball = 0;
        let at_knot = Regularity::of_reference(constants);
        if cover.knot || at_knot.is_kept_by(&regularity) || self.is_nearer_to_regular(&regularity) {
            return Ok(());
        }
        Err(Limit::Condition)
    }

    /// Whether a pose is as regular as the reference must be, or no less so than the start of the step.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn is_nearer_to_regular(&mut self, regularity: &Regularity) -> bool {
        let Self { constants, from, .. } = *self;
        let Some(from) = from else { return false };
        let start = *self.start_regularity.get_or_insert_with(|| Regularity::at(constants, from));
        Regularity::of_reference(constants).or_less(&start).is_kept_by(regularity)
    }

    /// The lengths at a knot, if the rates keep their limit.
    #[inline(always)]
    fn check_rates<S: Simd>(&self, simd: S, pose: &Pose, state: &PoseStopState) -> Result<LegLanes, Limit> {
        let machine = self.constants.machine();
        if !self.needs_rates {
            return Ok(length_lanes(simd, machine, pose));
        }
        let twist = Twist { angular: state.orientation.velocity, linear: state.position.velocity };
        let (lengths, rates) = length_and_rate_lanes(simd, machine, pose, &twist);
        let limit = machine.actuator.max_rate - self.rate_slack;
        let are_kept = rates.0.iter().fold(true, |are_kept, rate| are_kept & (rate.abs() <= limit));
        if are_kept { Ok(lengths) } else { Err(Limit::LegRate) }
    }

    fn check_envelope(&self, envelope: &Envelope, pose: &Pose, state: &PoseStopState) -> Result<(), Limit> {
        let p = &self.position_slack;
        let slacks = [p.x, p.y, p.z];
        let mut axes = pose.position.iter().zip(slacks).zip(ranges(envelope).skip(3));
        let is_within = axes.all(|((x, slack), range)| is_inside(*x, slack, range));
        if is_within && !self.needs_angles {
            return Ok(());
        }
        let x = task_coordinates(pose, &self.constants.machine().home);
        let [_, beta, ..] = x;
        let (s, c) = (libm::sin(beta).abs(), libm::cos(beta).abs());
        let w = state.orientation.velocity.norm()
            + self.constants.parameters.limits.orientation.acceleration * self.dt;
        let angular = self.stop.orientation.peak_velocity.min(w);
        let alpha = self.constants.parameters.limits.orientation.acceleration;
        let is_turning = self.stop.orientation.duration > 0.0;
        let curvature = alpha / c + angular * angular * (1.0 + c + 3.0 * s) / (c * c);
        let room = ROOM_RATIO * self.constants.machine().actuator.stroke() / self.constants.arm;
        let turned = if is_turning { (curvature * self.dt * self.dt / 8.0 - room).max(0.0) } else { 0.0 };
        let is_within = is_within
            && x.iter().zip(ranges(envelope)).take(3).all(|(x, range)| is_inside(*x, turned, range));
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

/// Whether the angles have room for every rotation of a stop, in any direction.
fn have_angles_room(constants: &Constants, envelope: &Envelope, pose: &Pose, stop: &Stop) -> bool {
    let x = task_coordinates(pose, &constants.machine().home);
    let [_, beta, ..] = x;
    let turn = stop.peak_velocity * stop.duration;
    let need = turn / libm::cos((beta.abs() + turn).min(core::f64::consts::FRAC_PI_2));
    x.iter().zip(ranges(envelope)).take(3).all(|(x, (low, high))| (x - low).min(high - x) >= need)
}

/// Whether a coordinate has a distance from both ends of its range, or a part of the range that is narrower.
fn is_inside(x: f64, slack: f64, (low, high): (&f64, &f64)) -> bool {
    (x - low).min(high - x) >= slack.min(MAX_SLACK_RATIO * (high - low))
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
