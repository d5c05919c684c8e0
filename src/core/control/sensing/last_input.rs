//! Validation that measurements and setpoints have in common: the last valid input, time stamp, stroke.
//!
//! A rejected input changes nothing: the last valid input stays and its age keeps growing. Invalid data thus
//! never restarts a watchdog. After the timeout the diagnostic is the reason of the rejection.

use serde::{Deserialize, Serialize};

use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::time::seconds_between;
use crate::model::LEGS;
use crate::model::machine::Actuator;

/// Tolerance of a measured length at the ends of the stroke, as a ratio of the stroke: encoders have offsets,
/// end stops have springs.
const STROKE_TOLERANCE_RATIO: f64 = 0.02;

/// Largest time over which a change is plausible after a rejection, in intervals of the messages. The
/// plausible change grows with the time since the last valid input; without this bound a series of rejected
/// inputs would widen it without limit. Two intervals, because one message may get lost. The longest interval
/// counts: after a pause of the loop the first message may be too old, and the next one shows the motion of
/// the whole pause.
const MAX_PLAUSIBILITY_WINDOW_INTERVALS: f64 = 2.0;

/// The last input, valid or not: the last valid one, and why a later one was rejected. `Valid` is the form in which a valid input is
/// stored.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::control) struct LastInput<Input, Valid> {
    pub valid: Option<Valid>,
    /// Last input if it was rejected, with the reason of its rejection or of the first since the valid one.
    rejected: Option<(Input, Diagnostic)>,
    /// Release of the cycle that validated the last input \[ns\].
    validated_ns: u64,
    /// Longest time between two inputs since the last valid one \[ns\].
    longest_interval_ns: u64,
}

impl<Input, Valid> Default for LastInput<Input, Valid> {
    fn default() -> Self {
        Self { valid: None, rejected: None, validated_ns: 0, longest_interval_ns: 0 }
    }
}

impl<Input: Copy + PartialEq, Valid: Copy + AsRef<Input>> LastInput<Input, Valid> {
    /// Whether an input differs from the last one, valid or rejected. Each input is validated once.
    pub fn is_new(&self, input: &Input) -> bool {
        let valid = || self.valid.as_ref().map(AsRef::as_ref);
        self.rejected.as_ref().map(|(rejected, _)| rejected).or_else(valid) != Some(input)
    }

    /// Longest time over which a change is plausible \[s\]; infinite if no input was rejected since the last
    /// valid one.
    pub fn plausibility_window_s(&self, now_ns: u64, period_ns: u64) -> f64 {
        if self.rejected.is_none() {
            return f64::INFINITY;
        }
        let interval_ns = self.interval_ns(now_ns).max(period_ns);
        MAX_PLAUSIBILITY_WINDOW_INTERVALS * (interval_ns as f64 * 1e-9)
    }

    /// Longest time between two inputs since the last valid one, if the next one comes now \[ns\].
    fn interval_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.validated_ns).max(self.longest_interval_ns)
    }

    /// Records an input with the result of its validation. With `keep_first` the first of several reasons
    /// stays: later inputs may be rejected merely because the last valid one is old.
    pub fn record(
        &mut self,
        input: &Input,
        result: Result<&Valid, Diagnostic>,
        now_ns: u64,
        keep_first: bool,
    ) {
        match result {
            Ok(valid) => (self.valid, self.rejected, self.longest_interval_ns) = (Some(*valid), None, 0),
            Err(diagnostic) => {
                self.longest_interval_ns = self.interval_ns(now_ns);
                let first = self.rejected.filter(|_| keep_first).map(|(_, first)| first);
                self.rejected = Some((*input, first.unwrap_or(diagnostic)));
            }
        }
        self.validated_ns = now_ns;
    }

    /// The last rejection, or `otherwise` if nothing was rejected since the last valid input.
    pub fn rejection_or(&self, otherwise: impl Into<Diagnostic>) -> Diagnostic {
        self.rejected.map_or_else(|| otherwise.into(), |(_, rejection)| rejection)
    }
}

/// Whether a time stamp is at most `timeout_ns` before or after now.
pub(in crate::control) fn check_time_stamp(
    code: DiagnosticCode,
    time_ns: u64,
    now_ns: u64,
    timeout_ns: u64,
) -> Result<(), Diagnostic> {
    if now_ns.abs_diff(time_ns) <= timeout_ns {
        return Ok(());
    }
    Err(Diagnostic::new(code, seconds_between(time_ns, now_ns), timeout_ns as f64 * 1e-9))
}

/// Whether all lengths are within the stroke, widened by the tolerance of a measurement.
pub(in crate::control) fn check_stroke_with_tolerance(
    actuator: &Actuator,
    code: DiagnosticCode,
    length_m: &[f64; LEGS],
) -> Result<(), Diagnostic> {
    check_stroke(actuator, STROKE_TOLERANCE_RATIO * actuator.stroke(), code, length_m)
}

/// Whether all lengths are within the stroke, widened by `tolerance_m` \[m\].
pub(in crate::control) fn check_stroke(
    actuator: &Actuator,
    tolerance_m: f64,
    code: DiagnosticCode,
    length_m: &[f64; LEGS],
) -> Result<(), Diagnostic> {
    let (shortest, longest) = (actuator.min_length_m - tolerance_m, actuator.max_length_m + tolerance_m);
    for (leg, length) in length_m.iter().enumerate() {
        if *length >= shortest && *length <= longest {
            continue;
        }
        let bound = if *length < shortest { shortest } else { longest };
        return Err(Diagnostic::new(code, *length, bound).at(leg));
    }
    Ok(())
}
