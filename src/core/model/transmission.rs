//! Transmission of the drives: from the command of a drive to the force that its leg gets, and back.
//!
//! ```text
//! G = s u                        force of the drive itself: s force scale, u command
//! F = G - mu |G| sign(L')        the leg: mu load friction, for example of a screw
//!
//! F = s u (1 - mu sign(u L'))    u = F / ( s (1 - mu sign(F L')) )
//! ```
//!
//! mu is less than 1, so u, G and F have the same sign and the second line is solved in closed form in both directions.
//! sign(L') is proportional below the smoothing speed, as for Coulomb friction. Friction that does not depend on the
//! load is a part of F, see [`super::active_forces`]. There is no bound on the condition but mu < 1: a relative error of F
//! is one of u.

use super::LEGS;
use super::inverse_geometry::leg_lengths_and_rates;
use super::machine::{Actuator, Machine};
use super::rigid::Motion;

/// Ratios of force at the leg to command, for the rates of one motion.
///
/// ```
/// use hexad_core::model::transmission::Transmission;
/// # let mut actuator = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine.actuator;
/// (actuator.force_scale, actuator.load_friction_share) = ([0.9; 6], [0.1; 6]);
/// // Of 100 N that the drive of leg 1 is told to push with, its leg gets 81 N as it extends, 99 N as it retracts.
/// let transmission = Transmission::new(&actuator, &[0.2, -0.2, 0.0, 0.0, 0.0, 0.0]);
/// let [extends, retracts, stands, ..] = transmission.leg_forces(&[100.0; 6]);
/// assert!((extends - 81.0).abs() < 1e-12 && (retracts - 99.0).abs() < 1e-12 && (stands - 90.0).abs() < 1e-12);
/// assert!((transmission.commands(&[81.0; 6])[0] - 100.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// Of drives that pull, and of drives that push; `None` if every ratio is 1.
    ratios: Option<[[f64; LEGS]; 2]>,
}

impl Transmission {
    /// Ratios for rates of the legs \[m/s\].
    pub fn new(actuator: &Actuator, rates_m_s: &[f64; LEGS]) -> Self {
        if !actuator.has_load_friction_or_scale() {
            return Self { ratios: None };
        }
        let mut ratios = [actuator.force_scale; 2];
        let [pulling, pushing] = &mut ratios;
        let legs = actuator.load_friction_share.iter().zip(rates_m_s);
        for ((load_friction, rate), (pull, push)) in legs.zip(pulling.iter_mut().zip(pushing)) {
            let loss = load_friction * actuator.sign(*rate);
            *pull *= 1.0 + loss;
            *push *= 1.0 - loss;
        }
        Self { ratios: Some(ratios) }
    }

    /// Ratios for a motion of the platform.
    pub fn of_motion(machine: &Machine, motion: &Motion) -> Self {
        if !machine.actuator.has_load_friction_or_scale() {
            return Self { ratios: None };
        }
        let (_, rates) = leg_lengths_and_rates(machine, &motion.pose, &motion.twist);
        Self::new(&machine.actuator, &rates)
    }

    /// Forces that the legs get \[N\].
    pub fn leg_forces(&self, commands_n: &[f64; LEGS]) -> [f64; LEGS] {
        self.scaled(commands_n, |command, ratio| command * ratio)
    }

    /// Commands that give the legs these forces \[N\].
    pub fn commands(&self, forces_n: &[f64; LEGS]) -> [f64; LEGS] {
        self.scaled(forces_n, |force, ratio| force / ratio)
    }

    #[inline(always)]
    fn scaled(&self, values: &[f64; LEGS], scale: impl Fn(f64, f64) -> f64) -> [f64; LEGS] {
        let mut scaled = *values;
        if let Some([pulling, pushing]) = &self.ratios {
            for (value, (pull, push)) in scaled.iter_mut().zip(pulling.iter().zip(pushing)) {
                *value = scale(*value, if *value < 0.0 { *pull } else { *push });
            }
        }
        scaled
    }
}
