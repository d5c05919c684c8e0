//! Friction that the machine file does not state: how much of a disturbance it may explain.
//!
//! Each leg may have dry friction of up to Fu, `actuator.friction_uncertainty_n`, beyond the model. While a leg
//! moves one way, this friction is constant and part of the usual disturbance. When the leg begins to move,
//! stops or turns around, its friction changes by up to 2 Fu, against the new direction. The error is desired
//! minus true: in the direction of the motion. With b_i the acceleration by a unit force of leg i and T the time
//! constant of what is usual:
//!
//! ```text
//! change of a disturbance by friction = sum of b_i f_i      |f_i| <= 2 Fu exp(-t_i / T),  t_i since leg i turned
//! ```
//!
//! The checks of payload, impact and swings permit such changes. A leg that sticks while the reference moves
//! takes a change of force of 2 Fu, see `frozen_sensors`.

use nalgebra::{Matrix6, Vector6};
use serde::{Deserialize, Serialize};

use crate::model::LEGS;

/// Time constants of the usual disturbance, several times the estimator's, and of the usual payload \[s\].
pub(super) const USUAL_DISTURBANCE_S: f64 = 0.15;
pub(super) const USUAL_PAYLOAD_S: f64 = 1.0;

/// Rate below which a leg may stick, and below which it stands \[m/s\].
const STICKING_M_S: f64 = 1e-4;
const STANDING_M_S: f64 = 1e-6;

/// Change of the friction of a leg that turned around, over Fu: 2, and how far its estimate swings beyond
/// (2026-11-26).
const REVERSAL: f64 = 2.4;

/// Friction of a machine and its effects.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrictionEffects {
    /// Fu \[N\].
    pub force_n: f64,
    /// Change of payload by a force of each leg \[kg/N\].
    pub payload_kg_per_n: [f64; LEGS],
    /// Largest acceleration that swings the platform by a force of one leg, its angles weighted \[m/s^2/N\].
    pub swing_acceleration_m_s2_per_n: [f64; LEGS],
    /// b_i, in error coordinates, and the inverse.
    pub by_force: Matrix6<f64>,
    /// Forces of the legs that explain a disturbance.
    pub force_by_disturbance: Matrix6<f64>,
}

/// Directions of the legs, and shares of the largest friction that its changes may still have.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct UnstatedFriction {
    /// 1, -1, or 0 for a leg that may stick.
    direction: [i8; LEGS],
    /// Of what is sudden, and of what is not usual.
    sudden: [f64; LEGS],
    unusual: [f64; LEGS],
}

impl UnstatedFriction {
    /// Follows the rates of the reference's legs, `dt_s` seconds after the last.
    pub fn update(&mut self, rates_m_s: &[f64; LEGS], dt_s: f64) {
        let is_standing = rates_m_s.iter().all(|rate| rate.abs() < STANDING_M_S);
        let legs = self.direction.iter_mut().zip(rates_m_s);
        for ((direction, rate), (sudden, unusual)) in legs.zip(self.sudden.iter_mut().zip(&mut self.unusual))
        {
            let now = if rate.abs() < STICKING_M_S { 0 } else { rate.signum() as i8 };
            *sudden *= 1.0 - (dt_s / USUAL_DISTURBANCE_S).min(1.0);
            *unusual *= 1.0 - (dt_s / USUAL_PAYLOAD_S).min(1.0);
            if now != *direction || now == 0 && !is_standing {
                (*direction, *sudden, *unusual) = (now, REVERSAL, REVERSAL);
            }
        }
    }

    /// Least and largest force of each leg that explains a change of friction in the error \[N\].
    fn forces(&self, friction: f64, shares: &[f64; LEGS]) -> [[f64; 2]; LEGS] {
        let mut forces = [[0.0; 2]; LEGS];
        for ((range, share), direction) in forces.iter_mut().zip(shares).zip(&self.direction) {
            let most = friction * share;
            *range = [if *direction > 0 { 0.0 } else { -most }, if *direction < 0 { 0.0 } else { most }];
        }
        forces
    }

    /// Least and largest change of payload that friction may explain \[kg\].
    pub fn payload_change_range_kg(&self, effects: &FrictionEffects) -> [f64; 2] {
        let forces = self.forces(effects.force_n, &self.unusual);
        forces.iter().zip(&effects.payload_kg_per_n).fold([0.0; 2], |[least, most], ([low, high], effect)| {
            let (low, high) = (low * effect, high * effect);
            [least + low.min(high), most + low.max(high)]
        })
    }

    /// Part of a sudden disturbance that friction does not explain.
    // Out of line because it is rare: the code of the cycle stays short.
    #[inline(never)]
    pub fn unexplained(&self, effects: &FrictionEffects, sudden_acceleration: &Vector6<f64>) -> Vector6<f64> {
        let mut explained = effects.force_by_disturbance * sudden_acceleration;
        for (force, [low, high]) in explained.iter_mut().zip(self.forces(effects.force_n, &self.sudden)) {
            // Not `clamp`, which may panic.
            *force = force.max(low).min(high);
        }
        sudden_acceleration - effects.by_force * explained
    }

    /// Acceleration with which friction may swing the platform \[m/s^2\].
    pub fn swing_acceleration(&self, effects: &FrictionEffects) -> f64 {
        let legs = self.unusual.iter().zip(&effects.swing_acceleration_m_s2_per_n);
        effects.force_n * legs.map(|(share, effect)| share * effect).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EFFECTS: FrictionEffects = FrictionEffects {
        force_n: 10.0,
        payload_kg_per_n: [0.1; LEGS],
        swing_acceleration_m_s2_per_n: [0.2; LEGS],
        by_force: Matrix6::new(
            1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
        ),
        force_by_disturbance: Matrix6::new(
            1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
        ),
    };

    #[test]
    fn friction_explains_a_change_only_for_a_while_after_a_leg_turned_and_only_against_its_motion() {
        let mut friction = UnstatedFriction::default();
        let mut play = |rate: f64, seconds: f64| {
            let rates = [rate, 0.01, 0.01, 0.01, 0.01, 0.01];
            (0..(1e3 * seconds) as u32).for_each(|_| friction.update(&rates, 1e-3));
            friction
        };
        let is_near = |found: f64, expected: f64| (found - expected).abs() < 0.01;
        let [least, most] = play(0.01, 0.001).payload_change_range_kg(&EFFECTS);
        assert!(least == 0.0 && is_near(most, 14.4), "all legs begin to move: {least} {most}");
        let [_, most] = play(0.01, 10.0).payload_change_range_kg(&EFFECTS);
        assert!(most < 1e-2, "all move one way");
        let turned = play(-0.01, 0.001);
        let [least, _] = turned.payload_change_range_kg(&EFFECTS);
        assert!(is_near(least, -2.4), "one turns around: {least}");
        let unexplained = |x: f64, y: f64| {
            let rest = turned.unexplained(&EFFECTS, &Vector6::new(x, y, 0.0, 0.0, 0.0, 0.0));
            [rest.x, rest.y]
        };
        assert_eq!([unexplained(23.0, 0.0), unexplained(-23.0, 0.0)], [[23.0, 0.0], [0.0, 0.0]]);
        let [x, y] = unexplained(-29.0, 3.0);
        assert!(is_near(x, -5.0) && is_near(y, 3.0), "{x} {y}");
        let [least, most] = play(-5e-5, 5.0).payload_change_range_kg(&EFFECTS);
        assert!(is_near(least, -2.4) && is_near(most, 2.4), "it may stick while others move: {least} {most}");
    }

    #[test]
    fn a_platform_at_rest_has_no_friction_that_changes() {
        let mut friction = UnstatedFriction::default();
        (0..10_000).for_each(|_| friction.update(&[1e-9; LEGS], 1e-3));
        assert_eq!(friction.payload_change_range_kg(&EFFECTS), [0.0; 2]);
        assert_eq!(friction.swing_acceleration(&EFFECTS), 0.0);
        let sudden = Vector6::repeat(1.0);
        assert_eq!(friction.unexplained(&EFFECTS, &sudden), sudden);
    }
}
