//! One cycle of control: from the newest setpoint and measurement to six forces, or the reason why not.
//!
//! Order of a cycle: judge the inputs, find the pose (forward kinematics), take the error, apply the law,
//! evaluate the inverse dynamics, check what comes out. Every cycle does a bounded amount of work.

use super::law::{Law, TrackingError};
use super::state::{Cause, State};
use crate::model::active_forces::InverseDynamics;
use crate::model::forward_kinematics::{Tracked, Tracker};
use crate::model::inverse_jacobian::twist_from_rates;
use crate::model::ladder::Rung;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist};
use crate::model::task::TaskState;

/// What a deployment chooses. Times in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub period_ns: u64,
    pub law: Law,
    /// Which terms of the dynamics are evaluated. It must have inertia: what the law commands is an
    /// acceleration, and without inertia there would be no feedback.
    pub rung: Rung,
    /// Largest position error at which control may begin \[m\].
    pub engage_position: f64,
    /// Largest orientation error at which control may begin \[rad\].
    pub engage_orientation: f64,
    /// Largest position error while active \[m\].
    pub following_position: f64,
    /// Largest orientation error while active \[rad\].
    pub following_orientation: f64,
    /// A setpoint older than this is lost.
    pub setpoint_timeout_ns: u64,
    /// A measurement older than this is lost.
    pub measured_timeout_ns: u64,
}

/// A setpoint and the instant it holds at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    pub time_ns: u64,
    pub task: TaskState,
}

/// Lengths \[m\] and rates \[m/s\] of the legs and the instant they hold at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    pub time_ns: u64,
    pub length: [f64; LEGS],
    pub rate: [f64; LEGS],
}

/// Everything a cycle depends on besides the controller's own state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Input {
    /// The instant of release of this cycle, on the grid.
    pub release_ns: u64,
    /// The newest setpoint, if one ever arrived.
    pub setpoint: Option<Setpoint>,
    /// The newest measurement, if one ever arrived.
    pub measurement: Option<Measurement>,
    /// Cycles were missed since the last one, and the deployment calls that a fault.
    pub deadline_missed: bool,
}

/// Result of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    pub state: State,
    /// Why no force is valid; `None` while active.
    pub cause: Cause,
    /// Forces \[N\]; zero unless active.
    pub force: [f64; LEGS],
    /// A force was cut to the actuators' limit.
    pub limited: bool,
    /// The measured pose and twist, when the pose is known.
    pub measured: Option<(Pose, Twist)>,
    /// Desired minus measured, when both are known.
    pub error: Option<TrackingError>,
}

/// The controller of one machine.
#[derive(Clone, Debug)]
pub struct Controller {
    model: InverseDynamics,
    parameters: Parameters,
    tracker: Tracker,
    state: State,
}

impl Controller {
    /// Waits at the home pose for a first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let tracker = home_tracker(machine);
        Self { model: InverseDynamics::new(machine), parameters, tracker, state: State::Waiting }
    }

    /// One cycle. Pure: depends on nothing but the state of the controller and `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        let mut output = Output::default();
        match self.control(input, &mut output) {
            Ok(()) => output.state = State::Active,
            Err(cause) => (output.cause, output.force) = (cause, [0.0; LEGS]),
        }
        self.state = output.state;
        output
    }

    fn control(&mut self, input: &Input, output: &mut Output) -> Result<(), Cause> {
        let measurement = self.fresh_measurement(input)?;
        let (pose, twist) = self.locate(measurement)?;
        output.measured = Some((pose, twist));

        let setpoint = self.fresh_setpoint(input)?;
        let desired_at =
            |time_ns: u64| setpoint.task.after(seconds_between(setpoint.time_ns, time_ns)).motion();
        let error = TrackingError::new(&desired_at(measurement.time_ns), &pose, &twist);
        output.error = Some(error);
        self.may_control(&error)?;
        if input.deadline_missed {
            return Err(Cause::DeadlineMissed);
        }

        // The force is held for one period from about the release on.
        let middle_of_hold_ns = input.release_ns.saturating_add(self.parameters.period_ns / 2);
        let command = self.parameters.law.command(&desired_at(middle_of_hold_ns), &error);
        let force = self.model.forces_of(self.parameters.rung, &command).ok_or(Cause::SingularPose)?;
        if force.iter().any(|value| !value.is_finite()) {
            return Err(Cause::ForceNotFinite);
        }
        let limit = self.model.machine().actuator.max_force;
        output.force = force.map(|value| value.max(-limit).min(limit));
        output.limited = output.force != force;
        Ok(())
    }

    fn fresh_measurement<'a>(&self, input: &'a Input) -> Result<&'a Measurement, Cause> {
        let measurement = input.measurement.as_ref().ok_or(Cause::NoMeasurement)?;
        // Far in the future is as wrong as long ago.
        if input.release_ns.abs_diff(measurement.time_ns) > self.parameters.measured_timeout_ns {
            return Err(Cause::MeasurementLost);
        }
        if measurement.length.iter().chain(&measurement.rate).any(|value| !value.is_finite()) {
            return Err(Cause::MeasurementNotFinite);
        }
        Ok(measurement)
    }

    fn fresh_setpoint<'a>(&self, input: &'a Input) -> Result<&'a Setpoint, Cause> {
        let setpoint = input.setpoint.as_ref().ok_or(Cause::NoSetpoint)?;
        if !setpoint.task.is_finite() {
            return Err(Cause::SetpointNotFinite);
        }
        if input.release_ns.abs_diff(setpoint.time_ns) > self.parameters.setpoint_timeout_ns {
            let at_rest = setpoint.task.xd.amax() == 0.0 && setpoint.task.xdd.amax() == 0.0;
            return Err(if at_rest { Cause::SetpointEnded } else { Cause::SetpointLost });
        }
        Ok(setpoint)
    }

    /// The pose and twist of the platform, by one bounded step of forward kinematics.
    fn locate(&mut self, measurement: &Measurement) -> Result<(Pose, Twist), Cause> {
        let machine = self.model.machine();
        let (tracked, _) = self.tracker.advance(machine, &measurement.length);
        match tracked {
            Tracked::Found => {}
            Tracked::Approaching if self.state == State::Active => return Err(Cause::MeasurementJumped),
            Tracked::Approaching => return Err(Cause::FindingPose),
            Tracked::NotConverged => {
                // Home is the one pose known to be on the right assembly mode: walk again from there.
                self.tracker = home_tracker(machine);
                return Err(Cause::PoseNotFound);
            }
        }
        let pose = self.tracker.pose;
        let twist = twist_from_rates(machine, &pose, &measurement.rate).ok_or(Cause::SingularPose)?;
        Ok((pose, twist))
    }

    /// Control begins only where the first force would be no jolt: near, and not passing by (an error of
    /// velocity weighs as much as the error of pose that it is worth to the law, `wn` times as large). It
    /// goes on only while the platform follows: a setpoint that jumps must not throw it.
    fn may_control(&self, error: &TrackingError) -> Result<(), Cause> {
        let limits = &self.parameters;
        let (position, orientation) = (error.pose.linear.norm(), error.pose.angular.norm());
        if self.state == State::Active {
            let on_path =
                position <= limits.following_position && orientation <= limits.following_orientation;
            return if on_path { Ok(()) } else { Err(Cause::OffPath) };
        }
        let Law { position: law_position, orientation: law_orientation } = &limits.law;
        let near = position <= limits.engage_position
            && orientation <= limits.engage_orientation
            && error.twist.linear.norm() <= limits.engage_position * law_position.stiffness.sqrt()
            && error.twist.angular.norm() <= limits.engage_orientation * law_orientation.stiffness.sqrt();
        if near { Ok(()) } else { Err(Cause::SetpointTooFar) }
    }
}

fn home_tracker(machine: &Machine) -> Tracker {
    Tracker::new(machine, TaskState::at_rest(machine.home).motion().pose)
}

/// `to - from` in seconds, either sign.
fn seconds_between(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9
}
