//! A controlled platform and what it feels, for the policies of setpoints.

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Setpoint, SetpointKind};
use hexad::control::signals::state::State;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::task::TaskState;
use nalgebra::Vector6;

use hexad_support::limit_check::{Largest, TrueMotion};
use hexad_support::rig::{Rig, parameters};
use hexad_support::{angle_between, deployed};

pub const MACHINES: [&str; 3] = ["fried2008", "motion_base", "tsai2000"];

/// The platform beside its reference: what a held force and the delay of the loop add to the limits.
pub const TRUE_ACCELERATION: f64 = 1.02;
/// Where legs are nearly flat small angles change much, and feedback takes part: the bound of reference and feedback together.
pub const TRUE_ACCELERATION_NEARLY_FLAT: f64 = 1.5;
pub const TRUE_JERK: f64 = 1.1;

pub fn with_policy(name: &str, policy: ViolationPolicy) -> Config {
    let mut config = deployed(name);
    config.deployment.setpoint.on_violation = policy;
    // Drives that can do what the limits allow at once, in every pose: the subject is the motion.
    config.machine.actuator.max_force_n *= 10.0;
    config
}

/// A controlled platform and what it has felt.
pub struct Ride {
    pub rig: Rig,
    pub home: TaskState,
    pub parameters: Parameters,
    pub felt: TrueMotion,
    /// The setpoint of a source that has ended.
    last: Option<Setpoint>,
}

impl Ride {
    /// Active at home.
    pub fn new(config: &Config) -> Self {
        let mut rig = Rig::new(config, &config.machine);
        let home = TaskState::at_rest(config.machine.home);
        rig.engage(&home);
        let parameters = parameters(config);
        let felt = TrueMotion::new(&rig, &parameters);
        Self { rig, home, parameters, felt, last: None }
    }

    /// One cycle with a setpoint of now, or with the last one again.
    pub fn cycle(&mut self, kind: SetpointKind, task: Option<TaskState>) -> Output {
        let mut input = self.rig.input(&task.unwrap_or_default());
        if let Some(setpoint) = input.setpoint.as_mut() {
            setpoint.kind = kind;
        }
        self.last = if task.is_some() { input.setpoint } else { self.last };
        input.setpoint = self.last;
        let output = self.rig.cycle(&input);
        self.felt.observe(&self.rig);
        output
    }

    /// One cycle that must be in control, without a diagnostic but for the pose that is held.
    pub fn follow(&mut self, task: Option<TaskState>) -> Output {
        let output = self.cycle(SetpointKind::Motion, task);
        assert!(matches!(output.state, State::Engaging | State::Active), "{output:?}");
        assert!(
            matches!(output.diagnostic.code, DiagnosticCode::None | DiagnosticCode::HoldingPose),
            "{output:?}"
        );
        assert_eq!(
            output.diagnostic.code == DiagnosticCode::HoldingPose,
            task.is_none() && output.state == State::Engaging
        );
        output
    }

    pub fn distance(&self, task: &TaskState) -> [f64; 2] {
        let (pose, wanted) = (self.rig.simulator().state().pose, task.motion().pose);
        [(pose.position - wanted.position).norm(), angle_between(&pose.rotation, &wanted.rotation)]
    }

    /// Difference of the velocities \[m/s\] and of the angular velocities \[rad/s\].
    pub fn velocity_error(&self, task: &TaskState) -> [f64; 2] {
        let (twist, wanted) = (self.rig.simulator().state().twist, task.motion().twist);
        [(twist.linear - wanted.linear).norm(), (twist.angular - wanted.angular).norm()]
    }

    /// The limits of the true motion; each of velocity, acceleration and jerk at least this much used.
    pub fn assert_limits(&self, used: [f64; 3], what: &str) {
        let Largest { velocity, acceleration, jerk, leg_rate, condition, room, .. } = self.felt.largest;
        println!("{what}: {:.4?}", self.felt.largest);
        let is_flat = condition
            > 2.0
                * KinematicState::new(self.rig.simulator().machine(), self.home.motion().pose)
                    .sensitivity()
                    .condition;
        let most = if is_flat { TRUE_ACCELERATION_NEARLY_FLAT } else { TRUE_ACCELERATION };
        let within = |found: f64, used: f64, bound: f64| (used..=bound).contains(&found);
        assert!(within(velocity, used[0], 1.001), "{what}: velocity {velocity}");
        assert!(within(acceleration, used[1], most), "{what}: acceleration {acceleration}");
        assert!(within(jerk, used[2], TRUE_JERK), "{what}: jerk {jerk}");
        assert!(
            leg_rate <= 1.001 && condition <= self.parameters.max_condition,
            "{what}: {leg_rate} {condition}"
        );
        // The platform may be beside its reference by some micrometres.
        assert!(room > -2e-5, "{what}: {room} m beyond the margin of the stroke");
    }
}

pub fn beside(home: &TaskState, offset: Vector6<f64>) -> TaskState {
    TaskState { x: home.x + offset, ..TaskState::default() }
}
