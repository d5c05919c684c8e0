//! Frozen sensors: readings that stay the same to the last bit while the reference moves.
//!
//! A sensor that is alive changes with every noise, and with every step of motion. Each of three readings in a row must differ, unless
//! the reference of the leg has moved no further than a bound since the first of them. A frozen sensor makes a false error that
//! grows with the reference and acts on the platform as long as nobody notices: the slower the motion, the longer.
//!
//! A sensor whose noise is at least its resolution does not repeat itself at rest either. One with less noise, or of unknown
//! resolution, may: a leg that freezes at rest cannot be distinguished then, and the platform drifts away. An independent pose
//! or a second encoder closes that.

use super::Readings;
use crate::control::diagnostic::{Diagnostic, DiagnosticCode};
use crate::model::machine::LEGS;

/// Equal readings in a row from which on a sensor may be frozen: fewer happen by chance with coarse steps.
const MIN_EQUAL_READINGS: u32 = 3;
/// Motion of the reference that six equal lengths allow, and one \[m\]. A drive with stiction of a thousandth of its
/// largest force leaves 6 and 33 um.
const ALL_LEGS_BOUND_M: f64 = 15e-6;
const ONE_LEG_BOUND_M: f64 = 60e-6;
/// Equal readings in a row of a sensor whose noise is one step, and of any with noise: by chance at most once in 1e12, with one
/// step also if the noise is a third of the configured one.
const MAX_EQUAL_AT_ONE_STEP: f64 = 100.0;
const MAX_EQUAL_NOISY_READINGS: f64 = 12.0;
/// The same in steps of a coarse sensor.
const BOUND_STEPS: f64 = 10.0;

impl Readings {
    /// Equal readings in a row that noise allows; `None` if its noise is less than a step, or the step is not known.
    fn most_equal(&self) -> Option<f64> {
        let steps = self.noise / self.step;
        (self.step > 0.0 && steps >= 1.0)
            .then(|| (MAX_EQUAL_AT_ONE_STEP / (steps * steps)).max(MAX_EQUAL_NOISY_READINGS))
    }
}

/// Readings that did not change, and where the reference was at the first of them.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub struct FrozenSensors {
    last: [f64; LEGS],
    equal_readings: [u32; LEGS],
    /// Lengths of the reference at the first of the equal readings \[m\].
    reference: [f64; LEGS],
}

impl FrozenSensors {
    /// Whether a new measurement is alive. `reference` are the lengths of the reference at its instant, evaluated only where a reading
    /// stayed the same.
    pub fn check(
        &mut self,
        length: &[f64; LEGS],
        readings: &Readings,
        reference: impl FnOnce() -> [f64; LEGS],
    ) -> Result<(), Diagnostic> {
        let mut is_any_equal = false;
        for ((last, equal), length) in self.last.iter_mut().zip(&mut self.equal_readings).zip(length) {
            // To the last bit, as a sensor that is frozen repeats itself.
            let is_equal = last.to_bits() == length.to_bits();
            *equal = if is_equal { equal.saturating_add(1) } else { 0 };
            *last = *length;
            is_any_equal |= is_equal;
        }
        if is_any_equal { self.check_motion(&reference(), readings) } else { Ok(()) }
    }

    /// Whether the reference has not moved while readings stayed the same.
    // Out of line, as most sensors have noise: the cycle stays short.
    #[inline(never)]
    fn check_motion(&mut self, reference: &[f64; LEGS], readings: &Readings) -> Result<(), Diagnostic> {
        let are_all_equal = self.equal_readings.iter().all(|equal| *equal + 1 >= MIN_EQUAL_READINGS);
        let bound = if are_all_equal { ALL_LEGS_BOUND_M } else { ONE_LEG_BOUND_M };
        let bound = bound.max(BOUND_STEPS * readings.step);
        let mut result = Ok(());
        let legs = self.reference.iter_mut().zip(&self.equal_readings).zip(reference);
        for (leg, ((first, equal), reference)) in legs.enumerate() {
            if *equal <= 1 {
                *first = *reference;
            }
            let moved = (reference - *first).abs();
            if *equal + 1 >= MIN_EQUAL_READINGS && moved > bound && result.is_ok() {
                result = Err(Diagnostic::new(DiagnosticCode::SensorFrozen, moved, bound).at(leg));
            }
            let repeats = |most| f64::from(*equal + 1) > most;
            if readings.most_equal().is_some_and(repeats) && result.is_ok() {
                result = Err(Diagnostic::new(DiagnosticCode::SensorFrozen, moved, readings.step).at(leg));
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Micrometres of the reference at which frozen legs are noticed, in steps of 5 um.
    fn noticed_um(frozen: &[usize], step: f64) -> Option<(f64, usize)> {
        let mut sensors = FrozenSensors::default();
        for k in 0..100 {
            let reference = [1.0 + 5e-6 * f64::from(k); LEGS];
            let mut length = reference;
            frozen.iter().filter(|_| k > 10).for_each(|leg| length[*leg] = 1.0);
            if let Err(diagnostic) = sensors.check(&length, &Readings { noise: 0.0, step }, || reference) {
                assert_eq!(diagnostic.code, DiagnosticCode::SensorFrozen);
                return Some((1e6 * diagnostic.value, diagnostic.index as usize));
            }
        }
        None
    }

    #[test]
    fn a_frozen_leg_is_named_after_its_bound_and_all_six_sooner() {
        assert_eq!(noticed_um(&[], 0.0), None);
        let (moved, leg) = noticed_um(&[4], 0.0).unwrap();
        assert!((60.0..66.0).contains(&moved) && leg == 5, "{moved} {leg}");
        let (moved, _) = noticed_um(&[0, 1, 2, 3, 4, 5], 0.0).unwrap();
        assert!((15.0..21.0).contains(&moved), "{moved}");
        let (moved, _) = noticed_um(&[2], 8e-6).unwrap();
        assert!((80.0..86.0).contains(&moved), "{moved}");
    }

    #[test]
    fn equal_readings_at_rest_are_no_fault() {
        let mut sensors = FrozenSensors::default();
        for _ in 0..1000 {
            assert!(sensors.check(&[1.0; LEGS], &Readings::default(), || [1.0; LEGS]).is_ok());
        }
    }

    /// Equal readings at rest until a sensor counts as frozen.
    fn repeated(noise: f64, step: f64) -> Option<u32> {
        let mut sensors = FrozenSensors::default();
        let readings = Readings { noise, step };
        (1..1000).find(|_| sensors.check(&[1.0; LEGS], &readings, || [1.0; LEGS]).is_err())
    }

    #[test]
    fn a_sensor_with_noise_repeats_itself_only_if_it_is_frozen() {
        assert_eq!(repeated(5e-6, 1e-6), Some(13));
        assert_eq!(repeated(2e-6, 1e-6), Some(26));
        assert_eq!(repeated(1e-6, 1e-6), Some(101));
        assert_eq!(repeated(0.9e-6, 1e-6), None);
        assert_eq!(repeated(1e-6, 0.0), None);
    }

    /// Steps of 1 um at 20 um/s: 50 equal readings in a row.
    #[test]
    fn a_coarse_sensor_in_slow_motion_is_no_fault() {
        let mut sensors = FrozenSensors::default();
        for k in 0..20_000 {
            let reference = [1.0 + 2e-8 * f64::from(k); LEGS];
            let length = reference.map(|length| (length * 1e6).round() * 1e-6);
            assert!(
                sensors.check(&length, &Readings { noise: 0.0, step: 1e-6 }, || reference).is_ok(),
                "{k}"
            );
        }
    }
}
