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
}

/// Smallest gain margin a configuration may ask for: the textbook's 6 dB. The loop stays stable with a
/// platform of half the modelled mass, or with half a period more delay than assumed.
pub const MIN_GAIN_MARGIN: f64 = 2.0;

/// The factor by which the loop gain may grow before the sampled loop is unstable; below 1 it is unstable
/// already. Never negative.
pub fn gain_margin(bandwidth_hz: f64, damping_ratio: f64, period_s: f64) -> f64 {
    let gains = Gains::new(bandwidth_hz, damping_ratio);
    let a = 0.5 * gains.stiffness * period_s * period_s;
    let b = gains.damping * period_s;
    ((b - 3.0 * a) / ((b - a) * (b - a))).max(0.0)
}

/// The largest bandwidth \[Hz\] with at least [`MIN_GAIN_MARGIN`] at this damping ratio and period.
pub fn max_bandwidth_hz(damping_ratio: f64, period_s: f64) -> f64 {
    // The margin falls from infinity at 0 to zero at wn T = 4 zeta / 3, where b = 3 a.
    let (mut low, mut high) = (0.0, 4.0 * damping_ratio / 3.0 / core::f64::consts::TAU / period_s);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if gain_margin(middle, damping_ratio, period_s) >= MIN_GAIN_MARGIN {
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
    fn simulated_error(bandwidth_hz: f64, damping_ratio: f64, period: f64, scale: f64) -> f64 {
        let gains = Gains::new(bandwidth_hz, damping_ratio);
        let (mut x, mut v, mut held) = (1.0, 0.0, 0.0);
        for _ in 0..2000 {
            let next = -scale * (gains.stiffness * x + gains.damping * v);
            x += period * v + 0.5 * period * period * held;
            v += period * held;
            held = next;
        }
        f64::abs(x)
    }

    #[test]
    fn the_margin_is_where_the_simulated_loop_turns_unstable() {
        for (bandwidth, damping, period) in [(10.0, 1.0, 1e-3), (30.0, 0.7, 1e-3), (5.0, 1.2, 4e-3)] {
            let margin = gain_margin(bandwidth, damping, period);
            assert!(margin > 1.0, "{margin}");
            assert!(simulated_error(bandwidth, damping, period, 0.98 * margin) < 1.0);
            assert!(simulated_error(bandwidth, damping, period, 1.02 * margin) > 1.0);
        }
    }

    #[test]
    fn the_largest_bandwidth_has_the_smallest_margin() {
        for (damping, period) in [(0.5, 1e-3), (1.0, 1e-3), (1.0, 50e-6), (2.0, 4e-3)] {
            let bandwidth = max_bandwidth_hz(damping, period);
            assert!((gain_margin(bandwidth, damping, period) - MIN_GAIN_MARGIN).abs() < 1e-6);
        }
    }
}
