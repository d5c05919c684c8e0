//! Gains from bandwidth and damping ratio, and the bound that sampling sets to them.
//!
//! Computed torque turns every axis into a double integrator `e'' = -Kd e' - Kp e`, with `Kp = wn^2`,
//! `Kd = 2 zeta wn`. The loop is sampled with period T, its force held (zero-order hold), and one period
//! passes from measurement to force. With `a = Kp T^2 / 2`, `b = Kd T` the characteristic polynomial is
//!
//! ```text
//! z (z - 1)^2 + a (z + 1) + b (z - 1) = z^3 - 2 z^2 + (1 + a + b) z + (a - b)
//! ```
//!
//! Jury's criterion leaves one condition: `b - 3 a > (b - a)^2`. Scaling the loop gain by k scales a and b,
//! so the largest stable k, the gain margin, is `(b - 3 a) / (b - a)^2`.
//!
//! An observer adds gain (see [`super::law`]), and a pole that a loop of too little gain does not carry: Routh's
//! criterion asks for a k beyond `L Kp / ((Kd + L) (Kp + L Kd))`. At the frequency where the gain margin is decided
//! it acts as the two gains that it adds.

/// Gains of a second-order error dynamics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Kp \[1/s^2\].
    pub stiffness: f64,
    /// Kd \[1/s\].
    pub damping: f64,
}

impl Gains {
    /// `Kp = wn^2`, `Kd = 2 zeta wn`, `wn = 2 pi bandwidth`.
    pub fn new(bandwidth_hz: f64, damping_ratio: f64) -> Self {
        let wn = core::f64::consts::TAU * bandwidth_hz;
        Self { stiffness: wn * wn, damping: 2.0 * damping_ratio * wn }
    }

    /// What they are together with an observer L \[1/s\], but for the integral in it.
    pub fn observed(&self, observer: f64) -> Self {
        Self { stiffness: self.stiffness + observer * self.damping, damping: self.damping + observer }
    }

    /// The factor by which the loop gain may grow before the sampled loop is unstable; below 1 it is unstable
    /// already. Never negative.
    pub fn margin(&self, period_s: f64) -> f64 {
        let a = 0.5 * self.stiffness * period_s * period_s;
        let b = self.damping * period_s;
        ((b - 3.0 * a) / ((b - a) * (b - a))).max(0.0)
    }

    /// The loop gain at which the integral in an observer L \[1/s\] makes the loop unstable.
    pub fn least_gain(&self, observer: f64) -> f64 {
        let Self { stiffness, damping } = self.observed(observer);
        observer * self.stiffness / (stiffness * damping)
    }
}

/// Smallest gain margin a configuration may ask for: the textbook's 6 dB. The loop stays stable with a
/// platform of half the modelled mass, or with half a period more delay than assumed.
pub const MIN_GAIN_MARGIN: f64 = 2.0;

/// The largest bandwidth \[Hz\] with at least this gain margin at this damping ratio and period.
pub fn max_bandwidth_hz(damping_ratio: f64, period_s: f64, margin: f64) -> f64 {
    // The margin falls from infinity at 0 to zero at wn T = 4 zeta / 3, where b = 3 a.
    let beyond = 4.0 * damping_ratio / 3.0 / core::f64::consts::TAU / period_s;
    largest(beyond, |hertz| Gains::new(hertz, damping_ratio).margin(period_s) >= margin)
}

/// The fastest observer \[1/s\], up to `fastest`, that leaves both margins on a loop whose modes have between
/// `softest` and `stiffest` times its gain.
pub fn max_observer(gains: &Gains, period_s: f64, [softest, stiffest]: [f64; 2], fastest: f64) -> f64 {
    largest(fastest, |observer| {
        gains.observed(observer).margin(period_s) >= MIN_GAIN_MARGIN * stiffest
            && gains.least_gain(observer) * MIN_GAIN_MARGIN <= softest
    })
}

/// The largest number below `high` of which something holds that holds of the small ones.
fn largest(mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let mut low = 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error after 2000 cycles of the sampled loop, started at 1, with the loop gain scaled.
    fn simulated_error(gains: &Gains, observer: f64, period: f64, scale: f64) -> f64 {
        let (mut x, mut v, mut held) = (1.0, 0.0, 0.0);
        let (mut d, mut expected) = (0.0, gains.damping);
        for _ in 0..2000 {
            let led = v + gains.damping * x;
            d += observer * (led - expected);
            expected = led - gains.stiffness * x * period;
            let next = -scale * (gains.stiffness * x + gains.damping * v + d);
            x += period * v + 0.5 * period * period * held;
            v += period * held;
            held = next;
        }
        f64::abs(x)
    }

    #[test]
    fn the_margin_is_where_the_simulated_loop_turns_unstable() {
        for (bandwidth, damping, period) in [(10.0, 1.0, 1e-3), (30.0, 0.7, 1e-3), (5.0, 1.2, 4e-3)] {
            let gains = Gains::new(bandwidth, damping);
            let margin = gains.margin(period);
            assert!(margin > 1.0, "{margin}");
            assert!(simulated_error(&gains, 0.0, period, 0.98 * margin) < 1.0);
            assert!(simulated_error(&gains, 0.0, period, 1.02 * margin) > 1.0);
        }
    }

    #[test]
    fn the_largest_bandwidth_has_the_smallest_margin() {
        for (damping, period) in [(0.5, 1e-3), (1.0, 1e-3), (1.0, 50e-6), (2.0, 4e-3)] {
            let bandwidth = max_bandwidth_hz(damping, period, MIN_GAIN_MARGIN);
            let margin = Gains::new(bandwidth, damping).margin(period);
            assert!((margin - MIN_GAIN_MARGIN).abs() < 1e-6);
        }
    }

    /// The fastest observer leaves the margins, up and down, but for what its integral takes of the upper one.
    #[test]
    fn the_fastest_observer_is_stable_with_its_margins() {
        for (bandwidth, damping, period) in [(10.0, 1.0, 1e-3), (3.0, 0.4, 1e-3), (60.0, 1.0, 2.5e-4)] {
            let gains = Gains::new(bandwidth, damping);
            let wn = gains.stiffness.sqrt();
            let observer = max_observer(&gains, period, [1.0; 2], 100.0 * wn);
            assert!(observer > 0.1 * wn);
            let settles = |observer: f64, scale: f64| simulated_error(&gains, observer, period, scale) < 0.5;
            assert!(settles(observer, 1.0) && settles(observer, 0.9 * MIN_GAIN_MARGIN));
            assert!(settles(observer, 1.1 / MIN_GAIN_MARGIN));
            let upper = gains.observed(observer).margin(period);
            assert!(!settles(observer, 1.1 * upper), "{upper}");
            let lower = gains.least_gain(observer);
            assert!(lower < 0.05 || !settles(observer, 0.8 * lower), "{lower}");
        }
    }
}
