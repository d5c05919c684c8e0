//! Simulated hardware: commands in, measured lengths and rates out, all of [`super::imperfections`] in between.

use super::delay::{DeadTime, DriveCommand};
use super::imperfections::{DriveErrors, Imperfections, SensorErrors};
use super::simulator::Simulator;
use crate::model::LEGS;
use crate::model::machine::Machine;
use crate::model::random::Random;
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;

/// Machine with its drives and sensors, in simulated time.
#[derive(Clone, Debug)]
pub struct Hardware {
    simulator: Simulator,
    drive: DriveErrors,
    sensor: SensorErrors,
    delay: DeadTime,
    random: Random,
}

impl Hardware {
    /// At rest at home, brakes closed; see [`Simulator::imperfect`].
    pub fn new(
        machine: &Machine,
        deceleration_m_s2: f64,
        max_step_s: f64,
        tolerance_m: f64,
        wanted: &Imperfections,
    ) -> Self {
        let mut random = Random::new(wanted.seed);
        let built = wanted.build.built(machine, &mut random);
        Self {
            simulator: Simulator::imperfect(&built, deceleration_m_s2, max_step_s, tolerance_m, wanted),
            drive: wanted.drive,
            sensor: wanted.sensor,
            delay: DeadTime::new(wanted.drive.dead_time_ns),
            random,
        }
    }

    /// The true state, without the errors of the sensors.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// Advances by `duration_ns` under a constant command.
    pub fn advance(&mut self, duration_ns: u64, command: DriveCommand) {
        let command = command.map(|force| force.map(|newtons| rounded(newtons, self.drive.force_step_n)));
        let Self { simulator, delay, .. } = self;
        delay.pass(duration_ns, command, |nanoseconds, command| {
            simulator.advance(nanoseconds as f64 * 1e-9, command.as_ref());
        });
    }

    /// Legs slip through their closed brakes; see [`Simulator::slip`].
    pub fn slip(&mut self, duration_ns: u64, rates_m_s: &[f64; LEGS]) {
        self.simulator.slip(duration_ns as f64 * 1e-9, rates_m_s);
    }

    /// Lengths \[m\] and rates \[m/s\] as the sensors measure them now. Each reading draws its own noise.
    pub fn measure(&mut self) -> ([f64; LEGS], [f64; LEGS]) {
        let legs = self.simulator.leg_motion();
        let SensorErrors { length_step_m, rate_step_m_s, length_noise_m, rate_noise_m_s } = self.sensor;
        let mut read = |values: [f64; LEGS], noise: f64, step: f64| {
            values.map(|value| {
                let noise = if noise > 0.0 { noise * self.random.near_gaussian() } else { 0.0 };
                rounded(value + noise, step)
            })
        };
        (
            read(legs.length_m, length_noise_m, length_step_m),
            read(legs.rate_m_s, rate_noise_m_s, rate_step_m_s),
        )
    }
}

/// To the nearest multiple of `step`; 0 leaves the value as it is.
fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}
