//! One cycle of control: from the newest setpoint and measurement to six forces, or the reason why not.
//!
//! Order of a cycle: doubt the inputs, find the pose (forward kinematics), decide the state, take the error
//! from the state's reference, apply the law, evaluate the inverse dynamics, check what comes out. Every
//! cycle does a bounded amount of work.
//!
//! The order is here; `inputs.rs` says which inputs count, `path.rs` what the platform is to do, `forces.rs`
//! with which forces.

use super::doubt;
use super::doubt::{Aim, Believed, Parting};
use super::law::{Deviation, Law, Observer, TrackingError};
use super::limits::{Limit, Limiting, Limits};
use super::reference::Segment;
use super::state::{Cause, Evidence, Request, State, Trouble};
use super::supervisor::{AfterStop, Findings, Mode, next};
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::model::forward_kinematics::Tracker;
use crate::model::inverse_geometry::leg_lengths;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist, Wrench};
use crate::model::task::TaskState;
#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;

mod forces;
mod inputs;
mod path;

/// What a deployment chooses. Times in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub period_ns: u64,
    pub law: Law,
    /// Which terms of the dynamics are evaluated. It must have inertia: what the law commands is an
    /// acceleration, and without inertia there would be no feedback.
    pub fidelity: Fidelity,
    /// Of every reference.
    pub limits: Limits,
    /// Where setpoints may be, if anybody has said.
    pub envelope: Option<Envelope>,
    /// Largest condition of the pose, see [`crate::model::sensitivity`].
    pub condition: f64,
    /// Largest change of a force \[N/s\].
    pub force_rate: f64,
    /// What follows the stop of a platform that lost its setpoint.
    pub after_loss: AfterStop,
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

impl Parameters {
    /// A setpoint is carried on until the first cycle that finds it too old \[s\].
    pub(super) fn longest_carried_s(&self) -> f64 {
        self.setpoint_timeout_ns.saturating_add(self.period_ns) as f64 * 1e-9
    }
}

/// Lowest and highest X of a setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    pub lowest: [f64; 6],
    pub highest: [f64; 6],
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
    /// The number behind the cause, if it has one.
    pub evidence: Evidence,
    /// The message of the last request carried out or refused.
    pub answered: (u64, u64),
    /// Why that one was refused; `None` if it was not.
    pub refused: Cause,
    /// Forces \[N\]; zero unless the state controls.
    pub force: [f64; LEGS],
    /// What the platform gets more than was asked for, about C: not zero where forces are limited.
    pub wrench_error: Wrench,
    /// The limits that this cycle is at.
    pub limiting: Limiting,
    /// Cycles under control without a new measurement or setpoint to believe, since start.
    pub without_measurement: u64,
    pub without_setpoint: u64,
    /// The measured pose and twist, when the pose is known.
    pub measured: Option<(Pose, Twist)>,
    /// Of that pose, see [`crate::model::sensitivity`].
    pub condition: f64,
    /// Until a singular pose, if the platform goes on as it does \[s\]; infinite if that leads to none.
    pub singular_in: f64,
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
    home: KinematicState,
    tracker: Tracker,
    /// The pose is known, from home on without a gap.
    known: bool,
    closing: Option<Closing>,
    /// Why the platform may be beyond a singular pose, until somebody has cleared it.
    astray: Option<Trouble>,
    measurement: Believed<Measurement>,
    parting: Parting,
    setpoint: Believed<Aim>,
    /// Of the newest setpoint.
    setpoint_limiting: Limiting,
    mode: Mode,
    evidence: Evidence,
    reference: Reference,
    observer: Observer,
    /// Under control: the last error.
    known_error: Option<KnownError>,
    /// Of the last cycle, if it was under control.
    force: Option<[f64; LEGS]>,
    answered: (u64, u64),
    refused: Cause,
    without_measurement: u64,
    without_setpoint: u64,
}

/// An error, and the instant of the measurement it comes from.
#[derive(Clone, Copy, Debug)]
struct KnownError {
    time_ns: u64,
    error: TrackingError,
    /// What the law sees of it: the same, or the legs' part.
    acted_on: Deviation,
}

/// A measurement and the pose and twist it stands for.
#[derive(Clone, Copy)]
struct Located {
    time_ns: u64,
    pose: Pose,
    twist: Twist,
}

/// How fast the determinant vanishes.
#[derive(Clone, Copy, Debug)]
struct Closing {
    /// Of the last measurement.
    time_ns: u64,
    determinant: f64,
    singular_in: f64,
}

impl Controller {
    /// Waits at the home pose for a first measurement.
    pub fn new(machine: &Machine, parameters: Parameters) -> Self {
        let home = KinematicState::new(machine, TaskState::at_rest(machine.home).motion().pose);
        Self {
            model: InverseDynamics::new(machine),
            parameters,
            home,
            tracker: Tracker::new(machine, *home.pose()),
            known: false,
            closing: None,
            astray: None,
            measurement: Believed::default(),
            parting: Parting::default(),
            setpoint: Believed::default(),
            setpoint_limiting: Limiting::default(),
            mode: Mode::default(),
            evidence: Evidence::default(),
            reference: Reference::Setpoint,
            observer: Observer::default(),
            known_error: None,
            force: None,
            answered: (0, 0),
            refused: Cause::None,
            without_measurement: 0,
            without_setpoint: 0,
        }
    }

    /// One cycle. Pure: depends on nothing but the state of the controller and `input`.
    pub fn step(&mut self, input: &Input) -> Output {
        let now_ns = input.release_ns;
        let unbroken = self.unbroken(now_ns);
        self.doubt(input);
        let located = unbroken.and_then(|()| self.locate(now_ns));
        let setpoint = self.fresh_setpoint(now_ns);
        let mut output = Output { limiting: self.setpoint_limiting, ..Output::default() };
        if self.mode.state.controls() || setpoint.is_ok() {
            output.error = located.ok().and_then(|at| self.error(&at));
        }
        let conditioned = self.conditioned(&mut output);
        let engageable = conditioned.and(setpoint).and_then(|()| self.near(output.error.as_ref()));
        let following = self.followed(input, setpoint, &mut output).and(conditioned);
        let before = self.mode.state;
        self.decide(input, [located.map(drop), engageable, following]);
        if let Ok(at) = located {
            output.measured = Some((at.pose, at.twist));
            output.condition = self.tracker.kinematic_state().sensitivity().condition;
            output.singular_in = self.singular_in(at.time_ns);
            if self.mode.state != before {
                self.enter(before, &at, now_ns);
                self.known_error = None;
                output.error = self.error(&at);
            }
            if self.mode.state.controls()
                && let Err(trouble) = self.control(now_ns, &mut output)
            {
                self.mode = Mode { state: State::Fault, cause: trouble.cause, ..Mode::default() };
                self.evidence = trouble.evidence;
            }
        }
        self.force = Some(output.force).filter(|_| self.mode.state.controls());
        if self.force.is_none() {
            output.force = [0.0; LEGS];
        }
        Output {
            state: self.mode.state,
            cause: self.mode.cause,
            evidence: self.evidence,
            answered: self.answered,
            refused: self.refused,
            without_measurement: self.without_measurement,
            without_setpoint: self.without_setpoint,
            ..output
        }
    }

    /// The next state; a request is carried out once.
    fn decide(&mut self, input: &Input, found: [Result<(), Trouble>; 3]) {
        let new = input.request.filter(|asked| asked.message != self.answered);
        let [located, engageable, following] = found.map(|found| found.map_err(|trouble| trouble.cause));
        let findings = Findings { located, engageable, following, arrived: self.arrived(input.release_ns) };
        let (mode, refused) =
            next(self.mode, new.map(|asked| asked.request), &findings, self.parameters.after_loss);
        if let Some(asked) = new {
            (self.answered, self.refused) = (asked.message, refused.unwrap_or_default());
            if asked.request == Request::Clear && self.astray.take().is_some() {
                self.walk_from_home();
            }
        }
        if mode.cause != self.mode.cause || !mode.state.controls() && mode.state != State::Fault {
            let fits = |trouble: &Trouble| trouble.cause == mode.cause;
            let trouble = found.into_iter().filter_map(Result::err).find(fits);
            self.evidence = trouble.unwrap_or_default().evidence;
        }
        self.mode = mode;
    }

    /// Control begins only where it is no motion of its own: near, and not passing by (an error of velocity
    /// weighs as much as the error of pose that it is worth to the law, `wn` times as large).
    fn near(&self, error: Option<&TrackingError>) -> Result<(), Trouble> {
        let Some(error) = error else { return Err(Cause::NoSetpoint.into()) };
        let away = self.away(error);
        if away <= 1.0 { Ok(()) } else { Err(Trouble::new(Cause::SetpointTooFar, away, 1.0)) }
    }

    /// The largest share of an engage tolerance.
    fn away(&self, error: &TrackingError) -> f64 {
        let Parameters { law, engage_position, engage_orientation, .. } = &self.parameters;
        let share = |pose: f64, rate: f64, tolerance: f64, stiffness: f64| {
            pose.max(rate / stiffness.sqrt()) / tolerance
        };
        let TrackingError { pose, twist } = error;
        share(pose.linear.norm(), twist.linear.norm(), *engage_position, law.position.stiffness).max(share(
            pose.angular.norm(),
            twist.angular.norm(),
            *engage_orientation,
            law.orientation.stiffness,
        ))
    }

    /// The pose is far enough from singular ones.
    fn conditioned(&self, output: &mut Output) -> Result<(), Trouble> {
        let condition = self.tracker.kinematic_state().sensitivity().condition;
        if output.limiting.keeps(Limit::Condition, condition / self.parameters.condition) {
            return Ok(());
        }
        Err(Trouble::new(Cause::NearSingular, condition, self.parameters.condition))
    }

    /// Whether control can go on as it is.
    fn followed(
        &self,
        input: &Input,
        setpoint: Result<(), Trouble>,
        output: &mut Output,
    ) -> Result<(), Trouble> {
        if !self.mode.state.controls() {
            return Ok(());
        }
        if let Some(error) = &output.error {
            let Parameters { following_position, following_orientation, .. } = self.parameters;
            let pose = &error.pose;
            let away =
                (pose.linear.norm() / following_position).max(pose.angular.norm() / following_orientation);
            if !output.limiting.keeps(Limit::Following, away) {
                return Err(Trouble::new(Cause::OffPath, away, 1.0));
            }
        }
        if input.deadline_missed {
            return Err(Cause::DeadlineMissed.into());
        }
        match self.mode.state {
            State::Engaging | State::Active => setpoint,
            _ => self.has_room(input.release_ns),
        }
    }

    /// A motion of the daemon's own stays within the stroke.
    fn has_room(&self, release_ns: u64) -> Result<(), Trouble> {
        let Some(reference) = self.reference_at(release_ns) else { return Ok(()) };
        let machine = self.model.machine();
        doubt::within_believed_stroke(
            &machine.actuator,
            Cause::SetpointOutOfReach,
            &leg_lengths(machine, &reference.pose),
        )
    }
}

/// `to - from` in seconds, either sign.
pub fn seconds_between(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9
}
