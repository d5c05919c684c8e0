//! A controller, simulated hardware and a source of setpoints. Every input of the controller is kept.

use hexad::config::Config;
use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint, SetpointKind};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::model::LEGS;
use hexad::model::random::Random;
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, fit};
use hexad::motion::minimum_jerk::{rise, straight_move};
use hexad::plant::hardware::Hardware;
use nalgebra::Vector6;

use super::super::stream::CYCLES;
use hexad_support::rig::{START_NS, parameters};

/// From the release to the force, as a ratio of the period.
const FORCE_DELAY: f64 = 0.1;
/// Binary digits after the point that numbers of an input keep: poses and lengths to 0.5 nm, their first and second derivatives,
/// forces. The remaining bytes of a number are zero then, which take nothing in a file.
const POSE_DIGITS: i32 = 31;
const RATE_DIGITS: i32 = 25;
const ACCELERATION_DIGITS: i32 = 19;
const FORCE_DIGITS: i32 = 10;

/// Motion of the source at an instant of the clock \[ns\]; `None` if it is silent.
type Source = Box<dyn Fn(u64) -> Option<TaskState>>;
/// Force that acts, of time \[s\] and force that was sent; `None`: brakes.
type Drives = Box<dyn Fn(f64, [f64; LEGS]) -> Option<[f64; LEGS]>>;

/// One cycle of a disturbance.
pub struct Moment<'a> {
    pub input: &'a mut Input,
    /// The input before the disturbance.
    pub before: &'a Input,
    /// That of the cycle before.
    pub last: &'a Input,
    /// Cycles since the disturbance began.
    pub cycle: u64,
    /// True X of the platform.
    pub x: [f64; 6],
    /// On the platform.
    pub force: Option<[f64; LEGS]>,
    pub random: &'a mut Random,
}

impl Moment<'_> {
    pub fn measured(&mut self) -> &mut Measurement {
        self.input.measurement.as_mut().unwrap()
    }

    pub fn rate(&mut self) -> &mut [f64; LEGS] {
        self.measured().rate_m_s.as_mut().unwrap()
    }

    pub fn setpoint(&mut self) -> &mut Setpoint {
        self.input.setpoint.as_mut().unwrap()
    }

    pub fn task(&mut self) -> &mut TaskState {
        &mut self.setpoint().task
    }
}

pub struct Recorder {
    pub config: Config,
    pub parameters: Parameters,
    pub controller: Controller,
    pub hardware: Hardware,
    pub output: Output,
    pub source: Source,
    pub drives: Drives,
    /// Kind and speed of the setpoints, and cycles from one to the next.
    pub kind: SetpointKind,
    pub target_speed: f64,
    pub interval: u64,
    pub has_rates: bool,
    /// What happens to every input.
    pub always: fn(&mut Moment<'_>),
    /// From the measurement to the release \[ns\].
    pub phase_ns: u64,
    pub now_ns: u64,
    asked: Option<OperatorRequest>,
    force: Option<[f64; LEGS]>,
    random: Random,
    pub inputs: Vec<Input>,
}

impl Recorder {
    /// With the inputs of a script; what it has not filled goes on as it was.
    pub fn record(configuration: &str, script: fn(&mut Self)) -> Self {
        let config = Config::parse(configuration, "configuration").unwrap_or_else(|error| panic!("{error}"));
        let parameters = parameters(&config);
        let home = TaskState::at_rest(config.machine.home);
        let mut recorder = Self {
            controller: Controller::new(&config.machine, parameters),
            hardware: config.deployment.plant.hardware(&config.machine),
            output: Output::default(),
            source: Box::new(move |_| Some(home)),
            drives: Box::new(|_, force| Some(force)),
            kind: SetpointKind::Motion,
            target_speed: 0.0,
            interval: 1,
            has_rates: true,
            always: |_| {},
            phase_ns: parameters.period_ns / 2,
            now_ns: START_NS,
            asked: None,
            force: None,
            random: Random::new(1),
            inputs: vec![],
            config,
            parameters,
        };
        script(&mut recorder);
        recorder.run(CYCLES as u64);
        recorder
    }

    pub fn run(&mut self, cycles: u64) {
        self.run_with(cycles, |_| {});
    }

    /// Cycles under a disturbance.
    pub fn run_with(&mut self, cycles: u64, mut disturb: impl FnMut(&mut Moment<'_>)) {
        let before = self.inputs.last().copied().unwrap_or_default();
        for cycle in 0..cycles {
            self.cycle(cycle, &before, &mut disturb);
        }
    }

    /// Goes on until a state.
    pub fn until(&mut self, state: State) {
        for _ in 0..CYCLES {
            if self.output.state == state || self.inputs.len() == CYCLES {
                return;
            }
            self.run(1);
        }
    }

    /// A request, from the next input on.
    pub fn ask(&mut self, request: Request) {
        let number = self.asked.map_or(1, |asked| asked.message.sequence + 1);
        self.asked =
            Some(OperatorRequest { request, message: MessageId { epoch: START_NS, sequence: number } });
    }

    /// Stops, clears a fault, and engages where the platform stands.
    pub fn engage(&mut self) {
        if self.output.state.has_control() {
            self.ask(Request::Stop);
            while self.output.state.has_control() && self.inputs.len() < CYCLES {
                self.run(1);
            }
        }
        if self.output.state == State::Fault || self.output.state == State::Off {
            self.ask(Request::Clear);
        }
        while self.output.diagnostic.code != DiagnosticCode::ReadyToEngage && self.inputs.len() < CYCLES {
            self.stand();
            self.run(3);
        }
        self.ask(Request::Engage);
        self.until(State::Active);
    }

    /// The source stands where the platform is.
    pub fn stand(&mut self) {
        let task = TaskState::at_rest(self.x().into());
        self.source = Box::new(move |_| Some(task));
    }

    pub fn fall_silent(&mut self) {
        self.source = Box::new(|_| None);
    }

    /// The source moves by an offset from the platform's pose, from rest to rest.
    pub fn go(&mut self, offset: [f64; 6], seconds: f64) {
        let (from, start_ns) = (self.x(), self.now_ns);
        let to = from + Vector6::from(offset);
        self.source = Box::new(move |now_ns| {
            let t = (now_ns - start_ns) as f64 * 1e-9;
            Some(straight_move(&from, &to, &rise(t, seconds)))
        });
    }

    /// The source plays a motion from where the platform is.
    pub fn play(&mut self, motion: BuiltInMotion, seconds: f64) {
        let (scene, start_ns) = (fit(&self.config.machine, motion, seconds), self.now_ns);
        let shift = self.x() - scene.at(0.0).x;
        self.source = Box::new(move |now_ns| {
            let task = scene.at((now_ns - start_ns) as f64 * 1e-9);
            Some(TaskState { x: task.x + shift, ..task })
        });
    }

    /// Since the first cycle \[s\].
    pub fn time_s(&self) -> f64 {
        (self.now_ns - START_NS) as f64 * 1e-9
    }

    /// True X of the platform.
    pub fn x(&self) -> Vector6<f64> {
        task_coordinates(&self.hardware.simulator().state().pose, &self.config.machine.home).into()
    }

    /// Time in which the controller runs no cycle.
    pub fn pause(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.pass(self.force);
        }
    }

    fn cycle(&mut self, cycle: u64, before: &Input, disturb: &mut impl FnMut(&mut Moment<'_>)) {
        if self.inputs.len() == CYCLES {
            return;
        }
        let last = self.inputs.last().copied().unwrap_or_default();
        let mut input = self.input(&last);
        let mut moment = Moment {
            input: &mut input,
            before,
            last: &last,
            cycle,
            x: self.x().into(),
            force: self.force,
            random: &mut self.random,
        };
        (self.always)(&mut moment);
        disturb(&mut moment);
        round(&mut input);
        let state = (self.output.state, self.output.diagnostic.code, self.output.request_diagnostic.code);
        self.output = self.controller.step(&input);
        let Output { diagnostic, request_diagnostic, .. } = &self.output;
        if state != (self.output.state, diagnostic.code, request_diagnostic.code) {
            let number = self.inputs.len() + 1;
            println!("{number:5} {:?} {diagnostic:?} {:?}", self.output.state, request_diagnostic.code);
        }
        self.inputs.push(input);
        let time_s = self.time_s();
        let force = self.output.state.has_control().then_some(self.output.command_n);
        self.pass(force.and_then(|force| (self.drives)(time_s, force)));
    }

    fn input(&mut self, last: &Input) -> Input {
        let (length_m, rate) = self.hardware.measure();
        let rate_m_s = self.has_rates.then_some(rate);
        let task =
            (self.source)(self.now_ns).filter(|_| (self.inputs.len() as u64).is_multiple_of(self.interval));
        let setpoint = task.map(|task| {
            let task =
                if self.kind == SetpointKind::Motion { task } else { TaskState::at_rest(task.x.into()) };
            let target_speed_share = self.target_speed;
            Setpoint { kind: self.kind, target_speed_share, ..Setpoint::motion(self.now_ns, task) }
        });
        Input {
            release_ns: self.now_ns + self.phase_ns,
            setpoint: setpoint.or(last.setpoint),
            measurement: Some(Measurement {
                time_ns: self.now_ns,
                length_m,
                rate_m_s,
                ..Measurement::default()
            }),
            request: self.asked,
            ..Input::default()
        }
    }

    /// One period of the hardware, in which another force arrives.
    fn pass(&mut self, next: Option<[f64; LEGS]>) {
        let period_ns = self.parameters.period_ns;
        let delay_ns = self.phase_ns + (FORCE_DELAY * period_ns as f64) as u64;
        self.hardware.advance(delay_ns, self.force);
        self.force = next;
        self.hardware.advance(period_ns - delay_ns, self.force);
        self.now_ns += period_ns;
    }
}

/// Rounds the numbers of an input to multiples of a power of two.
fn round(input: &mut Input) {
    let to =
        |number: &mut f64, digits: i32| *number = (*number * 2_f64.powi(digits)).round() / 2_f64.powi(digits);
    if let Some(Setpoint { task: TaskState { x, xd, xdd }, .. }) = &mut input.setpoint {
        x.iter_mut().for_each(|number| to(number, POSE_DIGITS));
        xd.iter_mut().for_each(|number| to(number, RATE_DIGITS));
        xdd.iter_mut().for_each(|number| to(number, ACCELERATION_DIGITS));
    }
    if let Some(Measurement { length_m, rate_m_s, pose, drives, .. }) = &mut input.measurement {
        length_m.iter_mut().chain(pose.iter_mut().flatten()).for_each(|number| to(number, POSE_DIGITS));
        rate_m_s.iter_mut().flatten().for_each(|number| to(number, RATE_DIGITS));
        drives.force_n.iter_mut().flatten().for_each(|number| to(number, FORCE_DIGITS));
    }
}
