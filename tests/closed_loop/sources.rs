//! The chart of sources and targets in `docs/operator.md`: each of its cells is played, and the outcome must be that of the
//! cell. What stands behind its colon is not played.

use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::inputs::SetpointKind;
use hexad::control::signals::state::{AfterStop, Request, State};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use nalgebra::Vector6;

use super::ride::{Ride, beside, with_policy};

const GUIDE: &str = include_str!("../../docs/operator.md");
/// First line of the chart.
const HEADING: &str = "| state | event | `\"stop\"` | `\"limit\"` |";
const MACHINE: &str = "motion_base";

/// Cycles of a scene at most, and of the motion that a scene in motion has played before the event.
const CYCLES: u32 = 8000;
const PLAYED: u32 = 1300;

/// A scene: the platform before the event, and what happens then.
struct Scene<'a> {
    ride: Ride,
    motion: FittedMotion,
    state: &'a str,
    event: &'a str,
}

impl<'a> Scene<'a> {
    fn new(policy: ViolationPolicy, state: &'a str, event: &'a str) -> Self {
        let mut config = with_policy(MACHINE, policy);
        config.deployment.setpoint.approach = event.contains("setpoint.approach");
        config.deployment.setpoint.holds_on_return = event.contains(r#"on_return = "hold""#);
        let goals = [("park", AfterStop::Park), ("stop", AfterStop::Standby)];
        let goal = goals.iter().find(|(goal, _)| event.contains(&format!(r#"on_setpoint_lost = "{goal}""#)));
        if let Some((_, goal)) = goal {
            (config.deployment.control.on_setpoint_lost, config.deployment.control.lost_hold_s) =
                (*goal, 0.5);
        }
        let motion = fit(&config.machine, BuiltInMotion::Sines, 8.0);
        let mut scene = Self { ride: Ride::new(&config), motion, state, event };
        scene.prepare();
        scene
    }

    /// Brings the platform into the state.
    fn prepare(&mut self) {
        match self.state {
            "standby" | "standby, without setpoints" => {
                self.request(Request::Stop, State::Standby);
                // The brakes close.
                let task = (self.state == "standby").then_some(self.ride.home);
                self.repeat(500, SetpointKind::Motion, task);
            }
            "active, at rest" => {}
            "active, at a target" => self.repeat(3000, SetpointKind::Target, Some(self.target())),
            "active, on the way to a target" => self.repeat(100, SetpointKind::Target, Some(self.target())),
            "fault" => self.request(Request::Estop, State::Fault),
            "active, in motion" | "stopping" | "parking" | "engaging, holds its pose (11)" => {
                for k in 0..PLAYED {
                    let task = self.playing(k, Vector6::zeros());
                    self.ride.cycle(SetpointKind::Motion, Some(task));
                }
                match self.state {
                    "stopping" => self.ride.rig.ask(Request::Stop),
                    "parking" => self.request(Request::Park, State::Parking),
                    "engaging, holds its pose (11)" => self.repeat(2000, SetpointKind::Motion, None),
                    _ => {}
                }
            }
            state => panic!("the chart has an unknown state: {state}"),
        }
    }

    fn repeat(&mut self, cycles: u32, kind: SetpointKind, task: Option<TaskState>) {
        (0..cycles).for_each(|_| _ = self.ride.cycle(kind, task));
    }

    fn request(&mut self, request: Request, state: State) {
        self.ride.rig.ask(request);
        let home = self.ride.home;
        let reached = (0..CYCLES).any(|_| self.ride.cycle(SetpointKind::Motion, Some(home)).state == state);
        assert!(reached, "{request:?}");
    }

    fn target(&self) -> TaskState {
        beside(&self.ride.home, Vector6::new(0.0, 0.05, 0.0, 0.03, 0.0, 0.02))
    }

    fn playing(&self, k: u32, offset: Vector6<f64>) -> TaskState {
        let mut task = self.motion.at(f64::from(k) * 1e-3);
        task.x += offset;
        task
    }

    /// What the event sends in a cycle after it; `None` for nothing.
    fn sent(&self, k: u32, begins_at: &TaskState) -> (SetpointKind, Option<TaskState>) {
        let far = Vector6::new(0.0, 0.0, 0.0, 0.02, -0.01, 0.0);
        let event = self.event.trim_start_matches("`engage`, ").split(';').next().unwrap_or_default();
        match event {
            "setpoints where the platform stands" => (SetpointKind::Motion, Some(*begins_at)),
            "setpoints in motion, away from the platform" => {
                (SetpointKind::Motion, Some(self.playing(PLAYED + k, far)))
            }
            "no setpoints" | "its source ends" => (SetpointKind::Motion, None),
            "a target" => (SetpointKind::Target, Some(self.target())),
            "the setpoint jumps" => (SetpointKind::Motion, Some(beside(begins_at, far))),
            "poses alone" => {
                let pose = self.playing(PLAYED + k, Vector6::zeros()).x.into();
                (SetpointKind::Pose, Some(TaskState::at_rest(pose)))
            }
            _ => panic!("the chart has an unknown event: {event}"),
        }
    }

    /// Plays the event, and compares what comes with a cell.
    fn play(mut self, cell: &str) -> Result<(), String> {
        if self.event.starts_with("`engage`") {
            self.ride.rig.ask(Request::Engage);
        }
        let begins_at = self.ride.rig.simulator().state();
        let begins_at = TaskState::at_rest(task_coordinates(&begins_at.pose, &self.ride.home.x.into()));
        let (mut last, mut output) = (None, None);
        for k in 0..CYCLES {
            let (kind, task) = self.sent(k, &begins_at);
            last = task;
            output = Some(self.ride.cycle(kind, task));
        }
        let output = output.unwrap();
        let (state, code, refused) =
            (output.state, output.diagnostic.code as u32, output.request_diagnostic.code as u32);
        let goal = match last {
            Some(task) if cell.contains("on the setpoint") => Some(task),
            _ if cell.contains("at the target") => Some(self.target()),
            _ if cell.contains("at home") => Some(self.ride.home),
            _ => None,
        };
        let distance = goal.map_or([0.0; 2], |goal| self.ride.distance(&goal));
        let speed = self.ride.rig.simulator().state().twist.vector().norm();
        let found =
            format!("{state:?} ({code}), refused ({refused}), {distance:?} from there, {speed:.1e} m/s");
        let numbers: Vec<u32> = cell.split(['(', ')']).filter_map(|part| part.parse().ok()).collect();
        let expected_code = numbers.first().copied().unwrap_or(0);
        let is_state = cell.starts_with(state.name());
        let is_code = if cell.contains("refused") { refused } else { code } == expected_code;
        let is_there = distance.into_iter().all(|distance| distance < 2e-4);
        let is_at_rest = cell.contains("on the setpoint") || speed < 1e-3;
        self.ride.assert_limits([0.0; 3], &format!("{} | {} | {cell}: {found}", self.state, self.event));
        if is_state && is_code && is_there && is_at_rest {
            return Ok(());
        }
        Err(format!("{} | {} | {cell}: {found}", self.state, self.event))
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn each_cell_of_the_chart_of_sources_holds() {
    let rows =
        GUIDE.lines().skip_while(|line| *line != HEADING).skip(2).take_while(|line| line.starts_with('|'));
    let mut wrong = vec![];
    let mut cells = 0;
    for row in rows {
        let [_, state, event, stop, limit, _] = row.split('|').map(str::trim).collect::<Vec<_>>()[..] else {
            panic!("not a row of the chart: {row}");
        };
        for (policy, cell) in [(ViolationPolicy::Stop, stop), (ViolationPolicy::Limit, limit)] {
            if cell != "-" {
                cells += 1;
                wrong.extend(Scene::new(policy, state, event).play(cell).err());
            }
        }
    }
    assert!(cells >= 30 && wrong.is_empty(), "{cells} cells, wrong:\n{}", wrong.join("\n"));
}

/// A source that was paused, and whose motion the limits do not allow to follow: once the platform has been near, it is
/// active, as it was before with the same motion and error.
#[test]
#[ignore = "second tier: takes long"]
fn a_platform_that_was_near_its_setpoint_is_active_within_two_seconds() {
    for jerk in [10.0, 12.0, 14.0, 16.0, 18.0] {
        let mut config = with_policy(MACHINE, ViolationPolicy::Limit);
        config.deployment.limits.reference.position.jerk = jerk;
        config.deployment.limits.reference.orientation.jerk = jerk;
        let motion = fit(&config.machine, BuiltInMotion::Sines, 8.0);
        let mut ride = Ride::new(&config);
        let Parameters { engage_position_m, engage_orientation_rad, law, .. } = ride.parameters;
        let is_near = |ride: &Ride, task: &TaskState| {
            let [linear, angular] = ride.distance(task);
            let [velocity, angular_velocity] = ride.velocity_error(task);
            linear.max(velocity / law.position.kp_per_s2.sqrt()) < engage_position_m
                && angular.max(angular_velocity / law.orientation.kp_per_s2.sqrt()) < engage_orientation_rad
        };
        let (mut near, mut active): (Option<u32>, Option<u32>) = (None, None);
        for k in 0..40_000 {
            let task = motion.at(f64::from(k % 8000) * 1e-3);
            let is_paused = (4000..6000).contains(&k);
            let state = ride.follow((!is_paused).then_some(task)).state;
            if k > 6000 {
                near = near.or_else(|| is_near(&ride, &task).then_some(k));
                active = active.or_else(|| (state == State::Active).then_some(k));
            }
        }
        println!("jerk {jerk}: near in cycle {near:?}, active in cycle {active:?}");
        let delay = near.zip(active).map(|(near, active)| active.saturating_sub(near));
        assert!(delay.is_some_and(|delay| delay < 2000), "jerk {jerk}: near {near:?}, active {active:?}");
    }
}
