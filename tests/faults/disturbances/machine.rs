//! Obstacles, brakes, drives and loads.

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

pub fn load_of_ten(m: &mut Moment) {
    m.begins(|world| world.load(10.0));
}
