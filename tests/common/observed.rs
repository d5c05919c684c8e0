//! The loop without threads with a meter on the platform: measurement at k T, release at half of the period or at once,
//! force a while after the release. It stops at each release, where the reference of the cycle before is due.

use hexad::config::Config;
use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::model::LEGS;
use hexad::model::machine::Machine;
use hexad::model::rigid::Motion;
use hexad::model::task::{TaskState, task_coordinates};
use hexad::plant::simulator::{Brakes, Simulator};
use nalgebra::Vector6;

use super::rig::parameters;
use super::true_motion::{Meter, reference};

/// The first cycle; the clock of a computer that has been up for a while.
pub const START_NS: u64 = 86_400_000_000_000;
/// Longest step of the integration \[s\]: no machine here has anything faster than a drive's viscous friction, so that the
/// error is below 1e-7 m.
pub const STEP_S: f64 = 2.5e-3;
/// More than the gentlest of motions onto a setpoint as near as it must be.
const LONGEST_ENGAGING_S: f64 = 5.0;

/// Whether the driver sends rates of the legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rates {
    Always,
    Never,
    /// In some measurements, in others not.
    Sometimes,
}

impl Rates {
    pub const ALL: [Self; 3] = [Self::Always, Self::Never, Self::Sometimes];

    /// Whether a measurement has them.
    pub fn are_sent(self, number: u64) -> bool {
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Sometimes => [0, 1, 2, 5, 7].contains(&(number % 11)),
        }
    }
}

/// A controller, a platform, and what is measured of it.
#[derive(Clone)]
pub struct Observed {
    pub controller: Controller,
    pub simulator: Simulator,
    pub meter: Meter,
    pub parameters: Parameters,
    pub machine: Machine,
    pub now_ns: u64,
    /// From the measurement to the release.
    pub phase_ns: u64,
    /// From the release to the instant at which the force acts.
    pub force_delay_ns: u64,
    pub asked: Option<OperatorRequest>,
    pub rates: Rates,
    /// On the platform now.
    pub force: Option<[f64; LEGS]>,
}

impl Observed {
    /// The plant has exactly the parameters of the model.
    pub fn new(config: &Config) -> Self {
        Self::with(config, &config.machine, parameters(config))
    }

    /// `plant` gives the pose at which the platform stands at first: its home.
    pub fn with(config: &Config, plant: &Machine, parameters: Parameters) -> Self {
        let machine = config.machine.clone();
        let simulator = Simulator::new(plant, config.deployment.plant.brake_deceleration_m_s2, STEP_S);
        Self {
            controller: Controller::new(&machine, parameters),
            meter: Meter::new(&machine, &parameters, simulator.machine()),
            simulator,
            parameters,
            machine,
            now_ns: START_NS,
            phase_ns: parameters.period_ns / 2,
            force_delay_ns: 0,
            asked: None,
            rates: Rates::Always,
            force: None,
        }
    }

    /// With the platform at rest at a task's pose.
    pub fn standing(config: &Config, parameters: Parameters, task: &TaskState) -> Self {
        let mut plant = config.machine.clone();
        plant.home = task.x.into();
        Self::with(config, &plant, parameters)
    }

    /// Goes on with setpoints at rest until active.
    pub fn engage(&mut self, task: &TaskState) {
        let mut output = Output::default();
        while output.state != State::Active {
            assert!(
                self.time_s() < LONGEST_ENGAGING_S,
                "not active after {LONGEST_ENGAGING_S} s: {output:?}"
            );
            if output.state == State::Standby {
                self.ask(Request::Engage);
            }
            output = self.cycle(&self.input(task));
        }
    }

    /// Since the first cycle \[s\].
    pub fn time_s(&self) -> f64 {
        (self.now_ns - START_NS) as f64 * 1e-9
    }

    pub fn period_s(&self) -> f64 {
        self.parameters.period_ns as f64 * 1e-9
    }

    pub fn release_ns(&self) -> u64 {
        self.now_ns + self.phase_ns
    }

    /// A request, from the next input on.
    pub fn ask(&mut self, request: Request) {
        let number = self.asked.map_or(1, |asked| asked.message.sequence + 1);
        self.asked =
            Some(OperatorRequest { request, message: MessageId { epoch: START_NS, sequence: number } });
    }

    /// X of the true platform.
    pub fn x(&self) -> Vector6<f64> {
        task_coordinates(&self.simulator.state().pose, &self.machine.home).into()
    }

    pub fn measurement(&self) -> Measurement {
        let legs = self.simulator.leg_motion();
        let has_rates = self.rates.are_sent((self.now_ns - START_NS) / self.parameters.period_ns);
        Measurement {
            time_ns: self.now_ns,
            length: legs.length,
            rate: has_rates.then_some(legs.rate),
            ..Measurement::default()
        }
    }

    /// What the controller sees in this cycle, everything in order.
    pub fn input(&self, task: &TaskState) -> Input {
        self.input_with(Some(Setpoint::motion(self.now_ns, *task)))
    }

    pub fn input_with(&self, setpoint: Option<Setpoint>) -> Input {
        Input {
            release_ns: self.release_ns(),
            setpoint,
            measurement: Some(self.measurement()),
            request: self.asked,
            ..Input::default()
        }
    }

    /// One cycle of the controller and one period of the platform.
    pub fn cycle(&mut self, input: &Input) -> Output {
        let output = self.controller.step(input);
        self.apply(&output);
        output
    }

    /// One period of the platform, in which the force of an output arrives.
    pub fn apply(&mut self, output: &Output) {
        self.apply_with(output, reference(output));
    }

    /// The same with a reference from elsewhere.
    pub fn apply_with(&mut self, output: &Output, reference: Option<Motion>) {
        let (period_ns, release_ns) = (self.parameters.period_ns, self.release_ns());
        let after_ns = period_ns - self.phase_ns;
        let delay_ns = self.force_delay_ns.min(after_ns);
        self.meter.late_s = delay_ns.saturating_sub(self.parameters.force_delay_ns) as f64 * 1e-9;
        let next = output.state.has_control().then_some(output.force);
        self.advance(self.phase_ns);
        self.meter.at_release(&self.simulator, self.force.as_ref(), release_ns);
        self.meter.expect(reference, output.state, release_ns + period_ns);
        self.advance(delay_ns);
        self.force = next;
        if self.simulator.brakes() != Brakes::Closed || self.force.is_some() {
            self.meter.at_force(&self.simulator, self.force.as_ref(), release_ns + delay_ns);
        }
        self.advance(after_ns - delay_ns);
        self.now_ns += period_ns;
    }

    fn advance(&mut self, duration_ns: u64) {
        self.simulator.advance(duration_ns as f64 * 1e-9, self.force.as_ref());
    }
}
