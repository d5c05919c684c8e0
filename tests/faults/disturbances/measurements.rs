//! Wrong, missing and noisy measurements.

use hexad::control::signals::inputs::Measurement;
use hexad::model::LEGS;

use super::{Moment, noise};

/// The driver of these tests sends rates.
fn rates<'a>(m: &'a mut Moment<'_>) -> &'a mut [f64; LEGS] {
    m.measured().rate_m_s.as_mut().unwrap()
}

pub fn end(m: &mut Moment) {
    m.input.measurement = m.before.measurement;
}

/// The driver repeats itself with fresh stamps.
pub fn freeze(m: &mut Moment) {
    let Measurement { length_m, rate_m_s, .. } = m.before.measurement.unwrap();
    *m.measured() = Measurement { length_m, rate_m_s, ..*m.measured() };
}

pub fn pause_10_ms(m: &mut Moment) {
    if m.cycle < 10 {
        end(m);
    }
}

pub fn pause_30_ms(m: &mut Moment) {
    if m.cycle < 30 {
        end(m);
    }
}

pub fn nan_length(m: &mut Moment) {
    m.measured().length_m[2] = f64::NAN;
}

pub fn nan_rate_once(m: &mut Moment) {
    if m.cycle == 0 {
        rates(m)[5] = f64::NAN;
    }
}

pub fn infinite_rate(m: &mut Moment) {
    rates(m)[1] = f64::INFINITY;
}

/// An encoder that lost counts.
pub fn jump_20_mm(m: &mut Moment) {
    m.measured().length_m[3] += 0.02;
}

pub fn jump_20_mm_once(m: &mut Moment) {
    if m.cycle == 0 {
        jump_20_mm(m);
    }
}

/// Too small to be called a jump, and it stays.
pub fn slip_1_mm(m: &mut Moment) {
    m.measured().length_m[3] += 0.001;
}

pub fn out_of_stroke(m: &mut Moment) {
    m.measured().length_m[0] = 2.4;
}

pub fn rates_of_wrong_sign(m: &mut Moment) {
    rates(m).iter_mut().for_each(|rate| *rate = -*rate);
}

pub fn rates_in_mm(m: &mut Moment) {
    rates(m).iter_mut().for_each(|rate| *rate *= 1e3);
}

pub fn rates_zero(m: &mut Moment) {
    *rates(m) = [0.0; LEGS];
}

pub fn stamps_1_s_old(m: &mut Moment) {
    m.measured().time_ns -= 1_000_000_000;
}

pub fn stamps_1_s_ahead(m: &mut Moment) {
    m.measured().time_ns += 1_000_000_000;
}

/// The way from the sensors has become longer.
pub fn older_than_the_loop_stands(m: &mut Moment) {
    let age_ns = m.world.parameters.max_age_at_arrival_ns + 1_000_000;
    m.measured().time_ns -= age_ns;
}

/// Of the daemon's clock two milliseconds pass in each cycle.
pub fn stamps_at_half_speed(m: &mut Moment) {
    m.input.clock_offset_ns = -1_000_000 * (m.cycle as i64 + 1);
}

pub fn stamps_of_nothing(m: &mut Moment) {
    m.measured().time_ns = 0;
}

pub fn stamps_run_backward(m: &mut Moment) {
    let before_ns = m.before.measurement.unwrap().time_ns;
    m.measured().time_ns = before_ns - 100_000 * (m.cycle + 1);
}

/// Rates behind a filter of the first order, with a time constant of 5 ms.
pub fn filtered_rates(m: &mut Moment) {
    let before = m.world.last.measurement.unwrap().rate_m_s.unwrap();
    for (rate, before) in rates(m).iter_mut().zip(before) {
        *rate = before + 0.2 * (*rate - before);
    }
}

/// What good encoders do: counts of a micrometre, rates with noise of a millimetre per second.
pub fn noise_of_encoders(m: &mut Moment) {
    let cycle = m.cycle;
    let Measurement { length_m, rate_m_s, .. } = m.measured();
    for (leg, (length, rate)) in length_m.iter_mut().zip(rate_m_s.as_mut().unwrap()).enumerate() {
        *length = (*length * 1e6).round() * 1e-6;
        *rate += 1e-3 * noise(cycle * 6 + leg as u64);
    }
}
