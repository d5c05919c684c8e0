//! Validation of measurements: stroke, change of lengths and rates, consistency of rates with lengths.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use serde::{Deserialize, Serialize};

use crate::control::cycle::Cycle;
use crate::control::parameters::Parameters;
use crate::control::sensing::last_input::{LastInput, check_stroke_with_tolerance, check_time_stamp};
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::inputs::{DriveStatus, Measurement};
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;
use crate::model::machine::Actuator;

/// Plausible rate of a leg as a ratio of its largest rate. An external force may move the leg faster than its
/// drive.
const LEG_RATE_FACTOR: f64 = 1.5;

/// Change of length that is always plausible, as a ratio of the stroke: noise.
const PLAUSIBLE_LENGTH_CHANGE_RATIO: f64 = 1e-3;

/// Tolerance of lengths against integrated rates, as a ratio of the travel: rates are filtered, late and not
/// quite to scale. A wrong sign gives twice the travel, a wrong unit a thousand times.
const RATE_INTEGRAL_TOLERANCE_PER_TRAVEL: f64 = 0.3;

/// Constant part of that tolerance, as a ratio of the stroke: noise and delay of the rates. It is small
/// because rates of the wrong sign double the error of the loop within milliseconds.
const RATE_INTEGRAL_TOLERANCE_PER_STROKE: f64 = 3e-4;

/// Time constant of residual and travel \[s\]: long compared with the delay of a filter, short compared with
/// a motion.
const RESIDUAL_TIME_CONSTANT_S: f64 = 0.03;

/// Largest plausible acceleration of a leg \[m/s^2\], five times gravity. No drive gives more; more is an
/// impact. The bound is the larger of this value and ten times the linear acceleration limit.
const MIN_ACCELERATION_BOUND_M_S2: f64 = 50.0;
const ACCELERATION_LIMIT_FACTOR: f64 = 10.0;

/// Change of a rate that is always plausible, as a ratio of the largest rate: noise.
const PLAUSIBLE_RATE_CHANGE_RATIO: f64 = 0.02;

/// Plausible lead of a stamp over the release, as a ratio of the period. No measurement is made in the
/// future; the estimator would misplace one by velocity times lead.
const LEAD_RATIO: f64 = 0.1;
/// Least bound on the lead, for high rates \[ns\]: clocks of processors and of drives agree no better.
const MIN_STAMP_LEAD_BOUND_NS: u64 = 10_000;

/// Residual and travel of each leg. The residual is the change of length minus the integral of the rate. Both
/// decay.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct RateConsistency {
    residual: [f64; LEGS],
    travel: [f64; LEGS],
}

impl RateConsistency {
    /// Residual and travel after the step from one measurement to the next, by the trapezoidal rule.
    fn updated(
        &self,
        now: &Measurement,
        before: &Measurement,
        [now_rate, before_rate]: [&[f64; LEGS]; 2],
    ) -> Self {
        let dt = seconds_between(before.time_ns, now.time_ns);
        let decay = 1.0 - dt / RESIDUAL_TIME_CONSTANT_S;
        if !(decay > 0.0) {
            return Self::default();
        }
        let mut next = *self;
        let rates = now_rate.iter().zip(before_rate);
        let lengths = now.length_m.iter().zip(&before.length_m);
        for ((residual, travel), ((now, before), (rate, rate_before))) in
            next.residual.iter_mut().zip(&mut next.travel).zip(lengths.zip(rates))
        {
            let change = now - before;
            *residual = *residual * decay + change - 0.5 * (rate + rate_before) * dt;
            *travel = *travel * decay + change.abs();
        }
        next
    }

    /// Whether each residual is within its tolerance. `step_error` \[m\]: error of the trapezoidal rule from
    /// one measurement to the next, for a motion within the limits.
    fn check(&self, actuator: &Actuator, step_error: f64) -> Result<(), Diagnostic> {
        for (leg, (residual, travel)) in self.residual.iter().zip(&self.travel).enumerate() {
            let bound = RATE_INTEGRAL_TOLERANCE_PER_TRAVEL * travel
                + RATE_INTEGRAL_TOLERANCE_PER_STROKE * actuator.stroke()
                + step_error;
            if residual.abs() > bound {
                let code = DiagnosticCode::RateInconsistent;
                return Err(Diagnostic::new(code, residual.abs(), bound).at(leg));
            }
        }
        Ok(())
    }
}

/// First stage of the cycle: validates each new measurement and keeps the last valid one.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct MeasurementValidator {
    last: LastInput<Measurement, Measurement>,
    consistency: RateConsistency,
    /// Cycles under control without a new valid measurement.
    pub cycles_without_valid: u64,
    /// Release of the cycle before \[ns\]; 0 before the first.
    released_before_ns: u64,
    /// Release of this cycle \[ns\].
    released_ns: u64,
}

impl MeasurementValidator {
    /// Returns the last valid measurement if it is recent. Under control the measurement that was valid
    /// before this cycle must be recent, too.
    pub fn validate(
        &mut self,
        cycle: &Cycle<'_>,
        newest: Option<&Measurement>,
    ) -> Result<&Measurement, Diagnostic> {
        (self.released_before_ns, self.released_ns) = (self.released_ns, cycle.release_ns);
        let continuity = self.check_input_continuity(cycle);
        let fault = newest.map_or(0, |newest| newest.drives.fault.unwrap_or_default());
        let has_bus_failed = fault & DriveStatus::BUS_FAILED_BIT != 0;
        let new = newest.filter(|newest| !has_bus_failed && self.last.is_new(newest));
        let is_accepted = new.is_some_and(|new| self.accept(cycle, new).is_ok());
        self.cycles_without_valid += u64::from(cycle.state.has_control() && !is_accepted);
        // Before any consequence of it.
        if has_bus_failed {
            return Err(DiagnosticCode::DriveBusFailed.into());
        }
        continuity?;
        let Some(valid) = &self.last.valid else {
            return Err(self.last.rejection_or(DiagnosticCode::NoMeasurement));
        };
        self.check_age(cycle, valid)?;
        Ok(valid)
    }

    /// Whether the inputs continued without a gap under control. After a pause of the loop they may be fresh
    /// again, but during the pause the drives had no force and the brakes closed. Control does not continue
    /// then.
    fn check_input_continuity(&self, cycle: &Cycle<'_>) -> Result<(), Diagnostic> {
        let last = self.last.valid.as_ref().filter(|_| cycle.state.has_control());
        last.map_or(Ok(()), |last| self.check_age(cycle, last))
    }

    fn check_age(&self, cycle: &Cycle<'_>, measurement: &Measurement) -> Result<(), Diagnostic> {
        let timeout_ns = cycle.constants.parameters.measured_timeout_ns;
        check_time_stamp(DiagnosticCode::MeasurementLost, measurement.time_ns, cycle.release_ns, timeout_ns)
            .map_err(|lost| self.pause(cycle, measurement).unwrap_or_else(|| self.last.rejection_or(lost)))
    }

    /// Diagnostic of a pause of the loop, if the pause and not the driver made a measurement too old.
    fn pause(&self, cycle: &Cycle<'_>, measurement: &Measurement) -> Option<Diagnostic> {
        let Parameters { measured_timeout_ns, longest_cycle_gap_ns, .. } = cycle.constants.parameters;
        let before_ns = self.released_before_ns;
        let pause_ns = self.released_ns.saturating_sub(before_ns);
        let was_recent = before_ns > 0 && before_ns.abs_diff(measurement.time_ns) <= measured_timeout_ns;
        let [pause_s, longest_s] = [pause_ns, longest_cycle_gap_ns].map(|time_ns| time_ns as f64 * 1e-9);
        (was_recent && pause_ns > longest_cycle_gap_ns)
            .then(|| Diagnostic::new(DiagnosticCode::DaemonHeld, pause_s, longest_s))
    }

    /// Validates a new measurement and records it. It must continue the last valid one if that one is recent
    /// or the platform is under control.
    fn accept(&mut self, cycle: &Cycle<'_>, new: &Measurement) -> Result<(), Diagnostic> {
        let (parameters, now_ns) = (&cycle.constants.parameters, cycle.release_ns);
        let timeout_ns = parameters.measured_timeout_ns;
        let has_control = cycle.state.has_control();
        let window_s = self.last.plausibility_window_s(now_ns, parameters.period_ns);
        let is_binding = |valid: &&Measurement| has_control || now_ns.abs_diff(valid.time_ns) <= timeout_ns;
        let before = self.last.valid.as_ref().filter(is_binding);
        let consistency = &mut self.consistency;
        let mut check = || {
            check_time_stamp(DiagnosticCode::MeasurementStampInvalid, new.time_ns, now_ns, timeout_ns)?;
            check_lead(new.time_ns, now_ns, parameters.period_ns)?;
            check_age_at_arrival(new.time_ns, now_ns, parameters.max_age_at_arrival_ns)?;
            check_measurement(cycle, new, before, window_s, consistency)
        };
        let result = check();
        self.last.record(new, result.map(|()| new), now_ns, has_control);
        result
    }
}

/// Whether the legs can have moved from `before` to a measurement, and the rates are consistent with the
/// lengths.
fn check_measurement(
    cycle: &Cycle<'_>,
    now: &Measurement,
    before: Option<&Measurement>,
    window_s: f64,
    consistency: &mut RateConsistency,
) -> Result<(), Diagnostic> {
    let actuator = &cycle.constants.machine().actuator;
    let not_finite = |values: &[f64; LEGS]| values.iter().position(|value| !value.is_finite());
    if let Some(leg) = not_finite(&now.length_m).or_else(|| now.rate_m_s.as_ref().and_then(not_finite)) {
        return Err(Diagnostic::from(DiagnosticCode::MeasurementNotFinite).at(leg));
    }
    check_stroke_with_tolerance(actuator, DiagnosticCode::LengthOutOfStroke, &now.length_m)?;
    let Some(before) = before else {
        *consistency = RateConsistency::default();
        return Ok(());
    };
    let dt = seconds_between(before.time_ns, now.time_ns);
    if dt < 0.0 {
        return Err(Diagnostic::new(DiagnosticCode::MeasurementStampInvalid, -dt, 0.0));
    }
    let noise = PLAUSIBLE_LENGTH_CHANGE_RATIO * actuator.stroke();
    let bound = LEG_RATE_FACTOR * actuator.max_rate_m_s * dt.min(window_s) + noise;
    check_change(DiagnosticCode::MeasurementJumped, &now.length_m, &before.length_m, bound)?;
    match (&now.rate_m_s, &before.rate_m_s) {
        (Some(rate), Some(before_rate)) => check_rate_jump_and_consistency(
            cycle,
            [now, before],
            [rate, before_rate],
            dt.min(window_s),
            consistency,
        ),
        _ => {
            *consistency = RateConsistency::default();
            Ok(())
        }
    }
}

/// Whether actuators can change the rates as measured, and the rates are the derivatives of the lengths.
fn check_rate_jump_and_consistency(
    cycle: &Cycle<'_>,
    [now, before]: [&Measurement; 2],
    [rate, before_rate]: [&[f64; LEGS]; 2],
    bounded_dt_s: f64,
    consistency: &mut RateConsistency,
) -> Result<(), Diagnostic> {
    let actuator = &cycle.constants.machine().actuator;
    let limits = cycle.constants.parameters.unscaled_limits();
    let acceleration =
        MIN_ACCELERATION_BOUND_M_S2.max(ACCELERATION_LIMIT_FACTOR * limits.position.acceleration);
    let bound = acceleration * bounded_dt_s + PLAUSIBLE_RATE_CHANGE_RATIO * actuator.max_rate_m_s;
    check_change(DiagnosticCode::RateJumped, rate, before_rate, bound)?;
    let updated = consistency.updated(now, before, [rate, before_rate]);
    // J dt^3 / 12 per step, times the steps within the time constant.
    let jerk = limits.position.jerk + cycle.constants.arm_m * limits.orientation.jerk;
    updated.check(actuator, RESIDUAL_TIME_CONSTANT_S * jerk * bounded_dt_s.powi(2) / 12.0)?;
    *consistency = updated;
    Ok(())
}

/// Whether a stamp is not in the future.
fn check_lead(time_ns: u64, now_ns: u64, period_ns: u64) -> Result<(), Diagnostic> {
    let bound_ns = MIN_STAMP_LEAD_BOUND_NS.max((LEAD_RATIO * period_ns as f64) as u64);
    if time_ns <= now_ns.saturating_add(bound_ns) {
        return Ok(());
    }
    let age_s = seconds_between(time_ns, now_ns);
    Err(Diagnostic::new(DiagnosticCode::MeasurementStampInvalid, age_s, -1e-9 * bound_ns as f64))
}

/// Whether the loop stays stable with measurements of this age. In a gap without new measurements the age of
/// the last one may grow further, up to the timeout; after the gap the loop is the same as before.
fn check_age_at_arrival(time_ns: u64, now_ns: u64, max_age_ns: u64) -> Result<(), Diagnostic> {
    if now_ns.saturating_sub(time_ns) <= max_age_ns {
        return Ok(());
    }
    let age_s = seconds_between(time_ns, now_ns);
    Err(Diagnostic::new(DiagnosticCode::MeasurementTooOld, age_s, 1e-9 * max_age_ns as f64))
}

fn check_change(
    code: DiagnosticCode,
    now: &[f64; LEGS],
    before: &[f64; LEGS],
    bound: f64,
) -> Result<(), Diagnostic> {
    for (leg, (now, before)) in now.iter().zip(before).enumerate() {
        let change = (now - before).abs();
        if change > bound {
            return Err(Diagnostic::new(code, change, bound).at(leg));
        }
    }
    Ok(())
}
