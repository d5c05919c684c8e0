//! Stability limits and noise of the sampled loop of one axis: exact for held forces, any delay and any mass ratio.
//!
//! Computed torque leaves of every axis, linear or angular, a double integrator of the error,
//! `e'' = -u / m`, with m the mass of the platform over that of the model. At instant k T a measurement gives e. The
//! [`estimator`](hexad_core::control::law::estimator) corrects its estimate by it and predicts the estimate over the known delay. The
//! law commands
//!
//! ```text
//! u_k = Kp ep_k + Kd wp_k + d_k        ep, wp, d: estimate at the instant at which the force begins
//! ```
//!
//! The drives hold it for a period from `k T + delay` on. The delay is the sum of the age of the measurement, computing, sending
//! and dead time. Its known part is the age, given by the time stamp, and the configured delay of the drives. Neither the
//! reference nor its instant appears: the error compares both at the same instant.
//!
//! One period takes `z = [e, T e', estimate of e, T w, T^2 d, u_k-1, u_k-2, ...]` to `A z + b n`, n the noise of the reading. The
//! loop is stable exactly while the spectral radius of A is below 1. It is conditionally stable: the platform may be too
//! light and too heavy. Noise of the platform: P = A P A^T + b b^T (Lyapunov). Franklin, Powell and Workman, "Digital Control of
//! Dynamic Systems", chapters 4 and 8; Åström and Wittenmark, "Computer-Controlled Systems", chapters 2, 3 and 10.
//!
//! Not covered: drives with a lag, elastic legs, and cycles without a new measurement. None of this is part of the cycle.

use nalgebra::{DMatrix, DVector};

use hexad_core::control::law::estimator::covariance::{KalmanGains, NoiseModel};

/// Longest delay that is computed, in periods; a loop that is stable with more counts as stable with this one.
pub const MAX_DELAY_PERIODS: usize = 64;

/// Halvings of an interval by bisection: to a billionth of it.
const BISECTION_STEPS: u32 = 40;
/// Squarings of a matrix: its 2^40th power is that of its spectral radius to rounding.
const SQUARINGS: i32 = 40;
/// Squarings of the doubling algorithm for Lyapunov's equation: a million cycles.
const LYAPUNOV_SQUARINGS: u32 = 20;
/// Steps of the search for a stable gain, each a tenth.
const GAIN_STEPS: i32 = 60;

/// Sampled control loop of one axis, without units.
///
/// ```
/// use hexad_machine::analysis::sampled_loop::SampledLoop;
/// let loop_of = |delay_periods| SampledLoop { wn_t: 0.06, delay_periods, ..SampledLoop::default() };
/// assert!(loop_of(1.0).gain_margin() > 2.0 && loop_of(1.0).longest_delay() > 6.0);
/// assert!(loop_of(2.0).largest_wn_t() < loop_of(1.0).largest_wn_t());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLoop {
    /// Natural frequency times period, `wn T`: `Kp = wn^2`, `Kd = 2 zeta wn`.
    pub wn_t: f64,
    /// zeta
    pub damping_ratio: f64,
    /// Bandwidth of the estimator over the natural frequency, `we / wn`.
    pub estimator_ratio: f64,
    /// Noise of a reading of the rate, times the period, over that of a length; `None` if rates are not used.
    pub rate_noise_ratio: Option<f64>,
    /// Whether the estimated disturbance is compensated.
    pub compensates_disturbance: bool,
    /// Part of the delay over which the estimator predicts, in periods.
    pub known_delay_periods: f64,
    /// Delay from the measurement to its force, in periods.
    pub delay_periods: f64,
    /// Mass of the platform over that of the model.
    pub mass_ratio: f64,
    /// Open-loop pole of the platform under held forces, times the period: see [`held_forces`](super::held_forces).
    pub held_pole_t: f64,
}

impl Default for SampledLoop {
    /// Critically damped, with an estimator as fast as the loop, without delay.
    fn default() -> Self {
        Self {
            wn_t: 0.06,
            damping_ratio: 1.0,
            estimator_ratio: 1.0,
            rate_noise_ratio: None,
            compensates_disturbance: true,
            known_delay_periods: 0.0,
            delay_periods: 0.0,
            mass_ratio: 1.0,
            held_pole_t: 0.0,
        }
    }
}

/// Error and rate of an axis, the acceleration that disturbs it, and its pole under held forces.
#[derive(Clone, Copy, Debug)]
struct Axis {
    e: f64,
    v: f64,
    d: f64,
    pole: f64,
}

impl Axis {
    /// Over `dt` with `e'' = pole^2 e + a`.
    fn step(&mut self, dt: f64, a: f64) {
        let Self { e, v, pole, .. } = *self;
        let half = 0.5 * pole * dt;
        // sinh x / x
        let by_half = if half < 1e-4 { 1.0 } else { libm::sinh(half) / half };
        let (cosh, sinh_over_pole) = (1.0 + 2.0 * (half * by_half).powi(2), dt * by_half * libm::cosh(half));
        let growth = pole * pole * sinh_over_pole;
        self.e = e * cosh + v * sinh_over_pole + 0.5 * a * (dt * by_half).powi(2);
        self.v = e * growth + v * cosh + a * sinh_over_pole;
    }

    /// Through commands that each act until the next: `u(j)` was commanded j periods ago and begins a delay later.
    fn advance(&mut self, duration: f64, delay: f64, u: impl Fn(usize) -> f64) {
        let (whole, mut now) = (delay.floor(), 0.0);
        let mut ago = whole as usize + 1;
        let mut end = delay - whole;
        while now < duration {
            let dt = end.min(duration) - now;
            if dt > 0.0 {
                self.step(dt, self.d - u(ago));
                now += dt;
            }
            (ago, end) = (ago.saturating_sub(1), if ago == 1 { f64::INFINITY } else { end + 1.0 });
        }
    }
}

/// One period as a linear map.
struct Period<'a> {
    of: &'a SampledLoop,
    gains: [KalmanGains; 2],
    pending: usize,
}

impl<'a> Period<'a> {
    fn new(of: &'a SampledLoop) -> Self {
        let bandwidth_rad_s = of.estimator_ratio * of.wn_t;
        let (_, gains) =
            NoiseModel { bandwidth_rad_s, rate_noise_ratio: of.rate_noise_ratio, period_s: 1.0 }.steady();
        Self { of, gains, pending: of.delay_periods.max(of.known_delay_periods).ceil() as usize + 1 }
    }

    /// With the poses for which forces were commanded, if they matter.
    fn states(&self) -> usize {
        let poses = if self.of.held_pole_t > 0.0 { self.pending } else { 0 };
        5 + self.pending + poses
    }

    /// The state a period later; `noise` of the readings of e and of T e', and what acts beside the commands of so many periods ago.
    fn advance(&self, z: &DVector<f64>, noise: [f64; 2], push: impl Fn(usize) -> f64) -> DVector<f64> {
        let SampledLoop {
            wn_t,
            damping_ratio,
            compensates_disturbance,
            known_delay_periods,
            delay_periods,
            mass_ratio,
            held_pole_t,
            ..
        } = *self.of;
        let at = |k: usize| z.get(k).copied().unwrap_or_default();
        let mut platform = Axis { e: at(0), v: at(1), d: 0.0, pole: held_pole_t };
        let mut estimate = Axis { e: at(2), v: at(3), d: at(4), pole: 0.0 };
        let correct = |[by_e, by_v, by_d]: KalmanGains, innovation: f64, estimate: &mut Axis| {
            estimate.e += by_e * innovation;
            estimate.v += by_v * innovation;
            estimate.d += by_d * innovation;
        };
        let [of_length, of_rate] = self.gains;
        correct(of_length, platform.e + noise[0] - estimate.e, &mut estimate);
        correct(of_rate, platform.v + noise[1] - estimate.v, &mut estimate);
        let residual = platform.e + noise[0] - estimate.e;
        let mut begin = estimate;
        begin.advance(known_delay_periods, known_delay_periods, |ago| at(4 + ago));
        let mut newest = wn_t * wn_t * begin.e + 2.0 * damping_ratio * wn_t * begin.v;
        if compensates_disturbance {
            newest += begin.d;
        }
        let u = |ago: usize| if ago == 0 { newest } else { at(4 + ago) };
        // The error of the pose for which the dynamics are evaluated.
        let mut middle = begin;
        middle.step(0.5, middle.d - newest);
        let pose = |ago: usize| if ago == 0 { middle.e + residual } else { at(4 + self.pending + ago) };
        estimate.advance(1.0, known_delay_periods, u);
        let pole_squared = held_pole_t * held_pole_t;
        platform
            .advance(1.0, delay_periods, |ago| (u(ago) + push(ago)) / mass_ratio + pole_squared * pose(ago));
        let head = [platform.e, platform.v, estimate.e, estimate.v, estimate.d];
        let (commands, poses) = ((0..self.pending).map(u), (0..self.pending).map(pose));
        DVector::from_iterator(
            self.states(),
            head.into_iter().chain(commands).chain(poses).take(self.states()),
        )
    }

    fn matrix(&self) -> DMatrix<f64> {
        let states = self.states();
        let unit = |k: usize| DVector::from_fn(states, |row, _| f64::from(u8::from(row == k)));
        let columns: Vec<_> = (0..states).map(|k| self.advance(&unit(k), [0.0; 2], |_| 0.0)).collect();
        DMatrix::from_columns(&columns)
    }
}

impl SampledLoop {
    /// Factor by which the slowest part of an error changes in a period, at most: the largest magnitude of an eigenvalue.
    pub fn spectral_radius(&self) -> f64 {
        let mut matrix = Period::new(self).matrix();
        let mut logarithm = 0.0;
        for squaring in 0..SQUARINGS {
            let norm = matrix.norm();
            if !(norm > 0.0 && norm.is_finite()) {
                return if norm == 0.0 { 0.0 } else { f64::INFINITY };
            }
            logarithm += libm::log(norm) / 2.0_f64.powi(squaring);
            matrix /= norm;
            // By columns: the product of two matrices rounds differently where the processor has FMA.
            let columns: Vec<_> = matrix.column_iter().map(|column| &matrix * column).collect();
            matrix = DMatrix::from_columns(&columns);
        }
        libm::exp(logarithm)
    }

    /// The loop of a mode in which feedback has `gain` times its gain, and the estimator's model includes that gain.
    pub fn with_feedback_gain(self, gain: f64) -> Self {
        let root = gain.sqrt();
        Self {
            wn_t: self.wn_t * root,
            damping_ratio: self.damping_ratio * root,
            estimator_ratio: self.estimator_ratio / root,
            ..self
        }
    }

    /// Whether every error fades. Far below the limit, where eigenvalues are next to 1, rounding decides.
    pub fn is_stable(&self) -> bool {
        self.spectral_radius() < 1.0
    }

    /// Standard deviation of the error of the platform for readings of the lengths, and of the rates times the period, with
    /// these. Infinite if the loop is not stable.
    pub fn noise(&self, deviations: [f64; 2]) -> f64 {
        if !self.is_stable() {
            return f64::INFINITY;
        }
        let period = Period::new(self);
        let still = DVector::zeros(period.states());
        let [of_length, of_rate] = [[deviations[0], 0.0], [0.0, deviations[1]]];
        let inputs = [of_length, of_rate].map(|noise| period.advance(&still, noise, |_| 0.0));
        let mut sum: DMatrix<f64> = inputs.iter().map(|input| input * input.transpose()).sum();
        let mut power = period.matrix();
        for _ in 0..LYAPUNOV_SQUARINGS {
            sum += &power * &sum * power.transpose();
            power = &power * &power;
        }
        sum.get((0, 0)).copied().unwrap_or(f64::NAN).sqrt()
    }

    /// Error at each of so many measurements, from this error that nothing has measured before, and a push of one period beside
    /// the first command, as an acceleration times `T^2`.
    pub fn response(&self, error: f64, push: f64, cycles: usize) -> Vec<f64> {
        let period = Period::new(self);
        let mut state = DVector::zeros(period.states());
        if let Some(e) = state.get_mut(0) {
            *e = error;
        }
        (0..cycles)
            .map(|cycle| {
                let beside = |ago| if ago == cycle { push } else { 0.0 };
                let next = period.advance(&state, [0.0; 2], beside);
                core::mem::replace(&mut state, next).get(0).copied().unwrap_or_default()
            })
            .collect()
    }

    /// Largest stable `wn T`, other parameters unchanged; all smaller ones are stable too.
    pub fn largest_wn_t(&self) -> f64 {
        // Beyond, delay and hold lag by more than the damping term leads, at any gain.
        let none = 4.0 * (1.0 + self.damping_ratio) / (self.delay_periods + 0.5);
        edge(0.0, none, |wn_t| Self { wn_t, ..*self }.is_stable())
    }

    /// Whether every error fades with so many times the loop gain.
    pub fn is_stable_with_gain(&self, gain: f64) -> bool {
        Self { mass_ratio: self.mass_ratio / gain, ..*self }.is_stable()
    }

    /// The factor by which the loop gain may grow, or the mass shrink; below 1 the loop is unstable already, 0 if no gain is
    /// stable.
    pub fn gain_margin(&self) -> f64 {
        let none = 16.0 * self.mass_ratio * (1.0 + 1.0 / (self.wn_t * self.damping_ratio));
        let stable = (0..GAIN_STEPS)
            .map(|step| libm::pow(0.9, step.into()))
            .find(|gain| self.is_stable_with_gain(*gain));
        stable.map_or(0.0, |inside| edge(inside, none, |gain| self.is_stable_with_gain(gain)))
    }

    /// The factor to which the loop gain may fall, or the inverse of that by which the mass may grow. Compensation of
    /// disturbances needs some gain.
    pub fn least_gain(&self) -> f64 {
        if self.is_stable() {
            edge(1.0, 0.0, |gain| gain > 0.0 && self.is_stable_with_gain(gain))
        } else {
            1.0
        }
    }

    /// The longest stable delay, in periods, at most [`MAX_DELAY_PERIODS`]. Its known part stays as it is.
    pub fn longest_delay(&self) -> f64 {
        let with = |delay_periods| Self { delay_periods, ..*self }.is_stable();
        let longest = MAX_DELAY_PERIODS as f64;
        if with(longest) { longest } else { edge(self.known_delay_periods, longest, with) }
    }
}

/// The last of the numbers from `inside` towards `outside` for which a condition holds, by bisection.
pub fn edge(inside: f64, outside: f64, holds: impl Fn(f64) -> bool) -> f64 {
    bisect_in_steps(BISECTION_STEPS, inside, outside, holds)
}

/// The same to the precision of so many steps.
pub fn bisect_in_steps(steps: u32, mut inside: f64, mut outside: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..steps {
        let middle = 0.5 * (inside + outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

#[cfg(test)]
mod tests;
