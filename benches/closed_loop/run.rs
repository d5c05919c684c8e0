//! One closed loop: a controller, the simulated hardware, the fast scene.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use hexad::config::Config;
use hexad::control::controller::Controller;
use hexad::control::law::ControlMode;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon;
use hexad::model::fidelity::Fidelity;
use hexad::model::task::TaskState;
use hexad::plant::hardware::Hardware;
use hexad::plant::imperfections::Imperfections;

use hexad_support::fast::Fast;
use hexad_support::rig::START_NS;
use hexad_support::{Errors, angle_between};

/// From measurement to force, as a share of the period: release in its middle, then reading, computing, sending.
const DELAY: f64 = 0.6;

/// What the loop has to find its pose, engage, and estimate its disturbances \[s\].
const SETTLING_S: f64 = 2.0;

/// What is run.
#[derive(Clone)]
pub struct Run {
    pub machine: &'static str,
    pub mode: ControlMode,
    pub fidelity: Fidelity,
    pub rate_hz: f64,
    /// Whether disturbances are compensated.
    pub compensates: bool,
    pub imperfections: Imperfections,
}

/// What came of it: errors over the scene, none if control was lost.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// \[m\]
    pub position: Errors,
    /// \[rad\]
    pub orientation: Errors,
    /// Why it was lost; `None` if it was not.
    pub lost: DiagnosticCode,
}

impl Outcome {
    /// RMS of the position error \[um\].
    pub fn rms_um(&self) -> f64 {
        if self.lost == DiagnosticCode::None { 1e6 * self.position.rms() } else { f64::NAN }
    }

    pub fn max_um(&self) -> f64 {
        if self.lost == DiagnosticCode::None { 1e6 * self.position.max } else { f64::NAN }
    }
}

impl Run {
    /// The daemon's own defaults for this rate; only the following error may be any, as it is what is measured.
    fn config(&self) -> Config {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(self.machine);
        let text = std::fs::read_to_string(path.with_extension("toml")).unwrap();
        let Self { mode, rate_hz, compensates, .. } = self;
        let run = format!(
            "\n[realtime]\nrate_hz = {rate_hz:?}\n[control]\nmode = \"{}\"\ncompensate_disturbances = {compensates}\n\
             following_position_m = 1.0\nfollowing_orientation_rad = 1.0\n[drive]\ndelay_us = {:?}\n",
            mode.name(),
            (DELAY - 0.5) * 1e6 / rate_hz + self.imperfections.drive.dead_time_ns as f64 * 1e-3,
        );
        Config::parse(&(text + &run), self.machine).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The whole scene.
    pub fn play(&self) -> Outcome {
        self.record(&mut |_| ())
    }

    fn record(&self, watch: &mut dyn FnMut(&Input)) -> Outcome {
        let config = self.config();
        let parameters = daemon::parameters(&config.machine, &config.deployment, self.fidelity);
        let plant = &config.deployment.plant;
        let mut hardware = Hardware::new(
            &config.machine,
            plant.brake_deceleration_m_s2,
            plant.step_s,
            plant.tolerance_m,
            &self.imperfections,
        );
        let mut controller = Controller::new(&config.machine, parameters);
        let scene = Fast::new(&config);
        let period_ns = parameters.period_ns;
        let delay_ns = (DELAY * period_ns as f64) as u64;
        let cycles = |seconds: f64| (seconds * 1e9 / period_ns as f64) as u64;
        let (settling, all) = (cycles(SETTLING_S), cycles(SETTLING_S + scene.duration()));
        let mut outcome = Outcome::default();
        let mut force = None;
        for cycle in 0..all {
            let now_ns = START_NS + cycle * period_ns;
            let task: TaskState = scene.at((cycle as f64 - settling as f64) * period_ns as f64 * 1e-9);
            if cycle >= settling {
                let (desired, actual) = (task.motion().pose, hardware.simulator().state().pose);
                outcome.position.add((desired.position - actual.position).norm());
                outcome.orientation.add(angle_between(&actual.rotation, &desired.rotation));
            }
            let (length_m, rate) = hardware.measure();
            let input = Input {
                release_ns: now_ns + period_ns / 2,
                setpoint: Some(Setpoint::motion(now_ns, task)),
                measurement: Some(Measurement {
                    time_ns: now_ns,
                    length_m,
                    rate_m_s: Some(rate),
                    ..Measurement::default()
                }),
                request: (cycle > 0).then_some(OperatorRequest {
                    request: Request::Engage,
                    message: MessageId { epoch: 1, sequence: 1 },
                }),
                ..Input::default()
            };
            watch(&input);
            let output = controller.step(&input);
            if cycle >= settling && output.state != State::Active {
                return Outcome { lost: output.diagnostic.code, ..outcome };
            }
            hardware.advance(delay_ns, force);
            force = output.state.has_control().then_some(output.command_n);
            hardware.advance(period_ns - delay_ns, force);
        }
        outcome
    }

    /// Median time of a cycle of the controller over the scene \[ns\], in so many passes.
    pub fn step_ns(&self, passes: usize) -> f64 {
        let config = self.config();
        let mut inputs = vec![];
        self.record(&mut |input| inputs.push(*input));
        let mut medians: Vec<_> = (0..passes)
            .map(|_| {
                let parameters = daemon::parameters(&config.machine, &config.deployment, self.fidelity);
                let mut controller = Controller::new(&config.machine, parameters);
                let time = |input: &Input| {
                    let started = Instant::now();
                    black_box(controller.step(black_box(input)));
                    started.elapsed().as_nanos() as f64
                };
                median(inputs.iter().map(time).collect())
            })
            .collect();
        medians.sort_by(f64::total_cmp);
        median(medians)
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
