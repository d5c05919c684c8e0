//! One cycle of control: from the newest setpoint and measurement to six forces, or the diagnostic why there are none.
//!
//! [`Controller::step`] shows the stages in order. Each is a function of its arguments and of the memory of its own
//! struct; none changes the memory of another. A cycle does a bounded amount of work.

use super::assessment::{Evidence, assess};
use super::diagnostic::{Diagnostic, DiagnosticCode};
use super::disturbance_observer::{DisturbanceObserver, ObserverReset};
use super::feedback_bound::FeedbackBound;
use super::force_limits::{ForceLimiter, LimitedForces};
use super::forces::forces;
use super::free_motion::FreeMotion;
use super::input_validation::{MeasurementValidator, SetpointValidator, ValidatedSetpoint};
use super::limits::LimitSet;
use super::localization::{Localization, PlatformState};
use super::parameters::{Constants, Parameters};
use super::reference::{ReferenceGenerator, Target};
use super::state::{OperatorRequest, Request, State};
use super::supervisor::Supervisor;
use super::tracking_error::{ErrorSample, ErrorTracker, TrackingError};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Motion, Wrench};
use crate::model::task::TaskState;

/// Meaning of the numbers of a setpoint, as the messages carry it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum SetpointKind {
    /// X, X' and X'' of a motion at one instant.
    #[default]
    Motion = 0,
    /// X of a motion at one instant, without derivatives; the messages may arrive more slowly than the cycles.
    Pose = 1,
    /// X of a pose to move to and to stand at.
    Target = 2,
    /// No kind has the number of the message: the setpoint is rejected.
    Unknown = 3,
}

impl SetpointKind {
    /// The kinds that a message may have, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Pose, Self::Target];
}

/// Task coordinates, with their derivatives, that the platform shall have at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Which of the numbers hold, and for how long.
    pub kind: SetpointKind,
    /// Instant for which the setpoint holds, on the clock of the releases \[ns\].
    pub time_ns: u64,
    /// X, X', X'' at that instant.
    pub task: TaskState,
}

impl Setpoint {
    /// X, X' and X'' of a motion at an instant.
    pub fn motion(time_ns: u64, task: TaskState) -> Self {
        Self { kind: SetpointKind::Motion, time_ns, task }
    }
}

/// Lengths \[m\] and rates \[m/s\] of the legs at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Instant of the measurement, on the clock of the releases \[ns\].
    pub time_ns: u64,
    /// Measured leg lengths L, from base joint to platform joint \[m\].
    pub length: [f64; LEGS],
    /// Measured leg rates L' \[m/s\].
    pub rate: [f64; LEGS],
}

/// Inputs of one cycle: with the controller's own state they determine its output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Input {
    /// The instant of release of this cycle, on the grid.
    pub release_ns: u64,
    /// The newest setpoint; `None` if none ever arrived.
    pub setpoint: Option<Setpoint>,
    /// The newest measurement; `None` if none ever arrived.
    pub measurement: Option<Measurement>,
    /// The newest request; `None` if none ever arrived. Each is carried out once.
    pub request: Option<OperatorRequest>,
    /// Whether cycles were missed since the last one, and the deployment makes that a fault.
    pub deadline_missed: bool,
}

/// Result of one cycle: forces, state, and the numbers that explain them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// State of the controller from this cycle on; it decides whether the forces are valid.
    pub state: State,
    /// Why the state is not active, or soon will not be; code `None` while engaging and active.
    pub diagnostic: Diagnostic,
    /// The message of the last request carried out or refused.
    pub answered: (u64, u64),
    /// Why that request was refused; code `None` if it was not.
    pub request_diagnostic: Diagnostic,
    /// Forces \[N\]; zero unless the state has control.
    pub force: [f64; LEGS],
    /// Wrench of the forces minus that of the commanded ones, about C: not zero where forces are limited.
    pub wrench_error: Wrench,
    /// The limits that this cycle has reached, or nearly.
    pub active_limits: LimitSet,
    /// Cycles under control without a new valid measurement, since start.
    pub missed_measurements: u64,
    /// Cycles under control without a new valid setpoint, since start.
    pub missed_setpoints: u64,
    /// The measured state of the platform; `None` if the pose is unknown.
    pub platform: Option<PlatformState>,
    /// Reference minus measured under control; else setpoint minus measured, if both are known.
    pub error: Option<TrackingError>,
    /// The reference at the end of this cycle's period, under control.
    pub reference: Option<Motion>,
}

/// Context of one cycle, which every stage may depend on.
#[derive(Clone, Copy)]
pub(super) struct Cycle<'a> {
    pub constants: &'a Constants,
    pub release_ns: u64,
    /// At the beginning of the cycle.
    pub state: State,
}

/// Controller of one machine: the constants and the memory of each stage.
#[derive(Clone, Debug)]
pub struct Controller {
    constants: Constants,
    measurements: MeasurementValidator,
    setpoints: SetpointValidator,
    localization: Localization,
    free_motion: FreeMotion,
    errors: ErrorTracker,
    supervisor: Supervisor,
    reference: ReferenceGenerator,
    observer: DisturbanceObserver,
    feedback: FeedbackBound,
    limiter: ForceLimiter,
}

impl Controller {
    /// Waits at the home pose for a first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let constants = Constants::new(machine, parameters);
        Self {
            localization: Localization::new(&constants),
            reference: ReferenceGenerator::new(&constants),
            constants,
            measurements: MeasurementValidator::default(),
            setpoints: SetpointValidator::default(),
            free_motion: FreeMotion::default(),
            errors: ErrorTracker::default(),
            supervisor: Supervisor::default(),
            observer: DisturbanceObserver::default(),
            feedback: FeedbackBound::default(),
            limiter: ForceLimiter::default(),
        }
    }

    /// One cycle. Depends on nothing but the state of the controller and `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        let Self { constants, measurements, setpoints, localization, supervisor, reference, .. } = self;
        let Self { free_motion, errors, observer, feedback, limiter, .. } = self;
        let cycle = Cycle { constants, release_ns: input.release_ns, state: supervisor.mode.state };
        let parameters = &constants.parameters;

        // Validate inputs.
        let measurement = measurements.validate(&cycle, input.measurement.as_ref());
        let setpoint = setpoints.validate(&cycle, input.setpoint.as_ref(), reference);

        // Locate platform.
        let located = measurement.and_then(|measurement| localization.locate(&cycle, measurement));
        let free_motion = free_motion.update(&cycle, located.as_ref().ok());
        let mut sample = errors.update(&cycle, reference, &setpoint, located.as_ref().ok());

        // Decide state.
        let request = supervisor.new_request(input);
        let evidence = Evidence {
            input,
            setpoint: &setpoint,
            located: located.as_ref().map_err(|diagnostic| *diagnostic),
            error: sample.as_ref().map(|sample| &sample.error),
            feedback,
            free_motion: free_motion.as_ref(),
        };
        let (findings, assessed_limits) = assess(&cycle, &evidence, localization, reference);
        let next = supervisor.decide(request, &findings, parameters.after_loss);
        if request.is_some_and(|new| new.request == Request::Clear) {
            localization.clear_assembly_mode_fault(&constants.home);
        }

        // Reference.
        let begins = next.has_control() && !cycle.state.has_control();
        if let Some(motion) = free_motion.as_ref().filter(|_| begins) {
            reference.start(constants, cycle.release_ns, motion);
            sample = Some(errors.restart(cycle.release_ns));
        }
        if next.has_control() {
            let target = target(constants, next, &setpoint);
            reference.set_closing_scale(closing_scale(parameters, next));
            let end_ns = cycle.release_ns.saturating_add(parameters.period_ns);
            reference.advance(constants, end_ns, target.as_ref());
        }

        // Control law, forces, checks.
        let continuity = match begins {
            true => ObserverReset::All,
            false if limiter.is_limited || feedback.is_saturated() => ObserverReset::Prediction,
            false => ObserverReset::Keep,
        };
        let mut actuate = || {
            let ErrorSample { error, deviation, .. } = sample.as_ref().ok_or(DiagnosticCode::SetpointLost)?;
            // The force is held for one period from about the release on.
            let middle_of_hold_ns = cycle.release_ns.saturating_add(parameters.period_ns / 2);
            let desired = reference.motion_of_hold(middle_of_hold_ns);
            let wanted = observer.update(&parameters.law, deviation, parameters.period_s(), continuity);
            let acceleration = feedback.limit(&cycle, &desired.acceleration, &wanted);
            let motion = parameters.law.dynamics_motion(desired, error, &acceleration);
            let force = forces(constants, &motion, &acceleration)?;
            limiter.limit(&cycle, &force, &motion)
        };
        let limited = if next.has_control() { actuate() } else { Ok(LimitedForces::default()) };
        let LimitedForces { force, wrench_error, active_limits } = limited.unwrap_or_else(|diagnostic| {
            supervisor.fail(diagnostic);
            LimitedForces::default()
        });
        let platform = located.ok().map(|located| located.platform);
        let mut output = Output {
            state: supervisor.mode.state,
            diagnostic: supervisor.mode.diagnostic,
            answered: supervisor.answered,
            request_diagnostic: supervisor.request_diagnostic,
            force,
            wrench_error,
            active_limits: setpoint
                .active_limits
                .union(assessed_limits)
                .union(reference.active_limits())
                .union(active_limits),
            missed_measurements: measurements.missed,
            missed_setpoints: setpoints.missed,
            platform,
            error: sample.map(|sample| sample.error),
            reference: None,
        };
        report_reference(&mut output, reference);
        output
    }
}

/// Adds the reference to an output under control.
// Out of line, as the proof on the machine code does not follow copies through a pointer to memcpy.
#[inline(never)]
fn report_reference(output: &mut Output, reference: &ReferenceGenerator) {
    if output.state.has_control() {
        output.reference = Some(*reference.motion());
    }
}

/// What the reference shall approach in a state; nothing where it follows its stop.
#[inline(never)]
fn target<'a>(
    constants: &'a Constants,
    state: State,
    setpoint: &ValidatedSetpoint<'a>,
) -> Option<Target<'a>> {
    match state {
        State::Engaging | State::Active => setpoint.target.filter(|_| setpoint.status.is_ok()),
        State::Parking => Some(Target::Pose(constants.home.pose())),
        State::Off | State::Standby | State::Stopping | State::Fault => None,
    }
}

/// Share of the limits with which the distance to the target is closed.
fn closing_scale(parameters: &Parameters, state: State) -> f64 {
    if state == State::Engaging { parameters.limits.autonomous_scale } else { 1.0 }
}
