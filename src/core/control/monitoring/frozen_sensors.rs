//! Frozen sensors: readings that repeat to the last bit while the reference moves.
//!
//! The reading of a working sensor changes with noise and with each step of motion. Three equal readings in a
//! row are a fault if the leg's reference has moved further than a bound since the second of them, and the feedback force
//! has changed by more than friction may hold. A frozen sensor causes a false error that grows with the reference. The error moves the platform until it is
//! detected, and slower motion takes longer to detect.
//!
//! A sensor whose noise is at least its resolution does not repeat at rest either. A sensor with less noise,
//! or of unknown resolution, may repeat at rest. If it freezes then, the failure cannot be detected and the
//! platform drifts away. An independent pose or a second encoder detects it.

use serde::{Deserialize, Serialize};

use crate::control::law::estimator::ReadingErrors;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::model::LEGS;
use crate::model::machine::Actuator;

/// Equal readings in a row from which a sensor may be frozen. Coarse steps repeat fewer by chance.
const MIN_EQUAL_READINGS: u32 = 3;
/// Motion of the reference that equal readings of all six legs permit, and of one leg in a loop of 10 Hz, in
/// addition to one step of the sensor \[m\]. The bounds are a tenth above the largest values that friction
/// caused by chance in ten hours of motion: 52 and 77 um, with a step (`false_alarms`, 2026-11-26).
const ALL_LEGS_BOUND_M: f64 = 54e-6;
const ONE_LEG_BOUND_M: f64 = 83e-6;
/// Square of the natural frequency of a 10 Hz loop \[1/s^2\].
const BOUND_KP_PER_S2: f64 = 3948.0;
/// Largest bound for one leg in a softer loop \[m\].
const MAX_ONE_LEG_BOUND_M: f64 = 1.5e-4;
/// Friction that the model may lack, relative to the largest force, with a reserve of a third: a fifth of
/// 0.5 % friction, and stiction of 0.05 %. While a platform crawls, feedback pushes a leg with a frozen
/// sensor harder than this long before the reference has moved by the bounds above.
const STICTION_RATIO: f64 = 0.002;
/// Change of the force on a leg that stands, relative to its unstated friction: from one direction to the other,
/// with reserve.
const FRICTION_REVERSAL: f64 = 4.0;
/// Time of equal readings from which a larger force is a fault \[s\]. A leg that is not frozen leaves its
/// step sooner.
const LONG_S: f64 = 0.05;
/// Smallest motion of the reference for that fault: length \[m\], and steps of the sensor.
const LEAST_MOTION_M: f64 = 5e-6;
const LEAST_MOTION_STEPS: f64 = 10.0;
/// Equal readings in a row that noise permits: if it is one step, and at any noise of at least one step.
/// Longer runs occur by chance at most once in 1e12. At one step this also holds if the noise is a third of
/// the configured one.
const MAX_EQUAL_AT_ONE_STEP: f64 = 100.0;
const MAX_EQUAL_NOISY_READINGS: f64 = 12.0;
/// Largest step of a sensor whose step is not stated \[m\].
const MAX_UNSTATED_STEP_M: f64 = 2e-5;
/// Bound on the motion in steps of a coarse sensor. In the same ten hours, with payload and friction known to
/// 20 %, the largest motion was 15.2 steps.
const MIN_BOUND_SENSOR_STEPS: f64 = 17.0;

impl ReadingErrors {
    /// Equal readings in a row that noise permits; `None` if the noise is less than a step or the step is
    /// unknown.
    fn max_equal_readings(&self) -> Option<f64> {
        let steps = self.deviation_m / self.resolution_or_0_m;
        (self.resolution_or_0_m > 0.0 && steps >= 1.0)
            .then(|| (MAX_EQUAL_AT_ONE_STEP / (steps * steps)).max(MAX_EQUAL_NOISY_READINGS))
    }
}

/// Bounds on equal readings of one leg, in addition to noise.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrozenLegBounds {
    /// Motion of the reference \[m\].
    pub motion_m: f64,
    /// Change of the feedback force on the leg \[N\], for a long run of equal readings while the reference
    /// has moved. Stiction may balance a smaller change.
    pub force_n: f64,
    /// Change of the force on a leg that unstated friction may balance while the leg stands \[N\].
    pub friction_n: f64,
    /// Number of readings that make a run long.
    pub long: u32,
}

impl FrozenLegBounds {
    /// Bounds of a loop with the stiffness Kp \[1/s^2\].
    pub fn new(kp_per_s2: f64, actuator: &Actuator, period_s: f64) -> Self {
        let friction_n = FRICTION_REVERSAL * actuator.friction_uncertainty_n;
        Self {
            motion_m: motion_bound(kp_per_s2),
            force_n: friction_n.max(STICTION_RATIO * actuator.max_force_n),
            friction_n,
            long: (LONG_S / period_s) as u32,
        }
    }
}

/// Motion of the reference that equal readings of one leg permit, in a loop with the stiffness Kp \[1/s^2\].
///
/// A reading with the error `v t` accelerates the platform by `Kp v t`. When the reference has moved by B,
/// the platform is `Kp B^3 / (6 v^2)` off its path. The bound makes this the same for all loops. If friction
/// holds a leg, the reference also moves further in a softer loop before the feedback force frees the leg.
fn motion_bound(kp_per_s2: f64) -> f64 {
    (ONE_LEG_BOUND_M * libm::cbrt(BOUND_KP_PER_S2 / kp_per_s2)).min(MAX_ONE_LEG_BOUND_M)
}

/// Runs of equal readings, and the reference near the beginning of each run.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct FrozenSensors {
    last: [f64; LEGS],
    equal_readings: [u32; LEGS],
    /// Smallest change of a reading: a step of the sensor, or less \[m\].
    least_change: [f64; LEGS],
    /// Reference lengths at the second of the equal readings \[m\].
    reference: [f64; LEGS],
    /// Feedback forces on the legs at the second of the equal readings \[N\].
    feedback: [f64; LEGS],
}

impl Default for FrozenSensors {
    fn default() -> Self {
        Self {
            last: [0.0; LEGS],
            equal_readings: [0; LEGS],
            least_change: [MAX_UNSTATED_STEP_M; LEGS],
            reference: [0.0; LEGS],
            feedback: [0.0; LEGS],
        }
    }
}

impl FrozenSensors {
    /// Checks a new measurement. `legs` returns the reference lengths at its instant and the feedback forces;
    /// it is called only if a reading has repeated.
    pub fn check(
        &mut self,
        length_m: &[f64; LEGS],
        errors: &ReadingErrors,
        one_leg: &FrozenLegBounds,
        legs: impl FnOnce() -> [[f64; LEGS]; 2],
    ) -> Result<(), Diagnostic> {
        let mut is_any_equal = false;
        let memory = self.last.iter_mut().zip(&mut self.equal_readings).zip(&mut self.least_change);
        for (((last, equal), least_change), length) in memory.zip(length_m) {
            // To the last bit, because a frozen sensor repeats its reading exactly.
            let is_equal = last.to_bits() == length.to_bits();
            *equal = if is_equal { equal.saturating_add(1) } else { 0 };
            if !is_equal {
                *least_change = least_change.min((length - *last).abs());
            }
            *last = *length;
            is_any_equal |= is_equal;
        }
        if is_any_equal { self.check_motion(&legs(), errors, one_leg) } else { Ok(()) }
    }

    /// Largest step that the sensors may have, by their readings.
    fn largest_step(&self) -> f64 {
        self.least_change.iter().copied().fold(0.0, f64::max)
    }

    /// Whether any sensor has repeated its reading often enough to be frozen.
    pub fn may_be_frozen(&self) -> bool {
        self.equal_readings.iter().any(|equal| *equal + 1 >= MIN_EQUAL_READINGS)
    }

    /// Checks the motion of the reference while readings repeated.
    // Out of line, because most sensors have noise: the cycle stays short.
    #[inline(never)]
    fn check_motion(
        &mut self,
        [reference, feedback_force]: &[[f64; LEGS]; 2],
        errors: &ReadingErrors,
        one_leg: &FrozenLegBounds,
    ) -> Result<(), Diagnostic> {
        let are_all_equal = self.equal_readings.iter().all(|equal| *equal + 1 >= MIN_EQUAL_READINGS);
        let bound = if are_all_equal { ALL_LEGS_BOUND_M } else { one_leg.motion_m };
        let resolution =
            if errors.resolution_or_0_m > 0.0 { errors.resolution_or_0_m } else { self.largest_step() };
        let bound = (bound + resolution).max(MIN_BOUND_SENSOR_STEPS * resolution);
        let least_motion = LEAST_MOTION_M.max(LEAST_MOTION_STEPS * resolution);
        let mut result = Ok(());
        let first = self.reference.iter_mut().zip(&mut self.feedback);
        let legs = first.zip(&self.equal_readings).zip(reference.iter().zip(feedback_force));
        for (leg, (((first, first_force), equal), (reference, force))) in legs.enumerate() {
            if *equal <= 1 {
                (*first, *first_force) = (*reference, *force);
            }
            let moved = (reference - *first).abs();
            let force = (force - *first_force).abs();
            let is_far = *equal + 1 >= MIN_EQUAL_READINGS && moved > bound;
            if is_far && force >= one_leg.friction_n && result.is_ok() {
                result = Err(Diagnostic::new(DiagnosticCode::SensorFrozen, moved, bound).at(leg));
            }
            let is_long = *equal >= one_leg.long && moved > least_motion;
            if is_long && force > one_leg.force_n && result.is_ok() {
                result = Err(Diagnostic::new(DiagnosticCode::SensorFrozen, moved, least_motion).at(leg));
            }
            let repeats = |most| f64::from(*equal + 1) > most;
            if errors.max_equal_readings().is_some_and(repeats) && result.is_ok() {
                result =
                    Err(Diagnostic::new(DiagnosticCode::SensorFrozen, moved, errors.resolution_or_0_m)
                        .at(leg));
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: FrozenLegBounds =
        FrozenLegBounds { motion_m: ONE_LEG_BOUND_M, force_n: 10.0, friction_n: 0.0, long: 50 };

    fn check(
        sensors: &mut FrozenSensors,
        length: [f64; LEGS],
        [deviation_m, resolution_or_0_m]: [f64; 2],
        legs: [[f64; LEGS]; 2],
    ) -> Result<(), Diagnostic> {
        sensors.check(&length, &ReadingErrors { deviation_m, resolution_or_0_m }, &BOUNDS, || legs)
    }

    /// Readings of a crawling leg that does not move while the feedback force on it grows to `newtons`.
    fn is_frozen_at(newtons: f64, readings: u32) -> bool {
        let mut sensors = FrozenSensors::default();
        (0..readings).any(|k| {
            let share = f64::from(k) / f64::from(readings);
            let legs = [[1.0 + 8e-6 * share; LEGS], [0.0, 0.0, 0.0, newtons * share, 0.0, 0.0]];
            let length = core::array::from_fn(|leg| if leg == 3 { 1.0 } else { 1.0 + 1e-9 * f64::from(k) });
            check(&mut sensors, length, [0.0, 1e-9], legs).is_err()
        })
    }

    #[test]
    fn a_crawling_leg_that_does_not_yield_to_a_force_is_frozen() {
        assert!(is_frozen_at(20.0, 200));
        assert!(!is_frozen_at(9.0, 200), "stiction");
        assert!(!is_frozen_at(20.0, 40), "not long");
    }

    /// Motion of the reference \[um\] at which frozen legs are detected, in steps of 5 um, and the leg.
    fn noticed_um(frozen: &[usize], step: f64) -> Option<(f64, usize)> {
        let mut sensors = FrozenSensors::default();
        for k in 0..100 {
            let reference = [1.0 + 5e-6 * f64::from(k); LEGS];
            let mut length = reference;
            frozen.iter().filter(|_| k > 10).for_each(|leg| length[*leg] = 1.0);
            if let Err(diagnostic) = check(&mut sensors, length, [0.0, step], [reference, [0.0; LEGS]]) {
                assert_eq!(diagnostic.code, DiagnosticCode::SensorFrozen);
                return Some((1e6 * diagnostic.value, diagnostic.index as usize));
            }
        }
        None
    }

    #[test]
    fn a_frozen_leg_is_named_after_its_bound_and_all_six_sooner() {
        assert_eq!(noticed_um(&[], 1e-9), None);
        let (moved, leg) = noticed_um(&[4], 1e-9).unwrap();
        assert!((83.0..89.0).contains(&moved) && leg == 5, "{moved} {leg}");
        let (moved, _) = noticed_um(&[0, 1, 2, 3, 4, 5], 1e-9).unwrap();
        assert!((54.0..60.0).contains(&moved), "{moved}");
        let (moved, _) = noticed_um(&[2], 8e-6).unwrap();
        assert!((136.0..142.0).contains(&moved), "{moved}");
    }

    /// Number of equal readings at rest until the sensor is reported as frozen.
    fn repeated(noise: f64, step: f64) -> Option<u32> {
        let mut sensors = FrozenSensors::default();
        (1..1000).find(|_| check(&mut sensors, [1.0; LEGS], [noise, step], [[1.0; LEGS]; 2]).is_err())
    }

    #[test]
    fn a_sensor_with_noise_repeats_itself_only_if_it_is_frozen() {
        assert_eq!(repeated(5e-6, 1e-6), Some(13));
        assert_eq!(repeated(2e-6, 1e-6), Some(26));
        assert_eq!(repeated(1e-6, 1e-6), Some(101));
        assert_eq!(repeated(0.9e-6, 1e-6), None);
        assert_eq!(repeated(1e-6, 0.0), None);
        assert_eq!(repeated(0.0, 0.0), None, "equal readings at rest");
    }

    /// Steps of 1 um at 20 um/s: 50 equal readings in a row.
    #[test]
    fn a_coarse_sensor_in_slow_motion_is_no_fault() {
        let mut sensors = FrozenSensors::default();
        for k in 0..20_000 {
            let reference = [1.0 + 2e-8 * f64::from(k); LEGS];
            let length = reference.map(|length| (length * 1e6).round() * 1e-6);
            assert!(check(&mut sensors, length, [0.0, 1e-6], [reference, [0.0; LEGS]]).is_ok(), "{k}");
        }
    }
}
