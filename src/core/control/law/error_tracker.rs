//! Tracking error of the platform: measured for the checks, estimated for feedback.
//!
//! The error is taken at the instant of the measurement, where reference and platform are known. The
//! [`estimator`](super::estimator) predicts it to the instant at which the force acts. Without a new
//! measurement the checks use the prediction, in modes on legs the last measured error.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::cycle::Cycle;
use crate::control::law::estimator::{Estimator, EstimatorConstants};
use crate::control::law::feedback_law::LegAccelerations;
use crate::control::monitoring::disturbance_monitor::DisturbanceMonitor;
use crate::control::monitoring::drive_response::DriveResponse;
use crate::control::monitoring::frozen_sensors::FrozenSensors;
use crate::control::monitoring::unstated_friction::UnstatedFriction;
use crate::control::reference::ReferenceGenerator;
use crate::control::sensing::localization::{Localization, Located};
use crate::control::setpoint::validated::ValidatedSetpoint;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::{ErrorCoordinates, ErrorEstimate, FeedbackAcceleration, PoseError};
use crate::model::LEGS;
use crate::model::inverse_geometry::{leg_lengths, leg_lengths_and_rates};
use crate::model::inverse_jacobian::leg_wrenches;
use crate::model::rigid::{Motion, Pose, Twist};

/// Error of the platform against the setpoint, while not under control; `None` unless the setpoint is valid
/// and recent.
pub(in crate::control) fn setpoint_error(
    cycle: &Cycle<'_>,
    setpoint: &ValidatedSetpoint<'_>,
    Located { measurement, platform, .. }: &Located<'_>,
) -> Option<PoseError> {
    let target = setpoint.target.as_ref().filter(|_| setpoint.follow_check.is_ok())?;
    let desired = target.motion_at(&cycle.constants.parameters, measurement.time_ns)?;
    Some(PoseError::new(&desired, &platform.pose, &platform.twist))
}

/// Error of the platform against the reference, under control.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct ErrorTracker {
    estimator: Estimator,
    sensors: FrozenSensors,
    drives: DriveResponse,
    disturbance: DisturbanceMonitor,
    friction: UnstatedFriction,
    /// Forces that the legs get by what was sent last \[N\], and its feedback acceleration.
    sent: [f64; LEGS],
    sent_acceleration: FeedbackAcceleration,
    /// Measured error; without a new measurement, the predicted error, in modes on legs the last measured one.
    error: PoseError,
    /// Measured minus estimated error, after the last measurement has corrected the estimate.
    post_fit_residual: Vector6<f64>,
    /// Fault of a sensor or drive at the last measurement, or an implausible innovation.
    sensor_or_drive_fault: Option<Diagnostic>,
    /// Change of payload, impact or oscillation at the last measurement.
    disturbance_diagnostic: Option<Diagnostic>,
}

impl ErrorTracker {
    /// Starts without an error at an instant after a measurement: the reference starts there with the
    /// platform's motion. Returns the error.
    pub fn start(&mut self, constants: &Constants, measured_ns: u64, begin_ns: u64) -> PoseError {
        self.estimator.start(&constants.estimator, measured_ns, begin_ns, &ErrorCoordinates::default());
        (self.sensors, self.drives, self.sensor_or_drive_fault) =
            (FrozenSensors::default(), DriveResponse::default(), None);
        (self.disturbance, self.disturbance_diagnostic) = (DisturbanceMonitor::default(), None);
        self.friction = UnstatedFriction::default();
        (self.error, self.post_fit_residual) = (PoseError::default(), Vector6::zeros());
        self.error
    }

    /// Corrects the estimate by a measurement, if it is new. Returns the error and the twist of the platform.
    /// The twist is the estimated one if the driver sends no rates.
    pub fn update(
        &mut self,
        cycle: &Cycle<'_>,
        reference: &ReferenceGenerator,
        localization: &Localization,
        located: &Located<'_>,
    ) -> (PoseError, Twist) {
        let Self { estimator, sensors, drives, disturbance, friction, sent, sent_acceleration, .. } = self;
        let constants = cycle.constants;
        let time_ns = located.measurement.time_ns;
        let desired = reference.motion_at(time_ns);
        let (mut error, deviation) = measured(cycle, &desired, located);
        let acts_on_legs = constants.parameters.law.mode.acts_on_legs();
        let interval_s = estimator.interval_s(time_ns);
        let innovation = estimator.correct(&constants.estimator, time_ns, &deviation);
        let is_new = innovation.is_some();
        if let Some(innovation) = innovation {
            self.post_fit_residual = deviation.value - estimator.estimate_at_last_measurement().value;
            let legs = || {
                let feedback = feedback_forces(constants, sent_acceleration, &desired.pose);
                [leg_lengths(constants.machine(), &desired.pose), feedback]
            };
            let EstimatorConstants { reading_errors, .. } = &constants.estimator;
            let disturbance_now = &estimator.estimate_at_last_measurement().disturbance_acceleration;
            let mut check = || {
                sensors.check(&located.measurement.length_m, reading_errors, &constants.frozen_leg, legs)?;
                check_innovation(constants, &innovation, interval_s, located)?;
                drives.check(constants, disturbance_now, sent, &located.platform.pose, interval_s)
            };
            self.sensor_or_drive_fault = check().err();
            if constants.machine().actuator.friction_uncertainty_n > 0.0 {
                let (_, rates) = leg_lengths_and_rates(constants.machine(), &desired.pose, &desired.twist);
                friction.update(&rates, interval_s);
            }
            self.disturbance_diagnostic = disturbance
                .check(
                    &constants.disturbance_bounds,
                    estimator.estimate_at_last_measurement(),
                    &desired,
                    (&drives.sudden_acceleration, friction),
                    interval_s,
                )
                .err();
        }
        let mut twist = located.platform.twist;
        // A measurement from before the start of control shows another motion.
        if located.measurement.rate_m_s.is_none() && interval_s >= 0.0 {
            let rate = &estimator.estimate_at_last_measurement().rate;
            error.twist = if acts_on_legs {
                localization.twist_of(constants, rate).unwrap_or(error.twist)
            } else {
                Twist::from_vector(rate)
            };
            twist.angular = desired.twist.angular - error.twist.angular;
            twist.linear = desired.twist.linear - error.twist.linear;
        }
        if is_new {
            self.error = error;
        } else if !acts_on_legs {
            let mut predicted = *estimator.estimate_at_last_measurement();
            estimator.predict(&mut predicted, cycle.release_ns);
            self.error = PoseError::from(&predicted.error());
        }
        (self.error, twist)
    }

    /// Frozen sensor, implausible innovation or missing drive force at the last measurement.
    pub fn sensor_or_drive_fault(&self) -> Option<&Diagnostic> {
        self.sensor_or_drive_fault.as_ref()
    }

    /// Whether a measured length repeats, so that its sensor may be frozen.
    pub fn may_be_frozen(&self) -> bool {
        self.sensors.may_be_frozen()
    }

    /// Change of payload, impact or oscillation at the last measurement.
    pub fn disturbance_diagnostic(&self) -> Option<&Diagnostic> {
        self.disturbance_diagnostic.as_ref()
    }

    /// Estimator, as of the last measurement.
    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    /// Predicted error, corrected by the last residual, because forces act along the true legs. The estimate
    /// lags behind the legs, and forces for a lagging pose act as a negative stiffness, which grows with the
    /// condition.
    pub fn corrected_to_last_measurement(&self, predicted: &ErrorEstimate) -> ErrorCoordinates {
        ErrorCoordinates { value: predicted.value + self.post_fit_residual, rate: predicted.rate }
    }

    /// Records the acceleration that force limits removed.
    pub fn record_removed_acceleration(
        &mut self,
        constants: &Constants,
        acceleration: &FeedbackAcceleration,
    ) {
        self.disturbance.record_removed_acceleration(&constants.disturbance_bounds, acceleration);
    }

    /// Records the forces at the legs and the feedback acceleration that are sent, after all limits, and the instant
    /// from which they act.
    pub fn record_sent(&mut self, begin_ns: u64, acceleration: &FeedbackAcceleration, force_n: &[f64; LEGS]) {
        (self.sent, self.sent_acceleration) = (*force_n, *acceleration);
        self.estimator.record_sent(begin_ns, acceleration);
    }
}

/// Leg forces of a feedback acceleration, each as if the other forces were constant.
fn feedback_forces(
    constants: &Constants,
    FeedbackAcceleration(acceleration): &FeedbackAcceleration,
    pose: &Pose,
) -> [f64; LEGS] {
    let law = &constants.parameters.law;
    let of_legs = match law.mode.acts_on_legs() {
        true => *acceleration,
        false => leg_wrenches(constants.machine(), pose).tr_mul(acceleration),
    };
    law.uncoupled_leg_forces(&LegAccelerations(of_legs))
}

/// Checks each leg's innovation against its bound. The innovation of a leg is `N^T nu`, at most
/// `|nu_p| + r |nu_R|`.
fn check_innovation(
    constants: &Constants,
    innovation: &Vector6<f64>,
    interval_s: f64,
    located: &Located<'_>,
) -> Result<(), Diagnostic> {
    let bound = constants.estimator.innovation_bound_m(interval_s);
    let acts_on_legs = constants.parameters.law.mode.acts_on_legs();
    let Twist { angular, linear } = Twist::from_vector(innovation);
    let largest =
        if acts_on_legs { innovation.amax() } else { linear.norm() + constants.arm_m * angular.norm() };
    if largest <= bound {
        return Ok(());
    }
    let of_legs = if acts_on_legs {
        *innovation
    } else {
        leg_wrenches(constants.machine(), &located.platform.pose).tr_mul(innovation)
    };
    let (leg, largest) = of_legs
        .iter()
        .map(|value| value.abs())
        .enumerate()
        .fold((0, 0.0), |most, next| if next.1 > most.1 { next } else { most });
    if largest <= bound {
        return Ok(());
    }
    Err(Diagnostic::new(DiagnosticCode::MeasurementImplausible, largest, bound).at(leg))
}

/// Measured error against a desired motion: pose error, and the errors that feedback acts on.
fn measured(
    cycle: &Cycle<'_>,
    desired: &Motion,
    Located { measurement, rate_m_s, platform }: &Located<'_>,
) -> (PoseError, ErrorCoordinates) {
    let constants = cycle.constants;
    let error = PoseError::new(desired, &platform.pose, &platform.twist);
    let deviation = match constants.parameters.law.mode.acts_on_legs() {
        true => ErrorCoordinates::of_legs(constants.machine(), desired, &measurement.length_m, rate_m_s),
        false => ErrorCoordinates::from(&error),
    };
    (error, deviation)
}
