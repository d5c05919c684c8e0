//! Examination of a stop near a bound, at instants along the stop: its [knots](super::knots).
//!
//! Between two knots, leg lengths, their rates and the coordinates of C depart little from a cubic. The cubic
//! is within the hull of its Bezier points, so these points are examined, too (see
//! [`super::cubic_departure`]). Angles depart from their chords by at most `|angle''| dt^2 / 8`, where dt is
//! the longer interval at the knot. So does every quantity in the step that leads to the stop, with its own
//! second derivative:
//!
//! ```text
//! |angle''| <= Ar / c + w^2 (1 + c + 3 s) / c^2     Bryan angles; s, c = |sin|, cos of beta
//! |x'''|    <= J (2 |u| + |e|)                      coordinates of C; u, e the directions of v, a
//! ```
//!
//! The attitude at the knots is the attitude of the stop that would be followed. Between knots a length may
//! exceed its bound by 2.5e-5 of the stroke, and an angle by as much at the outermost joint. If an axis of
//! the envelope is narrower than four times its margin between knots, it is proved at the knots only.

use fearless_simd::{Simd, dispatch, f64x8, prelude::*};
use nalgebra::Vector3;

use crate::control::constants::Constants;
use crate::control::parameters::Envelope;
use crate::control::reference::proof::angle_ranges::{AngleRanges, abs_cosine_of_beta};
use crate::control::reference::proof::cubic_departure::{
    CUBIC_DEPARTURE_RATIO, CUBIC_RATE_DEPARTURE_RATIO, length_acceleration_bound, length_jerk_bound,
};
use crate::control::reference::proof::drive_forces::ForceProof;
use crate::control::reference::proof::knots::{AdjacentIntervals, Knots, MAX_INTERVALS};
use crate::control::reference::proof::pose_bounds::PoseBounds;
use crate::control::reference::proof::position_ranges::PositionEnvelope;
use crate::control::reference::proof::refusal::Refusal;
use crate::control::reference::proof::regular_balls::RegularBalls;
use crate::control::reference::proof::regularity::{REGULARITY_EFFORT, Regularity, RegularityQuery};
use crate::control::reference::proof::step::Step;
use crate::control::reference::proof::tolerances::{
    ANGLE_ROUNDING_RAD, BETWEEN_KNOTS_PER_STROKE, VELOCITY_ROUNDING_RATIO,
};
use crate::control::reference::stop::pose_stop::{
    PoseStop, PoseStopState, advanced_without_orthonormalizing,
};
use crate::control::signals::limits::{Limit, Limits};
use crate::model::inverse_geometry::length_and_rate_lanes;
use crate::model::machine::Machine;
use crate::model::rigid::{Motion, Pose, Twist};
use crate::model::task::task_coordinates;
use crate::model::triples::LegLanes;

/// Departure of a length from its cubic that determines the number of knots \[m\].
const LENGTH_DEPARTURE_M: f64 = 2e-5;
/// Departure of a leg's rate from its cubic that determines the number of knots, as a ratio of the largest
/// rate.
const RATE_DEPARTURE_RATIO: f64 = 0.01;
/// Largest effort of a step, in knots: the longest stop, and the regularity of four poses, or of fewer if
/// walls took their part. It bounds the longest cycle. Balls that were found remain for the next step. With
/// three poses, a reference that presses against its limit of the condition is accepted and refused in turn,
/// and the platform jerks (2026-11-23).
pub(in crate::control::reference) const MAX_STEP_EFFORT: u32 = MAX_INTERVALS + 4 * REGULARITY_EFFORT;

/// Lengths and rates of the legs, in lanes.
type Legs<S> = (f64x8<S>, f64x8<S>);

/// Examination of a stop that brakes at once.
pub(in crate::control::reference) struct StopExamination<'a> {
    constants: &'a Constants,
    bounds: &'a PoseBounds,
    stop: &'a PoseStop,
    knots: Knots,
    /// Bound on the third derivative of a length, and largest departures within the step that leads to the
    /// stop: of a length \[m\], of a rate \[m/s\], and of a coordinate of C \[m\].
    length_jerk_bound: f64,
    step_departure: [f64; 3],
    step_s: f64,
    /// `2 |u| + |e|` for each coordinate of C.
    directions: Vector3<f64>,
    /// Whether rates could exceed their limit; ranges of the envelope for positions, and for angles if these
    /// could leave it.
    needs_rates: bool,
    positions: Option<PositionEnvelope>,
    angles: Option<AngleRanges>,
    /// Pose at the start of the step, and how far its lengths exceed their bounds \[m\]. If rounding put the
    /// start slightly beyond a bound, the stop may be equally far beyond. Otherwise the reference could not
    /// return.
    from: Option<&'a Pose>,
    length_excess_m: f64,
    /// Regularity of `from`, and the envelope extended to contain it; computed when they are first needed.
    start_regularity: Option<Regularity>,
    relaxed: Option<(Envelope, AngleRanges)>,
    /// Proof of the drives' forces.
    forces: ForceProof,
    /// Remaining effort, in knots.
    effort: u32,
    /// Bounds of the lengths, in lanes.
    shortest: LegLanes,
    longest: LegLanes,
}

impl<'a> StopExamination<'a> {
    pub fn new(
        constants: &'a Constants,
        bounds: &'a PoseBounds,
        stop: &'a PoseStop,
        motion: &Motion,
        x: Option<&[f64; 6]>,
        step: &Step<'a>,
        forces: ForceProof,
    ) -> Result<Self, Refusal> {
        let limits = &constants.parameters.limits;
        let Limits { orientation, position, .. } = limits;
        let (v, w) = (stop.position.peak_velocity, stop.orientation.peak_velocity);
        let allowed = 1.0 + VELOCITY_ROUNDING_RATIO;
        let inner = &step.inner_speeds;
        let is_slow = v.max(inner.linear) <= allowed * position.velocity
            && w.max(inner.angular) <= allowed * orientation.velocity;
        if !is_slow {
            return Err(Limit::Velocity.into());
        }
        let curvature = length_acceleration_bound(constants, v, w);
        let actuator = &constants.machine().actuator;
        let needs_rates = v + constants.arm_m * w > actuator.max_rate_m_s;
        let length_jerk_bound = length_jerk_bound(constants, v, w);
        // Enough knots that the departures of lengths are small, and of rates if these matter.
        let duration = stop.duration();
        let (square, cube) = (duration * duration, duration * duration * duration);
        let length_share = CUBIC_DEPARTURE_RATIO * length_jerk_bound * cube / LENGTH_DEPARTURE_M;
        let max_departure = RATE_DEPARTURE_RATIO * actuator.max_rate_m_s;
        let rate_share = if needs_rates {
            CUBIC_RATE_DEPARTURE_RATIO * length_jerk_bound * square / max_departure
        } else {
            0.0
        };
        let knots = Knots::new(duration, rate_share, length_share);
        let chord = step.duration_s * step.duration_s / 8.0;
        // The jerk is along the velocity u and, across it, along the remaining part of the acceleration's
        // direction e.
        let Motion { twist, acceleration, .. } = motion;
        let u = twist.linear.try_normalize(0.0).unwrap_or_default();
        let e = acceleration.linear.try_normalize(0.0).unwrap_or_default();
        Ok(Self {
            constants,
            bounds,
            knots,
            length_jerk_bound,
            step_departure: [curvature, length_jerk_bound, position.acceleration].map(|bound| bound * chord),
            step_s: step.duration_s,
            directions: u.abs() * 2.0 + e.abs(),
            needs_rates,
            positions: bounds.envelope.as_ref().map(PositionEnvelope::new),
            angles: bounds
                .envelope
                .as_ref()
                .zip(x)
                .and_then(|(envelope, x)| AngleRanges::if_stop_may_leave(envelope, x, &stop.orientation)),
            from: step.from,
            length_excess_m: step.from.map_or(0.0, |from| bounds.length_excess_m(constants, from)),
            start_regularity: None,
            relaxed: None,
            effort: MAX_STEP_EFFORT.saturating_sub(step.effort).saturating_sub(knots.intervals),
            shortest: constants.machine().joints.triples.pack(&bounds.shortest_m),
            longest: constants.machine().joints.triples.pack(&bounds.longest_m),
            stop,
            forces,
        })
    }

    /// Examines every knot. The code exists once for each instruction set.
    #[inline(never)]
    pub fn check_knots(&mut self, balls: &mut RegularBalls, start: &Motion) -> Result<(), Refusal> {
        dispatch!(self.constants.machine().level, simd => self.check_knots_in_lanes(simd, balls, start))
    }

    #[inline(always)]
    fn check_knots_in_lanes<S: Simd>(
        &mut self,
        simd: S,
        balls: &mut RegularBalls,
        start: &Motion,
    ) -> Result<(), Refusal> {
        let mut pose = start.pose;
        let mut state = PoseStopState::begin(start);
        let (mut t, mut adjacent, mut before) = (0.0, AdjacentIntervals::default(), None);
        let mut k = 0;
        loop {
            let next_t = self.knots.instant(k + 1);
            let is_last = k == self.knots.intervals;
            adjacent = AdjacentIntervals {
                before_s: adjacent.after_s,
                after_s: if is_last { 0.0 } else { next_t - t },
            };
            before = Some(self.check(simd, balls, &pose, &state, adjacent, before)?);
            if is_last {
                return Ok(());
            }
            let next = self.stop.at(simd, next_t);
            pose = advanced_without_orthonormalizing(&pose, &state, &next, adjacent.after_s);
            (t, state) = (next_t, next);
            k += 1;
        }
    }

    /// Checks a knot, and the Bezier points in the intervals before and after it. Returns lengths and rates
    /// at the knot.
    #[inline(always)]
    fn check<S: Simd>(
        &mut self,
        simd: S,
        balls: &mut RegularBalls,
        pose: &Pose,
        state: &PoseStopState,
        adjacent: AdjacentIntervals,
        before: Option<Legs<S>>,
    ) -> Result<Legs<S>, Refusal> {
        let dt = adjacent.longest();
        let twist = Twist { angular: state.orientation.velocity, linear: state.position.velocity };
        let legs @ (length, rate) = length_and_rate_lanes(simd, self.constants.machine(), pose, &twist);
        if self.needs_rates && !self.are_rates_kept(simd, &legs, adjacent, before.as_ref()) {
            return Err(Limit::LegRate.into());
        }
        let splat = |number: f64| f64x8::splat(simd, number);
        let load = |lanes: &LegLanes| f64x8::load_array(simd, lanes.0);
        let (next, last) = (rate * splat(adjacent.after_s / 3.0), rate * splat(-adjacent.before_s / 3.0));
        let (short, long) = (length + next.min(last), length + next.max(last));
        let room = (short - load(&self.shortest)).min(load(&self.longest) - long);
        let [in_step, ..] = self.step_departure;
        let departure = (self.length_jerk_bound * CUBIC_DEPARTURE_RATIO * dt * dt * dt).max(in_step);
        let margin =
            (departure - BETWEEN_KNOTS_PER_STROKE * self.constants.machine().actuator.stroke()).max(0.0);
        if !room.simd_ge(splat(margin - self.length_excess_m)).all_true() {
            return Err(Limit::Stroke.into());
        }
        if !self.is_in_envelope(simd, pose, state, adjacent) && !self.is_no_farther_beyond_envelope(pose) {
            return Err(Limit::Envelope.into());
        }
        self.check_condition(simd, balls, pose, state, dt)?;
        Ok(legs)
    }

    /// Whether the rates at a knot, and between it and the previous knot, keep their limit.
    #[inline(always)]
    fn are_rates_kept<S: Simd>(
        &self,
        simd: S,
        (length, rate): &Legs<S>,
        adjacent: AdjacentIntervals,
        before: Option<&Legs<S>>,
    ) -> bool {
        let dt = adjacent.longest();
        let [_, in_step, _] = self.step_departure;
        let margin = (self.length_jerk_bound * CUBIC_RATE_DEPARTURE_RATIO * dt * dt).max(in_step);
        let limit = f64x8::splat(simd, self.constants.machine().actuator.max_rate_m_s - margin);
        let between = before.map_or(*rate, |(length_before, rate_before)| {
            (*length - *length_before) * f64x8::splat(simd, 3.0 / adjacent.before_s) - *rate_before - *rate
        });
        rate.abs().max(between.abs()).simd_le(limit).all_true()
    }

    /// Whether the knot and the poses around it are regular enough.
    #[inline(always)]
    fn check_condition<S: Simd>(
        &mut self,
        simd: S,
        balls: &mut RegularBalls,
        pose: &Pose,
        state: &PoseStopState,
        dt: f64,
    ) -> Result<(), Refusal> {
        let constants = self.constants;
        let reach = self.stop.reach(state, dt, &constants.parameters.limits);
        if balls.prove_knot_from_kept(simd, constants, pose, reach, &mut self.forces) {
            return Ok(());
        }
        let around = RegularityQuery { pose, reach, required: Regularity::between_knots_bounds(constants) };
        let regularity = balls.prove_from_new(constants, &around, &mut self.forces, &mut self.effort)?;
        let at_knot = Regularity::reference_bounds(constants);
        if at_knot.is_kept_by(&regularity) || self.is_no_worse_than_start(&regularity)? {
            return Ok(());
        }
        Err(Limit::Condition.into())
    }

    /// Whether a regularity keeps the reference's bounds, or is no worse than at the start of the step.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    fn is_no_worse_than_start(&mut self, regularity: &Regularity) -> Result<bool, Refusal> {
        let Self { constants, from: Some(from), .. } = *self else { return Ok(false) };
        let start = match self.start_regularity {
            Some(start) => start,
            None => *self.start_regularity.insert(Regularity::at(constants, from, &mut self.effort)?),
        };
        let at_knot = Regularity::reference_bounds(constants);
        Ok(at_knot.looser_of(&start).is_kept_by(regularity))
    }

    /// Whether a knot, and the Bezier points before and after it, are within the envelope.
    #[inline(always)]
    fn is_in_envelope<S: Simd>(
        &self,
        simd: S,
        pose: &Pose,
        state: &PoseStopState,
        adjacent: AdjacentIntervals,
    ) -> bool {
        let Some(positions) = &self.positions else { return true };
        let dt = adjacent.longest();
        let [.., in_step] = self.step_departure;
        let jerk = self.constants.parameters.limits.position.jerk;
        let margin = self.directions * (jerk * CUBIC_DEPARTURE_RATIO * dt * dt * dt).max(in_step);
        let at = |t: f64| pose.position + state.position.velocity * t;
        positions.contain(simd, [&at(adjacent.after_s / 3.0), &at(-adjacent.before_s / 3.0)], &margin)
            && self
                .angles
                .as_ref()
                .is_none_or(|angles| angles.contain(simd, &pose.rotation, self.angle_margin(pose, state, dt)))
    }

    /// Departure of the angles from their chords around a knot, less the allowance between knots \[rad\].
    #[inline(always)]
    fn angle_margin(&self, pose: &Pose, state: &PoseStopState, dt: f64) -> f64 {
        if !(self.stop.orientation.duration_s > 0.0) {
            return 0.0;
        }
        let dt = dt.max(self.step_s);
        let (s, c) = (pose.rotation.m13.abs(), abs_cosine_of_beta(&pose.rotation));
        let alpha = self.constants.parameters.limits.orientation.acceleration;
        let w = state.orientation.velocity.norm() + alpha * dt;
        let w = self.stop.orientation.peak_velocity.min(w);
        let curvature = alpha / c + w * w * (1.0 + c + 3.0 * s) / (c * c);
        let room =
            BETWEEN_KNOTS_PER_STROKE * self.constants.machine().actuator.stroke() / self.constants.arm_m;
        (curvature * dt * dt / 8.0 - room).max(0.0)
    }

    /// Whether the start of the step is beyond the envelope, and a pose is no farther beyond it.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    fn is_no_farther_beyond_envelope(&mut self, pose: &Pose) -> bool {
        let (Some(from), Some(envelope)) = (self.from, &self.bounds.envelope) else { return false };
        let Machine { home, level, .. } = *self.constants.machine();
        let (relaxed, angles) = self.relaxed.get_or_insert_with(|| {
            let x = task_coordinates(from, &home);
            let relaxed = relaxed(envelope, &x);
            (relaxed, AngleRanges::new(&relaxed, &x))
        });
        relaxed != envelope
            && dispatch!(level, simd => {
                PositionEnvelope::new(relaxed).contain(simd, [&pose.position; 2], &Vector3::zeros())
                    && angles.contain(simd, &pose.rotation, -ANGLE_ROUNDING_RAD)
            })
    }
}

/// Envelope extended to contain X.
fn relaxed(envelope: &Envelope, x: &[f64; 6]) -> Envelope {
    let mut relaxed = *envelope;
    relaxed.lowest.iter_mut().zip(x).for_each(|(low, x)| *low = low.min(*x));
    relaxed.highest.iter_mut().zip(x).for_each(|(high, x)| *high = high.max(*x));
    relaxed
}
