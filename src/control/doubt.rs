//! Whether an input can be what it says it is.
//!
//! What is refused changes nothing: the last good input stays, and its age goes on counting. So bad data
//! never refreshes a watchdog, and the reason of the last refusal is told when the watchdog barks.

use super::controller::{Measurement, Setpoint, seconds_between};
use super::state::Cause;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::{Actuator, Machine};

/// How far beyond the ends of its stroke a leg is believed, as a share of the stroke: encoders have
/// offsets, end stops have springs.
const BEYOND_STROKE: f64 = 0.02;

/// How much faster than its greatest rate a leg is believed: it may be pushed.
const BEYOND_RATE: f64 = 1.5;

/// Change of length that is believed at once, whatever the time between, as a share of the stroke: noise.
const NOISE: f64 = 1e-3;

/// The last input that was believed, and why the one after it was not.
#[derive(Clone, Copy, Debug)]
pub struct Believed<T> {
    pub good: Option<T>,
    refused: Option<Cause>,
}

impl<T> Default for Believed<T> {
    fn default() -> Self {
        Self { good: None, refused: None }
    }
}

impl<T: Copy> Believed<T> {
    /// Takes an input in, if it is believed.
    pub fn take(&mut self, input: T, verdict: Result<(), Cause>) {
        match verdict {
            Ok(()) => *self = Self { good: Some(input), refused: None },
            Err(cause) => self.refused = Some(cause),
        }
    }

    /// Why there is no input that is good and young, where `lost` is the reason if nothing was refused.
    pub fn absence(&self, lost: Cause) -> Cause {
        self.refused.unwrap_or(lost)
    }
}

/// Whether the legs can be where a measurement says, after `before`.
pub fn measurement(
    machine: &Machine,
    now: &Measurement,
    before: Option<&Measurement>,
) -> Result<(), Cause> {
    if now.length.iter().chain(&now.rate).any(|value| !value.is_finite()) {
        return Err(Cause::MeasurementNotFinite);
    }
    let slack = BEYOND_STROKE * stroke(&machine.actuator);
    if !within_stroke(&machine.actuator, slack, now) {
        return Err(Cause::LengthOutOfStroke);
    }
    let Some(before) = before else { return Ok(()) };
    if !near(&machine.actuator, now, before) {
        return Err(Cause::MeasurementJumped);
    }
    if continues(&machine.actuator, now, before) { Ok(()) } else { Err(Cause::RateInconsistent) }
}

/// Whether the legs can do what a setpoint says, after `before`.
pub fn setpoint(machine: &Machine, now: &Setpoint, before: Option<&Setpoint>) -> Result<(), Cause> {
    if !now.task.is_finite() {
        return Err(Cause::SetpointNotFinite);
    }
    let legs = legs(machine, now);
    let slow = legs.rate.iter().all(|rate| rate.abs() <= machine.actuator.max_rate);
    if !slow || !within_stroke(&machine.actuator, 0.0, &legs) {
        return Err(Cause::SetpointOutOfReach);
    }
    let Some(before) = before else { return Ok(()) };
    let before = self::legs(machine, before);
    let smooth = near(&machine.actuator, &legs, &before) && continues(&machine.actuator, &legs, &before);
    if smooth { Ok(()) } else { Err(Cause::SetpointJumped) }
}

/// What a setpoint asks of the legs.
fn legs(machine: &Machine, setpoint: &Setpoint) -> Measurement {
    let legs = leg_motion(machine, &setpoint.task.motion());
    Measurement { time_ns: setpoint.time_ns, length: legs.length, rate: legs.rate }
}

fn stroke(actuator: &Actuator) -> f64 {
    actuator.max_length - actuator.min_length
}

fn within_stroke(actuator: &Actuator, slack: f64, legs: &Measurement) -> bool {
    let believed = actuator.min_length - slack..=actuator.max_length + slack;
    legs.length.iter().all(|length| believed.contains(length))
}

/// No leg moved further than a leg can; and time did not run backward.
fn near(actuator: &Actuator, now: &Measurement, before: &Measurement) -> bool {
    let dt = seconds_between(before.time_ns, now.time_ns);
    let most = BEYOND_RATE * actuator.max_rate * dt + NOISE * stroke(actuator);
    dt >= 0.0 && now.length.iter().zip(&before.length).all(|(now, before)| (now - before).abs() <= most)
}

/// The lengths changed by about what the rates say: a wrong sign or unit does not pass at speed.
fn continues(actuator: &Actuator, now: &Measurement, before: &Measurement) -> bool {
    let dt = seconds_between(before.time_ns, now.time_ns);
    let most = 0.5 * BEYOND_RATE * actuator.max_rate * dt + NOISE * stroke(actuator);
    let change = now.length.iter().zip(&before.length).map(|(now, before)| now - before);
    let by_rates = now.rate.iter().zip(&before.rate).map(|(now, before)| 0.5 * (now + before) * dt);
    change.zip(by_rates).all(|(change, by_rates)| (change - by_rates).abs() <= most)
}
