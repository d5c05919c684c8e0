//! One cycle of control: from the newest setpoint and measurement to six forces, or the reason why not.
//!
//! Order of a cycle: doubt the inputs, find the pose (forward kinematics), decide the state, take the error
//! from the state's reference, apply the law, evaluate the inverse dynamics, check what comes out. Every
//! cycle does a bounded amount of work.

use super::doubt::{self, Believed};
use super::law::{Law, TrackingError};
use super::reference::{Limits, Segment};
use super::state::{Cause, Request, State};
use super::supervisor::{Findings, Mode, next};
use crate::model::active_forces::InverseDynamics;
use crate::model::forward_kinematics::{Tracked, Tracker};
use crate::model::inverse_jacobian::twist_from_rates;
use crate::model::ladder::{Gravity, Rung};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};
use crate::model::task::TaskState;

/// What a deployment chooses. Times in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub period_ns: u64,
    pub law: Law,
    /// Which terms of the dynamics are evaluated. It must have inertia: what the law commands is an
    /// acceleration, and without inertia there would be no feedback.
    pub rung: Rung,
    /// Of the motions that the daemon makes by itself.
    pub limits: Limits,
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

/// A request of an operator, and which message it came with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    pub request: Request,
    /// Epoch and sequence number of the message.
    pub message: (u64, u64),
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
    /// The newest request, if one ever arrived. Each is carried out once.
    pub request: Option<Asked>,
    /// Cycles were missed since the last one, and the deployment calls that a fault.
    pub deadline_missed: bool,
}

/// Result of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    pub state: State,
    /// Why the state is not active, or will not be for long; `None` while engaging and active.
    pub cause: Cause,
    /// The message of the last request carried out or refused.
    pub answered: (u64, u64),
    /// Why that one was refused; `None` if it was not.
    pub refused: Cause,
    /// Forces \[N\]; zero unless the state controls.
    pub force: [f64; LEGS],
    /// The forces were reduced to the actuators' limit.
    pub limited: bool,
    /// The measured pose and twist, when the pose is known.
    pub measured: Option<(Pose, Twist)>,
    /// Reference minus measured under control; else setpoint minus measured, when both are known.
    pub error: Option<TrackingError>,
}

/// What the platform is to follow.
#[derive(Clone, Copy, Debug)]
enum Reference {
    Setpoint,
    OntoSetpoint(Segment),
    /// A displaced pose at rest.
    From(Pose, Segment),
}

/// The controller of one machine.
#[derive(Clone, Debug)]
pub struct Controller {
    model: InverseDynamics,
    parameters: Parameters,
    home: Pose,
    tracker: Tracker,
    measurement: Believed<Measurement>,
    setpoint: Believed<Setpoint>,
    mode: Mode,
    reference: Reference,
    answered: (u64, u64),
    refused: Cause,
}

/// A measurement and the pose and twist it stands for.
#[derive(Clone, Copy)]
struct Located {
    time_ns: u64,
    pose: Pose,
    twist: Twist,
}

impl Controller {
    /// Waits at the home pose for a first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        Self {
            model: InverseDynamics::new(machine),
            parameters,
            home: home_pose(machine),
            tracker: Tracker::new(machine, home_pose(machine)),
            measurement: Believed::default(),
            setpoint: Believed::default(),
            mode: Mode::default(),
            reference: Reference::Setpoint,
            answered: (0, 0),
            refused: Cause::None,
        }
    }

    /// One cycle. Pure: depends on nothing but the state of the controller and `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        self.doubt(input);
        let located = self.locate(input.release_ns);
        let setpoint = self.fresh_setpoint(input.release_ns);
        let error = self.error(located.ok());
        let findings = Findings {
            located: located.map(drop),
            engageable: setpoint.and_then(|()| self.near(error.as_ref())),
            following: self.followed(input, setpoint, error.as_ref()),
            arrived: self.arrived(input.release_ns),
        };
        let present = self.reference_at(input.release_ns);
        let before = self.mode.state;
        self.decide(input, &findings);
        let mut output = Output { answered: self.answered, refused: self.refused, error, ..Output::default() };
        if let Ok(at) = located {
            output.measured = Some((at.pose, at.twist));
            if self.mode.state != before {
                self.enter(&at, input.release_ns, present);
            }
            if self.mode.state.controls()
                && let Err(cause) = self.control(&at, input.release_ns, &mut output)
            {
                self.mode = Mode { state: State::Fault, cause, ..Mode::default() };
                output.force = [0.0; LEGS];
            }
        }
        (output.state, output.cause) = (self.mode.state, self.mode.cause);
        output
    }

    /// The next state; a request is carried out once.
    fn decide(&mut self, input: &Input, findings: &Findings) {
        let new = input.request.filter(|asked| asked.message != self.answered);
        let (mode, refused) = next(self.mode, new.map(|asked| asked.request), findings);
        self.mode = mode;
        if let Some(asked) = new {
            (self.answered, self.refused) = (asked.message, refused.unwrap_or_default());
        }
    }

    /// Takes in what can be believed. Continuity is asked for only where it can be had: of measurements
    /// that are young, of setpoints that are followed.
    fn doubt(&mut self, input: &Input) {
        let Self { parameters, measurement, setpoint, .. } = self;
        let machine = self.model.machine();
        let is_new = |now: u64, good: Option<u64>| good != Some(now);
        if let Some(now) = input.measurement
            && is_new(now.time_ns, measurement.good.map(|good| good.time_ns))
        {
            let young = measurement.good.filter(|good| {
                input.release_ns.abs_diff(good.time_ns) <= parameters.measured_timeout_ns
            });
            let verdict = if input.release_ns.abs_diff(now.time_ns) > parameters.measured_timeout_ns {
                Err(Cause::MeasurementLost)
            } else {
                doubt::measurement(machine, &now, young.as_ref())
            };
            measurement.take(now, verdict);
        }
        if let Some(now) = input.setpoint
            && is_new(now.time_ns, setpoint.good.map(|good| good.time_ns))
        {
            let follows = matches!(self.mode.state, State::Engaging | State::Active);
            let verdict = doubt::setpoint(machine, &now, setpoint.good.filter(|_| follows).as_ref());
            setpoint.take(now, verdict);
        }
    }

    /// The pose and twist of the platform, by one bounded step of forward kinematics.
    fn locate(&mut self, release_ns: u64) -> Result<Located, Cause> {
        let Some(measurement) = self.measurement.good else {
            return Err(self.measurement.absence(Cause::NoMeasurement));
        };
        // Far in the future is as wrong as long ago.
        if release_ns.abs_diff(measurement.time_ns) > self.parameters.measured_timeout_ns {
            return Err(self.measurement.absence(Cause::MeasurementLost));
        }
        let machine = self.model.machine();
        match self.tracker.advance(machine, &measurement.length).0 {
            Tracked::Found => {}
            Tracked::Approaching if self.mode.state.controls() => return Err(Cause::MeasurementJumped),
            Tracked::Approaching => return Err(Cause::FindingPose),
            Tracked::NotConverged => {
                // Home is the one pose known to be on the right assembly mode: walk again from there.
                self.tracker = Tracker::new(machine, self.home);
                return Err(Cause::PoseNotFound);
            }
        }
        let pose = self.tracker.pose;
        let twist = twist_from_rates(machine, &pose, &measurement.rate).ok_or(Cause::SingularPose)?;
        Ok(Located { time_ns: measurement.time_ns, pose, twist })
    }

    fn fresh_setpoint(&self, release_ns: u64) -> Result<(), Cause> {
        let Some(setpoint) = self.setpoint.good else {
            return Err(self.setpoint.absence(Cause::NoSetpoint));
        };
        if release_ns.abs_diff(setpoint.time_ns) > self.parameters.setpoint_timeout_ns {
            let at_rest = setpoint.task.xd.amax() == 0.0 && setpoint.task.xdd.amax() == 0.0;
            let lost = if at_rest { Cause::SetpointEnded } else { Cause::SetpointLost };
            return Err(self.setpoint.absence(lost));
        }
        Ok(())
    }

    fn setpoint_at(&self, instant_ns: u64) -> Option<Motion> {
        let setpoint = self.setpoint.good?;
        Some(setpoint.task.after(seconds_between(setpoint.time_ns, instant_ns)).motion())
    }

    /// What the platform is to do at an instant; without control, what the setpoint says.
    fn reference_at(&self, instant_ns: u64) -> Option<Motion> {
        match &self.reference {
            Reference::Setpoint => self.setpoint_at(instant_ns),
            Reference::OntoSetpoint(segment) => {
                Some(segment.displace(&self.setpoint_at(instant_ns)?, instant_ns))
            }
            Reference::From(pose, segment) => Some(segment.displace(&resting(pose), instant_ns)),
        }
    }

    /// Reference minus measured, at the instant of the measurement.
    fn error(&self, located: Option<Located>) -> Option<TrackingError> {
        let at = located?;
        Some(TrackingError::new(&self.reference_at(at.time_ns)?, &at.pose, &at.twist))
    }

    /// Control begins only where it is no motion of its own: near, and not passing by (an error of velocity
    /// weighs as much as the error of pose that it is worth to the law, `wn` times as large).
    fn near(&self, error: Option<&TrackingError>) -> Result<(), Cause> {
        let limits = &self.parameters;
        let Law { position, orientation } = &limits.law;
        let near = error.is_some_and(|error| {
            error.pose.linear.norm() <= limits.engage_position
                && error.pose.angular.norm() <= limits.engage_orientation
                && error.twist.linear.norm() <= limits.engage_position * position.stiffness.sqrt()
                && error.twist.angular.norm() <= limits.engage_orientation * orientation.stiffness.sqrt()
        });
        if near { Ok(()) } else { Err(Cause::SetpointTooFar) }
    }

    /// Whether control can go on as it is.
    fn followed(
        &self,
        input: &Input,
        setpoint: Result<(), Cause>,
        error: Option<&TrackingError>,
    ) -> Result<(), Cause> {
        let limits = &self.parameters;
        let on_path = error.is_none_or(|error| {
            error.pose.linear.norm() <= limits.following_position
                && error.pose.angular.norm() <= limits.following_orientation
        });
        if !on_path {
            return Err(Cause::OffPath);
        }
        if input.deadline_missed {
            return Err(Cause::DeadlineMissed);
        }
        let follows = matches!(self.mode.state, State::Engaging | State::Active);
        if follows { setpoint } else { Ok(()) }
    }

    fn arrived(&self, instant_ns: u64) -> bool {
        match &self.reference {
            Reference::Setpoint => true,
            Reference::OntoSetpoint(segment) | Reference::From(_, segment) => segment.ended(instant_ns),
        }
    }

    /// Begins the motion of the state just entered, where the one before it is at `present`.
    fn enter(&mut self, at: &Located, release_ns: u64, present: Option<Motion>) {
        let limits = &self.parameters.limits;
        let present = present.unwrap_or_else(|| resting(&at.pose));
        self.reference = match self.mode.state {
            State::Engaging => {
                let setpoint = self.setpoint_at(at.time_ns).unwrap_or(present);
                let from = TrackingError::new(&setpoint, &at.pose, &at.twist);
                let minus = |twist: &Twist| Twist { angular: -twist.angular, linear: -twist.linear };
                let (away, rate) = (minus(&from.pose), minus(&from.twist));
                Reference::OntoSetpoint(Segment::vanishing(at.time_ns, &away, &rate, limits))
            }
            State::Stopping => {
                let segment = Segment::to_rest(release_ns, &present.twist, &present.acceleration, limits);
                Reference::From(present.pose, segment)
            }
            State::Parking => {
                let away = self.home.displacement_to(&present.pose);
                let segment = Segment::vanishing(release_ns, &away, &Twist::default(), limits);
                Reference::From(self.home, segment)
            }
            State::Off | State::Standby | State::Active | State::Fault => Reference::Setpoint,
        };
    }

    /// The forces of this cycle, or why there are none.
    fn control(&self, at: &Located, release_ns: u64, output: &mut Output) -> Result<(), Cause> {
        let error = self.error(Some(*at)).ok_or(Cause::SetpointLost)?;
        // The force is held for one period from about the release on.
        let middle_of_hold_ns = release_ns.saturating_add(self.parameters.period_ns / 2);
        let desired = self.reference_at(middle_of_hold_ns).ok_or(Cause::SetpointLost)?;
        let command = self.parameters.law.command(&desired, &error);
        let force = self.model.forces_of(self.parameters.rung, &command).ok_or(Cause::SingularPose)?;
        if force.iter().any(|value| !value.is_finite()) {
            return Err(Cause::ForceNotFinite);
        }
        output.error = Some(error);
        output.force = self.within_limit(&force, &command)?;
        output.limited = output.force != force;
        Ok(())
    }

    /// Forces beyond the limit keep what holds the platform up and lose the same share of all else, so that
    /// what is left pushes in the direction that was meant.
    fn within_limit(&self, force: &[f64; LEGS], command: &Motion) -> Result<[f64; LEGS], Cause> {
        let limit = self.model.machine().actuator.max_force;
        if force.iter().all(|value| value.abs() <= limit) {
            return Ok(*force);
        }
        let weight = self.model.forces::<Gravity>(command).ok_or(Cause::SingularPose)?.map(|value| value.max(-limit).min(limit));
        let share = |(force, weight): (&f64, &f64)| {
            let rest = force - weight;
            if rest > 0.0 { (limit - weight) / rest } else if rest < 0.0 { (-limit - weight) / rest } else { 1.0 }
        };
        let share = force.iter().zip(&weight).map(share).fold(1.0, f64::min).max(0.0);
        let mut limited = weight;
        for (limited, force) in limited.iter_mut().zip(force) {
            *limited = (*limited + share * (force - *limited)).max(-limit).min(limit);
        }
        Ok(limited)
    }
}

fn resting(pose: &Pose) -> Motion {
    Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() }
}

fn home_pose(machine: &Machine) -> Pose {
    TaskState::at_rest(machine.home).motion().pose
}

/// `to - from` in seconds, either sign.
pub(super) fn seconds_between(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9
}
