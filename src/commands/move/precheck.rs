//! Precheck of a trajectory: whether the daemon would accept its setpoints, by the daemon's own rule, before anything
//! moves.
//!
//! The precheck does not look at forces, nor at the approach to the first setpoint, which keeps the limits by itself.

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

/// Share of each limit that a built-in motion may use; the rest is reserve, as the instant between two setpoints at
/// which a cycle begins is not known in advance.
const USABLE_SHARE: f64 = 0.95;

/// Largest number of setpoints that are checked in a span; its polynomials of fifth order need far fewer.
const MAX_STEPS_PER_SPAN: f64 = 100.0;

/// Check of setpoints by the rule and the parameters of the daemon.
pub struct Precheck<'a> {
    machine: &'a Machine,
    parameters: Parameters,
    home: KinematicState,
}

impl<'a> Precheck<'a> {
    /// Precheck with the limits of the daemon.
    pub fn new(config: &'a Config) -> Self {
        let machine = &config.machine;
        // The fidelity has no part in the decision about a setpoint.
        let parameters = daemon::parameters(machine, &config.deployment, Fidelity::Exact);
        Self { machine, parameters, home: KinematicState::new(machine, machine.home_pose()) }
    }

    /// The same with a reserve to each limit; home at rest keeps the reduced limits too.
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

    /// The first setpoint after `from` and not after `to` that the daemon would refuse after the setpoint of the cycle
    /// before. Both ends of the span are checked, where jerk is greatest.
    pub fn refusal(&self, at: impl Fn(f64) -> TaskState, [from, to]: [f64; 2]) -> Option<SetpointRefusal> {
        let period_s = self.parameters.period_ns as f64 * 1e-9;
        let first = (from + period_s).min(to);
        let steps = ((to - first) / period_s).ceil().clamp(1.0, MAX_STEPS_PER_SPAN);
        let t = |k: u32| first + (to - first) * f64::from(k) / steps;
        (0..=steps as u32).find_map(|k| self.refused(t(k), [at(t(k) - period_s), at(t(k))]))
    }

    fn refused(&self, t: f64, [before, now]: [TaskState; 2]) -> Option<SetpointRefusal> {
        let Self { machine, parameters, home } = self;
        let [before, now] = [(0, before), (parameters.period_ns, now)]
            .map(|(time_ns, task)| SetpointMotion::new(Setpoint::motion(time_ns, task)));
        let SetpointCheck { active_limits, result } =
            check_setpoint(machine, parameters, home, &now, Some(&before), f64::INFINITY);
        result.err().map(|diagnostic| SetpointRefusal { t, diagnostic, active_limits })
    }

    /// The first refusal within `seconds`, searched in equal spans.
    pub fn first_refusal(
        &self,
        at: impl Fn(f64) -> TaskState + Sync,
        seconds: f64,
        spans: u32,
    ) -> Option<SetpointRefusal> {
        let end = |k: u32| seconds * f64::from(k) / f64::from(spans);
        (0..spans).into_par_iter().find_map_first(|k| self.refusal(&at, [end(k), end(k + 1)]))
    }
}

/// SetpointRefusal of a setpoint: its time, the reason, and the limits that it exceeds.
#[derive(Clone, Copy, Debug)]
pub struct SetpointRefusal {
    /// Time since the start of the trajectory \[s\].
    pub t: f64,
    diagnostic: Diagnostic,
    active_limits: LimitSet,
}

impl fmt::Display for SetpointRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { t, diagnostic, active_limits } = self;
        write!(f, "t = {t:.4}: ")?;
        // In reverse order of the checks, which end at the first limit that is exceeded.
        let limits = [Limit::Jerk, Limit::LegRate, Limit::Acceleration, Limit::Velocity];
        let beyond = limits.into_iter().find(|limit| active_limits.contains(*limit));
        if let (DiagnosticCode::SetpointTooFast, Some(limit)) = (diagnostic.code, beyond) {
            write!(f, "{}: ", limit.name())?;
        }
        write!(f, "{diagnostic}")
    }
}
