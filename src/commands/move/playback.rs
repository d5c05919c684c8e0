//! Playback of a trajectory: the setpoint of each instant. It begins at the pose of the platform.

use nalgebra::Vector6;
use tracing::{info, warn};

use super::approach::unhurried_approach_s;
use super::engagement::Engagement;
use super::path::Path;
use super::trajectory::Trajectory;
use crate::commands::failure::Failure;
use hexad_client::messages::{StatusMessage, Subscriber};
use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad_core::control::signals::inputs::{Setpoint, SetpointKind};
use hexad_core::control::signals::limits::Limits;
use hexad_core::control::signals::state::State;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::task::TaskState;
use hexad_core::motion::timeline::Timeline;
use hexad_daemon::rate_change::RateChange;
use hexad_daemon::target_source::request_held_x;
use hexad_machine::config::Config;

/// Time without a status of a daemon in control, after which the approach starts again \[ns\].
const CONTROL_TIMEOUT_NS: u64 = 200_000_000;

/// Shortest time for which the last pose is published as a target \[ns\], so that the daemon reads many of these messages, and longest,
/// beside the settling time, for a platform that does not come into position.
const HOLD_TIME_NS: u64 = 100_000_000;
const LONGEST_HOLD_TIME_NS: u64 = 5_000_000_000;

/// Interval of the questions whether the platform is held for a source that has ended \[ns\].
const INQUIRY_INTERVAL_NS: u64 = 100_000_000;

/// Output of the playback at one instant.
pub(super) enum PlaybackStep {
    Silent,
    Setpoint(Setpoint),
    Finished,
}

/// Phase of the playback.
enum Phase {
    /// Until the pose is valid and no other source is followed.
    Waiting,
    /// At the pose of the platform, until the daemon takes control.
    Standing(Timeline),
    /// Playing since this instant \[ns\].
    Playing(Path, u64),
    /// Slowing down along the path since this instant \[ns\].
    Slowing(Path, RateChange, u64),
    /// At rest at this time of the path \[s\], until resumed.
    Paused(Path, f64),
    /// At rest at this pose since this instant \[ns\].
    Holding(TaskState, u64),
}

/// State of the playback of one trajectory.
pub(super) struct Playback<'a> {
    config: &'a Config,
    limits: Limits,
    trajectory: &'a Trajectory,
    statuses: Subscriber<StatusMessage>,
    engagement: Engagement,
    phase: Phase,
    /// The newest status.
    status: Option<StatusMessage>,
    /// Instant of the last status of a daemon in control \[ns\].
    last_active_ns: u64,
    /// Instant of the next question whether the platform is held for a source that has ended \[ns\].
    next_inquiry_ns: u64,
    /// Reason for waiting, as last logged, without its numbers.
    reason: String,
    /// Whether the platform is to stand under control at the end of the motion.
    is_to_hold: bool,
    /// Whether it ends when control ends: its own request for control is spent.
    ends_with_control: bool,
    /// Whether the platform is to come to rest for good, and whether until resumed.
    is_ending: bool,
    is_to_pause: bool,
}

impl<'a> Playback<'a> {
    pub fn new(
        config: &'a Config,
        trajectory: &'a Trajectory,
        is_to_hold: bool,
        statuses: Subscriber<StatusMessage>,
        engagement: Engagement,
    ) -> Self {
        Self {
            config,
            limits: config.deployment.limits.in_force(),
            trajectory,
            statuses,
            ends_with_control: matches!(engagement, Engagement::Socket { .. }),
            engagement,
            phase: Phase::Waiting,
            status: None,
            last_active_ns: 0,
            next_inquiry_ns: 0,
            reason: String::new(),
            is_to_hold,
            is_ending: false,
            is_to_pause: false,
        }
    }

    /// Whether the source may join, else the reason. In lock-step the daemon follows a source from its first message on, so that a
    /// platform that is held can be taken over only before it.
    pub fn may_join(&mut self) -> Result<(), String> {
        let held = request_held_x(self.config)
            .inspect_err(|reason| self.log_reason(&format!("waiting: {reason}")))?;
        self.phase = held.map_or(Phase::Waiting, |x| Phase::Standing(self.timeline(&x.into())));
        Ok(())
    }

    /// Reads all new statuses. An error if control has ended.
    pub fn receive(&mut self, now_ns: u64) -> Result<(), Failure> {
        while let Some(status) = self.statuses.receive() {
            self.update(now_ns, &status)?;
            self.status = Some(status);
        }
        Ok(())
    }

    /// Reads all new statuses and returns the setpoint of an instant.
    pub fn step(&mut self, now_ns: u64) -> Result<PlaybackStep, Failure> {
        self.receive(now_ns)?;
        let is_followed = matches!(self.phase, Phase::Playing(..) | Phase::Slowing(..) | Phase::Paused(..));
        if is_followed && now_ns.saturating_sub(self.last_active_ns) > CONTROL_TIMEOUT_NS {
            self.start_over()?;
        }
        self.setpoint(now_ns)
    }

    /// Brings the platform to rest along its path and holds it there. True if no motion is to be ended.
    pub fn slow_down(&mut self, now_ns: u64) -> bool {
        self.is_ending = true;
        match &self.phase {
            Phase::Waiting => true,
            Phase::Standing(timeline) => {
                let has_control =
                    self.status.as_ref().and_then(StatusMessage::state).is_some_and(State::has_control);
                self.phase = Phase::Holding(timeline.at(0.0, |t| self.trajectory.at(t)), now_ns);
                !has_control
            }
            Phase::Playing(path, since_ns) => {
                self.phase = self.slowing(*path, *since_ns, now_ns);
                false
            }
            Phase::Paused(path, t) => {
                self.phase = Phase::Holding(path.at(*t, self.trajectory), now_ns);
                false
            }
            Phase::Slowing(..) | Phase::Holding(..) => false,
        }
    }

    /// Pauses or resumes the motion, along its path, from rest to rest.
    pub fn set_paused(&mut self, now_ns: u64, is_to_pause: bool) {
        let has_changed = core::mem::replace(&mut self.is_to_pause, is_to_pause) != is_to_pause;
        match &self.phase {
            Phase::Playing(path, since_ns) if is_to_pause => {
                self.phase = self.slowing(*path, *since_ns, now_ns);
            }
            Phase::Paused(path, t) if !is_to_pause => {
                info!("resumed");
                self.phase = Phase::Playing(path.resumed(*t, &self.limits, self.trajectory), now_ns);
            }
            Phase::Waiting | Phase::Standing(_) if has_changed => {
                info!("{}", if is_to_pause { "paused: the motion will not begin" } else { "resumed" });
            }
            _ => {}
        }
    }

    fn slowing(&self, path: Path, since_ns: u64, now_ns: u64) -> Phase {
        let t = seconds_since_or_0(since_ns, now_ns);
        let slowdown = RateChange::to_rest(t, &self.limits, |t| path.at(t, self.trajectory));
        let then = if self.is_ending { "once more ends at once" } else { "hexad move --resume goes on" };
        info!("slowing down along the path, within {:.1} s; {then}", slowdown.duration_s);
        Phase::Slowing(path, slowdown, now_ns)
    }

    fn update(&mut self, now_ns: u64, status: &StatusMessage) -> Result<(), Failure> {
        let state = status.state().unwrap_or_default();
        let diagnostic = status.diagnostic.diagnostic().unwrap_or_default();
        let is_restarted = self.status.as_ref().is_some_and(|last| last.header.epoch != status.header.epoch);
        if is_restarted && !matches!(self.phase, Phase::Waiting | Phase::Standing(_)) {
            self.start_over()?;
        }
        match &self.phase {
            Phase::Waiting | Phase::Standing(_) => self.prepare(now_ns, status, state),
            Phase::Playing(..) | Phase::Slowing(..) | Phase::Paused(..) | Phase::Holding(..) => {
                self.follow(now_ns, state, diagnostic)
            }
        }
    }

    /// Before control: holds the pose of the platform, unless the daemon follows another source.
    fn prepare(&mut self, now_ns: u64, status: &StatusMessage, state: State) -> Result<(), Failure> {
        if let (Phase::Standing(timeline), State::Active) = (&self.phase, state) {
            info!("the daemon is in control: moving");
            self.engagement.note_control_begun();
            let path = Path::new(*timeline);
            (self.phase, self.last_active_ns) = (Phase::Playing(path, now_ns), now_ns);
            return Ok(());
        }
        // The setpoint must not change while the daemon engages.
        if !state.has_control() {
            self.phase = match status.pose_valid {
                1 => Phase::Standing(self.timeline(&Vector6::from(status.x))),
                _ => Phase::Waiting,
            };
        }
        Ok(())
    }

    fn timeline(&self, from: &Vector6<f64>) -> Timeline {
        let to = self.trajectory.at(0.0).x;
        let timeline = Timeline::new(&self.config.machine, from, &to, self.trajectory.duration());
        timeline.with_shortest_approach(unhurried_approach_s(&self.limits, from, &to))
    }

    /// Under control: ends after an operator's request, starts again after a fault.
    fn follow(&mut self, now_ns: u64, state: State, diagnostic: Diagnostic) -> Result<(), Failure> {
        let by_operator =
            matches!(diagnostic.code, DiagnosticCode::OperatorRequest | DiagnosticCode::EmergencyStop);
        let is_ended = !matches!(state, State::Active | State::Engaging);
        if is_ended && by_operator {
            return Err(ended(state, &diagnostic));
        }
        if state == State::Active {
            self.last_active_ns = now_ns;
        } else if !state.has_control() {
            // The status reports the end of control, so the timeout is not needed.
            self.last_active_ns = 0;
        }
        Ok(())
    }

    /// Starts again from the present pose. An error if the platform was to come to rest under control, or nobody waits for it to engage.
    fn start_over(&mut self) -> Result<(), Failure> {
        if self.ends_with_control || self.is_ending || matches!(self.phase, Phase::Holding(..)) {
            return Err(self.ended());
        }
        warn!("the daemon gave up control or is gone: starting again from the present pose");
        self.phase = Phase::Waiting;
        Ok(())
    }

    /// The error of control that has ended.
    fn ended(&self) -> Failure {
        let status = self.status.unwrap_or_default();
        match status.state().unwrap_or_default() {
            state if state.has_control() => Failure::after_start(
                "the motion has ended: no status of the daemon any more; is it stopped or killed?",
            ),
            state => ended(state, &status.diagnostic.diagnostic().unwrap_or_default()),
        }
    }

    fn setpoint(&mut self, now_ns: u64) -> Result<PlaybackStep, Failure> {
        let motion = |task| Ok(PlaybackStep::Setpoint(Setpoint::motion(now_ns, task)));
        match &self.phase {
            Phase::Waiting => {
                self.wait(now_ns)?;
                Ok(PlaybackStep::Silent)
            }
            Phase::Standing(timeline) => {
                let task = timeline.at(0.0, |t| self.trajectory.at(t));
                if let Some(status) = &self.status {
                    self.engagement.request(now_ns, status)?;
                }
                let reason =
                    "the setpoints hold the pose of the platform: waiting for control (hexad engage)";
                self.engagement.check_time(now_ns, reason)?;
                self.log_reason(reason);
                motion(task)
            }
            Phase::Playing(path, since_ns) => {
                let t = seconds_since_or_0(*since_ns, now_ns);
                let task = path.at(t, self.trajectory);
                match path.has_ended(t) {
                    true if self.is_to_hold => self.phase = Phase::Holding(task, now_ns),
                    true => return Ok(PlaybackStep::Finished),
                    false => {}
                }
                motion(task)
            }
            Phase::Slowing(path, slowdown, since_ns) => {
                let since_s = seconds_since_or_0(*since_ns, now_ns);
                let task = slowdown.at(since_s, |t| path.at(t, self.trajectory));
                if slowdown.has_ended(since_s) {
                    self.phase = if self.is_ending {
                        Phase::Holding(task, now_ns)
                    } else {
                        info!("paused");
                        Phase::Paused(*path, slowdown.own_time_s(since_s))
                    };
                }
                motion(task)
            }
            Phase::Paused(path, t) => motion(TaskState::at_rest(path.at(*t, self.trajectory).x.into())),
            Phase::Holding(task, since_ns) => self.hold(now_ns, task, now_ns.saturating_sub(*since_ns)),
        }
    }

    /// The pose of a task as a target, until the platform is in position there.
    fn hold(&self, now_ns: u64, task: &TaskState, held_ns: u64) -> Result<PlaybackStep, Failure> {
        if now_ns.saturating_sub(self.last_active_ns) > CONTROL_TIMEOUT_NS {
            return Err(self.ended());
        }
        let is_in_position = self.status.is_some_and(|status| status.in_position == 1);
        let longest_ns = LONGEST_HOLD_TIME_NS + self.config.deployment.in_position.settling_ns;
        if held_ns > if is_in_position { HOLD_TIME_NS } else { longest_ns } {
            let how =
                if is_in_position { "stands" } else { "is not in position ([in_position]); it is held" };
            info!("the platform {how} under control; hexad stop or park ends it");
            return Ok(PlaybackStep::Finished);
        }
        let task = TaskState::at_rest(task.x.into());
        let setpoint = Setpoint { kind: SetpointKind::Target, ..Setpoint::motion(now_ns, task) };
        Ok(PlaybackStep::Setpoint(setpoint))
    }

    /// Begins where the platform is held for a source that has ended. Otherwise logs why there is no setpoint yet.
    /// An error if that takes too long.
    fn wait(&mut self, now_ns: u64) -> Result<(), Failure> {
        let reason = match &self.status {
            None => "no status of a daemon".into(),
            Some(status) if status.state().is_some_and(State::has_control) => {
                if now_ns < self.next_inquiry_ns {
                    return Ok(());
                }
                self.next_inquiry_ns = now_ns + INQUIRY_INTERVAL_NS;
                match request_held_x(self.config) {
                    Ok(Some(x)) => {
                        self.phase = Phase::Standing(self.timeline(&x.into()));
                        return Ok(());
                    }
                    Ok(None) => "the daemon does not answer".into(),
                    Err(reason) => reason,
                }
            }
            Some(status) => {
                let diagnostic = status.diagnostic.diagnostic().unwrap_or_default();
                format!("the pose of the platform is unknown: {diagnostic}")
            }
        };
        self.engagement.check_time(now_ns, &reason)?;
        self.log_reason(&format!("waiting: {reason}"));
        Ok(())
    }

    /// Logs a reason once, however its numbers change.
    fn log_reason(&mut self, reason: &str) {
        let words = |text: &str| text.split(|c: char| c.is_ascii_digit()).collect::<String>();
        if self.reason != words(reason) {
            info!("{reason}");
            self.reason = words(reason);
        }
    }
}

fn ended(state: State, reason: &Diagnostic) -> Failure {
    let state = state.name();
    Failure::after_start(format_args!("the motion has ended: the daemon is in {state}: {reason}"))
}
