//! Setpoints along the path of a tool: a target alone does not keep rotation and translation in proportion.

use core::ops::ControlFlow;

use crate::precheck::Precheck;
use crate::rate_change::RateChange;
use crate::target_source::TargetError;
use hexad_core::control::signals::limits::Limits;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::task::TaskState;
use hexad_machine::analysis::target_motion::TargetRefusal;
use hexad_machine::analysis::tool_motion::ToolMotion;
use hexad_machine::config::Config;

/// Factor to the next longer duration, and number of durations: up to 30 times the shortest.
const FACTOR: f64 = 1.25;
const DURATIONS: i32 = 16;

/// Least cosine of beta on the way: the rates of alpha and gamma then have ten digits.
const MIN_COS_BETA: f64 = 1e-3;

/// Motion of a tool that is published from its first setpoint on.
#[derive(Clone, Copy, Debug)]
pub struct ToolStream {
    motion: ToolMotion,
    /// Home, near which the angles are.
    near: [f64; 6],
    limits: Limits,
    began_ns: Option<u64>,
    /// The way to rest along the path, and when it began \[ns\].
    slowdown: Option<(RateChange, u64)>,
}

impl ToolStream {
    /// The motion, as much slower as the daemon needs to follow it. `go_on` says whether to go on.
    pub fn new(config: &Config, fastest: ToolMotion, go_on: impl Fn() -> bool) -> Result<Self, TargetError> {
        let near = config.machine.home;
        let has_rates = |state: TaskState| libm::cos(state.x.y).abs() >= MIN_COS_BETA;
        if !fastest.samples().all(|(t, _)| fastest.task_state(t, &near).is_some_and(has_rates)) {
            return Err(TargetError::AngleRates);
        }
        let limits = config.deployment.limits.in_force();
        let precheck = Precheck::new(config);
        let mut refused = None;
        for k in 0..DURATIONS {
            let motion = fastest.slower(FACTOR.powi(k));
            let stream = Self { motion, near, limits, began_ns: None, slowdown: None };
            refused = None;
            let refuse = |refusal| {
                refused = Some(refusal);
                ControlFlow::Break(())
            };
            precheck.follow(|t| stream.task(t), [0.0, motion.duration_s], refuse, |_| go_on());
            if !go_on() {
                return Err(TargetRefusal::Interrupted.into());
            }
            if refused.is_none() {
                return Ok(stream);
            }
        }
        let reason = refused.map_or_else(String::new, |refused| refused.to_string());
        Err(TargetError::NotFollowable(fastest.slower(FACTOR.powi(DURATIONS - 1)).duration_s, reason))
    }

    /// The motion.
    pub fn motion(&self) -> &ToolMotion {
        &self.motion
    }

    /// X, X', X'' at an instant; `None` after the end.
    pub fn next(&mut self, now_ns: u64) -> Option<TaskState> {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        if let Some((slowdown, since_ns)) = self.slowdown {
            let since_s = seconds_since_or_0(since_ns, now_ns);
            return (!slowdown.has_ended(since_s)).then(|| slowdown.at(since_s, |t| self.task(t)));
        }
        let t = seconds_since_or_0(began_ns, now_ns);
        (t < self.motion.duration_s).then(|| self.task(t))
    }

    /// Slows down along the path from an instant on. Returns X at rest; `None` if the tool does not move.
    pub fn slow_down(&mut self, now_ns: u64) -> Option<[f64; 6]> {
        let t = seconds_since_or_0(self.began_ns?, now_ns);
        if t >= self.motion.duration_s {
            return None;
        }
        let slowdown = RateChange::to_rest(t, &self.limits, |t| self.task(t));
        self.slowdown = Some((slowdown, now_ns));
        Some(self.task(slowdown.own_time_s(slowdown.duration_s)).x.into())
    }

    fn task(&self, t: f64) -> TaskState {
        // It has rates everywhere, as examined; zeros would be refused.
        self.motion.task_state(t, &self.near).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants;
    use hexad_core::model::rigid::Pose;
    use hexad_core::model::task::pose_of;
    use hexad_core::motion::frames::Frames;
    use hexad_core::motion::tool_path::ToolPath;
    use nalgebra::Vector3;

    const MACHINE: &str = include_str!("../../../config/fried2008.toml");

    /// A tool 0.3 m from the platform's origin that turns: its origin stays to a picometre at every setpoint, also while it is
    /// interrupted, and the daemon follows.
    #[test]
    fn a_tool_stays_on_its_path_to_the_end_and_when_interrupted() {
        let config = Config::parse(MACHINE, "a test").unwrap();
        let constants = constants(&config);
        let tool = Pose { position: Vector3::new(0.3, 0.0, 0.0), ..Frames::default().tool };
        let frames = Frames { tool, ..Frames::default() };
        let home = frames.tool_pose(&config.machine.home_pose());
        let turned = Pose { rotation: pose_of(&[0.05, 0.08, -0.1, 0.0, 0.0, 0.0]).rotation, ..home };
        let path = ToolPath::new(frames, &config.machine.home_pose(), &frames.platform_pose(&turned));
        let fastest = ToolMotion::fastest(&constants, path, 1.0).unwrap();
        let planned = ToolStream::new(&config, fastest, || true).unwrap();
        assert!(planned.motion.duration_s < 1.3 * fastest.duration_s, "{}", planned.motion.duration_s);
        for interrupted_ns in [u64::MAX, 0, 300_000_000] {
            let (mut stream, mut resting, mut last) = (planned, None, None);
            for k in 1.. {
                let now_ns = k * 1_000_000;
                if now_ns > interrupted_ns && stream.began_ns.is_some() && resting.is_none() {
                    resting = stream.slow_down(now_ns);
                }
                let Some(task) = stream.next(now_ns) else { break };
                let off = frames.tool_pose(&task.motion().pose).position - home.position;
                assert!(off.norm() < 1e-12, "{off} at {k} ms");
                last = Some(task);
            }
            let end = resting.map_or(frames.platform_pose(&turned), |x| pose_of(&x));
            let left = last.unwrap().motion().pose.displacement_to(&end);
            assert!(left.vector().amax() < 1e-6, "{left:?} from rest");
        }
    }

    #[test]
    fn a_way_that_leaves_the_workspace_is_refused() {
        let config = Config::parse(MACHINE, "a test").unwrap();
        let constants = constants(&config);
        let mut far = config.machine.home_pose();
        far.position.z += 5.0;
        let path = ToolPath::new(Frames::default(), &config.machine.home_pose(), &far);
        let refusal = ToolMotion::fastest(&constants, path, 1.0).unwrap_err().to_string();
        assert!(refusal.starts_with("the target is outside of the workspace: leg"), "{refusal}");
    }
}
