//! The reference: the motion that the platform follows in each state, and the way from one to the next.

use nalgebra::Vector3;

use super::controller::Cycle;
use super::diagnostic::{Diagnostic, DiagnosticCode};
use super::input_validation::{SetpointMotion, ValidatedSetpoint, check_stroke_with_tolerance};
use super::limits::Limits;
use super::localization::Located;
use super::parameters::{Constants, Parameters};
use super::quintic_offset::QuinticOffset;
use super::state::State;
use super::tracking_error::{FeedbackError, TrackingError};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Smallest jump after a gap in the setpoints, relative to the engage tolerance, that is blended; smaller ones come from
/// time stamps and rounding.
const MIN_BLEND_RATIO: f64 = 0.05;

/// Reference of a state.
#[derive(Clone, Copy, Debug, Default)]
enum Reference {
    /// The setpoint; also the value while there is no control.
    #[default]
    Setpoint,
    /// The setpoint, with a displacement that decays.
    OntoSetpoint(QuinticOffset),
    /// A fixed pose (where the stop began, or home) plus an offset that varies in time.
    FromPose(Pose, QuinticOffset),
}

/// Fourth stage of the cycle: the reference of the present state at any instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReferenceGenerator {
    reference: Reference,
}

impl ReferenceGenerator {
    /// The reference at an instant; `None` if it depends on a setpoint and there is none.
    pub fn motion_at(
        &self,
        parameters: &Parameters,
        setpoint: Option<&SetpointMotion>,
        instant_ns: u64,
    ) -> Option<Motion> {
        let setpoint = || Some(setpoint?.motion_at(parameters, instant_ns));
        match &self.reference {
            Reference::Setpoint => setpoint(),
            Reference::OntoSetpoint(segment) => Some(segment.displace(&setpoint()?, instant_ns)),
            Reference::FromPose(pose, segment) => Some(segment.displace(&at_rest(pose), instant_ns)),
        }
    }

    /// Whether the autonomous motion of the state has come to its end.
    pub fn has_ended(&self, instant_ns: u64) -> bool {
        match &self.reference {
            Reference::Setpoint => true,
            Reference::OntoSetpoint(segment) | Reference::FromPose(_, segment) => {
                segment.has_ended(instant_ns)
            }
        }
    }

    /// Whether an autonomous motion stays within the stroke.
    pub fn check_stroke(
        &self,
        constants: &Constants,
        setpoint: Option<&SetpointMotion>,
        instant_ns: u64,
    ) -> Result<(), Diagnostic> {
        let Some(motion) = self.motion_at(&constants.parameters, setpoint, instant_ns) else { return Ok(()) };
        let machine = constants.machine();
        check_stroke_with_tolerance(
            &machine.actuator,
            DiagnosticCode::SetpointOutOfReach,
            &leg_lengths(machine, &motion.pose),
        )
    }

    /// After a gap a setpoint may differ, within its tolerance, from the continuation of the one before. If the step
    /// would exceed the limit of jerk, a segment leads onto the setpoint. True if the reference has changed.
    pub fn blend_after_gap(&mut self, cycle: &Cycle<'_>, setpoint: &ValidatedSetpoint<'_>) -> bool {
        setpoint.before_gap.as_ref().is_some_and(|before| self.bridge(cycle, setpoint.valid, before))
    }

    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn bridge(
        &mut self,
        cycle: &Cycle<'_>,
        setpoint: Option<&SetpointMotion>,
        before: &SetpointMotion,
    ) -> bool {
        let (parameters, now_ns) = (&cycle.constants.parameters, cycle.release_ns);
        let present = self.motion_at(parameters, Some(before), now_ns);
        let next = self.motion_at(parameters, setpoint, now_ns);
        let (Some(present), Some(next)) = (present, next) else { return false };
        let Parameters { law, limits, .. } = parameters;
        let error = TrackingError::new(&present, &next.pose, &next.twist);
        if error.tolerance_ratio(parameters) < MIN_BLEND_RATIO {
            return false;
        }
        let feedback = law.feedback(&FeedbackError::from(&error));
        let command = law.command(&present, &error, &feedback).acceleration;
        let step = |command: Vector3<f64>, next: Vector3<f64>| (command - next).norm();
        let period_s = parameters.period_s();
        let has_jerk = step(command.linear, next.acceleration.linear) > limits.position.jerk * period_s
            || step(command.angular, next.acceleration.angular) > limits.orientation.jerk * period_s;
        if has_jerk {
            // With the full limits, as for a stop: a slower blend would stay off the planned path for longer.
            self.reference = onto_setpoint(parameters, setpoint, &present, now_ns, 1.0);
        }
        has_jerk
    }

    /// Begins the reference of the state just entered.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    pub fn enter(
        &mut self,
        cycle: &Cycle<'_>,
        next: State,
        setpoint: Option<&SetpointMotion>,
        Located { measurement, platform }: &Located<'_>,
    ) {
        let Cycle { constants, release_ns, state } = *cycle;
        let (parameters, limits) = (&constants.parameters, &constants.parameters.limits);
        let measured = Motion { twist: platform.twist, ..at_rest(&platform.pose) };
        // Without control the platform stands or coasts; its acceleration is not measured.
        let present = self.motion_at(parameters, setpoint, release_ns).filter(|_| state.has_control());
        let present = present.unwrap_or(measured);
        self.reference = match next {
            State::Engaging => {
                let scale = limits.autonomous_scale;
                onto_setpoint(parameters, setpoint, &measured, measurement.time_ns, scale)
            }
            State::Stopping => {
                let segment =
                    QuinticOffset::to_rest(release_ns, &present.twist, &present.acceleration, limits);
                Reference::FromPose(present.pose, segment)
            }
            State::Parking => {
                let home = *constants.home.pose();
                let displacement = home.displacement_to(&present.pose);
                let Motion { twist: rate, acceleration, .. } = present;
                let segment = QuinticOffset::to_zero(release_ns, &displacement, &rate, &acceleration, limits);
                Reference::FromPose(home, segment)
            }
            State::Off | State::Standby | State::Active | State::Fault => Reference::Setpoint,
        };
    }
}

/// From a motion onto the setpoint, with the limits times a factor.
fn onto_setpoint(
    parameters: &Parameters,
    setpoint: Option<&SetpointMotion>,
    from: &Motion,
    instant_ns: u64,
    scale: f64,
) -> Reference {
    let Some(setpoint) = setpoint else { return Reference::Setpoint };
    let base = setpoint.motion_at(parameters, instant_ns);
    let displacement = base.pose.displacement_to(&from.pose);
    let rate = Twist::from_vector(&(from.twist.vector() - base.twist.vector()));
    let acceleration = Acceleration::from_vector(&(from.acceleration.vector() - base.acceleration.vector()));
    let limits = Limits { autonomous_scale: scale, ..parameters.limits };
    Reference::OntoSetpoint(QuinticOffset::to_zero(instant_ns, &displacement, &rate, &acceleration, &limits))
}

fn at_rest(pose: &Pose) -> Motion {
    Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() }
}
