//! One cycle of control: from the newest setpoint and measurement to six forces, or to the reason why there
//! are none.
//!
//! [`Controller::step`] shows the stages in order. Each stage is a function of its arguments and of the
//! memory of its own struct, and changes no other memory. The effort of a cycle is bounded.

use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::law::actuation::actuate;
use crate::control::law::error_tracker::{ErrorTracker, setpoint_error};
use crate::control::law::feedback_limiter::FeedbackLimiter;
use crate::control::law::force_limits::{ForceLimiter, LimitedForces};
use crate::control::parameters::Parameters;
use crate::control::reference::{ReferenceGenerator, Refusal};
use crate::control::sensing::drive_monitor::DriveMonitor;
use crate::control::sensing::external_pose::ExternalPose;
use crate::control::sensing::free_motion::FreeMotion;
use crate::control::sensing::leg_rates::LegRateEstimator;
use crate::control::sensing::localization::{Localization, Located, PlatformState};
use crate::control::sensing::measurement::MeasurementValidator;
use crate::control::sensing::stamp_clock::StampClockOffset;
use crate::control::setpoint::validated::ValidatedSetpoint;
use crate::control::setpoint::validation::SetpointValidator;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::PoseError;
use crate::control::signals::inputs::Input;
use crate::control::signals::limits::{Limit, LimitSet};
use crate::control::signals::state::{MessageId, Request, State};
use crate::control::supervision::assessment::{Evidence, assess};
use crate::control::supervision::supervisor::Supervisor;
use crate::model::LEGS;
use crate::model::machine::Machine;
use crate::model::rigid::{Motion, Wrench};

/// Result of one cycle: forces, state, and the values that explain them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// State of the controller from this cycle on; it decides whether the forces are valid.
    pub state: State,
    /// Why the state is not active, or soon will not be; code `None` while engaging and active.
    pub diagnostic: Diagnostic,
    /// Message of the last request that was carried out or refused.
    pub answered_message: MessageId,
    /// Why that request was refused; code `None` if it was not.
    pub request_diagnostic: Diagnostic,
    /// Commands to the drives \[N\]; zero unless the state has control. With load friction and force scales a leg gets another
    /// force, see [`Transmission`](crate::model::transmission::Transmission).
    pub command_n: [f64; LEGS],
    /// Wrench of the forces minus the wrench of the commanded forces, about C; zero unless forces are
    /// limited.
    pub wrench_error: Wrench,
    /// Limits that this cycle has reached, or nearly.
    pub active_limits: LimitSet,
    /// Cycles under control without a new valid measurement, since start.
    pub missed_measurements: u64,
    /// Cycles under control without a new valid setpoint, since start.
    pub missed_setpoints: u64,
    /// Measured state of the platform, without measured rates with the estimated twist; `None` if the pose is unknown.
    pub platform: Option<PlatformState>,
    /// Reference minus measured under control; else setpoint minus measured, if the setpoint may be followed.
    pub error: Option<PoseError>,
    /// Reference at the end of this cycle's hold of the force, under control.
    pub reference: Option<Motion>,
}

/// Controller of one machine: its constants, and the memory of each stage.
#[derive(Clone, Debug)]
pub struct Controller {
    constants: Constants,
    memory: Memory,
}

/// State of a controller that changes from cycle to cycle. With it and the inputs all later cycles can be
/// repeated.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Memory {
    stamp_clock: StampClockOffset,
    drives: DriveMonitor,
    external_pose: ExternalPose,
    measurements: MeasurementValidator,
    setpoints: SetpointValidator,
    localization: Localization,
    free_motion: FreeMotion,
    errors: ErrorTracker,
    supervisor: Supervisor,
    reference: ReferenceGenerator,
    leg_rates: LegRateEstimator,
    feedback: FeedbackLimiter,
    limiter: ForceLimiter,
}

impl Controller {
    /// Creates a controller that waits at the home pose for its first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let constants = Constants::new(machine, parameters);
        let memory = Memory {
            localization: Localization::new(&constants),
            reference: ReferenceGenerator::new(&constants),
            stamp_clock: StampClockOffset::default(),
            drives: DriveMonitor::default(),
            external_pose: ExternalPose::default(),
            measurements: MeasurementValidator::default(),
            setpoints: SetpointValidator::default(),
            free_motion: FreeMotion::default(),
            errors: ErrorTracker::default(),
            supervisor: Supervisor::default(),
            leg_rates: LegRateEstimator::default(),
            feedback: FeedbackLimiter::default(),
            limiter: ForceLimiter::default(),
        };
        Self { constants, memory }
    }

    /// Memory after the last cycle.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Continues from a memory of a controller with the same machine and parameters.
    pub fn set_memory(&mut self, memory: Memory) {
        self.memory = memory;
    }

    /// State since the last cycle.
    pub fn state(&self) -> State {
        self.memory.supervisor.current.state
    }

    /// Exchanges the constants with a new controller of the same machine, before its first cycle. Not allowed
    /// under control.
    ///
    /// Results that were proved or accepted with the old constants are forgotten. Pose, state and statistics
    /// remain.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    pub fn exchange_configuration(&mut self, new: &mut Self) {
        core::mem::swap(&mut self.constants, &mut new.constants);
        core::mem::swap(&mut self.memory.reference, &mut new.memory.reference);
        self.memory.setpoints.forget();
    }

    /// Runs one cycle. The output depends only on the state of the controller and on `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        let Self { constants, memory } = self;
        let Memory { measurements, setpoints, localization, supervisor, reference, .. } = memory;
        let Memory { stamp_clock, drives, external_pose, free_motion, errors, leg_rates, .. } = memory;
        let cycle = Cycle { constants, release_ns: input.release_ns, state: supervisor.current.state };

        // Validate inputs.
        let clock = stamp_clock.check(&cycle, input.clock_offset_ns);
        let measurement = clock.and(measurements.validate(&cycle, input.measurement.as_ref()));
        let setpoint = setpoints.validate(&cycle, input, supervisor.holds_after_setpoint_loss(), reference);
        let reported = measurement.as_ref().ok().copied();
        let reports = [drives.check(&cycle, reported), external_pose.check(&cycle, reported)];

        // Locate the platform.
        let mut located = measurement.and_then(|measurement| {
            let rate = leg_rates.rates(&constants.leg_rate_estimator, measurement);
            localization.locate(&cycle, measurement, rate)
        });
        let free_motion = free_motion.update(&cycle, localization, located.as_ref().ok());
        let mut error =
            update_error_and_twist(&cycle, &setpoint, errors, reference, localization, &mut located);

        // Decide the state.
        let mut active_limits = setpoint.active_limits;
        let start = verify_start(&cycle, localization, reference, &located, free_motion);
        let evidence = Evidence {
            input,
            setpoint: &setpoint,
            localization: located.as_ref().map(drop).map_err(|cause| *cause),
            error: error.as_ref(),
            start,
            drive_and_pose_checks: &reports,
            is_ready: drives.is_ready,
            feedback: &memory.feedback,
            sensor_or_drive_fault: errors.sensor_or_drive_fault(),
            disturbance_diagnostic: errors.disturbance_diagnostic(),
            may_be_frozen: errors.may_be_frozen(),
        };
        let request = supervisor.new_request(input);
        let near_since_ns = &mut supervisor.near_since_ns;
        let findings = assess(&cycle, &evidence, localization, reference, &mut active_limits, near_since_ns);
        let next = supervisor.decide(request, &findings, constants.parameters.after_loss);
        if request.is_some_and(|new| new.request == Request::Clear) {
            localization.clear_assembly_mode_fault(&constants.home);
        }

        // Move the reference, and compute the forces that move the platform with it.
        let mut limited = LimitedForces::default();
        if next.has_control() {
            let begin_ns = cycle.release_ns.saturating_add(constants.parameters.force_delay_ns);
            if !cycle.state.has_control() {
                reference.begin_placed_motion(begin_ns);
                let measured_ns = located.as_ref().map_or(begin_ns, |located| located.measurement.time_ns);
                error = Some(errors.start(constants, measured_ns, begin_ns));
            }
            let desired = advance(&cycle, reference, next, begin_ns, &setpoint, drives.is_ready);
            let stages = (&mut memory.feedback, &mut memory.limiter);
            if let Err(diagnostic) = actuate(&cycle, begin_ns, desired, errors, stages, &mut limited) {
                supervisor.enter_fault(diagnostic);
            }
        }
        drives.record_sent(&limited.command_n);

        let mut output = Output::new(supervisor, &limited, error);
        output.active_limits = active_limits.union(reference.active_limits()).union(limited.active_limits);
        // Written in place: the largest fields, and the count, whose struct `located` borrows until here.
        output.platform = located.as_ref().ok().map(|located| located.platform);
        (output.missed_measurements, output.missed_setpoints) =
            (measurements.cycles_without_valid, setpoints.cycles_without_valid);
        output.reference = output.state.has_control().then(|| *reference.motion());
        output
    }
}

impl Output {
    /// Output of a state, without the motions of platform and reference, and without counts.
    #[inline(always)]
    fn new(supervisor: &Supervisor, limited: &LimitedForces, error: Option<PoseError>) -> Self {
        let LimitedForces { command_n, wrench_error, active_limits } = *limited;
        Self {
            state: supervisor.current.state,
            diagnostic: supervisor.current.diagnostic,
            answered_message: supervisor.answered_message,
            request_diagnostic: supervisor.request_diagnostic,
            command_n,
            wrench_error,
            active_limits,
            missed_measurements: 0,
            missed_setpoints: 0,
            platform: None,
            error,
            reference: None,
        }
    }
}

/// Error of the platform: from the reference under control, else from the setpoint. Under control it also
/// sets the platform's twist to the estimate if the driver sends no rates.
#[inline(always)]
fn update_error_and_twist(
    cycle: &Cycle<'_>,
    setpoint: &ValidatedSetpoint<'_>,
    errors: &mut ErrorTracker,
    reference: &ReferenceGenerator,
    localization: &Localization,
    located: &mut Result<Located<'_>, Diagnostic>,
) -> Option<PoseError> {
    let located = located.as_mut().ok()?;
    if !cycle.state.has_control() {
        return setpoint_error(cycle, setpoint, located);
    }
    let (error, twist) = errors.update(cycle, reference, localization, located);
    located.platform.twist = twist;
    Some(error)
}

/// Without control, places the reference where control would begin, and verifies a stop from there. If no
/// stop keeps every limit, returns the reason why control does not begin.
#[inline(always)]
pub(in crate::control) fn verify_start(
    cycle: &Cycle<'_>,
    localization: &Localization,
    reference: &mut ReferenceGenerator,
    located: &Result<Located<'_>, Diagnostic>,
    free_motion: Result<Motion, Diagnostic>,
) -> Result<(), Diagnostic> {
    if cycle.state.has_control() || located.is_err() {
        return Ok(());
    }
    reference.verify_start(cycle.constants, &free_motion?).map_err(|refusal| match refusal {
        Refusal::Limit(Limit::Condition) => {
            localization.near_singular(cycle.constants.max_reference_condition)
        }
        Refusal::Limit(Limit::Force) => DiagnosticCode::DrivesTooWeak.into(),
        Refusal::Limit(_) | Refusal::Effort => DiagnosticCode::PlatformMoving.into(),
    })
}

/// Moves the reference to the end of this cycle's hold of the force. Returns the motion that the force must
/// produce.
#[inline(always)]
fn advance(
    cycle: &Cycle<'_>,
    reference: &mut ReferenceGenerator,
    next: State,
    begin_ns: u64,
    setpoint: &ValidatedSetpoint<'_>,
    are_drives_ready: bool,
) -> Motion {
    let Parameters { period_ns, limits, .. } = &cycle.constants.parameters;
    // Until the drives are ready the reference stays at its pose or comes to rest. The first cycle does the
    // same, because its stop was verified in this cycle and a cycle has one examination.
    let is_waiting = !cycle.state.has_control() || next == State::Engaging && !are_drives_ready;
    let target = setpoint.target_in(cycle.constants, next).filter(|_| !is_waiting);
    reference.set_closing_scale(if next == State::Engaging { limits.autonomous_scale } else { 1.0 });
    reference.set_keeps_limits(setpoint.keeps_limits || next == State::Parking);
    reference.advance(cycle.constants, begin_ns.saturating_add(*period_ns), target.as_ref());
    reference.motion_for_held_force(begin_ns.saturating_add(period_ns / 2))
}
