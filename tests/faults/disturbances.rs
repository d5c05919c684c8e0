//! What goes wrong, each as a change of one cycle's input or of the world.

use hexad::control::controller::{Input, Measurement};
use hexad::control::state::Request;
use hexad::model::machine::LEGS;

use super::situations::GAMMA_RANGE;
use super::world::{Grip, Source, World, measured, wanted};

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
    let mut x = seed.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

pub type Disturbance = fn(&mut Moment);

pub mod measurements {
    use super::*;

    pub fn end(m: &mut Moment) {
        m.input.measurement = m.before.measurement;
    }

    /// The driver repeats itself with fresh stamps.
    pub fn freeze(m: &mut Moment) {
        let Measurement { length, rate, .. } = m.before.measurement.unwrap();
        *m.measured() = Measurement { length, rate, ..*m.measured() };
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
        m.measured().length[2] = f64::NAN;
    }

    pub fn nan_rate_once(m: &mut Moment) {
        if m.cycle == 0 {
            m.measured().rate[5] = f64::NAN;
        }
    }

    pub fn infinite_rate(m: &mut Moment) {
        m.measured().rate[1] = f64::INFINITY;
    }

    /// An encoder that lost counts.
    pub fn jump_20_mm(m: &mut Moment) {
        m.measured().length[3] += 0.02;
    }

    pub fn jump_20_mm_once(m: &mut Moment) {
        if m.cycle == 0 {
            jump_20_mm(m);
        }
    }

    /// Too small to be called a jump, and it stays.
    pub fn slip_1_mm(m: &mut Moment) {
        m.measured().length[3] += 0.001;
    }

    pub fn out_of_stroke(m: &mut Moment) {
        m.measured().length[0] = 2.4;
    }

    pub fn rates_of_wrong_sign(m: &mut Moment) {
        m.measured().rate.iter_mut().for_each(|rate| *rate = -*rate);
    }

    pub fn rates_in_mm(m: &mut Moment) {
        m.measured().rate.iter_mut().for_each(|rate| *rate *= 1e3);
    }

    pub fn rates_zero(m: &mut Moment) {
        m.measured().rate = [0.0; LEGS];
    }

    pub fn stamps_1_s_old(m: &mut Moment) {
        m.measured().time_ns -= 1_000_000_000;
    }

    pub fn stamps_1_s_ahead(m: &mut Moment) {
        m.measured().time_ns += 1_000_000_000;
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
        let before = m.world.last.measurement.unwrap().rate;
        for (rate, before) in m.measured().rate.iter_mut().zip(before) {
            *rate = before + 0.2 * (*rate - before);
        }
    }

    /// What good encoders do: counts of a micrometre, rates with noise of a millimetre per second.
    pub fn noise_of_encoders(m: &mut Moment) {
        let cycle = m.cycle;
        let Measurement { length, rate, .. } = m.measured();
        for (leg, (length, rate)) in length.iter_mut().zip(rate).enumerate() {
            *length = (*length * 1e6).round() * 1e-6;
            *rate += 1e-3 * noise(cycle * 6 + leg as u64);
        }
    }
}

pub mod setpoints {
    use super::*;

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
        let back_ns = (m.cycle - newest) * m.world.rig.period_ns;
        let jitter = (2e5 * noise(newest)) as i64;
        let instant_ns = m.world.rig.now_ns - back_ns;
        let task = m.world.task(instant_ns);
        if let Some(task) = task {
            let stamp_ns = instant_ns.wrapping_add_signed(jitter);
            *wanted(m.input) = hexad::control::controller::Setpoint::motion(stamp_ns, task);
        }
    }
}

pub mod operator {
    use super::*;

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
                task.x[5] += 5.0 * world.parameters.engage_position;
            }
        });
        if m.cycle == 1 {
            m.world.ask(Request::Engage);
        }
    }
}

pub mod machine {
    use super::*;

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
}

pub mod host {
    use super::*;

    pub fn deadline_missed(m: &mut Moment) {
        m.input.deadline_missed = m.cycle == 0;
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
}

pub mod together {
    use super::*;

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
}
