//! One world in each state, a moment before something goes wrong.

use hexad::analysis::envelope;
use hexad::config::Config;
use hexad::control::controller::Controller;
use hexad::control::law::ControlMode;
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::limits::DerivativeLimits;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};

use super::world::{Source, World};
use hexad_support::deployed;
use hexad_support::rig::{Rates, Rig, parameters};

/// In the order of the columns of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    Standby,
    Engaging,
    AtRest,
    InMotion,
    Stopping,
    Parking,
    Fault,
}

impl Situation {
    pub const ALL: [Self; 7] = [
        Self::Standby,
        Self::Engaging,
        Self::AtRest,
        Self::InMotion,
        Self::Stopping,
        Self::Parking,
        Self::Fault,
    ];

    pub fn state(self) -> State {
        match self {
            Self::Standby => State::Standby,
            Self::Engaging => State::Engaging,
            Self::AtRest | Self::InMotion => State::Active,
            Self::Stopping => State::Stopping,
            Self::Parking => State::Parking,
            Self::Fault => State::Fault,
        }
    }

    /// Before anything goes wrong.
    pub fn begins(self) -> (State, DiagnosticCode) {
        let cause = match self {
            Self::Standby => DiagnosticCode::ReadyToEngage,
            Self::Engaging | Self::AtRest | Self::InMotion => DiagnosticCode::None,
            Self::Stopping | Self::Parking => DiagnosticCode::OperatorRequest,
            Self::Fault => DiagnosticCode::EmergencyStop,
        };
        (self.state(), cause)
    }

    /// A machine for a person, in this situation.
    pub fn world(self, mode: ControlMode, policy: ViolationPolicy, rates: Rates) -> World {
        let (mut config, _) = machine(mode);
        config.deployment.setpoint.on_violation = policy;
        // The model is exact here, and the file states that.
        config.machine.actuator.friction_uncertainty_n = 0.0;
        if self == Self::Engaging {
            config.deployment.limits.reference.autonomous_scale = SLOW_SCALE;
        }
        let parameters = Parameters { max_age_at_arrival_ns: MAX_MEASURED_AGE_NS, ..parameters(&config) };
        let mut rig = Rig::new(&config, &config.machine);
        rig.controller = Controller::new(&config.machine, parameters);
        let mut world = World::new(rig, &config.machine, parameters);
        world.rates = rates;
        // Without rates, rest is shown by lengths over a while.
        world.run(50);
        let mut home = TaskState::at_rest(config.machine.home);
        match self {
            Self::Standby => {}
            Self::Engaging => {
                home.x[5] += 0.75 * parameters.engage_position_m;
                world.source = Source::Still(home);
                world.ask(Request::Engage);
                world.run(30);
            }
            Self::AtRest => {
                world.ask(Request::Engage);
                world.until(|output| output.state == State::Active);
                // In a mode without weight the platform sags for a while.
                world.run(500);
            }
            Self::InMotion => moving(&mut world),
            Self::Stopping => {
                moving(&mut world);
                world.ask(Request::Stop);
                world.run(20);
            }
            Self::Parking => {
                moving(&mut world);
                world.ask(Request::Park);
                world.until(|output| output.state == State::Parking);
                world.run(100);
            }
            Self::Fault => {
                moving(&mut world);
                world.ask(Request::Estop);
                world.run(200);
            }
        }
        let output = world.cycle(|_, _| {});
        assert_eq!((output.state, output.diagnostic.code), self.begins());
        world.recording.samples.clear();
        world
    }
}

/// The motion base, with an envelope that ends before the stroke does in one axis only, and a plant that is
/// fast to compute.
pub fn machine(mode: ControlMode) -> (Config, Parameters) {
    let mut config = deployed("motion_base");
    config.deployment.control.mode = mode;
    config.deployment.control.compensate_disturbances = mode.includes_inertia();
    config.deployment.plant.step_s = 1e-3;
    // The table is that of limits whose defaults its drives cannot give all at once.
    config.deployment.limits.reference.orientation =
        DerivativeLimits { velocity: 2.0, acceleration: 20.0, jerk: 2000.0 };
    config.deployment.control.following_velocity_rad_s = 0.6;
    let wide = [0.5, 0.5, GAMMA_RANGE, 1.0, 1.0, 1.0];
    config.deployment.envelope = Some(envelope::EnvelopeBounds {
        pose_min: wide.map(|x| -x),
        pose_max: wide,
        velocity: [1.0; 6],
        acceleration: [1.0; 6],
    });
    let parameters = parameters(&config);
    (config, parameters)
}

/// Less than the timeout of measurements, as in loops with higher bandwidths.
const MAX_MEASURED_AGE_NS: u64 = 12_000_000;

/// With this share of the limits it engages so slowly that every timeout is over before.
const SLOW_SCALE: f64 = 0.02;

/// Of the envelope about home \[rad\].
pub const GAMMA_RANGE: f64 = 0.3;

/// Active, in the middle of sines on all axes.
fn moving(world: &mut World) {
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    let scene = fit(&world.machine, BuiltInMotion::Sines, 8.0);
    world.source = Source::Plays(scene, world.rig.now_ns);
    world.run(1900);
    let speed = world.rig.simulator().state().twist.linear.norm();
    assert!(speed > 0.2, "{speed}");
}
