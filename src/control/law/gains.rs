//! Gains from bandwidth and damping ratio.
//!
//! Computed torque turns every axis into a double integrator `e'' = -Kd e' - Kp e`, with `Kp = wn^2`,
//! `Kd = 2 zeta wn`. The bound that sampling sets to them is in [`crate::analysis::sampled_loop`].

/// Stiffness and damping of second-order error dynamics.
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
