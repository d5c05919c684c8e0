//! Wrong, missing and noisy setpoints.

use hexad::control::signals::inputs::Setpoint;

use super::super::situations::GAMMA_RANGE;
use super::super::world::{Source, wanted};
use super::{Moment, noise};

pub fn end(m: &mut Moment) {
    m.begins(|world| world.source = Source::Silent);
    m.input.setpoint = m.before.setpoint;
}

/// No new message in this cycle.
pub fn end_for_now(m: &mut Moment) {
    m.input.setpoint = m.before.setpoint;
}

pub fn pause_30_ms(m: &mut Moment) {
    if m.cycle < 30 {
        end_for_now(m);
    }
}

/// The source repeats itself with fresh stamps.
pub fn freeze(m: &mut Moment) {
    wanted(m.input).task = m.before.setpoint.unwrap().task;
}

pub fn nan_x(m: &mut Moment) {
    m.x()[4] = f64::NAN;
}

pub fn nan_x_once(m: &mut Moment) {
    if m.cycle == 0 {
        nan_x(m);
    }
}

pub fn infinite_xdd(m: &mut Moment) {
    m.xdd()[0] = f64::NEG_INFINITY;
}

pub fn jump_10_mm(m: &mut Moment) {
    m.x()[3] += 0.01;
}

pub fn jump_10_mm_once(m: &mut Moment) {
    if m.cycle == 0 {
        jump_10_mm(m);
    }
}

/// Zeros: a source that never learned its first message.
pub fn all_zero(m: &mut Moment) {
    wanted(m.input).task = Default::default();
}

pub fn without_rates(m: &mut Moment) {
    m.xd().fill(0.0);
}

pub fn rates_in_mm(m: &mut Moment) {
    *m.xd() *= 1e3;
}

pub fn rates_of_wrong_sign(m: &mut Moment) {
    *m.xd() *= -1.0;
}

pub fn rate_while_standing(m: &mut Moment) {
    m.xd()[5] += 0.2;
}

pub fn without_accelerations(m: &mut Moment) {
    m.xdd().fill(0.0);
}

pub fn acceleration_while_standing(m: &mut Moment) {
    m.xdd()[5] += 3.0;
}

pub fn too_fast(m: &mut Moment) {
    m.xd()[4] = 1.5;
}

pub fn too_strong(m: &mut Moment) {
    m.xdd()[4] = 6.0;
}

/// A motion that belongs to itself, but begins with a step of acceleration.
pub fn step_of_acceleration(m: &mut Moment) {
    let t = m.seconds() + 1e-3;
    m.adds([t * t, 2.0 * t, 2.0]);
}

/// Upward with a tenth of the limits of jerk, acceleration and velocity, and on until there is no stroke left.
pub fn run_out_of_stroke(m: &mut Moment) {
    let t = m.seconds() + 1e-3;
    let (jerk, rise) = (5.0, 0.1);
    let ramp = t.min(rise);
    let mut z = [jerk * ramp.powi(3) / 6.0, 0.5 * jerk * ramp * ramp, jerk * ramp];
    if t > rise {
        let after = t - rise;
        z = [z[0] + z[1] * after + 0.5 * z[2] * after * after, z[1] + z[2] * after, z[2]];
    }
    m.adds(z);
}

pub fn beyond_stroke(m: &mut Moment) {
    m.x()[5] += 0.9;
}

/// Reachable, and not allowed.
pub fn out_of_envelope(m: &mut Moment) {
    m.x()[2] = 1.1 * GAMMA_RANGE;
}

pub fn stamps_1_s_old(m: &mut Moment) {
    wanted(m.input).time_ns -= 1_000_000_000;
}

pub fn stamps_1_s_ahead(m: &mut Moment) {
    wanted(m.input).time_ns += 1_000_000_000;
}

pub fn stamps_run_backward(m: &mut Moment) {
    let before_ns = m.before.setpoint.unwrap().time_ns;
    wanted(m.input).time_ns = before_ns - 100_000 * (m.cycle + 1);
}

/// Every second message is of somebody else.
pub fn second_source(m: &mut Moment) {
    if m.cycle % 2 == 1 {
        m.x()[3] += 0.05;
    }
}

/// 100 Hz, and stamped up to 0.2 ms early or late.
pub fn slow_and_jittery(m: &mut Moment) {
    let newest = m.cycle - m.cycle % 10;
    let back_ns = (m.cycle - newest) * m.world.rig.parameters.period_ns;
    let jitter = (2e5 * noise(newest)) as i64;
    let instant_ns = m.world.rig.now_ns - back_ns;
    let task = m.world.task(instant_ns);
    if let Some(task) = task {
        let stamp_ns = instant_ns.wrapping_add_signed(jitter);
        *wanted(m.input) = Setpoint::motion(stamp_ns, task);
    }
}
