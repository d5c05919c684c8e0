//! Source of targets: poses to move to and hold, for requests of operators and for `hexad move --udp`.
//!
//! The daemon's reference generator makes the motion, so no target can exceed a limit. A target has no end:
//! after its source has ended, the platform holds it under control until another source, `stop` or `park`. So
//! a source ends when its target is reached.

use nalgebra::Vector3;

pub use self::error::{Deviation, TargetError, reason};
pub use self::observation::Observation;
use super::nanoseconds;
use super::process_names::named;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, Publisher, SetpointMessage};
use hexad_client::operator::requests::status;
use hexad_client::operator::status_report::{ProcessReport, StatusReport};
use hexad_client::realtime::clock::{Grid, sleep_until};
use hexad_core::control::constants::Constants;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::inputs::{Setpoint, SetpointKind};
use hexad_core::control::signals::limits::DerivativeLimits;
use hexad_core::control::signals::state::State;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::{TaskState, pose_of, task_coordinates};
use hexad_machine::analysis::target_motion::{REACHED_M, REACHED_RAD, check_target};
use hexad_machine::config::Config;

mod error;
mod observation;

/// Time within which the daemon must follow a published target \[ns\].
const FOLLOWING_LIMIT_NS: u64 = 3_000_000_000;

/// Largest difference between a published coordinate and the received one \[rad\], \[m\].
const SAME: f64 = 1e-12;

/// Longest time between two observations from which a velocity is computed \[s\].
const MAX_INTERVAL_S: f64 = 0.5;

/// X at which the platform stands under control, held after its source has ended; `None` if no daemon is in control.
/// An error with the reason if another source cannot take over.
pub fn request_held_x(config: &Config) -> Result<Option<[f64; 6]>, String> {
    let Some(answer) = status(&config.name).ok() else { return Ok(None) };
    let Some(seen) = Observation::of_answer(&answer, 0, &config.machine.home)
        .filter(|observation| observation.state.has_control())
    else {
        return Ok(None);
    };
    let report = answer.status.as_deref();
    if let Some(other) = report.and_then(other_source) {
        return Err(TargetError::OtherSource(other).to_string());
    }
    // Without setpoints, `on_violation = "limit"` holds the reference.
    let is_holding = DiagnosticCode::from_number(seen.code).is_some_and(DiagnosticCode::holds_pose);
    let held = if is_holding { seen.reference_or_measured_x } else { seen.target };
    let (Some(held), Some(reference)) = (held, seen.reference_or_measured_x) else {
        let state = seen.state.name();
        return Err(format!("the platform follows another source or a stop: the daemon is in {state}"));
    };
    let [mm, mrad] = distance(&reference, &held).map(|distance| 1e3 * distance);
    if is_reached(&reference, &held) {
        return Ok(Some(held));
    }
    Err(format!("the platform is still {mm:.3} mm and {mrad:.3} mrad from the target that it moves to"))
}

/// The target that is followed or held, if the platform can reach it.
pub fn reachable_target(constants: &Constants, seen: &Observation) -> Option<[f64; 6]> {
    seen.target.filter(|target| check_target(constants, &pose_of(target)).is_ok())
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

/// Another process that publishes setpoints and has not ended, by number and command.
pub fn other_source(report: &StatusReport) -> Option<String> {
    let sources = report.sources.iter().filter(|source| source.topic == "setpoint");
    let mut processes = sources.flat_map(|source| &source.processes);
    let lives =
        |process: &&ProcessReport| !process.command.is_empty() && process.process_id != std::process::id();
    processes.find(lives).map(|process| named(process.process_id))
}

/// What a source of targets needs from the daemon.
pub trait Feed {
    /// The newest observation, and an earlier one. An error if the daemon does not answer.
    fn observe(&mut self) -> Result<(&Observation, Option<&Observation>), TargetError>;

    /// Requests control, once, after the first target was published. An error if it was refused.
    fn request_control(&mut self) -> Result<(), TargetError>;
}

/// Source of targets.
pub struct TargetSource<'a, F> {
    config: &'a Config,
    setpoints: Publisher<SetpointMessage>,
    /// Observations.
    pub feed: F,
    grid: Grid,
    tick_ns: u64,
    /// Instant since which the state is active \[ns\].
    active_since_ns: Option<u64>,
    /// X of the last setpoint, and the instant of its first publication \[ns\].
    published: Option<([f64; 6], u64)>,
    /// Instant at which the source was opened \[ns\].
    began_ns: u64,
    /// Share of the limits of autonomous motions with which the next targets are approached.
    pub speed_share: f64,
}

impl<'a, F: Feed> TargetSource<'a, F> {
    /// Joins the machine. The platform must be under control, unless the source may request it.
    pub fn open(config: &'a Config, bus: &Bus, mut feed: F, may_engage: bool) -> Result<Self, TargetError> {
        if bus.is_simulated() {
            return Err(TargetError::Simulated);
        }
        let (now, _) = feed.observe()?;
        let is_active = now.state == State::Active;
        if !is_active && !may_engage {
            return Err(TargetError::NotInControl(now.state, reason(&now.text)));
        }
        let mut setpoints: Publisher<SetpointMessage> = bus.publisher()?;
        setpoints.begin_epoch();
        let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
        let began_ns = monotonic_ns();
        Ok(Self {
            config,
            setpoints,
            feed,
            grid,
            tick_ns: grid.next_after(began_ns),
            active_since_ns: is_active.then_some(began_ns),
            published: None,
            began_ns,
            speed_share: 1.0,
        })
    }

    /// Instant since which the platform follows \[ns\].
    pub fn active_since_ns(&self) -> Option<u64> {
        self.active_since_ns
    }

    /// X of the reference or of the platform now.
    pub fn present_x(&mut self) -> Result<[f64; 6], TargetError> {
        let (now, _) = self.feed.observe()?;
        now.reference_or_measured_x.ok_or_else(|| TargetError::UnknownPose(reason(&now.text)))
    }

    /// X at which the platform comes to rest if it brakes now with the limits of autonomous motions. The
    /// present X, if that one is outside the workspace.
    pub fn resting_or_present_x(&mut self, constants: &Constants) -> Result<[f64; 6], TargetError> {
        let (newest, before) = self.feed.observe()?;
        let of = |observation: &Observation| Some(pose_of(&observation.reference_or_measured_x?));
        let now = of(newest).ok_or_else(|| TargetError::UnknownPose(reason(&newest.text)))?;
        let earlier = before.and_then(|before| {
            let interval_s = seconds_since_or_0(before.time_ns, newest.time_ns);
            Some((of(before)?, interval_s))
                .filter(|_| interval_s > 0.0 && interval_s < MAX_INTERVAL_S && newest.state.has_control())
        });
        let Some((then, interval_s)) = earlier else { return self.present_x() };
        let moved = then.displacement_to(&now);
        let limits = &constants.parameters.limits;
        let age_s = seconds_since_or_0(newest.time_ns, monotonic_ns());
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
        self.send(&Setpoint { kind: SetpointKind::Target, target_speed_share: self.speed_share, ..motion })
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
            self.published = Some((x, monotonic_ns()));
        }
        if self.active_since_ns.is_none() {
            self.feed.request_control()?;
        }
        self.check()
    }

    /// Whether the platform is still under control by this source, or has come under control.
    fn check(&mut self) -> Result<(), TargetError> {
        let Some((x, published_ns)) = self.published else { return Ok(()) };
        let (now, _) = self.feed.observe()?;
        let Some(since_ns) = self.active_since_ns else {
            let has_control = now.state == State::Active && now.time_ns > self.began_ns;
            self.active_since_ns = has_control.then(monotonic_ns);
            return Ok(());
        };
        if now.time_ns < since_ns {
            return Ok(());
        }
        if !now.state.follows() {
            return Err(TargetError::Ended(now.state, reason(&now.text)));
        }
        // An older observation has another setpoint.
        let is_late = monotonic_ns().saturating_sub(published_ns.max(since_ns)) > FOLLOWING_LIMIT_NS;
        if is_late && now.time_ns >= published_ns && !has_received(now, &x) {
            return Err(TargetError::NotFollowed);
        }
        Ok(())
    }
}

/// Whether the newest setpoint that the daemon has is X.
pub fn has_received(observation: &Observation, x: &[f64; 6]) -> bool {
    let is_same = |received: [f64; 6]| received.iter().zip(x).all(|(a, b)| (a - b).abs() < SAME);
    observation.setpoint.is_some_and(is_same)
}
