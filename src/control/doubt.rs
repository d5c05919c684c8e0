//! Whether an input can be what it says it is.
//!
//! What is refused changes nothing: the last good input stays, and its age goes on counting. So bad data
//! never refreshes a watchdog, and the reason of a refusal is told when the watchdog barks.

use super::controller::{Measurement, Parameters, Setpoint, seconds_between};
use super::limits::{AxisLimits, Limit, Limiting, Limits};
use super::reference::Segment;
use super::state::{Cause, Trouble};
use crate::model::inverse_geometry::leg_motion;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::{Actuator, LEGS, Machine};
use crate::model::rigid::{Motion, Pose, Twist};

/// How far beyond the ends of its stroke a leg is believed, as a share of the stroke: encoders have
/// offsets, end stops have springs.
const BEYOND_STROKE: f64 = 0.02;

/// How much faster than its greatest rate a leg is believed: it may be pushed.
const BEYOND_RATE: f64 = 1.5;

/// Change of length that is believed at once, whatever the time between, as a share of the stroke: noise.
const NOISE: f64 = 1e-3;

/// Lengths and the integral of the rates may part by this share of the way: rates are filtered, late, and
/// not quite to scale. A wrong sign parts by twice the way, a wrong unit by a thousand times.
const RATE_SHARE: f64 = 0.3;

/// And by so much, as a share of the stroke: noise and delay of the rates. What a wrong sign makes of a loop
/// doubles within milliseconds, so this is not the place to be generous.
const RATE_NOISE: f64 = 3e-4;

/// What no drive does to a leg \[m/s^2\]: five times gravity is an impact. Or ten times the limit of
/// acceleration, where somebody has asked for more.
const LEG_ACCELERATION: f64 = 50.0;
const LIMIT_SHARE: f64 = 10.0;

/// Change of a rate that is believed at once, as a share of the greatest rate: noise.
const RATE_GRAIN: f64 = 0.02;

/// What parted so long ago is forgotten \[s\]: long against the delay of a filter, short against a motion.
const RATE_MEMORY_S: f64 = 0.03;

/// Difference between a setpoint and what the one before it leads to that is believed, as a share of the way
/// between: messages are stamped a little late or early.
const SETPOINT_SHARE: f64 = 0.25;

/// And at least so much, as a share of the stroke: too small to do harm, and numbers are rounded.
const SETPOINT_GRAIN: f64 = 1e-4;

/// A grain of rate is what moves a grain of length in this time \[s\].
const SETPOINT_GRAIN_S: f64 = 0.1;

/// What may have changed since the last good input grows with the time since, but no further than in so many
/// intervals of the messages: refused ones must not widen what is believed. Two: one may get lost.
const BELIEVED_INTERVALS: f64 = 2.0;

/// The last input that was believed, and why the one after it was not.
#[derive(Clone, Copy, Debug)]
pub struct Believed<T> {
    pub good: Option<T>,
    /// The last one, good or not: each is looked at once.
    pub newest: Option<T>,
    /// When that one was looked at.
    newest_ns: u64,
    refused: Option<Trouble>,
}

impl<T> Default for Believed<T> {
    fn default() -> Self {
        Self { good: None, newest: None, newest_ns: 0, refused: None }
    }
}

impl<T: Copy> Believed<T> {
    /// Longest time \[s\] since the good input that widens what is believed now: any, as long as nothing was
    /// refused since.
    pub fn widest(&self, now_ns: u64, period_ns: u64) -> f64 {
        if self.refused.is_none() {
            return f64::INFINITY;
        }
        let interval_ns = now_ns.saturating_sub(self.newest_ns).max(period_ns);
        BELIEVED_INTERVALS * (interval_ns as f64 * 1e-9)
    }

    /// Takes an input in, if it is believed. Of several that `bind` and are refused the first is the one to
    /// tell of: the others may only be far from what was good so long ago.
    pub fn take(&mut self, input: T, verdict: Result<(), Trouble>, now_ns: u64, bind: bool) {
        (self.newest, self.newest_ns) = (Some(input), now_ns);
        match verdict {
            Ok(()) => (self.good, self.refused) = (Some(input), None),
            Err(trouble) => self.refused = self.refused.filter(|_| bind).or(Some(trouble)),
        }
    }

    /// Why there is no input that is good and young, where `lost` is the reason if nothing was refused.
    pub fn absence(&self, lost: impl Into<Trouble>) -> Trouble {
        self.refused.unwrap_or_else(|| lost.into())
    }
}

/// Whether an input is of now: neither too old nor from the future.
pub fn time(cause: Cause, time_ns: u64, now_ns: u64, timeout_ns: u64) -> Result<(), Trouble> {
    if now_ns.abs_diff(time_ns) <= timeout_ns {
        return Ok(());
    }
    Err(Trouble::new(cause, seconds_between(time_ns, now_ns), timeout_ns as f64 * 1e-9))
}

/// How far each leg's length and the integral of its rate have parted, and on what way. Both fade.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parting {
    apart: [f64; LEGS],
    way: [f64; LEGS],
}

impl Parting {
    /// A step from one measurement to the next.
    fn after(&self, now: &Measurement, before: &Measurement) -> Self {
        let dt = seconds_between(before.time_ns, now.time_ns);
        let kept = 1.0 - dt / RATE_MEMORY_S;
        if !(kept > 0.0) {
            return Self::default();
        }
        let mut next = *self;
        let rates = now.rate.iter().zip(&before.rate);
        let lengths = now.length.iter().zip(&before.length);
        for ((apart, way), ((now, before), (rate, rate_before))) in
            next.apart.iter_mut().zip(&mut next.way).zip(lengths.zip(rates))
        {
            let change = now - before;
            *apart = *apart * kept + change - 0.5 * (rate + rate_before) * dt;
            *way = *way * kept + change.abs();
        }
        next
    }
}

/// Whether the legs can be where a measurement says, after `before`. `widest`: see [`Believed::widest`].
/// `parting` goes on with what is believed.
pub fn measurement(
    actuator: &Actuator,
    limit: &AxisLimits,
    now: &Measurement,
    before: Option<&Measurement>,
    widest: f64,
    parting: &mut Parting,
) -> Result<(), Trouble> {
    if now.length.iter().chain(&now.rate).any(|value| !value.is_finite()) {
        return Err(Cause::MeasurementNotFinite.into());
    }
    within_believed_stroke(actuator, Cause::LengthOutOfStroke, &now.length)?;
    let Some(before) = before else {
        *parting = Parting::default();
        return Ok(());
    };
    let dt = seconds_between(before.time_ns, now.time_ns);
    if dt < 0.0 {
        return Err(Trouble::new(Cause::MeasurementFromElsewhen, -dt, 0.0));
    }
    let noise = NOISE * stroke(actuator);
    let furthest = BEYOND_RATE * actuator.max_rate * dt.min(widest) + noise;
    for (leg, (now, before)) in now.length.iter().zip(&before.length).enumerate() {
        let moved = (now - before).abs();
        if moved > furthest {
            return Err(Trouble::new(Cause::MeasurementJumped, moved, furthest).at(leg));
        }
    }
    let strongest = LEG_ACCELERATION.max(LIMIT_SHARE * limit.acceleration);
    let furthest = strongest * dt.min(widest) + RATE_GRAIN * actuator.max_rate;
    for (leg, (now, before)) in now.rate.iter().zip(&before.rate).enumerate() {
        let changed = (now - before).abs();
        if changed > furthest {
            return Err(Trouble::new(Cause::RateJumped, changed, furthest).at(leg));
        }
    }
    let next = parting.after(now, before);
    for (leg, (apart, way)) in next.apart.iter().zip(&next.way).enumerate() {
        let furthest = RATE_SHARE * way + RATE_NOISE * stroke(actuator);
        if apart.abs() > furthest {
            return Err(Trouble::new(Cause::RateInconsistent, apart.abs(), furthest).at(leg));
        }
    }
    *parting = next;
    Ok(())
}

/// A setpoint and the motion that it says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    pub setpoint: Setpoint,
    pub motion: Motion,
}

/// Whether a setpoint keeps the limits and, if it is followed since `before`, continues it. `widest`: see
/// [`Believed::widest`].
pub fn setpoint(
    machine: &Machine,
    parameters: &Parameters,
    home: &KinematicState,
    now: &Aim,
    before: Option<&Aim>,
    widest: f64,
    limiting: &mut Limiting,
) -> Result<(), Trouble> {
    let Aim { setpoint, motion } = now;
    if !setpoint.task.is_finite() {
        return Err(Cause::SetpointNotFinite.into());
    }
    within_limits(parameters, motion, limiting)?;
    within_envelope(parameters, setpoint, limiting)?;
    within_legs(machine, motion, limiting)?;
    with_room_to_stop(machine, parameters, home, motion, limiting)?;
    let Some(before) = before else { return Ok(()) };
    let dt = seconds_between(before.setpoint.time_ns, setpoint.time_ns);
    if dt <= 0.0 {
        return Err(Trouble::new(Cause::SetpointFromElsewhen, -dt, 0.0));
    }
    continues(machine, parameters, motion, &before.motion, [dt, widest], limiting)
}

fn within_limits(parameters: &Parameters, motion: &Motion, limiting: &mut Limiting) -> Result<(), Trouble> {
    let Motion { twist, acceleration, .. } = motion;
    let Limits { orientation, position, .. } = &parameters.limits;
    let fastest = (twist.angular.norm() / orientation.velocity).max(twist.linear.norm() / position.velocity);
    let strongest = (acceleration.angular.norm() / orientation.acceleration)
        .max(acceleration.linear.norm() / position.acceleration);
    for (limit, share) in [(Limit::Velocity, fastest), (Limit::Acceleration, strongest)] {
        if !limiting.keeps(limit, share) {
            return Err(Trouble::new(Cause::SetpointTooFast, share, 1.0));
        }
    }
    Ok(())
}

fn within_envelope(parameters: &Parameters, now: &Setpoint, limiting: &mut Limiting) -> Result<(), Trouble> {
    let Some(envelope) = &parameters.envelope else { return Ok(()) };
    for (axis, ((x, low), high)) in now.task.x.iter().zip(&envelope.lowest).zip(&envelope.highest).enumerate()
    {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let away = (x - middle).abs();
        // A range of nothing is kept by what does not leave it by more than rounding.
        if !limiting.keeps(Limit::Envelope, away / (half + 1e-9)) {
            let bound = if *x > middle { *high } else { *low };
            return Err(Trouble::new(Cause::SetpointOutOfEnvelope, *x, bound).at(axis));
        }
    }
    Ok(())
}

/// The legs can follow.
fn within_legs(machine: &Machine, motion: &Motion, limiting: &mut Limiting) -> Result<(), Trouble> {
    let actuator = &machine.actuator;
    let legs = leg_motion(machine, motion);
    for (leg, rate) in legs.rate.iter().enumerate() {
        if !limiting.keeps(Limit::LegRate, rate.abs() / actuator.max_rate) {
            return Err(Trouble::new(Cause::SetpointTooFast, rate.abs() / actuator.max_rate, 1.0).at(leg));
        }
    }
    within_stroke(actuator, 0.0, Cause::SetpointOutOfReach, &legs.length)
}

/// If the next message did not come, the platform would come to rest within the stroke and before a singular pose.
fn with_room_to_stop(
    machine: &Machine,
    parameters: &Parameters,
    home: &KinematicState,
    motion: &Motion,
    limiting: &mut Limiting,
) -> Result<(), Trouble> {
    let actuator = &machine.actuator;
    let stop = KinematicState::new(machine, where_stopped(parameters, motion));
    let length = stop.lengths(machine);
    let middle = 0.5 * (actuator.min_length + actuator.max_length);
    let furthest = length.iter().fold(0.0_f64, |furthest, length| furthest.max((length - middle).abs()));
    limiting.keeps(Limit::Stroke, furthest / (0.5 * stroke(actuator)));
    within_stroke(actuator, 0.0, Cause::SetpointOutOfReach, &length)?;
    let (there, here) = (stop.sensitivity(), home.sensitivity());
    // On the way to the other side the condition has no bound.
    let across = there.determinant * here.determinant < 0.0;
    let condition = if across { f64::INFINITY } else { there.condition };
    if !limiting.keeps(Limit::Condition, condition / parameters.condition) {
        return Err(Trouble::new(Cause::NearSingular, condition, parameters.condition));
    }
    Ok(())
}

/// Where the platform stands if this is the last setpoint: carried on for the timeout, then brought to rest.
fn where_stopped(parameters: &Parameters, motion: &Motion) -> Pose {
    let t = parameters.longest_carried_s();
    let (v, a) = (motion.twist.vector(), motion.acceleration.vector());
    let last = Twist::from_vector(&(v + a * t));
    let stop = Segment::to_rest(0, &last, &motion.acceleration, &parameters.limits);
    motion.pose.displaced(&Twist::from_vector(&((v + a * (0.5 * t)) * t + stop.end())))
}

/// X' and X'' are the derivatives of X, as far as two messages `dt` apart can show.
fn continues(
    machine: &Machine,
    parameters: &Parameters,
    now: &Motion,
    before: &Motion,
    [dt, widest]: [f64; 2],
    limiting: &mut Limiting,
) -> Result<(), Trouble> {
    let grain = SETPOINT_GRAIN * stroke(&machine.actuator);
    let time = dt.min(widest);
    let moved = before.pose.displacement_to(&now.pose);
    let rates = |motion: &Motion| [motion.twist.angular, motion.twist.linear];
    let accelerations = |motion: &Motion| [motion.acceleration.angular, motion.acceleration.linear];
    let (v, v_before) = (rates(now), rates(before));
    let (a, a_before) = (accelerations(now), accelerations(before));
    let limits = [&parameters.limits.orientation, &parameters.limits.position];
    let grains = [grain / machine.joints.radius, grain];
    let each =
        [moved.angular, moved.linear].into_iter().zip(v.iter().zip(&v_before)).zip(a.iter().zip(&a_before));
    for (((moved, (v, v_before)), (a, a_before)), (limit, grain)) in each.zip(limits.into_iter().zip(grains))
    {
        let jerk = limit.jerk * time;
        let share = |apart: f64, way: f64, drift: f64| apart / (SETPOINT_SHARE * way + drift + grain);
        let fastest = v.norm().max(v_before.norm());
        let strongest = a.norm().max(a_before.norm());
        let x =
            share((moved - (v + v_before) * (0.5 * dt)).norm(), fastest * time, jerk * time * time / 12.0);
        let v = (v - v_before - (a + a_before) * (0.5 * dt)).norm()
            / (SETPOINT_SHARE * strongest * time + 0.25 * jerk * time + grain / SETPOINT_GRAIN_S);
        if x > 1.0 || v > 1.0 {
            return Err(Trouble::new(Cause::SetpointJumped, x.max(v), 1.0));
        }
        // Rates of X'' are asked for over a period at least: messages that come in pairs are no jerk.
        let longest = time.max(parameters.period_ns as f64 * 1e-9);
        let jerk = (a - a_before).norm() / (limit.jerk * longest);
        if !limiting.keeps(Limit::Jerk, jerk) {
            return Err(Trouble::new(Cause::SetpointTooFast, jerk, 1.0));
        }
    }
    Ok(())
}

fn stroke(actuator: &Actuator) -> f64 {
    actuator.max_length - actuator.min_length
}

/// Whether all legs are where a leg can be believed to be.
pub fn within_believed_stroke(
    actuator: &Actuator,
    cause: Cause,
    length: &[f64; LEGS],
) -> Result<(), Trouble> {
    within_stroke(actuator, BEYOND_STROKE * stroke(actuator), cause, length)
}

/// Whether all legs are within their stroke and `slack`.
fn within_stroke(actuator: &Actuator, slack: f64, cause: Cause, length: &[f64; LEGS]) -> Result<(), Trouble> {
    for (leg, length) in length.iter().enumerate() {
        for (bound, beyond) in [
            (actuator.min_length - slack, actuator.min_length - slack - length),
            (actuator.max_length + slack, length - actuator.max_length - slack),
        ] {
            if beyond > 0.0 || beyond.is_nan() {
                return Err(Trouble::new(cause, *length, bound).at(leg));
            }
        }
    }
    Ok(())
}
