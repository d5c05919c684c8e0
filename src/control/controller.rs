//! One cycle of control: from the newest setpoint and measurement to six forces, or the reason why not.
//!
//! Order of a cycle: doubt the inputs, find the pose (forward kinematics), decide the state, take the error
//! from the state's reference, apply the law, evaluate the inverse dynamics, check what comes out. Every
//! cycle does a bounded amount of work.

use nalgebra::Vector3;

use super::doubt::{self, Aim, Believed, Parting};
use super::law::{Integral, Law, TrackingError};
use super::limits::{Limit, Limiting, Limits};
use super::reference::Segment;
use super::state::{Cause, Evidence, Request, State, Trouble};
use super::supervisor::{AfterStop, Findings, Mode, next};
use crate::model::active_forces::InverseDynamics;
use crate::model::forward_kinematics::{Tracked, Tracker};
use crate::model::inverse_geometry::leg_lengths;
use crate::model::ladder::{Gravity, Rung};
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};
use crate::model::task::TaskState;

/// Trusted steps of forward kinematics in one cycle under control. One is far more than a cycle's motion; after a
/// pause of the measurements it may take some.
const STEPS: u32 = 8;

/// What a deployment chooses. Times in nanoseconds, like the clock.
#[derive(Clone, Copy, Debug)]
pub struct Parameters {
    pub period_ns: u64,
    pub law: Law,
    /// Which terms of the dynamics are evaluated. It must have inertia: what the law commands is an
    /// acceleration, and without inertia there would be no feedback.
    pub rung: Rung,
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
    /// The limits that this cycle is at.
    pub limiting: Limiting,
    /// Cycles under control without a new measurement or setpoint to believe, since start.
    pub without_measurement: u64,
    pub without_setpoint: u64,
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
    parting: Parting,
    setpoint: Believed<Aim>,
    /// Of the newest setpoint.
    setpoint_limiting: Limiting,
    mode: Mode,
    evidence: Evidence,
    reference: Reference,
    integral: Integral,
    /// Under control: the last error, and the instant of the measurement it comes from.
    known_error: Option<(u64, TrackingError)>,
    /// Of the last cycle, if it was under control.
    force: Option<[f64; LEGS]>,
    answered: (u64, u64),
    refused: Cause,
    without_measurement: u64,
    without_setpoint: u64,
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
            parting: Parting::default(),
            setpoint: Believed::default(),
            setpoint_limiting: Limiting::default(),
            mode: Mode::default(),
            evidence: Evidence::default(),
            reference: Reference::Setpoint,
            integral: Integral::default(),
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
        }
        if mode.cause != self.mode.cause || !mode.state.controls() && mode.state != State::Fault {
            let fits = |trouble: &Trouble| trouble.cause == mode.cause;
            let trouble = found.into_iter().filter_map(Result::err).find(fits);
            self.evidence = trouble.unwrap_or_default().evidence;
        }
        self.mode = mode;
    }

    /// Takes in what can be believed. Continuity is asked for only where it can be had: of measurements that
    /// are young or control the platform, of setpoints that are followed.
    fn doubt(&mut self, input: &Input) {
        let Self { parameters, measurement, parting, setpoint, .. } = self;
        let machine = self.model.machine();
        let now_ns = input.release_ns;
        let controls = self.mode.state.controls();
        let mut waited = [true; 2];
        if let Some(now) = input.measurement
            && measurement.newest != Some(now)
        {
            let timeout_ns = parameters.measured_timeout_ns;
            let widest = measurement.widest(now_ns, parameters.period_ns);
            let binds = |good: &Measurement| controls || now_ns.abs_diff(good.time_ns) <= timeout_ns;
            let verdict = doubt::time(Cause::MeasurementFromElsewhen, now.time_ns, now_ns, timeout_ns)
                .and_then(|()| {
                    let before = measurement.good.filter(binds);
                    let limit = &parameters.limits.position;
                    doubt::measurement(&machine.actuator, limit, &now, before.as_ref(), widest, parting)
                });
            measurement.take(now, verdict, now_ns, controls);
            waited[0] = verdict.is_err();
        }
        if let Some(now) = input.setpoint
            && setpoint.newest.map(|aim| aim.setpoint) != Some(now)
        {
            let timeout_ns = parameters.setpoint_timeout_ns;
            let widest = setpoint.widest(now_ns, parameters.period_ns);
            let follows = matches!(self.mode.state, State::Engaging | State::Active);
            let mut limiting = Limiting::default();
            let now = Aim { setpoint: now, motion: now.task.motion() };
            let verdict = doubt::time(Cause::SetpointFromElsewhen, now.setpoint.time_ns, now_ns, timeout_ns)
                .and_then(|()| {
                    let before = setpoint.good.filter(|_| follows);
                    doubt::setpoint(machine, parameters, &now, before.as_ref(), widest, &mut limiting)
                });
            self.setpoint_limiting = limiting;
            let gap = setpoint.good.map(|good| now.setpoint.time_ns.abs_diff(good.setpoint.time_ns));
            let after_gap = gap.is_some_and(|gap| gap > parameters.period_ns + parameters.period_ns / 2);
            let present = self.reference_at(now_ns).filter(|_| follows && after_gap);
            let verdict = verdict.and_then(|()| match present {
                Some(_) => self.takes_over(&now, now_ns),
                None => Ok(()),
            });
            waited[1] = verdict.is_err();
            self.setpoint.take(now, verdict, now_ns, follows);
            if let Some(present) = present.filter(|_| verdict.is_ok()) {
                self.bridge(&present, now_ns);
            }
        }
        let [no_measurement, no_setpoint] = waited.map(u64::from);
        self.without_measurement += u64::from(controls) * no_measurement;
        self.without_setpoint += u64::from(controls) * no_setpoint;
    }

    /// After a pause of the loop the inputs may be fresh again, but meanwhile the drives had no force and
    /// have let go: control does not go on as if nothing had been.
    fn unbroken(&self, now_ns: u64) -> Result<(), Trouble> {
        let last = self.measurement.good.filter(|_| self.mode.state.controls());
        last.map_or(Ok(()), |last| self.is_young(&last, now_ns))
    }

    fn is_young(&self, measurement: &Measurement, now_ns: u64) -> Result<(), Trouble> {
        let timeout_ns = self.parameters.measured_timeout_ns;
        doubt::time(Cause::MeasurementLost, measurement.time_ns, now_ns, timeout_ns)
            .map_err(|lost| self.measurement.absence(lost))
    }

    /// The pose and twist of the platform, by one bounded step of forward kinematics.
    fn locate(&mut self, release_ns: u64) -> Result<Located, Trouble> {
        let Some(measurement) = self.measurement.good else {
            return Err(self.measurement.absence(Cause::NoMeasurement));
        };
        self.is_young(&measurement, release_ns)?;
        let machine = self.model.machine();
        let controls = self.mode.state.controls();
        let trusted = self.tracker.stance().sensitivity().trusted_step * machine.joints.radius;
        let before = self.tracker.stance().lengths(machine);
        let mut tracked = self.tracker.advance(machine, &measurement.length).0;
        for _ in 1..if controls { STEPS } else { 1 } {
            if tracked == Tracked::Approaching {
                tracked = self.tracker.advance(machine, &measurement.length).0;
            }
        }
        match tracked {
            Tracked::Found => {}
            Tracked::Approaching if controls => {
                let way = |(now, before): (&f64, &f64)| (now - before).abs();
                let furthest = measurement.length.iter().zip(&before).map(way).fold(0.0, f64::max);
                return Err(Trouble::new(Cause::MeasurementJumped, furthest, f64::from(STEPS) * trusted));
            }
            Tracked::Approaching => return Err(Cause::FindingPose.into()),
            Tracked::NotConverged => {
                // Home is the one pose known to be on the right assembly mode: walk again from there.
                self.tracker = Tracker::new(machine, self.home);
                return Err(Cause::PoseNotFound.into());
            }
        }
        let pose = self.tracker.pose;
        let twist = self.tracker.stance().twist(machine, &measurement.rate).ok_or(Cause::SingularPose)?;
        Ok(Located { time_ns: measurement.time_ns, pose, twist })
    }

    fn fresh_setpoint(&self, release_ns: u64) -> Result<(), Trouble> {
        let Some(Aim { setpoint, .. }) = self.setpoint.good else {
            return Err(self.setpoint.absence(Cause::NoSetpoint));
        };
        let at_rest = setpoint.task.xd.amax() == 0.0 && setpoint.task.xdd.amax() == 0.0;
        let lost = if at_rest { Cause::SetpointEnded } else { Cause::SetpointLost };
        doubt::time(lost, setpoint.time_ns, release_ns, self.parameters.setpoint_timeout_ns)
            .map_err(|lost| self.setpoint.absence(lost))
    }

    fn setpoint_at(&self, instant_ns: u64) -> Option<Motion> {
        Some(self.carried(self.setpoint.good.as_ref()?, instant_ns))
    }

    /// A setpoint, carried on or back no longer than it may be.
    fn carried(&self, aim: &Aim, instant_ns: u64) -> Motion {
        let Aim { setpoint, motion } = aim;
        if instant_ns == setpoint.time_ns {
            return *motion;
        }
        let longest = self.parameters.longest_carried_s();
        let dt = seconds_between(setpoint.time_ns, instant_ns).max(-longest).min(longest);
        setpoint.task.after(dt).motion()
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

    /// Reference minus measured, at the instant of the measurement; while there is no new one, what becomes of
    /// it by the law.
    fn error(&mut self, at: &Located) -> Option<TrackingError> {
        let known = self.known_error.filter(|(time_ns, _)| *time_ns == at.time_ns);
        let error = match known {
            Some((_, error)) => {
                self.parameters.law.predicted(&error, self.parameters.period_ns as f64 * 1e-9)
            }
            None => TrackingError::new(&self.reference_at(at.time_ns)?, &at.pose, &at.twist),
        };
        self.known_error = Some((at.time_ns, error)).filter(|_| self.mode.state.controls());
        Some(error)
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
        let condition = self.tracker.stance().sensitivity().condition;
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

    fn arrived(&self, instant_ns: u64) -> bool {
        match &self.reference {
            Reference::Setpoint => true,
            Reference::OntoSetpoint(segment) | Reference::From(_, segment) => segment.ended(instant_ns),
        }
    }

    /// After a gap the setpoint is near what the one before it leads to, as near as one to engage on.
    // Out of line, as it is rare: the cycle stays short.
    #[inline(never)]
    fn takes_over(&self, now: &Aim, now_ns: u64) -> Result<(), Trouble> {
        let Some(led_to) = self.setpoint_at(now_ns) else { return Ok(()) };
        let next = self.carried(now, now_ns);
        let away = self.away(&TrackingError::new(&led_to, &next.pose, &next.twist));
        if away <= 1.0 { Ok(()) } else { Err(Trouble::new(Cause::SetpointJumped, away, 1.0)) }
    }

    /// After a gap a setpoint may be, within what is believed, elsewhere than the one before it led to: where
    /// following it at once would be a jerk beyond the limit, the platform is led there.
    #[inline(never)]
    fn bridge(&mut self, present: &Motion, now_ns: u64) {
        let Some(next) = self.reference_at(now_ns) else { return };
        let Parameters { period_ns, law, limits, .. } = &self.parameters;
        let error = TrackingError::new(present, &next.pose, &next.twist);
        let command = law.command(present, &error, &Integral::default()).acceleration;
        let longest = *period_ns as f64 * 1e-9;
        let step = |command: Vector3<f64>, next: Vector3<f64>| (command - next).norm();
        if step(command.linear, next.acceleration.linear) > limits.position.jerk * longest
            || step(command.angular, next.acceleration.angular) > limits.orientation.jerk * longest
        {
            // As hard as a stop: what lags behind is off the path that somebody planned.
            self.reference = self.onto_setpoint(present, now_ns, 1.0);
        }
    }

    /// From a motion onto the setpoint, with a share of the limits.
    fn onto_setpoint(&self, from: &Motion, instant_ns: u64, share: f64) -> Reference {
        let Some(base) = self.setpoint_at(instant_ns) else { return Reference::Setpoint };
        let away = base.pose.displacement_to(&from.pose);
        let rate = Twist::from_vector(&(from.twist.vector() - base.twist.vector()));
        let acceleration =
            Acceleration::from_vector(&(from.acceleration.vector() - base.acceleration.vector()));
        Reference::OntoSetpoint(Segment::vanishing(
            instant_ns,
            &away,
            &rate,
            &acceleration,
            &Limits { own_share: share, ..self.parameters.limits },
        ))
    }

    /// Begins the motion of the state just entered.
    fn enter(&mut self, before: State, at: &Located, release_ns: u64) {
        let limits = &self.parameters.limits;
        // Without control the platform stands, or coasts; what it accelerates with is not measured.
        let present = self.reference_at(release_ns).filter(|_| before.controls());
        let present = present.unwrap_or_else(|| Motion { twist: at.twist, ..resting(&at.pose) });
        self.reference = match self.mode.state {
            State::Engaging => {
                self.integral = Integral::default();
                self.onto_setpoint(
                    &Motion { twist: at.twist, ..resting(&at.pose) },
                    at.time_ns,
                    limits.own_share,
                )
            }
            State::Stopping => {
                let segment = Segment::to_rest(release_ns, &present.twist, &present.acceleration, limits);
                Reference::From(present.pose, segment)
            }
            State::Parking => {
                let away = self.home.displacement_to(&present.pose);
                let Motion { twist: rate, acceleration, .. } = present;
                Reference::From(
                    self.home,
                    Segment::vanishing(release_ns, &away, &rate, &acceleration, limits),
                )
            }
            State::Off | State::Standby | State::Active | State::Fault => Reference::Setpoint,
        };
    }

    /// The forces of this cycle, or why there are none.
    fn control(&mut self, release_ns: u64, output: &mut Output) -> Result<(), Trouble> {
        let error = output.error.ok_or(Cause::SetpointLost)?;
        let Parameters { period_ns, law, rung, limits, .. } = &self.parameters;
        // The force is held for one period from about the release on.
        let middle_of_hold_ns = release_ns.saturating_add(period_ns / 2);
        let desired = self.reference_at(middle_of_hold_ns).ok_or(Cause::SetpointLost)?;
        let command = law.command(&desired, &error, &self.integral);
        let force = self.model.forces_of(*rung, &command).ok_or(Cause::SingularPose)?;
        if force.iter().any(|value| !value.is_finite()) {
            return Err(Cause::ForceNotFinite.into());
        }
        let limited = self.within_limit(&force, &command)?;
        output.force = self.within_rate(limited);
        output.limiting = output
            .limiting
            .with(Limit::Force, limited != force)
            .with(Limit::ForceRate, output.force != limited);
        if output.force == force {
            self.integral.add(law, &error.pose, *period_ns as f64 * 1e-9, limits);
        }
        Ok(())
    }

    /// Forces beyond the limit keep what holds the platform up and lose the same share of all else, so that
    /// what is left pushes in the direction that was meant.
    fn within_limit(&self, force: &[f64; LEGS], command: &Motion) -> Result<[f64; LEGS], Trouble> {
        let limit = self.model.machine().actuator.max_force;
        if force.iter().all(|value| value.abs() <= limit) {
            return Ok(*force);
        }
        let weight = self.model.forces::<Gravity>(command).ok_or(Cause::SingularPose)?;
        Ok(toward(&weight.map(|value| value.max(-limit).min(limit)), force, |_| (-limit, limit)))
    }

    /// Forces that change no faster than they may, all by the same share of the change that was meant.
    fn within_rate(&self, force: [f64; LEGS]) -> [f64; LEGS] {
        let Some(before) = &self.force else { return force };
        let most = self.parameters.force_rate * self.parameters.period_ns as f64 * 1e-9;
        toward(before, &force, |before| (before - most, before + most))
    }
}

/// From `start`, which is within its bounds, so far toward `end` as all bounds allow.
fn toward(start: &[f64; LEGS], end: &[f64; LEGS], bounds: impl Fn(f64) -> (f64, f64)) -> [f64; LEGS] {
    let share = |(start, end): (&f64, &f64)| {
        let ((low, high), way) = (bounds(*start), end - start);
        let room = if way > 0.0 { high - start } else { low - start };
        if way == 0.0 { 1.0 } else { room / way }
    };
    let share = start.iter().zip(end).map(share).fold(1.0, f64::min).max(0.0);
    let mut reached = *end;
    if share < 1.0 {
        for (reached, start) in reached.iter_mut().zip(start) {
            let (low, high) = bounds(*start);
            *reached = (start + share * (*reached - start)).max(low).min(high);
        }
    }
    reached
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
