//! Late, stopped and restarted daemons.

use super::super::world::{Grip, World};
use super::Moment;

pub fn deadline_missed(m: &mut Moment) {
    m.input.had_faulty_overrun = m.cycle == 0;
}

/// SIGSTOP and SIGCONT a second later.
pub fn held_1_s(m: &mut Moment) {
    m.begins(|world| world.grip = Grip::DaemonHeld { cycles: 1000, driven: 50 });
}

pub fn held_5_ms(m: &mut Moment) {
    m.begins(|world| world.grip = Grip::DaemonHeld { cycles: 5, driven: 50 });
}

pub fn restarted(m: &mut Moment) {
    m.begins(World::restart_daemon);
}
