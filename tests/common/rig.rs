//! The loop without threads: measurement and setpoint at k T, release at k T + T / 2, force on the platform
//! from 100 us after the release on.

use std::collections::BTreeMap;
use std::sync::Mutex;

use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};

use hexad::config::Config;
use hexad::config::deployment::FidelityChoice;
use hexad::control::law::input_matrix::InputMatrix;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::errors::{ErrorEstimate, FeedbackAcceleration};
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon;
use hexad::model::LEGS;
use hexad::model::fidelity::Fidelity;
use hexad::model::machine::Machine;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad::motion::timeline::Timeline;
use hexad::plant::simulator::Simulator;
use nalgebra::Vector6;

use super::{Errors, Remembered, angle_between, remembered};

/// What reading, computing and sending take, about as on a common computer.
const FORCE_DELAY_NS: u64 = 100_000;

/// In cycles; a second is more than the gentlest of motions onto a setpoint as near as it must be.
const LONGEST_ENGAGING: u32 = 1000;

/// The first cycle; the clock of a computer that has been up for a while.
const START_NS: u64 = 86_400_000_000_000;

/// What a deployment's sections mean to the controller. Remembered, as the age at which a loop is stable takes a tenth of a second.
pub fn parameters(config: &Config) -> Parameters {
    static KNOWN: Remembered<Parameters> = Mutex::new(BTreeMap::new());
    let fidelity = match config.deployment.control.fidelity {
        FidelityChoice::Fixed(fidelity) => fidelity,
        FidelityChoice::Auto => Fidelity::Exact,
    };
    let make = || daemon::parameters(&config.machine, &config.deployment, fidelity);
    remembered(&KNOWN, &format!("{config:?}"), make)
}

/// Acceleration that the law answers a first measured error with, after rest without one: the gains of the estimator, its
/// prediction to the force 0.6 periods after the measurement, and the law.
pub fn answer(config: &Config, error: &Vector6<f64>) -> Vector6<f64> {
    let parameters = parameters(config);
    let (_, [[by_e, by_w, by_d], _]) = parameters.noise.steady();
    let period_s = parameters.noise.period_s;
    let input_matrix = InputMatrix::at_home(
        &config.machine,
        parameters.law.mode,
        &parameters.law.leg_masses,
        parameters.fidelity,
    );
    let largest = input_matrix.largest_compensable_disturbance(&parameters.law.max_compensated_disturbance);
    let estimate = ErrorEstimate {
        value: error * by_e,
        rate: error * (by_w / period_s),
        disturbance: (error * (by_d / (period_s * period_s))).sup(&-largest).inf(&largest),
    };
    let at_force = estimate.after(0.6 * period_s, &FeedbackAcceleration::default());
    parameters.law.commanded_acceleration(&at_force, &input_matrix).0
}

/// A controller, a platform, and what is between them.
#[derive(Clone)]
pub struct Rig {
    pub controller: Controller,
    pub simulator: Simulator,
    pub now_ns: u64,
    pub period_ns: u64,
    /// The newest request.
    pub asked: Option<OperatorRequest>,
    /// On the platform now.
    pub force: Option<[f64; LEGS]>,
}

/// How far the platform was from where it should have been.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tracking {
    pub position: Errors,
    pub orientation: Errors,
}

impl Rig {
    /// The platform may differ from what the controller thinks.
    pub fn new(config: &Config, platform: &Machine) -> Self {
        let plant = &config.deployment.plant;
        let parameters = parameters(config);
        Self {
            controller: Controller::new(&config.machine, parameters),
            simulator: Simulator::new(platform, plant.brake_deceleration_m_s2, plant.step_s),
            now_ns: START_NS,
            period_ns: parameters.period_ns,
            asked: None,
            force: None,
        }
    }

    /// A request, from the next input on.
    pub fn ask(&mut self, request: Request) {
        let number = self.asked.map_or(1, |asked| asked.message.sequence + 1);
        self.asked =
            Some(OperatorRequest { request, message: MessageId { epoch: START_NS, sequence: number } });
    }

    /// Asks to engage and goes on until active, on a setpoint at rest.
    pub fn engage(&mut self, task: &TaskState) {
        self.ask(Request::Engage);
        for _ in 0..LONGEST_ENGAGING {
            if self.cycle(&self.input(task)).state == State::Active {
                return;
            }
        }
        panic!("not active after {LONGEST_ENGAGING} cycles: {:?}", self.cycle(&self.input(task)));
    }

    /// What the controller sees in this cycle, everything in order.
    pub fn input(&self, task: &TaskState) -> Input {
        let legs = self.simulator.leg_motion();
        Input {
            release_ns: self.now_ns + self.period_ns / 2,
            setpoint: Some(Setpoint::motion(self.now_ns, *task)),
            measurement: Some(Measurement {
                time_ns: self.now_ns,
                length: legs.length,
                rate: Some(legs.rate),
                ..Measurement::default()
            }),
            request: self.asked,
            ..Input::default()
        }
    }

    /// One cycle of the controller and one period of the platform.
    pub fn cycle(&mut self, input: &Input) -> Output {
        let output = self.controller.step(input);
        self.pass(output.state.has_control().then_some(output.force));
        output
    }

    /// One period of the platform, in which another force arrives.
    pub fn pass(&mut self, next: Option<[f64; LEGS]>) {
        let before = self.period_ns / 2 + FORCE_DELAY_NS;
        self.simulator.advance(before as f64 * 1e-9, self.force.as_ref());
        self.force = next;
        self.simulator.advance((self.period_ns - before) as f64 * 1e-9, self.force.as_ref());
        self.now_ns += self.period_ns;
    }

    /// Engages and plays a motion from home with approach and settling; each cycle goes to `watch`.
    pub fn play(
        &mut self,
        machine: &Machine,
        scene: &FittedMotion,
        mut watch: impl FnMut(&Input, &Output),
    ) -> Tracking {
        let timeline = Timeline::new(machine, &machine.home.into(), &scene.at(0.0).x, scene.duration);
        let start_ns = self.now_ns;
        self.ask(Request::Engage);
        let mut tracking = Tracking::default();
        loop {
            let t = (self.now_ns - start_ns) as f64 * 1e-9;
            if t > timeline.end() {
                return tracking;
            }
            let task = timeline.at(t, |t| scene.at(t));
            let (desired, actual) = (task.motion().pose, self.simulator.state().pose);
            tracking.position.add((desired.position - actual.position).norm());
            tracking.orientation.add(angle_between(&actual.rotation, &desired.rotation));
            let input = self.input(&task);
            let output = self.cycle(&input);
            watch(&input, &output);
        }
    }
}

/// Plays a motion of `seconds` on a platform of its own; every cycle must be in control.
pub fn track(config: &Config, platform: &Machine, motion: BuiltInMotion, seconds: f64) -> Tracking {
    let scene = fit(&config.machine, motion, seconds);
    let mut cycles = 0;
    let tracking = Rig::new(config, platform).play(&config.machine, &scene, |_, output| {
        assert!(
            output.state.has_control() && output.diagnostic.code == DiagnosticCode::None,
            "{:?}",
            output.diagnostic.code
        );
        assert!(output.state == State::Active || cycles < LONGEST_ENGAGING);
        cycles += 1;
        let cut = [Limit::Force, Limit::ForceRate].map(|limit| output.active_limits.contains(limit));
        assert_eq!(cut, [false; 2], "cycle {cycles}");
    });
    assert!(cycles > LONGEST_ENGAGING);
    tracking
}

/// A rig in the middle of a motion, and the task at its next cycle.
pub fn in_motion(config: &Config) -> (Rig, TaskState) {
    let mut rig = Rig::new(config, &config.machine);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let period_s = rig.period_ns as f64 * 1e-9;
    rig.engage(&scene.at(0.0));
    for k in 0..1500 {
        let input = rig.input(&scene.at(period_s * f64::from(k)));
        assert_eq!(rig.cycle(&input).state, State::Active);
    }
    let task = scene.at(period_s * 1500.0);
    assert!(task.xd.amax() > 0.01, "{}", task.xd);
    (rig, task)
}
