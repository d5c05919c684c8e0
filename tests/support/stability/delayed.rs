//! The real controller and the real plant in closed loop, with any delay between measurement and force.

#![allow(dead_code, reason = "the bench uses a part of it")]

use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::Parameters;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};

use hexad::analysis::sampled_loop::SampledLoop;
use hexad::config::Config;
use hexad::config::deployment::FidelityChoice;
use hexad::control::law::estimator::ReadingErrors;
use hexad::control::law::estimator::covariance::NoiseModel;
use hexad::control::law::gains::Gains;
use hexad::control::law::{ControlMode, Law};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::pair::Pair;
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::rigid::{Acceleration, Motion};
use hexad::model::task::TaskState;
use hexad::plant::hardware::Hardware;
use hexad::plant::imperfections::{Imperfections, SensorErrors};
use nalgebra::{Vector3, Vector6};

use crate::rig::START_NS;

/// The push that begins a run gives every axis this velocity \[m/s\], \[rad/s\]: errors stay below a micrometre
/// as long as the loop is stable, where everything is linear and nothing is limited.
pub const PUSH: f64 = 1e-4;

/// Nothing but the loop limits the loop: more force, change of force and feedback than anything asks for.
const UNLIMITED: f64 = 1e12;

/// What is between controller and platform.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Of every axis.
    pub sampled: SampledLoop,
    /// How much of the delay is age of the measurement at the release, in periods; at most 1. The rest is dead time.
    pub age: f64,
    pub sensor: SensorErrors,
}

impl Setup {
    /// What the estimator knows of the delay, half a period at most, before the release; perfect sensors.
    pub fn of(sampled: SampledLoop) -> Self {
        Self { sampled, age: sampled.known_delay_periods.min(0.5), sensor: SensorErrors::default() }
    }
}

/// One cycle as seen from outside.
#[derive(Clone, Copy, Debug)]
pub struct Cycle {
    /// Setpoint minus platform, not as measured: angular, linear.
    pub error: Vector6<f64>,
    /// Of the platform.
    pub twist: Vector6<f64>,
}

pub struct Delayed {
    controller: Controller,
    hardware: Hardware,
    setpoint: TaskState,
    force: Option<[f64; LEGS]>,
    push: [f64; LEGS],
    now_ns: u64,
    period_ns: u64,
    age_ns: u64,
    /// Of the last cycle.
    state: State,
}

impl Delayed {
    pub fn new(config: &Config, setup: &Setup) -> Self {
        let parameters = parameters(config, setup);
        let SampledLoop { delay_periods, mass_ratio, .. } = setup.sampled;
        let in_ns = |periods: f64| (periods * parameters.period_ns as f64).round() as u64;
        let mut wanted = Imperfections { seed: 1, sensor: setup.sensor, ..Imperfections::default() };
        wanted.drive.dead_time_ns = in_ns(delay_periods) - in_ns(setup.age);
        let mut strong = config.machine.clone();
        strong.actuator.max_force_n = UNLIMITED;
        let plant = &config.deployment.plant;
        let built = scaled(&strong, mass_ratio);
        let setpoint = TaskState::at_rest(config.machine.home);
        Self {
            controller: Controller::new(&strong, parameters),
            hardware: Hardware::new(&built, plant.brake_deceleration_m_s2, 1e-3, 1.0, &wanted),
            setpoint,
            force: None,
            push: push(&strong, &setpoint.motion(), PUSH / (parameters.period_ns as f64 * 1e-9)),
            now_ns: START_NS,
            period_ns: parameters.period_ns,
            age_ns: in_ns(setup.age),
            state: State::Off,
        }
    }

    /// One period, from measurement to measurement. Pushes in the first under control.
    pub fn cycle(&mut self) -> (Cycle, Output) {
        let state = *self.hardware.simulator().state();
        let error = state.pose.displacement_to(&self.setpoint.motion().pose).vector();
        let (length_m, rate) = self.hardware.measure();
        let (time_ns, task) = (self.now_ns, self.setpoint);
        let output = self.controller.step(&Input {
            release_ns: time_ns + self.age_ns,
            setpoint: Some(Setpoint::motion(time_ns, task)),
            measurement: Some(Measurement {
                time_ns,
                length_m,
                rate_m_s: Some(rate),
                ..Measurement::default()
            }),
            request: Some(OperatorRequest {
                request: Request::Engage,
                message: MessageId { epoch: START_NS, sequence: 1 },
            }),
            ..Input::default()
        });
        self.hardware.advance(self.age_ns, self.force);
        self.force = output.state.has_control().then_some(output.command_n);
        if let Some(force) = &mut self.force {
            let push = core::mem::take(&mut self.push);
            *force = core::array::from_fn(|leg| force[leg] + push[leg]);
        }
        self.hardware.advance(self.period_ns - self.age_ns, self.force);
        self.now_ns += self.period_ns;
        (Cycle { error, twist: state.twist.vector() }, output)
    }

    /// So many cycles under control, or until the controller gives up, and why.
    pub fn run(&mut self, cycles: usize) -> (Vec<Cycle>, DiagnosticCode) {
        let mut seen = vec![];
        while seen.len() < cycles {
            let (cycle, output) = self.cycle();
            if self.state.has_control() && !output.state.has_control() {
                return (seen, output.diagnostic.code);
            }
            self.state = output.state;
            if self.state.has_control() {
                seen.push(cycle);
            }
            assert!(self.now_ns < START_NS + 10 * self.period_ns || self.state.has_control(), "{output:?}");
        }
        (seen, DiagnosticCode::None)
    }
}

fn parameters(config: &Config, setup: &Setup) -> Parameters {
    let FidelityChoice::Fixed(fidelity) = config.deployment.control.fidelity else { panic!("not fixed") };
    let parameters = daemon::parameters(&config.machine, &config.deployment, fidelity);
    let SampledLoop { wn_t, damping_ratio, estimator_ratio, rate_noise_ratio, .. } = setup.sampled;
    let wn = wn_t * config.deployment.realtime.rate_hz;
    let gains = Gains::new(wn / core::f64::consts::TAU, damping_ratio);
    let law = Law::new(
        &config.machine,
        ControlMode::ComputedTorque,
        Pair { angular: gains, linear: gains },
        config.deployment.control.leg_masses,
        setup.sampled.compensates_disturbance,
        &parameters.limits,
    );
    Parameters {
        law: Law { max_compensated_acceleration: Vector6::repeat(UNLIMITED), ..law },
        noise: NoiseModel {
            bandwidth_rad_s: estimator_ratio * wn,
            rate_noise_ratio: rate_noise_ratio.map(|ratio| ratio * config.deployment.realtime.rate_hz),
            period_s: parameters.noise.period_s,
        },
        // What the estimator knows beside the age of the measurement.
        force_delay_ns: ((setup.sampled.known_delay_periods - setup.age).max(0.0)
            * parameters.period_ns as f64) as u64,
        force_rate_n_s: UNLIMITED,
        // Disturbances are not faults here.
        payload_change_kg: Some(UNLIMITED),
        disturbance_step_m_s2: Some(UNLIMITED),
        feedback_scale: UNLIMITED,
        reading_errors: ReadingErrors { deviation_m: UNLIMITED, resolution_or_0_m: 0.0 },
        ..parameters
    }
}

/// A machine of which every part weighs so much more.
pub fn scaled(machine: &Machine, ratio: f64) -> Machine {
    let mut scaled = machine.clone();
    scaled.platform.mass_kg *= ratio;
    scaled.platform.inertia *= ratio;
    for link in [&mut scaled.cylinder, &mut scaled.rod] {
        link.mass_kg *= ratio;
        link.axial_inertia_kg_m2 *= ratio;
        link.transverse_inertia.constant_kg_m2 *= ratio;
        link.transverse_inertia.quadratic_kg *= ratio;
    }
    let actuator = &mut scaled.actuator;
    actuator.reflected_mass_kg *= ratio;
    actuator.viscous_friction_n_s_m.iter_mut().for_each(|friction| *friction *= ratio);
    actuator.coulomb_friction_n.iter_mut().for_each(|friction| *friction *= ratio);
    scaled
}

/// What accelerates a machine at rest in all axes.
fn push(machine: &Machine, still: &Motion, acceleration: f64) -> [f64; LEGS] {
    let all = Vector3::repeat(acceleration);
    let moved = Motion { acceleration: Acceleration { angular: all, linear: all }, ..*still };
    let model = InverseDynamics::new(machine);
    let [pushed, held] = [&moved, still].map(|motion| model.forces::<Exact>(motion).unwrap());
    core::array::from_fn(|leg| pushed[leg] - held[leg])
}

/// Largest velocity of an axis in these cycles.
fn fastest(cycles: &[Cycle]) -> f64 {
    cycles.iter().map(|cycle| cycle.twist.amax()).fold(0.0, f64::max)
}

/// Cycles after which growth and decay are told apart, a thousandth from the limit.
const LONG: usize = 4000;

/// Largest `wn T` at which the loop of this setup settles, by bisection of its logarithm to a thousandth.
pub fn boundary(config: &Config, sampled: &SampledLoop) -> f64 {
    let (mut low, mut high) = (0.005_f64, 5.0_f64);
    for _ in 0..13 {
        let wn_t = (low * high).sqrt();
        let setup = Setup::of(SampledLoop { wn_t, ..*sampled });
        if settles(config, &setup) { low = wn_t } else { high = wn_t }
    }
    (low * high).sqrt()
}

/// Whether the push is forgotten.
fn settles(config: &Config, setup: &Setup) -> bool {
    let mut delayed = Delayed::new(config, setup);
    let mut before = f64::INFINITY;
    // Long enough for the slowest oscillation of the setups that are looked at.
    for _ in 0..4 {
        let (cycles, cause) = delayed.run(LONG / 4);
        let now = fastest(&cycles);
        // Beyond, the controller believes no more what it measures, and the loop is another.
        if cause != DiagnosticCode::None || now > 100.0 * PUSH {
            return false;
        }
        if now < 1e-3 * PUSH {
            return true;
        }
        if now > before {
            return false;
        }
        before = now;
    }
    true
}
