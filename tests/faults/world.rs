//! A controller, a platform, a setpoint source, and what may go wrong between them.

use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::Request;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::{Exact, Gravity};
use hexad::model::machine::Machine;
use hexad::model::rigid::{Acceleration, Motion};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::FittedMotion;
use hexad::motion::minimum_jerk::{rise, straight_move};
use hexad::plant::forward_dynamics::ForwardDynamics;
use hexad::plant::hardware::Hardware;
use hexad::plant::imperfections::Imperfections;
use nalgebra::Vector6;

use super::recording::{Recording, Sample};
use hexad_support::rig::{Rates, Rig};

/// Where setpoints come from.
#[derive(Clone)]
pub enum Source {
    Silent,
    Still(TaskState),
    /// A scene that began at this instant.
    Plays(FittedMotion, u64),
    /// From rest to rest on a straight line, from this instant on, in so many seconds.
    Moves([Vector6<f64>; 2], u64, f64),
}

/// What holds the platform besides the forces it is sent.
#[derive(Clone)]
pub enum Grip {
    Free,
    /// An obstacle or its own brakes: forces do nothing.
    Held,
    /// This leg pushes nothing.
    Dead(usize),
    /// The weight of a load that the controller does not know.
    Load(Box<[InverseDynamics; 2]>),
    /// Forces beside those of the drives.
    Beside([f64; LEGS]),
    /// The process of the daemon stands still, for so many more cycles. The drives apply its last force
    /// for so many of them, then brake.
    DaemonHeld {
        cycles: u32,
        driven: u32,
    },
}

#[derive(Clone)]
pub struct World {
    pub rig: Rig,
    pub source: Source,
    pub grip: Grip,
    pub rates: Rates,
    pub machine: Machine,
    pub parameters: Parameters,
    /// What the controller got last, with rates in any case.
    pub last: Input,
    pub recording: Recording,
    dynamics: ForwardDynamics,
}

impl World {
    pub fn new(rig: Rig, machine: &Machine, parameters: Parameters) -> Self {
        let dynamics = ForwardDynamics::new(rig.simulator().machine());
        Self {
            rig,
            source: Source::Still(TaskState::at_rest(machine.home)),
            grip: Grip::Free,
            rates: Rates::Always,
            machine: machine.clone(),
            parameters,
            last: Input::default(),
            recording: Recording::default(),
            dynamics,
        }
    }

    /// The setpoint at an instant.
    pub fn task(&self, now_ns: u64) -> Option<TaskState> {
        match &self.source {
            Source::Silent => None,
            Source::Still(task) => Some(*task),
            Source::Plays(scene, start_ns) => Some(scene.at((now_ns - start_ns) as f64 * 1e-9)),
            Source::Moves([from, to], start_ns, seconds) => {
                let t = (now_ns - start_ns) as f64 * 1e-9;
                Some(straight_move(from, to, &rise(t, *seconds)))
            }
        }
    }

    /// One cycle in which `spoil` changes what the controller sees.
    pub fn cycle(&mut self, spoil: impl FnOnce(&mut Self, &mut Input)) -> Output {
        let now_ns = self.rig.now_ns;
        let task = self.task(now_ns);
        let mut input = self.rig.input(&task.unwrap_or_default());
        if task.is_none() {
            input.setpoint = self.last.setpoint;
        }
        spoil(self, &mut input);
        input.request = self.rig.asked;
        if let Grip::DaemonHeld { cycles, driven } = &mut self.grip
            && *cycles > 0
        {
            *cycles -= 1;
            let is_driven = *driven > 0;
            *driven = driven.saturating_sub(1);
            self.rig.pass(self.rig.force.filter(|_| is_driven));
            return Output::default();
        }
        self.last = input;
        let has_none = |measurement: &&mut Measurement| {
            !self.rates.are_sent(measurement.time_ns / self.parameters.period_ns)
        };
        input.measurement.iter_mut().filter(has_none).for_each(|measurement| measurement.rate_m_s = None);
        let output = self.rig.controller.step(&input);
        let force = output.state.has_control().then_some(output.command_n);
        let applied = self.applied(force);
        self.rig.pass(applied);
        self.record(now_ns, Some(output));
        output
    }

    /// Cycles without any fault.
    pub fn run(&mut self, cycles: u32) -> Output {
        (0..cycles).map(|_| self.cycle(|_, _| {})).last().unwrap()
    }

    /// Goes on until the output is as wanted.
    pub fn until(&mut self, wanted: impl Fn(&Output) -> bool) -> Output {
        for _ in 0..5000 {
            let output = self.cycle(|_, _| {});
            if wanted(&output) {
                return output;
            }
        }
        panic!("never came: {:?}", self.cycle(|_, _| {}));
    }

    pub fn ask(&mut self, request: Request) {
        self.rig.ask(request);
    }

    /// X of the platform.
    pub fn x(&self) -> Vector6<f64> {
        task_coordinates(&self.rig.simulator().state().pose, &self.machine.home).into()
    }

    /// The source stands where the platform does.
    pub fn source_at_platform(&mut self) {
        self.source = Source::Still(TaskState::at_rest(self.x().into()));
    }

    /// Cycles in which no daemon runs. The drives apply its last force for some of them.
    pub fn without_daemon(&mut self, cycles: u32, driven: u32) {
        for cycle in 0..cycles {
            let now_ns = self.rig.now_ns;
            self.rig.pass(self.rig.force.filter(|_| cycle < driven));
            self.record(now_ns, None);
        }
    }

    /// The platform stands where it is, at once, and stays.
    pub fn hold(&mut self) {
        let pose = self.rig.simulator().state().pose;
        let mut standing = self.rig.simulator().machine().clone();
        standing.home = task_coordinates(&pose, &standing.home);
        self.rig.put(Hardware::new(&standing, 9.81, 1e-3, f64::INFINITY, &Imperfections::default()));
        self.grip = Grip::Held;
    }

    /// A load of so many times the platform's weight hangs from now on.
    pub fn load(&mut self, share: f64) {
        let mut heavy = self.machine.clone();
        heavy.platform.mass_kg *= 1.0 + share;
        let models = [&heavy, &self.machine].map(InverseDynamics::new);
        self.grip = Grip::Load(Box::new(models));
    }

    /// Something pushes with this acceleration from now on.
    pub fn push(&mut self, acceleration: [f64; 6]) {
        let model = InverseDynamics::new(&self.machine);
        let acceleration = Acceleration::from_vector(&acceleration.into());
        let motions = [Motion { acceleration, ..self.motion() }, self.motion()];
        let [pushed, usual] = motions.map(|motion| model.forces::<Exact>(&motion).unwrap());
        self.grip = Grip::Beside(core::array::from_fn(|leg| pushed[leg] - usual[leg]));
    }

    /// The daemon is gone, and a new one takes its place.
    pub fn restart_daemon(&mut self) {
        self.rig.controller = Controller::new(&self.machine, self.parameters);
        self.rig.asked = None;
    }

    fn motion(&self) -> Motion {
        let state = self.rig.simulator().state();
        Motion { pose: state.pose, twist: state.twist, acceleration: Acceleration::default() }
    }

    /// What becomes of a force on the way to the platform.
    fn applied(&self, force: Option<[f64; LEGS]>) -> Option<[f64; LEGS]> {
        let mut force = force?;
        match &self.grip {
            Grip::Free | Grip::DaemonHeld { .. } => {}
            Grip::Held => return None,
            Grip::Dead(leg) => force[*leg] = 0.0,
            Grip::Beside(beside) => force = core::array::from_fn(|leg| force[leg] + beside[leg]),
            Grip::Load(models) => {
                let motion = Motion { twist: Default::default(), ..self.motion() };
                let [heavy, light] = models.each_ref().map(|model| model.forces::<Gravity>(&motion).unwrap());
                force = core::array::from_fn(|leg| force[leg] - heavy[leg] + light[leg]);
            }
        }
        Some(force)
    }

    fn record(&mut self, now_ns: u64, output: Option<Output>) {
        let state = self.rig.simulator().state();
        let acceleration =
            self.rig.force.and_then(|force| self.dynamics.acceleration(&state.pose, &state.twist, &force));
        self.recording.push(Sample {
            time_ns: now_ns,
            output: output.unwrap_or_default(),
            has_daemon: output.is_some(),
            pose: state.pose,
            twist: state.twist,
            setpoint: self.task(now_ns),
            acceleration,
        });
    }
}

/// Parts of an input that is known to be complete.
pub fn measured(input: &mut Input) -> &mut Measurement {
    input.measurement.as_mut().unwrap()
}

pub fn wanted(input: &mut Input) -> &mut Setpoint {
    input.setpoint.as_mut().unwrap()
}
