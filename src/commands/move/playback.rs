//! Playback of a trajectory: the setpoint of each instant, from the pose at which the platform stands.

use nalgebra::Vector6;
use tracing::{info, warn};

use super::trajectory::Trajectory;
use crate::commands::operate::Operator;
use crate::config::Config;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::limits::{DerivativeLimits, Limits};
use crate::control::state::{Request, State};
use crate::messages::PortError;
use crate::messages::StatusMessage;
use crate::model::machine::Machine;
use crate::model::task::TaskState;
use crate::motion::minimum_jerk::shortest_duration;
use crate::motion::timeline::Timeline;

/// Share of each limit that the approach uses; the rest is for angles that turn at once and add up.
const APPROACH_SHARE: f64 = 0.5;

/// Longest time without a status of a daemon in control, after which the approach starts over \[ns\].
const CONTROL_TIMEOUT_NS: u64 = 200_000_000;

/// Output of the playback at one instant.
pub(super) enum PlaybackStep {
    Silent,
    Setpoint(TaskState),
    Finished,
}

/// State of the playback of one trajectory.
pub(super) struct Playback<'a> {
    machine: &'a Machine,
    limits: &'a Limits,
    trajectory: &'a Trajectory,
    operator: Operator,
    /// Whether to request control, until the daemon has taken it.
    engage: bool,
    /// Approach and trajectory, from the pose at which the platform stands, or stood when the daemon took control.
    timeline: Option<Timeline>,
    /// Instant since which the daemon is in control \[ns\].
    engaged_ns: Option<u64>,
    /// Instant of the last status of a daemon in control \[ns\].
    last_active_ns: u64,
}

impl<'a> Playback<'a> {
    pub fn new(config: &'a Config, trajectory: &'a Trajectory, operator: Operator, engage: bool) -> Self {
        let Config { machine, deployment, .. } = config;
        let limits = &deployment.limits.reference;
        Self {
            machine,
            limits,
            trajectory,
            operator,
            engage,
            timeline: None,
            engaged_ns: None,
            last_active_ns: 0,
        }
    }

    /// Reads the newest status and returns the setpoint of an instant.
    pub fn step(&mut self, now_ns: u64) -> Result<PlaybackStep, PortError> {
        if let Some(status) = self.operator.status() {
            self.update(now_ns, &status);
            if self.engage && status.diagnostic.code == DiagnosticCode::ReadyToEngage as u32 {
                self.operator.send(Request::Engage)?;
            }
        }
        if self.engaged_ns.is_some() && now_ns.saturating_sub(self.last_active_ns) > CONTROL_TIMEOUT_NS {
            warn!("the daemon gave up control or is gone: starting over from where the platform stands");
            (self.engaged_ns, self.timeline) = (None, None);
        }
        let Some(timeline) = &self.timeline else { return Ok(PlaybackStep::Silent) };
        // Until the daemon engages, the setpoint is the pose at which the platform stands.
        let t = self.engaged_ns.map_or(0.0, |engaged_ns| now_ns.saturating_sub(engaged_ns) as f64 * 1e-9);
        Ok(if t > timeline.end() {
            PlaybackStep::Finished
        } else {
            PlaybackStep::Setpoint(timeline.at(t, |t| self.trajectory.at(t)))
        })
    }

    fn update(&mut self, now_ns: u64, status: &StatusMessage) {
        let state = State::from_number(status.state).unwrap_or_default();
        // If an operator ends the control, no further request follows.
        self.engage &= !state.has_control();
        if state == State::Active && self.timeline.is_some() {
            self.last_active_ns = now_ns;
            if self.engaged_ns.is_none() {
                info!("the daemon is in control: moving");
                self.engaged_ns = Some(now_ns);
            }
        } else if !state.has_control() {
            // The status reports the end of control: no need to wait for the timeout.
            self.last_active_ns = 0;
            if self.engaged_ns.is_none() && status.pose_valid == 1 {
                let (from, to) = (Vector6::from(status.x), self.trajectory.at(0.0).x);
                let timeline = Timeline::new(self.machine, &from, &to, self.trajectory.duration());
                self.timeline = Some(timeline.with_shortest_approach(approach_s(self.limits, &from, &to)));
            }
        }
        // While the daemon engages, the setpoint must not change. While the platform follows the setpoints of another
        // source, this one publishes none.
    }
}

/// Duration \[s\] of an approach that keeps the limits, in any direction.
fn approach_s(limits: &Limits, from: &Vector6<f64>, to: &Vector6<f64>) -> f64 {
    let way = to - from;
    // No angle turns the platform further than by itself.
    let angle = way.fixed_rows::<3>(0).abs().sum();
    let shortest = |way: f64, limits: &DerivativeLimits| {
        let DerivativeLimits { velocity, acceleration, jerk } = limits.scaled(APPROACH_SHARE);
        shortest_duration(way, [velocity, acceleration, jerk])
    };
    shortest(angle, &limits.orientation).max(shortest(way.fixed_rows::<3>(3).norm(), &limits.position))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use crate::commands::r#move::precheck::Precheck;

    /// From far and turned, under limits of which each binds once; a quarter of the time would not do.
    #[test]
    fn the_approach_keeps_the_limits() {
        for tight in
            ["velocity_m_s = 0.02", "acceleration_m_s2 = 0.02", "jerk_m_s3 = 0.05", "jerk_rad_s3 = 0.1"]
        {
            let config = Config::parse(&format!("{DEFAULT_CONFIG}\n[limits]\n{tight}\n"), "a test").unwrap();
            let home = Vector6::from(config.machine.home);
            let from = home + Vector6::new(0.08, -0.1, 0.09, 0.06, 0.05, -0.04);
            let precheck = Precheck::new(&config);
            let refused = |share: f64| {
                let duration_s = share * approach_s(&config.deployment.limits.reference, &from, &home);
                let timeline =
                    Timeline::new(&config.machine, &from, &home, 1.0).with_shortest_approach(duration_s);
                let at = |t| timeline.at(t, |_| TaskState::at_rest(config.machine.home));
                // In one piece: where the reference begins anew it has fallen behind nothing.
                precheck.refusal(at, [0.0, timeline.motion_start()])
            };
            assert!(refused(1.0).is_none(), "{tight}: {:?}", refused(1.0));
            assert!(refused(0.25).is_some(), "{tight}");
        }
    }
}
