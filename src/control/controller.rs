//! One cycle of control: from the newest setpoint and measurement to six forces, or the diagnostic why there are none.
//!
//! [`Controller::step`] shows the stages in order. Each is a function of its arguments and of the memory of its own
//! struct; none changes the memory of another. A cycle does a bounded amount of work.

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::law::error_tracker::{ErrorTracker, setpoint_error};
use crate::control::law::feedback_bound::FeedbackBound;
use crate::control::law::force_limits::{ForceLimiter, LimitedForces};
use crate::control::law::forces::forces;
use crate::control::parameters::Parameters;
use crate::control::reference::ReferenceGenerator;
use crate::control::sensing::drive_monitor::DriveMonitor;
use crate::control::sensing::external_pose::ExternalPose;
use crate::control::sensing::free_motion::FreeMotion;
use crate::control::sensing::leg_rates::LegRateEstimator;
use crate::control::sensing::localization::{Localization, PlatformState};
use crate::control::sensing::measurement::MeasurementValidator;
use crate::control::sensing::stamp_clock::StampClock;
use crate::control::setpoint::validation::SetpointValidator;
use crate::control::signals::diagnostic::Diagnostic;
use crate::control::signals::errors::TrackingError;
use crate::control::signals::inputs::Input;
use crate::control::signals::limits::LimitSet;
use crate::control::signals::state::{Request, State};
use crate::control::supervision::assessment::{Evidence, assess};
use crate::control::supervision::supervisor::Supervisor;
use crate::model::LEGS;
use crate::model::machine::Machine;
use crate::model::rigid::{Motion, Wrench};

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
    /// The reference at the end of the hold of this cycle's force, under control.
    pub reference: Option<Motion>,
}

/// Controller of one machine: its constants, and the memory of each stage.
#[derive(Clone, Debug)]
pub struct Controller {
    constants: Constants,
    memory: Memory,
}

/// All of a controller that changes from cycle to cycle: with it and the inputs what follows can be repeated.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub struct Memory {
    stamp_clock: StampClock,
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
    feedback: FeedbackBound,
    limiter: ForceLimiter,
}

impl Controller {
    /// Waits at the home pose for a first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let constants = Constants::new(machine, parameters);
        let memory = Memory {
            localization: Localization::new(&constants),
            reference: ReferenceGenerator::new(&constants),
            stamp_clock: StampClock::default(),
            drives: DriveMonitor::default(),
            external_pose: ExternalPose::default(),
            measurements: MeasurementValidator::default(),
            setpoints: SetpointValidator::default(),
            free_motion: FreeMotion::default(),
            errors: ErrorTracker::default(),
            supervisor: Supervisor::default(),
            leg_rates: LegRateEstimator::default(),
            feedback: FeedbackBound::default(),
            limiter: ForceLimiter::default(),
        };
        Self { constants, memory }
    }

    /// What it remembers after the last cycle.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Goes on from a memory, which a controller of the same machine and parameters had.
    pub fn set_memory(&mut self, memory: Memory) {
        self.memory = memory;
    }

    /// State since the last cycle.
    pub fn state(&self) -> State {
        self.memory.supervisor.mode.state
    }

    /// Exchanges the constants for those of a controller of the same machine before its first cycle. Not under control.
    ///
    /// What was proved or accepted by the old constants is forgotten; pose, state and statistics remain.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn exchange_constants(&mut self, new: &mut Self) {
        core::mem::swap(&mut self.constants, &mut new.constants);
        core::mem::swap(&mut self.memory.reference, &mut new.memory.reference);
        self.memory.setpoints.forget();
    }

    /// One cycle. Depends on nothing but the state of the controller and `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        let Self { constants, memory } = self;
        let Memory { measurements, setpoints, localization, supervisor, reference, .. } = memory;
        let Memory { stamp_clock, drives, external_pose, free_motion, errors, leg_rates, .. } = memory;
        let Memory { feedback, limiter, .. } = memory;
        let cycle = Cycle { constants, release_ns: input.release_ns, state: supervisor.mode.state };
        let parameters = &constants.parameters;

        // Validate inputs.
        let clock = stamp_clock.check(&cycle, input.clock_offset_ns);
        let measurement = clock.and(measurements.validate(&cycle, input.measurement.as_ref()));
        let setpoint = setpoints.validate(&cycle, input.setpoint.as_ref(), reference);
        let reported = measurement.as_ref().ok().copied();
        let reports = [drives.check(&cycle, reported), external_pose.check(&cycle, reported)];

        // Locate platform.
        let mut located = measurement.and_then(|measurement| {
            let rate = leg_rates.rates(&constants.leg_rates, measurement);
            localization.locate(&cycle, measurement, rate)
        });
        let free_motion = free_motion.update(&cycle, localization, located.as_ref().ok());
        let mut error = match &mut located {
            Ok(located) if cycle.state.has_control() => {
                Some(errors.update(&cycle, reference, localization, located))
            }
            Ok(located) => setpoint_error(&cycle, &setpoint, located),
            Err(_) => None,
        };

        // Decide state.
        let request = supervisor.new_request(input);
        let evidence = Evidence {
            input,
            setpoint: &setpoint,
            located: located.as_ref().map_err(|diagnostic| *diagnostic),
            error: error.as_ref(),
            feedback,
            distrust: errors.distrust(),
            change: errors.change(),
            reports: &reports,
            is_ready: drives.is_ready,
            free_motion: free_motion.as_ref().map_err(|diagnostic| *diagnostic),
            is_doubtful: errors.is_doubtful(),
        };
        let mut assessed_limits = LimitSet::default();
        let findings = assess(&cycle, &evidence, localization, reference, &mut assessed_limits);
        let next = supervisor.decide(request, &findings, parameters.after_loss);
        if request.is_some_and(|new| new.request == Request::Clear) {
            localization.clear_assembly_mode_fault(&constants.home);
        }

        // Reference.
        let begin_ns = cycle.release_ns.saturating_add(parameters.force_delay_ns);
        let begins = next.has_control() && !cycle.state.has_control();
        if begins {
            reference.begin(begin_ns);
            let measured_ns = located.as_ref().map_or(begin_ns, |located| located.measurement.time_ns);
            error = Some(errors.start(constants, measured_ns, begin_ns));
        }
        if next.has_control() {
            // Until the drives are ready it stays where it is, or comes to rest. So it does in the first cycle, in which its stop
            // was verified: there is one examination in a cycle.
            let is_waiting = begins || next == State::Engaging && !drives.is_ready;
            let target = setpoint.target_in(constants, next).filter(|_| !is_waiting);
            reference.set_closing_scale(closing_scale(parameters, next));
            reference.advance(constants, begin_ns.saturating_add(parameters.period_ns), target.as_ref());
        }

        // Control law, forces, checks.
        let mut limited = LimitedForces::default();
        let mut actuate = || {
            let desired = reference.motion_of_hold(begin_ns.saturating_add(parameters.period_ns / 2));
            let estimator = errors.estimator();
            let mut at_begin = *estimator.state();
            estimator.predict(&mut at_begin, begin_ns);
            let wanted = parameters.law.acceleration(&at_begin, &constants.input_matrix);
            let acceleration = feedback.limit(&cycle, &desired.acceleration, &wanted);
            let mut sent = constants.input_matrix.acceleration(&acceleration);
            let in_middle = at_begin.after(0.5 * parameters.period_s(), &sent);
            let motion =
                parameters.law.dynamics_motion(desired, &errors.without_lag(&in_middle), &acceleration);
            let force = forces(constants, &motion, &acceleration)?;
            limiter.limit(&cycle, &force, &motion, &mut limited)?;
            if limited.force != force {
                let (machine, missing) = (constants.machine(), &limited.wrench_error);
                let acceleration = constants.input_matrix.acceleration_of(machine, &motion.pose, missing);
                sent += acceleration;
                errors.record_limited(constants, &acceleration);
            }
            errors.record_sent(begin_ns, &sent, &limited.force);
            Ok(())
        };
        let actuated = if next.has_control() { actuate() } else { Ok(()) };
        if let Err(diagnostic) = actuated {
            supervisor.fail(diagnostic);
        }
        let LimitedForces { force, wrench_error, active_limits } = limited;
        drives.record_sent(&force);
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
            missed_measurements: 0,
            missed_setpoints: setpoints.missed,
            platform: None,
            error,
            reference: None,
        };
        // Written where they stay: the largest fields, and the count, which `located` holds
        // borrowed until here.
        if let Ok(located) = &located {
            output.platform = Some(located.platform);
        }
        output.missed_measurements = measurements.missed;
        if output.state.has_control() {
            output.reference = Some(*reference.motion());
        }
        output
    }
}

/// Share of the limits with which the distance to the target is closed.
fn closing_scale(parameters: &Parameters, state: State) -> f64 {
    if state == State::Engaging { parameters.limits.autonomous_scale } else { 1.0 }
}
