//! Faults and requests that follow each other while the platform moves.

use hexad::control::signals::state::Request;

use super::disturbances::{Moment, setpoints};
use super::world::wanted;

/// Requests of the operator at their cycles.
fn ask(m: &mut Moment, requests: &[(u64, Request)]) {
    for (cycle, request) in requests {
        if *cycle == m.cycle {
            m.world.ask(*request);
        }
    }
}

/// The brakes have hardly begun: the platform is still near to the setpoint, in pose and in velocity.
pub fn off_then_engage(m: &mut Moment) {
    ask(m, &[(0, Request::Off), (3, Request::Engage)]);
}

pub fn off_then_park(m: &mut Moment) {
    ask(m, &[(0, Request::Off), (10, Request::Park)]);
}

pub fn estop_clear_park(m: &mut Moment) {
    ask(m, &[(0, Request::Estop), (5, Request::Clear), (10, Request::Park)]);
}

/// Cycles of setpoints before their source ends.
const ACCELERATES: u64 = 100;

/// Up to 2 m/s^2 along z, beside what it does, and then no more messages.
pub fn ends_while_accelerating(m: &mut Moment) {
    if m.cycle < ACCELERATES {
        let (t, jerk) = ((m.cycle + 1) as f64 * 1e-3, 20.0);
        let task = &mut wanted(m.input).task;
        task.x[5] += jerk * t.powi(3) / 6.0;
        task.xd[5] += 0.5 * jerk * t * t;
        task.xdd[5] += jerk * t;
    } else {
        m.input.setpoint = m.world.last.setpoint;
    }
}

/// Half a second without messages, then those of a source that is elsewhere.
pub fn end_and_go_on_elsewhere(m: &mut Moment) {
    if m.cycle < 500 {
        setpoints::end_for_now(m);
    } else {
        wanted(m.input).task.x[3] += 0.05;
    }
}
