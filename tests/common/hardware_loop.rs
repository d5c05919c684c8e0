//! The loop without threads on imperfect hardware, over the fast scene: measurement at k T, release at k T + T / 2, force on its
//! way 0.1 T after the release.

use std::collections::BTreeMap;
use std::sync::Mutex;

use hexad::analysis::drive_delay::{MeasuredMotion, RecordedStretch};
use hexad::analysis::force_integrals::SentForce;
use hexad::config::Config;
use hexad::control::controller::{Controller, Output};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::model::LEGS;
use hexad::model::machine::Machine;
use hexad::model::task::TaskState;
use hexad::plant::hardware::Hardware;
use hexad::plant::imperfections::Imperfections;
use toml::Table;

use super::fast::Fast;
use super::observed::Rates;
use super::rig::{Tracking, parameters};
use super::{Remembered, angle_between, edited, remembered};

/// From the release to the force message, as a share of the period.
pub const SENDING: f64 = 0.1;
/// What the loop has to find its pose, engage, and estimate the disturbance \[s\].
const SETTLING_S: f64 = 2.0;
/// The clock of a computer that has been up for a while.
const START_NS: u64 = 86_400_000_000_000;

/// A deployable machine with other values of the keys in these lines.
pub fn configured(machine: &str, lines: &str) -> Config {
    static KNOWN: Remembered<Config> = Mutex::new(BTreeMap::new());
    let make = || {
        let mut table = edited::deployed_table(machine);
        for (section, keys) in lines.parse::<Table>().unwrap() {
            for (key, value) in keys.as_table().unwrap() {
                edited::set(&mut table, &section, key, value.clone());
            }
        }
        edited::config(&table)
    };
    remembered(&KNOWN, &format!("{machine} {lines}"), make)
}

/// Adds a cycle under control to a stretch.
pub fn record(stretch: &mut RecordedStretch, input: &Input, output: &Output) {
    let measurement = input.measurement.unwrap();
    stretch.sent.push(SentForce { release_ns: input.release_ns, force: output.force });
    stretch.measured.push(MeasuredMotion {
        time_ns: measurement.time_ns,
        length: measurement.length,
        pose: output.platform.unwrap().pose,
        reference: output.reference.unwrap(),
    });
}

/// A controller and imperfect hardware.
pub struct HardwareLoop {
    pub controller: Controller,
    pub hardware: Hardware,
    pub rates: Rates,
    pub now_ns: u64,
    pub period_ns: u64,
    /// Number of the request for control.
    asked: u64,
    had_control: bool,
    force: Option<[f64; LEGS]>,
}

impl HardwareLoop {
    pub fn new(config: &Config, platform: &Machine, imperfections: &Imperfections) -> Self {
        let parameters = parameters(config);
        let plant = &config.deployment.plant;
        Self {
            controller: Controller::new(&config.machine, parameters),
            hardware: Hardware::new(
                platform,
                plant.brake_deceleration_m_s2,
                plant.step_s,
                plant.tolerance_m,
                imperfections,
            ),
            rates: Rates::Never,
            asked: 0,
            had_control: false,
            now_ns: START_NS,
            period_ns: parameters.period_ns,
            force: None,
        }
    }

    pub fn time_s(&self) -> f64 {
        (self.now_ns - START_NS) as f64 * 1e-9
    }

    /// What the controller sees, everything in order.
    pub fn input(&mut self, task: &TaskState) -> Input {
        // Asks as an operator who waits: until control begins, and not after it has ended.
        self.had_control |= self.controller.state().has_control();
        self.asked += u64::from(!self.had_control);
        let (length, rate) = self.hardware.measure();
        let rate = self.rates.are_sent(self.now_ns / self.period_ns).then_some(rate);
        Input {
            release_ns: self.now_ns + self.period_ns / 2,
            setpoint: Some(Setpoint::motion(self.now_ns, *task)),
            measurement: Some(Measurement { time_ns: self.now_ns, length, rate, ..Measurement::default() }),
            request: Some(OperatorRequest {
                request: Request::Engage,
                message: MessageId { epoch: 1, sequence: self.asked },
            }),
            ..Input::default()
        }
    }

    /// One cycle of the controller and one period of the hardware.
    pub fn cycle(&mut self, input: &Input) -> Output {
        let output = self.controller.step(input);
        let delay_ns = self.period_ns / 2 + (SENDING * self.period_ns as f64) as u64;
        self.hardware.advance(delay_ns, self.force);
        self.force = output.state.has_control().then_some(output.force);
        self.hardware.advance(self.period_ns - delay_ns, self.force);
        self.now_ns += self.period_ns;
        output
    }

    /// Plays the fast scene. Errors of the true platform against the setpoints; the cause if control was lost.
    pub fn play(&mut self, config: &Config) -> Result<Tracking, DiagnosticCode> {
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
                let (desired, actual) = (task.motion().pose, self.hardware.simulator().state().pose);
                tracking.position.add((desired.position - actual.position).norm());
                tracking.orientation.add(angle_between(&actual.rotation, &desired.rotation));
            }
            let input = self.input(&task);
            output = self.cycle(&input);
        }
        Ok(tracking)
    }
}
