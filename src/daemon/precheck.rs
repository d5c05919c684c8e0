//! Precheck of a trajectory: whether the daemon would follow its setpoints, before the platform moves. The
//! daemon's own reference generator follows the whole trajectory, cycle by cycle.
//!
//! The precheck covers neither the forces of feedback nor the approach to the first setpoint, which keeps the limits by construction.

use core::fmt;
use core::ops::ControlFlow;

use nalgebra::Vector6;

use super::parameters::parameters;
use hexad_core::control::constants::{Constants, MAX_HOLDING_SHARE};
use hexad_core::control::parameters::{Envelope, Parameters, ViolationPolicy};
use hexad_core::control::reference::ReferenceGenerator;
use hexad_core::control::setpoint::motion::SetpointMotion;
use hexad_core::control::setpoint::target::Target;
use hexad_core::control::setpoint::validation::{check_deviation, check_setpoint};
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::errors::PoseError;
use hexad_core::control::signals::inputs::Setpoint;
use hexad_core::control::signals::limits::{Limit, LimitSet};
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Motion;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::drive_capability::DriveCapability;
use hexad_machine::config::Config;

/// Share of each limit that a built-in motion may use. The rest is a reserve, because a cycle may begin at any instant
/// between two setpoints.
const USABLE_SHARE: f64 = 0.95;

/// Share of the largest distance of the setpoints from the first, of which the reference must go as much.
const LEAST_MOVED_SHARE: f64 = 0.5;

/// Cycles between two reports of progress: about a millisecond of effort.
const CYCLES_PER_REPORT: u64 = 1024;

/// Check of setpoints with the rules and parameters of the daemon.
pub struct Precheck {
    machine: Machine,
    parameters: Parameters,
}

impl Precheck {
    /// Precheck with the limits of the daemon.
    pub fn new(config: &Config) -> Self {
        let machine = config.machine.clone();
        // The decision about a setpoint does not depend on the fidelity.
        let parameters = parameters(&machine, &config.deployment, Fidelity::Exact);
        Self { machine, parameters }
    }

    /// The same with a reserve to each limit. Home at rest satisfies the reduced limits, too.
    pub fn with_reserve(mut self) -> Self {
        let Parameters { limits, envelope, max_condition, .. } = &mut self.parameters;
        limits.position = limits.position.scaled(USABLE_SHARE);
        limits.orientation = limits.orientation.scaled(USABLE_SHARE);
        let home = Vector6::from(self.machine.home);
        let nearer = |x: [f64; 6]| home.lerp(&x.into(), USABLE_SHARE).into();
        *envelope = envelope.map(|Envelope { lowest, highest }| Envelope {
            lowest: nearer(lowest),
            highest: nearer(highest),
        });
        let at_home = KinematicState::new(&self.machine, self.machine.home_pose()).sensitivity().condition;
        *max_condition = at_home + USABLE_SHARE * (*max_condition - at_home);
        let drives = DriveCapability::new(&self.machine, &self.machine.home_pose());
        let available = self.machine.actuator.weakest_available_force_n();
        let at_home =
            drives.map_or(0.0, |drives| drives.largest_holding_force().1 / (MAX_HOLDING_SHARE * available));
        self.machine.actuator.max_force_n *= at_home + USABLE_SHARE * (1.0 - at_home);
        self
    }

    /// Whether a setpoint keeps the limits at its instant, including the limits of the pose.
    pub fn keeps_limits(&self, state: &TaskState) -> bool {
        let setpoint = SetpointMotion::new(Setpoint::motion(0, *state));
        let kinematic_state = KinematicState::new(&self.machine, setpoint.motion.pose);
        check_setpoint(&self.machine, &self.parameters, &setpoint, &mut LimitSet::default()).is_ok()
            && kinematic_state.sensitivity().condition <= self.parameters.max_condition
    }

    /// The first setpoint from `from` to `to` that the daemon would refuse, if it followed the trajectory
    /// from `from` on.
    pub fn refusal(&self, at: impl Fn(f64) -> TaskState, span: [f64; 2]) -> Option<SetpointRefusal> {
        let mut first = None;
        let refused = |refusal| {
            first = Some(refusal);
            ControlFlow::Break(())
        };
        self.follow(at, span, refused, |_| true);
        first
    }

    /// Follows the trajectory from `from` to `to`. After a refusal it continues from the refused setpoint,
    /// unless `refused` breaks. `progress` receives the time since the beginning \[s\] and says
    /// whether to go on.
    pub fn follow(
        &self,
        at: impl Fn(f64) -> TaskState,
        [from, to]: [f64; 2],
        mut refused: impl FnMut(SetpointRefusal) -> ControlFlow<()>,
        mut progress: impl FnMut(f64) -> bool,
    ) {
        let constants = Constants::new(&self.machine, self.parameters);
        let period_ns = self.parameters.period_ns;
        let setpoint = |k: u64| SetpointMotion::new(Setpoint::motion(k * period_ns, at(self.time(from, k))));
        let mut reference = ReferenceGenerator::new(&constants);
        let mut now = setpoint(0);
        let mut before = now;
        reference.verify_start(&constants, &now.motion).ok();
        reference.begin_placed_motion(0);
        let steps = ((to - from) / self.time(0.0, 1)).ceil() as u64;
        let tolerance = |a: &Motion, b: &Motion| {
            self.parameters.engage_tolerance_ratio(&PoseError::new(a, &b.pose, &b.twist))
        };
        let (start, mut wanted, mut moved) = (now.motion, 0.0_f64, 0.0_f64);
        for k in 0..=steps {
            if k % CYCLES_PER_REPORT == 0 && !progress(self.time(0.0, k)) {
                return;
            }
            let mut active_limits = LimitSet::default();
            let result = check_setpoint(&self.machine, &self.parameters, &now, &mut active_limits)
                .and_then(|()| check_deviation(&self.parameters, &reference, &before, &now));
            if let Err(diagnostic) = result {
                let active_limits = active_limits.union(reference.active_limits());
                let policy = self.parameters.on_violation;
                let refusal = SetpointRefusal {
                    t_s: self.time(from, k),
                    diagnostic: Some(diagnostic),
                    active_limits,
                    policy,
                };
                if refused(refusal).is_break() {
                    return;
                }
                reference.verify_start(&constants, &now.motion).ok();
                reference.begin_placed_motion(k * period_ns);
            }
            reference.advance(&constants, (k + 1) * period_ns, Some(&Target::Motion(&now)));
            wanted = wanted.max(tolerance(&now.motion, &start));
            moved = moved.max(tolerance(reference.motion(), &start));
            (before, now) = (now, setpoint(k + 1));
        }
        // Within the tolerance a reference that never moves would count as one that follows.
        if moved < LEAST_MOVED_SHARE * wanted {
            let policy = self.parameters.on_violation;
            let active_limits = reference.active_limits();
            let _ = refused(SetpointRefusal { t_s: to, diagnostic: None, active_limits, policy });
        }
    }

    /// Time of the k-th cycle \[s\].
    fn time(&self, from: f64, k: u64) -> f64 {
        from + (k * self.parameters.period_ns) as f64 * 1e-9
    }
}

/// Refusal of a setpoint: its time, the reason, and the limits that it exceeds.
#[derive(Clone, Copy, Debug)]
pub struct SetpointRefusal {
    /// Time since the start of the trajectory \[s\].
    pub t_s: f64,
    /// `None`: the reference did not follow at all.
    diagnostic: Option<Diagnostic>,
    active_limits: LimitSet,
    policy: ViolationPolicy,
}

/// Remedy that is no remedy where it is set already.
const ADVICE_OF_LIMIT: &str = ", or set [setpoint] on_violation to limit";

impl fmt::Display for SetpointRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { t_s, diagnostic, active_limits, policy } = self;
        write!(f, "t = {t_s:.4}: ")?;
        let Some(diagnostic) = diagnostic else {
            return write!(
                f,
                "the platform would not move: no stop within [limits] is proved from where it stands"
            );
        };
        // In reverse order of the checks, which end at the first exceeded limit.
        let limits = [Limit::Jerk, Limit::LegRate, Limit::Acceleration, Limit::Velocity];
        let beyond = limits.into_iter().find(|limit| active_limits.contains(*limit));
        if let (DiagnosticCode::SetpointTooFast, Some(limit)) = (diagnostic.code, beyond) {
            write!(f, "{}: ", limit.name())?;
        }
        match policy {
            ViolationPolicy::Stop => write!(f, "{diagnostic}"),
            ViolationPolicy::Limit => write!(f, "{}", diagnostic.to_string().replace(ADVICE_OF_LIMIT, "")),
        }
    }
}
