//! The loop without threads: measurement at k T, release a phase later, force on the platform a delay after the release. The platform is
//! perfect or has imperfections that the model lacks, and its true motion may be compared with every limit by a [`Meter`].

use std::collections::BTreeMap;
use std::sync::Mutex;

use hexad::analysis::drive_delay::{MeasuredMotion, RecordedStretch};
use hexad::analysis::force_integrals::SentForce;
use hexad::config::Config;
use hexad::config::deployment::FidelityChoice;
use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon;
use hexad::model::LEGS;
use hexad::model::fidelity::Fidelity;
use hexad::model::machine::Machine;
use hexad::model::rigid::Motion;
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad::motion::timeline::Timeline;
use hexad::plant::delay::DriveCommand;
use hexad::plant::hardware::Hardware;
use hexad::plant::imperfections::Imperfections;
use hexad::plant::simulator::{Brakes, Simulator};
use nalgebra::Vector6;

use super::fast::Fast;
use super::true_motion::Meter;
use super::{Errors, Remembered, angle_between, remembered};

/// What reading, computing and sending take, about as on a common computer.
const FORCE_DELAY_NS: u64 = 100_000;
/// From the release to the force message of imperfect hardware, as a share of the period.
pub const SENDING: f64 = 0.1;
/// Longest step of the integration under a meter \[s\]: no machine here has anything faster than a drive's viscous friction, so that
/// the error is below 1e-7 m.
pub const STEP_S: f64 = 2.5e-3;
/// More than the gentlest of motions onto a setpoint as near as it must be.
const LONGEST_ENGAGING_S: f64 = 5.0;
/// What the loop has to find its pose, engage, and estimate the disturbance \[s\].
const SETTLING_S: f64 = 2.0;
/// The first cycle; the clock of a computer that has been up for a while.
pub const START_NS: u64 = 86_400_000_000_000;

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

/// How far the platform was from where it should have been.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tracking {
    pub position: Errors,
    pub orientation: Errors,
}

impl Tracking {
    fn add(&mut self, task: &TaskState, simulator: &Simulator) {
        let (desired, actual) = (task.motion().pose, simulator.state().pose);
        self.position.add((desired.position - actual.position).norm());
        self.orientation.add(angle_between(&actual.rotation, &desired.rotation));
    }
}

/// A controller, a platform, and what is between them.
#[derive(Clone)]
pub struct Rig {
    pub controller: Controller,
    pub machine: Machine,
    pub parameters: Parameters,
    pub now_ns: u64,
    /// From the measurement to the release.
    pub phase_ns: u64,
    /// From the release to the instant at which the force acts.
    pub force_delay_ns: u64,
    pub rates: Rates,
    /// The newest request.
    pub asked: Option<OperatorRequest>,
    /// On the platform now.
    pub force: DriveCommand,
    pub hardware: Hardware,
    /// Lengths and rates as they are measured now.
    measured: [[f64; LEGS]; 2],
    meter: Option<Meter>,
    had_control: bool,
}

impl Rig {
    /// The platform may differ from what the controller thinks; all else is as the controller thinks.
    pub fn new(config: &Config, platform: &Machine) -> Self {
        Self::assembled(config, parameters(config), perfect(config, platform, config.deployment.plant.step_s))
    }

    /// On hardware with imperfections, which sends lengths alone.
    pub fn imperfect(config: &Config, platform: &Machine, imperfections: &Imperfections) -> Self {
        let plant = &config.deployment.plant;
        let hardware = Hardware::new(
            platform,
            plant.brake_deceleration_m_s2,
            plant.step_s,
            plant.tolerance_m,
            imperfections,
        );
        let parameters = parameters(config);
        let force_delay_ns = (SENDING * parameters.period_ns as f64) as u64;
        Self { rates: Rates::Never, force_delay_ns, ..Self::assembled(config, parameters, hardware) }
    }

    /// With a meter; the force acts at the release. `platform` gives the pose at which it stands at first: its home.
    pub fn metered(config: &Config, platform: &Machine, parameters: Parameters) -> Self {
        let hardware = perfect(config, platform, STEP_S);
        let meter = Meter::new(&config.machine, &parameters, hardware.simulator().machine());
        Self { meter: Some(meter), force_delay_ns: 0, ..Self::assembled(config, parameters, hardware) }
    }

    /// The same with the platform at rest at a task's pose.
    pub fn standing(config: &Config, parameters: Parameters, task: &TaskState) -> Self {
        let mut platform = config.machine.clone();
        platform.home = task.x.into();
        Self::metered(config, &platform, parameters)
    }

    fn assembled(config: &Config, parameters: Parameters, hardware: Hardware) -> Self {
        let mut rig = Self {
            controller: Controller::new(&config.machine, parameters),
            machine: config.machine.clone(),
            parameters,
            now_ns: START_NS,
            phase_ns: parameters.period_ns / 2,
            force_delay_ns: FORCE_DELAY_NS,
            rates: Rates::Always,
            asked: None,
            force: None,
            hardware,
            measured: [[0.0; LEGS]; 2],
            meter: None,
            had_control: false,
        };
        rig.measure();
        rig
    }

    fn measure(&mut self) {
        self.measured = self.hardware.measure().into();
    }

    /// Other hardware is in its place at once.
    pub fn put(&mut self, hardware: Hardware) {
        self.hardware = hardware;
        self.measure();
    }

    /// The true platform.
    pub fn simulator(&self) -> &Simulator {
        self.hardware.simulator()
    }

    /// The meter of a rig that has one.
    pub fn meter(&self) -> &Meter {
        self.meter.as_ref().expect("a rig with a meter")
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

    /// X of the true platform.
    pub fn x(&self) -> Vector6<f64> {
        task_coordinates(&self.simulator().state().pose, &self.machine.home).into()
    }

    /// A request, from the next input on.
    pub fn ask(&mut self, request: Request) {
        let number = self.asked.map_or(1, |asked| asked.message.sequence + 1);
        self.asked =
            Some(OperatorRequest { request, message: MessageId { epoch: START_NS, sequence: number } });
    }

    /// Asks to engage and goes on until active, on a setpoint at rest.
    pub fn engage(&mut self, task: &TaskState) {
        let end_ns = self.now_ns + (LONGEST_ENGAGING_S * 1e9) as u64;
        let mut output = Output::default();
        self.ask(Request::Engage);
        while output.state != State::Active {
            assert!(self.now_ns < end_ns, "not active after {LONGEST_ENGAGING_S} s: {output:?}");
            if output.state == State::Standby {
                self.ask(Request::Engage);
            }
            output = self.cycle(&self.input(task));
        }
    }

    pub fn measurement(&self) -> Measurement {
        let [length_m, rate] = self.measured;
        let has_rates = self.rates.are_sent((self.now_ns - START_NS) / self.parameters.period_ns);
        Measurement {
            time_ns: self.now_ns,
            length_m,
            rate_m_s: has_rates.then_some(rate),
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

    /// The same with the request of an operator who waits: until control begins, and not after it has ended.
    pub fn waiting_input(&mut self, task: &TaskState) -> Input {
        self.had_control |= self.controller.state().has_control();
        if !self.had_control {
            self.ask(Request::Engage);
        }
        self.input(task)
    }

    /// One cycle of the controller and one period of the platform.
    pub fn cycle(&mut self, input: &Input) -> Output {
        let output = self.controller.step(input);
        self.apply(&output, output.reference);
        output
    }

    /// One period of the platform, in which the force of an output arrives; the meter expects this reference.
    pub fn apply(&mut self, output: &Output, reference: Option<Motion>) {
        self.elapse(output.state.has_control().then_some(output.command_n), reference, output.state);
    }

    /// One period of the platform, in which another force arrives.
    pub fn pass(&mut self, next: DriveCommand) {
        self.elapse(next, None, State::Off);
    }

    /// It stops at the release, where the reference of the cycle before is due.
    fn elapse(&mut self, next: DriveCommand, reference: Option<Motion>, state: State) {
        let (period_ns, release_ns) = (self.parameters.period_ns, self.release_ns());
        let after_ns = period_ns - self.phase_ns;
        let delay_ns = self.force_delay_ns.min(after_ns);
        self.hardware.advance(self.phase_ns, self.force);
        if let Some(meter) = &mut self.meter {
            meter.late_s = delay_ns.saturating_sub(self.parameters.force_delay_ns) as f64 * 1e-9;
            meter.at_release(self.hardware.simulator(), self.force.as_ref(), release_ns);
            meter.expect(reference, state, release_ns + period_ns);
        }
        self.hardware.advance(delay_ns, self.force);
        self.force = next;
        if let Some(meter) = &mut self.meter
            && (self.hardware.simulator().brakes() != Brakes::Closed || self.force.is_some())
        {
            meter.at_force(self.hardware.simulator(), self.force.as_ref(), release_ns + delay_ns);
        }
        self.hardware.advance(after_ns - delay_ns, self.force);
        self.now_ns += period_ns;
        self.measure();
    }

    /// Engages and plays a motion from home with approach and settling; each cycle goes to `watch`.
    pub fn play(&mut self, scene: &FittedMotion, mut watch: impl FnMut(&Input, &Output)) -> Tracking {
        let timeline =
            Timeline::new(&self.machine, &self.machine.home.into(), &scene.at(0.0).x, scene.duration_s);
        let start_ns = self.now_ns;
        self.ask(Request::Engage);
        let mut tracking = Tracking::default();
        loop {
            let t = (self.now_ns - start_ns) as f64 * 1e-9;
            if t > timeline.end() {
                return tracking;
            }
            let task = timeline.at(t, |t| scene.at(t));
            tracking.add(&task, self.simulator());
            let input = self.input(&task);
            let output = self.cycle(&input);
            watch(&input, &output);
        }
    }

    /// Plays the fast scene. Errors of the true platform against the setpoints; the cause if control was lost.
    pub fn play_fast(&mut self, config: &Config) -> Result<Tracking, DiagnosticCode> {
        let scene = Fast::new(config);
        let mut tracking = Tracking::default();
        let mut output = Output::default();
        while self.time_s() < SETTLING_S + scene.duration() {
            let is_settled = self.time_s() >= SETTLING_S;
            if is_settled && output.state != State::Active {
                return Err(output.diagnostic.code);
            }
            let task = scene.at((self.time_s() - SETTLING_S).max(0.0));
            if is_settled {
                tracking.add(&task, self.simulator());
            }
            let input = self.waiting_input(&task);
            output = self.cycle(&input);
        }
        Ok(tracking)
    }
}

/// Hardware that is the model.
fn perfect(config: &Config, platform: &Machine, step_s: f64) -> Hardware {
    let plant = &config.deployment.plant;
    // Nothing is imperfect, so no tolerance decides anything.
    Hardware::new(platform, plant.brake_deceleration_m_s2, step_s, f64::INFINITY, &Imperfections::default())
}

/// Adds a cycle under control to a stretch.
pub fn record(stretch: &mut RecordedStretch, input: &Input, output: &Output) {
    let measurement = input.measurement.unwrap();
    stretch.sent.push(SentForce { release_ns: input.release_ns, force_n: output.command_n });
    stretch.measured.push(MeasuredMotion {
        time_ns: measurement.time_ns,
        length_m: measurement.length_m,
        pose: output.platform.unwrap().pose,
        reference: output.reference.unwrap(),
    });
}

/// At most so many cycles of [`track`] are not active yet.
const ENGAGING_CYCLES: u32 = 1000;

/// Plays a motion of `seconds` on a platform of its own; every cycle must be in control.
pub fn track(config: &Config, platform: &Machine, motion: BuiltInMotion, seconds: f64) -> Tracking {
    let scene = fit(&config.machine, motion, seconds);
    let mut cycles = 0;
    let tracking = Rig::new(config, platform).play(&scene, |_, output| {
        assert!(
            output.state.has_control() && output.diagnostic.code == DiagnosticCode::None,
            "{:?}",
            output.diagnostic.code
        );
        assert!(output.state == State::Active || cycles < ENGAGING_CYCLES);
        cycles += 1;
        let cut = [Limit::Force, Limit::ForceRate].map(|limit| output.active_limits.contains(limit));
        assert_eq!(cut, [false; 2], "cycle {cycles}");
    });
    assert!(cycles > ENGAGING_CYCLES);
    tracking
}

/// A rig in the middle of a motion, and the task at its next cycle.
pub fn in_motion(config: &Config) -> (Rig, TaskState) {
    let mut rig = Rig::new(config, &config.machine);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let period_s = rig.period_s();
    rig.engage(&scene.at(0.0));
    for k in 0..1500 {
        let input = rig.input(&scene.at(period_s * f64::from(k)));
        assert_eq!(rig.cycle(&input).state, State::Active);
    }
    let task = scene.at(period_s * 1500.0);
    assert!(task.xd.amax() > 0.01, "{}", task.xd);
    (rig, task)
}
