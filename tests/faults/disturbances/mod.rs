//! What goes wrong, each as a change of one cycle's input or of the world.

use hexad::control::signals::inputs::{Input, Measurement};
use hexad::control::signals::state::Request;
use hexad::model::random::Random;

use super::world::{World, measured, wanted};

pub mod host;
pub mod machine;
pub mod measurements;
pub mod operator;
pub mod reports;
pub mod setpoints;
pub mod together;

/// One cycle of a fault.
pub struct Moment<'a> {
    pub world: &'a mut World,
    pub input: &'a mut Input,
    /// The input before the fault began.
    pub before: Input,
    /// Cycles since it began.
    pub cycle: u64,
}

impl Moment<'_> {
    fn seconds(&self) -> f64 {
        self.cycle as f64 * 1e-3
    }

    fn measured(&mut self) -> &mut Measurement {
        measured(self.input)
    }

    fn x(&mut self) -> &mut nalgebra::Vector6<f64> {
        &mut wanted(self.input).task.x
    }

    fn xd(&mut self) -> &mut nalgebra::Vector6<f64> {
        &mut wanted(self.input).task.xd
    }

    fn xdd(&mut self) -> &mut nalgebra::Vector6<f64> {
        &mut wanted(self.input).task.xdd
    }

    fn ask_once(&mut self, request: Request) {
        if self.cycle == 0 {
            self.world.ask(request);
        }
    }

    /// Adds a motion along z that belongs to itself: `[z, z', z'']` at the seconds since the beginning.
    fn adds(&mut self, [z, rate, accel]: [f64; 3]) {
        let task = &mut wanted(self.input).task;
        task.x[5] += z;
        task.xd[5] += rate;
        task.xdd[5] += accel;
    }

    /// Once, at the beginning.
    fn begins(&mut self, change: impl FnOnce(&mut World)) {
        if self.cycle == 0 {
            change(self.world);
        }
    }
}

/// Numbers that look random, of magnitude up to 1, the same in every run.
pub fn noise(seed: u64) -> f64 {
    Random::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)).signed()
}

pub type Disturbance = fn(&mut Moment);
