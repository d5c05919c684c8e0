//! Stability limits of the sampled loop of one axis: exact for held forces, any delay and any mass ratio.
//!
//! Computed torque leaves of every axis, linear or angular, a double integrator of the error,
//! `e'' = -u / m`, with m the mass of the platform over that of the model. At instant k T the controller
//! has e and e', commands
//!
//! ```text
//! u_k = Kp e_k + Kd e'_k + s_k        s_k+1 = s_k + Ki T e_k
//! ```
//!
//! and the drives hold it for a period from `k T + delay` on. The delay is the sum of the age of the
//! measurement, computing, sending and dead time. Neither the reference nor its instant appears: the error compares both at
//! the same instant, so a delay makes no error, but it remains in the loop. With
//! `delay = (d + f) T`, `0 <= f < 1`, `h = 1 - f`, one period takes the state, with its pending commands, to
//!
//! ```text
//!           e_k+1 = e_k + T e'_k - T^2 / m (h^2 / 2 u_k-d + (1 - h^2) / 2 u_k-d-1)
//! T        e'_k+1 =       T e'_k - T^2 / m (h       u_k-d +  f            u_k-d-1)
//! ```
//!
//! The characteristic polynomial of that matrix, `kp = Kp T^2 / m`, `kd = Kd T / m`, `ki = Ki T^3 / m`, is
//!
//! ```text
//! z^(d+1) (z - 1)^3 + (kp (z - 1) + ki) q(z) + kd (h z + f) (z - 1)^2
//! q(z) = h^2 / 2 z^2 + (1 / 2 + h f) z + f^2 / 2
//! ```
//!
//! without Ki less one factor `z - 1`. An observer L ([`crate::control::law`]) makes such a loop: in sum it adds `L Kd` to
//! Kp, L to Kd, and `Ki = L Kp`. The loop is stable exactly while all its zeros are within
//! the unit circle. Franklin, Powell and Workman, "Digital Control of Dynamic Systems", chapter 4 (hold and delay);
//! Åström and Wittenmark, "Computer-Controlled Systems", chapters 2 and 3 (the same; Jury's criterion).
//!
//! Short delays are no simpler: a strong damping term is stable with a quarter of a period and not without.
//! Not covered: drives with a lag, elastic legs, and cycles without a new measurement, which extrapolate the last error.
//! None of this is part of the cycle.

/// Longest delay that is computed, in periods; a loop that is stable with more counts as stable with this one.
pub const MAX_DELAY_PERIODS: usize = 64;

/// Coefficients of the polynomial with the longest delay and an observer.
const MAX_COEFFICIENTS: usize = MAX_DELAY_PERIODS + 5;

/// Halvings of an interval by bisection, down to rounding.
const BISECTION_STEPS: u32 = 60;

/// Sampled control loop of one axis, without units.
///
/// ```
/// use hexad::analysis::sampled_loop::SampledLoop;
/// let loop_of = |delay| SampledLoop { wn_t: 0.06, damping_ratio: 1.0, observer: 0.0, delay, mass_ratio: 1.0 };
/// // One period of delay: Jury's criterion in closed form, with a = (wn T)^2 / 2 and b = 2 zeta wn T.
/// let (a, b) = (0.5 * 0.06_f64.powi(2), 2.0 * 0.06);
/// assert!((loop_of(1.0).gain_margin() - (b - 3.0 * a) / (b - a).powi(2)).abs() < 1e-9);
/// assert!(loop_of(2.0).largest_wn_t() < loop_of(1.0).largest_wn_t());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLoop {
    /// Natural frequency times period, `wn T`: `Kp = wn^2`, `Kd = 2 zeta wn`.
    pub wn_t: f64,
    /// zeta
    pub damping_ratio: f64,
    /// `L / wn` of the observer; 0 is without.
    pub observer: f64,
    /// Delay from the measurement to its force, in periods.
    pub delay: f64,
    /// Mass of the platform over that of the model.
    pub mass_ratio: f64,
}

impl SampledLoop {
    /// Kp and Kd with the additions of the observer, in units of `wn^2` and `wn`.
    fn observed(&self) -> [f64; 2] {
        let damping = 2.0 * self.damping_ratio;
        [1.0 + self.observer * damping, damping + self.observer]
    }

    /// The characteristic polynomial, lowest coefficient first, and its degree; the commands of `after` periods
    /// are pending, the oldest for a share `f` of a period more.
    fn characteristic(&self, after: usize, f: f64) -> ([f64; MAX_COEFFICIENTS], usize) {
        let h = 1.0 - f;
        let [stiffness, damping] = self.observed();
        let kp = stiffness * self.wn_t * self.wn_t / self.mass_ratio;
        let kd = damping * self.wn_t / self.mass_ratio;
        let ki = self.observer * self.wn_t * self.wn_t * self.wn_t / self.mass_ratio;
        let [q0, q1, q2] = [0.5 * f * f, 0.5 + h * f, 0.5 * h * h];
        let [n0, n1, n2] = [kp * q0 - kd * f, kp * q1 + kd * (f - h), kp * q2 + kd * h];
        let mut coefficients = [0.0; MAX_COEFFICIENTS];
        let mut add = |lowest: usize, terms: [f64; 4]| {
            for (sum, term) in coefficients.iter_mut().skip(lowest).zip(terms) {
                *sum += term;
            }
        };
        if self.observer > 0.0 {
            add(after, [-1.0, 3.0, -3.0, 1.0]);
            add(0, [ki * q0 - n0, ki * q1 + n0 - n1, ki * q2 + n1 - n2, n2]);
            (coefficients, after + 3)
        } else {
            add(after, [1.0, -2.0, 1.0, 0.0]);
            add(0, [n0, n1, n2, 0.0]);
            (coefficients, after + 2)
        }
    }

    /// Whether every error fades. Far below the limit, where zeros are next to 1, rounding decides.
    fn is_stable(&self) -> bool {
        let whole = self.delay.floor();
        let after = whole as usize + 1;
        let (mut coefficients, degree) = self.characteristic(after, self.delay - whole);
        coefficients.get_mut(..=degree).is_some_and(within_unit_circle)
    }

    /// Largest stable `wn T`, other parameters unchanged; all smaller ones are stable too.
    pub fn largest_wn_t(&self) -> f64 {
        // Beyond half of it, delay and hold lag by more than the damping term leads, at any gain; the integral in an
        // observer may move that a little.
        let [stiffness, damping] = self.observed();
        let none = 2.0 * damping / (stiffness * (self.delay + 0.5));
        boundary(none, |wn_t| Self { wn_t, ..*self }.is_stable())
    }

    /// The factor by which the loop gain may grow, or the mass shrink; below 1 the loop is unstable already.
    pub fn gain_margin(&self) -> f64 {
        // At any delay kd < 6, by that lag and Jury's conditions at z = 0 and z = -1; an observer may move it.
        let [_, damping] = self.observed();
        let none = 8.0 * self.mass_ratio / (damping * self.wn_t);
        boundary(none, |gain| Self { mass_ratio: self.mass_ratio / gain, ..*self }.is_stable())
    }

    /// The factor to which the loop gain may fall; an observer needs some gain. Routh's criterion, for a loop that is slow
    /// against its period.
    pub fn least_gain(&self) -> f64 {
        let [stiffness, damping] = self.observed();
        self.mass_ratio * self.observer / (stiffness * damping)
    }

    /// The longest stable delay, in periods; no longer than [`MAX_DELAY_PERIODS`]. Shorter ones are too, down
    /// to a quarter of a period; below, a strong damping term would need some.
    pub fn longest_delay(&self) -> f64 {
        boundary(MAX_DELAY_PERIODS as f64, |delay| self.wn_t < Self { delay, ..*self }.largest_wn_t())
    }
}

/// Upper end of the interval from 0, within `high`, in which a condition holds; by bisection.
pub fn boundary(mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let mut low = 0.0;
    for _ in 0..BISECTION_STEPS {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Whether all zeros of a polynomial, lowest coefficient first, are within the unit circle: Jury's table, in the
/// form of Schur and Cohn. Each row is `(p(z) - k z^n p(1 / z)) / z` of the row before. Overwrites.
fn within_unit_circle(mut row: &mut [f64]) -> bool {
    while let [lowest, .., highest] = row {
        let k = *lowest / *highest;
        if !(k.abs() < 1.0) {
            return false;
        }
        let mut rest = row.iter_mut();
        while let Some(low) = rest.next() {
            match rest.next_back() {
                Some(high) => (*low, *high) = (*low - k * *high, *high - k * *low),
                None => *low -= k * *low,
            }
        }
        row = row.get_mut(1..).unwrap_or_default();
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOP: SampledLoop =
        SampledLoop { wn_t: 0.1, damping_ratio: 1.0, observer: 0.0, delay: 1.0, mass_ratio: 1.0 };

    fn loops() -> impl Iterator<Item = SampledLoop> {
        [0.1, 0.5, 1.0, 3.0, 10.0].into_iter().flat_map(|damping_ratio| {
            [0.0, 0.3, 0.999, 1.0, 1.5, 2.0, 2.1, 5.7].into_iter().flat_map(move |delay| {
                [0.3, 1.0, 3.0].into_iter().flat_map(move |mass_ratio| {
                    [0.0, 0.5 * damping_ratio].map(|observer| SampledLoop {
                        damping_ratio,
                        delay,
                        mass_ratio,
                        observer,
                        ..LOOP
                    })
                })
            })
        })
    }

    /// Largest error in the last quarter of so many cycles, started at 1, by the recurrence itself.
    fn simulated(of: &SampledLoop, cycles: usize) -> f64 {
        let SampledLoop { wn_t, damping_ratio, observer, delay, mass_ratio } = *of;
        let (d, f) = (delay as usize, delay.fract());
        let h = 1.0 - f;
        let (kp, kd, l) = (wn_t * wn_t, 2.0 * damping_ratio * wn_t, observer * wn_t);
        let [mut e, mut v, mut learnt] = [1.0, 0.0, 0.0];
        let mut expected = kd;
        // The newest first.
        let mut commands = [0.0; 16];
        let mut largest = 0.0;
        for cycle in 0..cycles {
            commands.copy_within(0..15, 1);
            learnt += l * (v + kd * e - expected);
            expected = v + kd * e - kp * e;
            commands[0] = kp * e + kd * v + learnt;
            let [late, early] = [commands[d], commands[d + 1]].map(|u| u / mass_ratio);
            e += v - 0.5 * h * h * late - 0.5 * (1.0 - h * h) * early;
            v -= h * late + f * early;
            if e.abs() > 1e100 {
                return f64::INFINITY;
            }
            largest = if 4 * cycle < 3 * cycles { 0.0 } else { f64::max(largest, e.abs()) };
        }
        largest
    }

    #[test]
    fn the_limit_is_where_the_recurrence_turns_unstable() {
        for each in loops() {
            let limit = each.largest_wn_t();
            let [below, above] = [0.98, 1.02].map(|share| {
                let at = SampledLoop { wn_t: share * limit, ..each };
                [20_000, 100_000].map(|cycles| simulated(&at, cycles))
            });
            assert!(below[1] <= 0.99 * below[0], "{each:?} settles below {limit}: {below:?}");
            assert!(!(above[1] < 1.01 * above[0]), "{each:?} grows above {limit}: {above:?}");
        }
    }

    /// One period, no observer: with `a = kp / 2`, `b = kd` Jury's criterion leaves `b - 3 a > (b - a)^2`.
    #[test]
    fn with_one_period_the_gain_margin_is_the_closed_form() {
        for (wn_t, damping_ratio) in [(0.06, 1.0), (0.19, 0.7), (0.3, 1.2), (0.05, 0.1)] {
            let (a, b): (f64, f64) = (0.5 * wn_t * wn_t, 2.0 * damping_ratio * wn_t);
            let expected = (b - 3.0 * a) / (b - a).powi(2);
            let found = SampledLoop { wn_t, damping_ratio, ..LOOP }.gain_margin();
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }

    /// Bisection would not see an island.
    #[test]
    fn what_is_stable_is_one_interval() {
        for each in loops() {
            let limit = each.largest_wn_t();
            let at = SampledLoop { wn_t: 0.5 * limit, ..each };
            let gain = at.gain_margin();
            for share in (30..400).filter(|percent| *percent != 100).map(|percent| 0.01 * f64::from(percent))
            {
                let faster = SampledLoop { wn_t: share * limit, ..each };
                assert_eq!(faster.is_stable(), share < 1.0, "{faster:?}, limit {limit}");
                let stronger = SampledLoop { mass_ratio: each.mass_ratio / (share * gain), ..at };
                assert_eq!(stronger.is_stable(), share < 1.0, "{stronger:?}, limit {gain}");
            }
        }
    }

    #[test]
    fn the_longer_the_delay_the_lower_the_limit() {
        for each in loops() {
            let limit = |delay| SampledLoop { delay, ..each }.largest_wn_t();
            for delay in (1..100).map(|quarter| 0.25 * f64::from(quarter)) {
                assert!(limit(delay) > limit(delay + 0.25), "{each:?} at {delay}");
            }
            let at = SampledLoop { wn_t: 0.5 * each.largest_wn_t(), ..each };
            let there = SampledLoop { delay: at.longest_delay(), ..at };
            // Slow loops with an observer, to rounding.
            assert!(
                (there.largest_wn_t() / at.wn_t - 1.0).abs() < 1e-4,
                "{there:?}: {}",
                there.largest_wn_t() / at.wn_t
            );
        }
    }
}
