//! Whether the daemon would take the setpoints of a score, by its own rule, before anything moves.
//!
//! What this file does not do: say whether the forces suffice; the way to the first setpoint keeps the limits by itself.

use core::fmt;

use nalgebra::Vector6;
use rayon::prelude::*;

use crate::config::Config;
use crate::control::controller::Setpoint;
use crate::control::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::input_validation::{SetpointCheck, SetpointMotion, check_setpoint};
use crate::control::limits::{Limit, LimitSet};
use crate::control::parameters::{Envelope, Parameters};
use crate::daemon;
use crate::model::fidelity::Fidelity;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// What a motion of hexad's own uses of each limit, the rest is reserve: where between two setpoints a cycle
/// begins is not known before.
const USABLE_SHARE: f64 = 0.95;

/// Most steps in which a span is looked through: its polynomials of fifth order need far fewer.
const MOST_STEPS: f64 = 100.0;

/// Looks at setpoints as the daemon does.
pub struct Rehearsal<'a> {
    machine: &'a Machine,
    parameters: Parameters,
    home: KinematicState,
}

impl<'a> Rehearsal<'a> {
    /// With the daemon's own limits.
    pub fn new(config: &'a Config) -> Self {
        let machine = &config.machine;
        // A setpoint is taken or not whatever the fidelity.
        let parameters = daemon::parameters(machine, &config.deployment, Fidelity::Exact);
        Self {
            machine,
            parameters,
            home: KinematicState::new(machine, TaskState::at_rest(machine.home).motion().pose),
        }
    }

    /// With a reserve to each limit; standing at home keeps them all the same.
    pub fn with_reserve(mut self) -> Self {
        let Parameters { limits, envelope, condition, .. } = &mut self.parameters;
        limits.position = limits.position.scaled(USABLE_SHARE);
        limits.orientation = limits.orientation.scaled(USABLE_SHARE);
        let home = Vector6::from(self.machine.home);
        let nearer = |x: [f64; 6]| home.lerp(&x.into(), USABLE_SHARE).into();
        *envelope = envelope.map(|Envelope { lowest, highest }| Envelope {
            lowest: nearer(lowest),
            highest: nearer(highest),
        });
        let at_home = self.home.sensitivity().condition;
        *condition = at_home + USABLE_SHARE * (*condition - at_home);
        self
    }

    /// The first setpoint after `from` and not after `to` that would be refused after the one a cycle before it. Both
    /// ends of the span are looked at: jerk is greatest there.
    pub fn refusal(&self, at: impl Fn(f64) -> TaskState, [from, to]: [f64; 2]) -> Option<Refusal> {
        let period_s = self.parameters.period_ns as f64 * 1e-9;
        let first = (from + period_s).min(to);
        let steps = ((to - first) / period_s).ceil().clamp(1.0, MOST_STEPS);
        let t = |k: u32| first + (to - first) * f64::from(k) / steps;
        (0..=steps as u32).find_map(|k| self.refused(t(k), [at(t(k) - period_s), at(t(k))]))
    }

    fn refused(&self, t: f64, [before, now]: [TaskState; 2]) -> Option<Refusal> {
        let Self { machine, parameters, home } = self;
        let [before, now] = [(0, before), (parameters.period_ns, now)]
            .map(|(time_ns, task)| SetpointMotion::new(Setpoint { time_ns, task }));
        let SetpointCheck { active_limits, result } =
            check_setpoint(machine, parameters, home, &now, Some(&before), f64::INFINITY);
        result.err().map(|diagnostic| Refusal { t, diagnostic, active_limits })
    }

    /// The first one in the first of many spans that has any.
    pub fn first_refusal(
        &self,
        at: impl Fn(f64) -> TaskState + Sync,
        seconds: f64,
        spans: u32,
    ) -> Option<Refusal> {
        let end = |k: u32| seconds * f64::from(k) / f64::from(spans);
        (0..spans).into_par_iter().find_map_first(|k| self.refusal(&at, [end(k), end(k + 1)]))
    }
}

/// A setpoint that would be refused.
#[derive(Clone, Copy, Debug)]
pub struct Refusal {
    /// Of the score \[s\].
    pub t: f64,
    diagnostic: Diagnostic,
    active_limits: LimitSet,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { t, diagnostic, active_limits } = self;
        write!(f, "t = {t:.4}: ")?;
        // From the last that is looked at to the first: what is beyond ends the looking.
        let limits = [Limit::Jerk, Limit::LegRate, Limit::Acceleration, Limit::Velocity];
        let beyond = limits.into_iter().find(|limit| active_limits.contains(*limit));
        if let (DiagnosticCode::SetpointTooFast, Some(limit)) = (diagnostic.code, beyond) {
            write!(f, "{}: ", limit.name())?;
        }
        write!(f, "{diagnostic}")
    }
}
