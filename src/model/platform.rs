//! Mobile platform (paper, eq. 88-93): the wrench its own motion needs.
//!
//! ```text
//! c = R CG        I = R I_G R^T        f = m (v' + omega' x c + omega x (omega x c) - g)
//! [ I omega' + omega x I omega + c x f ;  f ]                    torque about C, then force
//! ```
//!
//! Against the print: (88), (93) have g with the sign opposite to (74)-(81); (90), (91) put an inertia
//! about the centre of mass beside moments about C. Here the inertia is about the centre of mass and the
//! moment of f about C is explicit, which is the parallel-axis term.

use super::machine::Machine;
use super::rigid::{Motion, Wrench};

/// Wrench about C that the platform needs for this motion, legs not counted.
#[inline(always)]
pub fn platform_wrench(machine: &Machine, motion: &Motion) -> Wrench {
    let body = &machine.platform;
    let r = &motion.pose.rotation;
    let omega = &motion.twist.angular;
    let omega_rate = &motion.acceleration.angular;
    let c = r * body.center_of_mass;
    let accel = motion.acceleration.linear + omega_rate.cross(&c) + omega.cross(&omega.cross(&c));
    let force = (accel - machine.gravity) * body.mass;
    // In platform axes the inertia is constant.
    let omega_platform = r.tr_mul(omega);
    let momentum = body.inertia * omega_platform;
    let torque = body.inertia * r.tr_mul(omega_rate) + omega_platform.cross(&momentum);
    Wrench { torque: r * torque + c.cross(&force), force }
}
