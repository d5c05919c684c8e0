//! Feedback gains from bandwidth and damping ratio.
//!
//! Computed torque makes each axis a double integrator with `e'' = -Kd e' - Kp e`, `Kp = wn^2`,
//! `Kd = 2 zeta wn`. `hexad_machine::analysis::sampled_loop` gives the largest gains that sampling permits.

/// Stiffness and damping of second-order error dynamics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Kp \[1/s^2\].
    pub kp_per_s2: f64,
    /// Kd \[1/s\].
    pub kd_per_s: f64,
}

impl Gains {
    /// Gains of a bandwidth: `Kp = wn^2`, `Kd = 2 zeta wn`, `wn = 2 pi bandwidth`.
    pub fn new(bandwidth_hz: f64, damping_ratio: f64) -> Self {
        let wn = core::f64::consts::TAU * bandwidth_hz;
        Self { kp_per_s2: wn * wn, kd_per_s: 2.0 * damping_ratio * wn }
    }
}
