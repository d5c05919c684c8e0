//! Obstacles, brakes, drives and loads.

use hexad::model::LEGS;

use super::super::world::{Grip, World};
use super::Moment;

pub fn collision(m: &mut Moment) {
    m.begins(World::hold);
}

/// The drives brake by themselves, and say nothing.
pub fn braked(m: &mut Moment) {
    m.begins(|world| world.grip = Grip::Held);
}

pub fn leg_without_force(m: &mut Moment) {
    m.begins(|world| world.grip = Grip::Dead(4));
}

pub fn load_of_a_tenth(m: &mut Moment) {
    m.begins(|world| world.load(0.1));
}

pub fn load_of_a_fifth(m: &mut Moment) {
    m.begins(|world| world.load(0.2));
}

/// With 1 g for 10 ms.
pub fn struck(m: &mut Moment) {
    m.begins(|world| world.push([0.0, 0.0, 0.0, 9.81, 0.0, 0.0]));
    if m.cycle == 10 {
        m.world.grip = Grip::Free;
    }
}

/// A tenth of the largest force at 30 Hz.
pub fn shaking_drive(m: &mut Moment) {
    let phase = 30.0 * core::f64::consts::TAU * m.seconds();
    let mut beside = [0.0; LEGS];
    beside[4] = 0.1 * m.world.machine.actuator.max_force_n * phase.sin();
    m.world.grip = Grip::Beside(beside);
}

pub fn load_of_ten(m: &mut Moment) {
    m.begins(|world| world.load(10.0));
}
