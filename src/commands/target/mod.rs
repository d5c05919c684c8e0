//! Source of targets for `goto`, `hold` and `jog`: poses to move to and hold.
//!
//! The daemon's reference generator makes the motion, so no target can exceed a limit. A target has no end:
//! after its source has ended, the platform holds it under control until another source, `stop` or `park`. So
//! a command ends when its target is reached, and `goto` when the platform is in position.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use nalgebra::Vector3;

pub use self::error::{Deviation, TargetError};
use self::watch::{StatusWatch, Watched};
use super::plant::prepare_thread;
use super::request::carry_out_in_background;
use crate::analysis::target_motion::{REACHED_M, REACHED_RAD, check_target};
use crate::config::Config;
use crate::control::constants::Constants;
use crate::control::signals::diagnostic::DiagnosticCode;
use crate::control::signals::inputs::{Setpoint, SetpointKind};
use crate::control::signals::limits::DerivativeLimits;
use crate::control::signals::state::{Request, State};
use crate::daemon::process_names::named;
use crate::daemon::{self, nanoseconds};
use crate::messages::clock::monotonic_ns;
use crate::messages::{Bus, Publisher, SetpointMessage};
use crate::model::fidelity::Fidelity;
use crate::model::rigid::{Pose, Twist};
use crate::model::task::{TaskState, task_coordinates};
use crate::operator::protocol::AnswerLine as Answer;
use crate::operator::requests::status;
use crate::operator::status_report::{ProcessReport, StatusReport};
use crate::operator::{OperatorError, Order};
use crate::realtime::clock::{Grid, sleep_until};
use crate::realtime::stop_request::Stop;

mod error;
pub mod pose_options;
pub mod watch;

/// Time within which the daemon must follow a published target.
const FOLLOWING_LIMIT: Duration = Duration::from_secs(3);

/// Largest difference between a published coordinate and the received one \[rad\], \[m\].
const SAME: f64 = 1e-12;

/// Longest time between two status reports from which a velocity is computed \[s\].
const MAX_REPORT_INTERVAL_S: f64 = 0.5;

/// Constants of the daemon's controller.
pub fn constants(config: &Config) -> Constants {
    // The reference does not depend on the fidelity.
    let parameters = daemon::parameters(&config.machine, &config.deployment, Fidelity::Exact);
    Constants::new(&config.machine, parameters)
}

/// The pose of X.
pub fn pose_of(x: &[f64; 6]) -> Pose {
    TaskState::at_rest(*x).motion().pose
}

/// X of the reference under control, else of the platform; `None` if it is unknown.
pub fn reference_x(config: &Config, answer: &Answer) -> Option<[f64; 6]> {
    let report = answer.status.as_ref()?;
    let pose = report.pose?;
    let error = report.orientation_error_rad.zip(report.position_error_m);
    let Some((angular, linear)) = error.filter(|_| has_control(answer)) else { return Some(pose) };
    let error = Twist { angular: Vector3::from(angular), linear: Vector3::from(linear) };
    Some(task_coordinates(&pose_of(&pose).displaced(&error), &config.machine.home))
}

/// X of the target that is followed or held; `None` if there is none, or if the platform cannot reach it.
pub fn target_x(constants: &Constants, answer: &Answer) -> Option<[f64; 6]> {
    let target = answer.status.as_ref()?.target?;
    check_target(constants, &pose_of(&target)).is_ok().then_some(target)
}

/// X at which the platform stands under control, held after its source has ended; `None` if no daemon is in control.
/// An error with the reason if another source cannot take over.
pub fn held_x(config: &Config) -> Result<Option<[f64; 6]>, String> {
    let Some(answer) = status(&config.name).ok().filter(has_control) else { return Ok(None) };
    if let Some(other) = answer.status.as_deref().and_then(other_source) {
        return Err(TargetError::OtherSource(named(other)).to_string());
    }
    let reference = reference_x(config, &answer);
    // Without setpoints, `on_violation = "limit"` holds the reference.
    let is_holding = answer.diagnostic.code == DiagnosticCode::HoldingPose as u32;
    let target = answer.status.as_ref().and_then(|report| report.target);
    let held = if is_holding { reference } else { target };
    let (Some(held), Some(reference)) = (held, reference) else {
        let state = answer.state;
        return Err(format!("the platform follows another source or a stop: the daemon is in {state}"));
    };
    let [mm, mrad] = distance(&reference, &held).map(|distance| 1e3 * distance);
    if is_reached(&reference, &held) {
        return Ok(Some(held));
    }
    Err(format!("the platform is still {mm:.3} mm and {mrad:.3} mrad from the target that it moves to"))
}

/// Distance \[m\] and angle \[rad\] between two X.
fn distance(from: &[f64; 6], to: &[f64; 6]) -> [f64; 2] {
    let left = pose_of(from).displacement_to(&pose_of(to));
    [left.linear.norm(), left.angular.norm()]
}

/// Whether X counts as at the target.
pub fn is_reached(x: &[f64; 6], target: &[f64; 6]) -> bool {
    let [linear, angular] = distance(x, target);
    linear < REACHED_M && angular < REACHED_RAD
}

fn has_control(answer: &Answer) -> bool {
    State::ALL.into_iter().any(|state| state.has_control() && state.name() == answer.state)
}

/// Source of targets.
pub struct TargetSource<'a> {
    config: &'a Config,
    setpoints: Publisher<SetpointMessage>,
    _bus: Bus,
    watch: StatusWatch,
    engagement: Option<Receiver<Result<(), OperatorError>>>,
    within: Option<Duration>,
    stop: Stop,
    grid: Grid,
    tick_ns: u64,
    /// Instant since which the state is active.
    active_since: Option<Instant>,
    published: Option<([f64; 6], Instant)>,
    /// Share of the limits of autonomous motions.
    speed: f64,
}

impl<'a> TargetSource<'a> {
    /// Joins the machine. The platform must be at rest under control, or be taken under control within a
    /// time, and no other source may publish.
    pub fn open(config: &'a Config, within: Option<Duration>, stop: &Stop) -> Result<Self, TargetError> {
        let answer = status(&config.name)?;
        let bus = config.join()?;
        if bus.is_simulated() {
            return Err(TargetError::Simulated);
        }
        if let Some(other) = answer.status.as_deref().and_then(other_source) {
            return Err(TargetError::OtherSource(named(other)));
        }
        let is_active = answer.state == State::Active.name();
        if !is_active && within.is_none() {
            return Err(TargetError::NotInControl(answer.state, answer.text));
        }
        prepare_thread(config);
        let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
        Ok(Self {
            config,
            setpoints: bus.publisher()?,
            _bus: bus,
            watch: StatusWatch::start(config, answer),
            engagement: None,
            within: within.filter(|_| !is_active),
            stop: stop.clone(),
            grid,
            tick_ns: grid.next_after(monotonic_ns()),
            active_since: is_active.then(Instant::now),
            published: None,
            speed: 1.0,
        })
    }

    /// Sets the share of the limits of autonomous motions with which the next targets are approached.
    pub fn set_speed(&mut self, speed: f64) {
        self.speed = speed;
    }

    /// The newest status.
    pub fn status(&self) -> Watched {
        self.watch.newest()
    }

    /// Instant since which the platform follows.
    pub fn active_since(&self) -> Option<Instant> {
        self.active_since
    }

    /// X of the reference or of the platform now.
    pub fn present_x(&self) -> Result<[f64; 6], TargetError> {
        let Watched { newest: (_, answer), .. } = self.watch.newest();
        reference_x(self.config, &answer).ok_or(TargetError::UnknownPose(answer.text))
    }

    /// X at which the platform comes to rest if it brakes now with the limits of autonomous motions. The
    /// present X, if that one is outside the workspace.
    pub fn resting_x(&self, constants: &Constants) -> Result<[f64; 6], TargetError> {
        let Watched { newest: (requested, answer), before, .. } = self.watch.newest();
        let of = |answer: &Answer| Some(pose_of(&reference_x(self.config, answer)?));
        let now = of(&answer).ok_or(TargetError::UnknownPose(answer.text.clone()))?;
        let earlier = before.and_then(|(then, answer)| {
            let interval_s = requested.duration_since(then).as_secs_f64();
            Some((of(&answer)?, interval_s)).filter(|_| interval_s < MAX_REPORT_INTERVAL_S)
        });
        let Some((then, interval_s)) = earlier else { return self.present_x() };
        let moved = then.displacement_to(&now);
        let limits = &constants.parameters.limits;
        let age_s = requested.elapsed().as_secs_f64();
        let ahead = |moved: Vector3<f64>, limits: &DerivativeLimits| {
            let DerivativeLimits { acceleration, jerk, .. } =
                limits.scaled(constants.parameters.limits.autonomous_scale);
            let velocity = moved / interval_s;
            velocity * (age_s + velocity.norm() / (2.0 * acceleration) + acceleration / (2.0 * jerk))
        };
        let ahead = Twist {
            angular: ahead(moved.angular, &limits.orientation),
            linear: ahead(moved.linear, &limits.position),
        };
        let rest = now.displaced(&ahead);
        let pose = if check_target(constants, &rest).is_ok() { rest } else { now };
        Ok(task_coordinates(&pose, &self.config.machine.home))
    }

    /// Instant of the next setpoint \[ns\].
    pub fn next_ns(&self) -> u64 {
        self.tick_ns
    }

    /// Waits for the next instant of the loop and publishes a target. An error if control has ended.
    pub fn publish(&mut self, x: [f64; 6]) -> Result<(), TargetError> {
        let motion = Setpoint::motion(self.tick_ns, TaskState::at_rest(x));
        self.send(&Setpoint { kind: SetpointKind::Target, target_speed: self.speed, ..motion })
    }

    /// The same with a motion, which is followed as it is.
    pub fn publish_motion(&mut self, task: TaskState) -> Result<(), TargetError> {
        self.send(&Setpoint::motion(self.tick_ns, task))
    }

    /// The same with a sample of a motion, X of an earlier instant \[ns\], if there is one.
    pub fn publish_sample(&mut self, sample: Option<(u64, [f64; 6])>) -> Result<(), TargetError> {
        if let Some((time_ns, x)) = sample {
            let motion = Setpoint::motion(time_ns, TaskState::at_rest(x));
            return self.send(&Setpoint { kind: SetpointKind::Pose, ..motion });
        }
        self.sleep();
        self.check()
    }

    fn sleep(&mut self) {
        sleep_until(self.tick_ns);
        self.tick_ns = self.grid.next_after(self.tick_ns.max(monotonic_ns()));
    }

    fn send(&mut self, setpoint: &Setpoint) -> Result<(), TargetError> {
        self.sleep();
        self.setpoints.publish(setpoint.time_ns, setpoint.into())?;
        let x = setpoint.task.x.into();
        if self.published.is_none_or(|(published, _)| published != x) {
            self.published = Some((x, Instant::now()));
        }
        self.engage()?;
        self.check()
    }

    /// Requests control once, if the platform is not under control.
    fn engage(&mut self) -> Result<(), TargetError> {
        let Some(timeout) = self.within else { return Ok(()) };
        let engagement = self.engagement.get_or_insert_with(|| {
            let order = Order { request: Request::Engage, is_patient: true, timeout, remote: None };
            carry_out_in_background(&self.config.name, order, &self.stop)
        });
        match engagement.try_recv() {
            // The command has received the same signal.
            Ok(Err(OperatorError::Interrupted)) => {
                self.within = None;
                Ok(())
            }
            Ok(outcome) => {
                outcome?;
                (self.within, self.active_since) = (None, Some(Instant::now()));
                Ok(())
            }
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => Ok(()),
        }
    }

    /// Whether the platform is still under control by this source.
    fn check(&self) -> Result<(), TargetError> {
        let (Some(since), Some((x, published))) = (self.active_since, self.published) else { return Ok(()) };
        let Watched { newest: (requested, answer), error, .. } = self.watch.newest();
        if let Some(error) = error {
            return Err(TargetError::Ended("an unknown state".into(), error));
        }
        if requested < since {
            return Ok(());
        }
        if !has_control(&answer) || [State::Stopping, State::Parking].iter().any(|s| s.name() == answer.state)
        {
            return Err(TargetError::Ended(answer.state, answer.text));
        }
        // An older status has another setpoint.
        let is_new = requested >= published;
        if is_new && !has_received(&answer, &x) && published.max(since).elapsed() > FOLLOWING_LIMIT {
            return Err(TargetError::NotFollowed);
        }
        Ok(())
    }
}

/// Whether X is that of the newest setpoint of the daemon.
pub fn has_received(answer: &Answer, x: &[f64; 6]) -> bool {
    let received = answer.status.as_ref().and_then(|report| report.setpoint);
    received.is_some_and(|received| received.iter().zip(x).all(|(a, b)| (a - b).abs() < SAME))
}

/// Another process that publishes setpoints and has not ended.
fn other_source(report: &StatusReport) -> Option<u32> {
    let sources = report.sources.iter().filter(|source| source.topic == "setpoint");
    let mut processes = sources.flat_map(|source| &source.processes);
    let lives =
        |process: &&ProcessReport| !process.command.is_empty() && process.process_id != std::process::id();
    processes.find(lives).map(|process| process.process_id)
}
