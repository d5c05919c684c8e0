//! Requests of the operator.

use hexad::control::signals::state::Request;

use super::super::world::Source;
use super::Moment;

pub fn estop(m: &mut Moment) {
    m.ask_once(Request::Estop);
}

pub fn off(m: &mut Moment) {
    m.ask_once(Request::Off);
}

pub fn stop(m: &mut Moment) {
    m.ask_once(Request::Stop);
}

pub fn park(m: &mut Moment) {
    m.ask_once(Request::Park);
}

pub fn clear(m: &mut Moment) {
    m.ask_once(Request::Clear);
}

pub fn engage(m: &mut Moment) {
    m.ask_once(Request::Engage);
}

pub fn engage_far_away(m: &mut Moment) {
    m.begins(|world| {
        if let Source::Still(task) = &mut world.source {
            task.x[5] += 5.0 * world.parameters.engage_position_m;
        }
    });
    if m.cycle == 1 {
        m.world.ask(Request::Engage);
    }
}
