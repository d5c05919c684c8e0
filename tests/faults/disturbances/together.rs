//! Several faults at once.

use hexad::control::signals::state::Request;

use super::{Moment, host, machine, measurements, operator, setpoints};

pub fn setpoint_ends_then_measurement(m: &mut Moment) {
    setpoints::end(m);
    if m.cycle >= 60 {
        m.input.measurement = m.world.last.measurement;
    }
}

pub fn both_end(m: &mut Moment) {
    setpoints::end(m);
    measurements::end(m);
}

pub fn nan_in_both(m: &mut Moment) {
    setpoints::nan_x(m);
    measurements::nan_length(m);
}

pub fn setpoint_jumps_and_deadline_missed(m: &mut Moment) {
    setpoints::jump_10_mm(m);
    host::deadline_missed(m);
}

pub fn estop_without_measurement(m: &mut Moment) {
    measurements::end(m);
    operator::estop(m);
}

pub fn off_without_measurement(m: &mut Moment) {
    measurements::end(m);
    if m.cycle == 25 {
        m.world.ask(Request::Off);
    }
}

pub fn collision_and_setpoint_ends(m: &mut Moment) {
    machine::collision(m);
    setpoints::end(m);
}

pub fn braked_and_setpoint_ends(m: &mut Moment) {
    machine::braked(m);
    setpoints::end(m);
}

/// A stop is asked for, and again and again.
pub fn stop_every_10_ms(m: &mut Moment) {
    if m.cycle.is_multiple_of(10) {
        m.world.ask(Request::Stop);
    }
}

pub fn estop_then_engage(m: &mut Moment) {
    m.ask_once(Request::Estop);
    if m.cycle > 0 && m.cycle.is_multiple_of(100) {
        m.world.ask(Request::Engage);
    }
}
