//! Disturbance monitor: detects a payload change, an impact, an oscillation.
//!
//! The estimator compensates a disturbance whatever its cause. Three causes are faults nevertheless: a
//! payload change under control, a collision, and a loop near its limit of stability. With e the estimated
//! error, d the estimated disturbance, M the inertia and a the acceleration of the reference:
//!
//! ```text
//! payload       m = -(M d).g / (g.g - a.g)                            mass that the model lacks
//!               | mean of m over 30 ms - mean of m over 1 s | <= bound
//! impact        | d - mean of d over 150 ms | <= bound               unless the force of one leg explains it
//!               above the bound for 20 ms: a lasting collision, or several drives without force
//! oscillation   e reverses by more than a bound, four times in a row, each within a period of the loop
//! ```
//!
//! The bounds of payload and impact grow by what friction may explain, see [`super::unstated_friction`].
//! A payload that is present when control begins is no fault. After an impact or a payload change the
//! platform is still under control, and it stops. Angles are weighted by the radius of the platform.
//!
//! Two causes of swings are permitted and widen the bound. If the reference shakes, the error shakes as well,
//! because masses are not known exactly. A sudden disturbance that `[limits]` permits shakes the platform.
//! Forces that limits removed are known only as well as the inertia at home approximates the inertia at the
//! pose. Their acceleration is therefore added to the bounds of payload and impact.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::control::law::estimator::ReadingErrors;
use crate::control::law::input_matrix::InputMatrix;
use crate::control::monitoring::unstated_friction::{FrictionEffects, USUAL_PAYLOAD_S, UnstatedFriction};
use crate::control::monitoring::weighting::weighted;
use crate::control::parameters::Parameters;
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::control::signals::errors::{ErrorEstimate, FeedbackAcceleration};
use crate::model::LEGS;
use crate::model::machine::Machine;
use crate::model::rigid::{Acceleration, Motion};

/// Time constant of the present payload \[s\].
const PAYLOAD_TIME_CONSTANT_S: f64 = 0.03;
/// Time from the start of control in which any payload is usual, and in which swings decay \[s\].
const START_S: f64 = 1.0;
/// Default of `limits.payload_change_kg`, relative to the mass of the platform and to the mass that unstated
/// friction of all legs looks like.
const DEFAULT_PAYLOAD_CHANGE_PER_PLATFORM_MASS: f64 = 0.1;
const DEFAULT_PAYLOAD_CHANGE_PER_FRICTION: f64 = 0.67;
/// Time constant with which removed forces are forgotten \[s\]: the same as for the usual payload.
const CUT_FORCE_DECAY_TIME_CONSTANT_S: f64 = USUAL_PAYLOAD_S;
/// Smallest weight in a motion, relative to the weight at rest: a falling platform has no weight to compare
/// with.
const LEAST_APPARENT_GRAVITY_RATIO: f64 = 0.3;

/// Default of `limits.disturbance_step_m_s2`, relative to the acceleration limit, of which 0.5 is
/// compensated, and relative to the acceleration by the smallest missing force of a drive.
const DEFAULT_IMPACT_PER_ACCELERATION_LIMIT: f64 = 0.4;
const DEFAULT_IMPACT_PER_FRICTION: f64 = 1.5;
/// Longest impact \[s\].
const MAX_IMPACT_S: f64 = 0.02;

/// Change of the error between two reversals in a loop of 10 Hz \[m\].
const MIN_SWING_PEAK_TO_PEAK_M: f64 = 8e-5;
/// Square of the natural frequency of a 10 Hz loop \[1/s^2\], and largest change for a softer loop \[m\].
const SWING_STIFFNESS: f64 = 3948.0;
const MAX_SWING_M: f64 = 5e-3;
/// Change of the error between two reversals, in standard deviations of a reading.
const SWING_DEVIATIONS: f64 = 10.0;
/// Number of swings in a row that make an oscillation.
const MIN_OSCILLATION_SWINGS: u32 = 4;
/// Smallest ratio of a swing to the previous one. A smaller ratio is the end of a disturbance.
const LEAST_GROWTH: f64 = 0.9;
/// Swing of the error times Kp, relative to the disturbance by friction.
const SWING_BY_FRICTION: f64 = 0.3;
/// Swing of the error times Kp, relative to the acceleration of a shaking reference. A payload of 20 % and
/// the delay of the drives cause half of it at 7 to 10 Hz (2026-11-23). Without inertia in the law the
/// reference itself causes the error.
const SHAKING_RATIO: f64 = 1.0;
const SHAKING_RATIO_WITHOUT_INERTIA: f64 = 4.0;
/// The same ratio for a sudden disturbance that `[limits]` permits. A force that switches at 5 to 10 Hz
/// causes 0.9 (2026-11-23).
const MAX_SWING_BY_DISTURBANCE_STEP: f64 = 1.5;
/// The same ratio for friction of legs that turned around.
const MAX_SWING_BY_FRICTION: f64 = 0.75;
/// Rate at which the reference's shaking is forgotten, relative to the rate at which its slow part follows.
const FORGETTING_RATIO: f64 = 0.3;

/// Bounds on the disturbance and on the error.
#[derive(Clone, Copy, Debug)]
pub struct DisturbanceBounds {
    /// Payload per unit disturbance \[kg / (m/s^2)\].
    payload_by_disturbance: Vector6<f64>,
    /// Largest payload per unit disturbance in any direction \[kg / (m/s^2)\].
    payload_by_norm: f64,
    /// Gravity over its square \[s^2/m\].
    gravity_over_square: Vector3<f64>,
    /// Bound on a payload change \[kg\].
    pub max_payload_change_kg: f64,
    /// Bound on a sudden disturbance \[m/s^2\].
    pub max_sudden_acceleration_m_s2: f64,
    /// Bound on a swing of the error \[m\].
    swing: f64,
    /// Swing of the error per acceleration of the reference \[m / (m/s^2)\].
    swing_by_acceleration: f64,
    /// Swing of the error per acceleration by friction \[m / (m/s^2)\].
    swing_by_friction: f64,
    /// Longest time between two reversals \[s\].
    max_reversal_interval_s: f64,
    /// Square of the radius that weights angles \[m^2\].
    arm_squared: f64,
    /// Friction that is not stated.
    pub friction: FrictionEffects,
}

impl DisturbanceBounds {
    /// Bounds of a machine. `arm_m` is the radius that weights angles \[m\].
    pub fn new(machine: &Machine, parameters: &Parameters, input_matrix: &InputMatrix, arm_m: f64) -> Self {
        let Parameters { law, payload_change_kg, disturbance_step_m_s2, .. } = parameters;
        let ReadingErrors { deviation_m: noise, .. } = parameters.reading_errors;
        let expects_forces = law.mode.includes_inertia();
        let has_weight = expects_forces && machine.gravity_m_s2.norm_squared() > 0.0;
        let gravity_over_square =
            machine.gravity_m_s2 / machine.gravity_m_s2.norm_squared().max(f64::MIN_POSITIVE);
        let along_gravity =
            Vector6::new(0.0, 0.0, 0.0, gravity_over_square.x, gravity_over_square.y, gravity_over_square.z);
        let payload_by_disturbance = -input_matrix.home_wrench_by_disturbance(machine).tr_mul(&along_gravity);
        let by_force = input_matrix.acceleration_by_force(machine, &machine.home_pose());
        let friction = FrictionEffects {
            force_n: machine.actuator.friction_uncertainty_n,
            payload_kg_per_n: by_force.tr_mul(&payload_by_disturbance).into(),
            swing_acceleration_m_s2_per_n: core::array::from_fn(|leg| {
                weighted(&by_force.column(leg).into(), arm_m).norm()
            }),
            by_force,
            force_by_disturbance: by_force.try_inverse().unwrap_or_default(),
        };
        let sum = |effects: [f64; LEGS]| friction.force_n * effects.into_iter().map(f64::abs).sum::<f64>();
        let of_one_leg = friction.force_n
            * friction.swing_acceleration_m_s2_per_n.into_iter().fold(f64::INFINITY, f64::min);
        let default_kg = (DEFAULT_PAYLOAD_CHANGE_PER_PLATFORM_MASS * machine.platform.mass_kg)
            .max(DEFAULT_PAYLOAD_CHANGE_PER_FRICTION * sum(friction.payload_kg_per_n));
        let default_step = (DEFAULT_IMPACT_PER_ACCELERATION_LIMIT
            * parameters.unscaled_limits().position.acceleration)
            .max(DEFAULT_IMPACT_PER_FRICTION * of_one_leg);
        let softest = law.position.kp_per_s2.min(law.orientation.kp_per_s2);
        let softness = (SWING_STIFFNESS / softest).max(1.0);
        let swing = (MIN_SWING_PEAK_TO_PEAK_M * softness * softness).min(MAX_SWING_M);
        let by_step = MAX_SWING_BY_DISTURBANCE_STEP * disturbance_step_m_s2.unwrap_or(0.0) / softest;
        let shaking = if expects_forces { SHAKING_RATIO } else { SHAKING_RATIO_WITHOUT_INERTIA };
        let by_angles = payload_by_disturbance.fixed_rows::<3>(0).norm() / arm_m;
        Self {
            payload_by_disturbance,
            payload_by_norm: by_angles.hypot(payload_by_disturbance.fixed_rows::<3>(3).norm()),
            gravity_over_square,
            max_payload_change_kg: if has_weight {
                payload_change_kg.unwrap_or(default_kg)
            } else {
                f64::INFINITY
            },
            max_sudden_acceleration_m_s2: if expects_forces {
                disturbance_step_m_s2.unwrap_or(default_step)
            } else {
                f64::INFINITY
            },
            swing: by_step
                + swing.max(SWING_DEVIATIONS * noise).max(SWING_BY_FRICTION * of_one_leg / softest),
            swing_by_acceleration: shaking / softest,
            swing_by_friction: MAX_SWING_BY_FRICTION / softest,
            max_reversal_interval_s: core::f64::consts::TAU / softest.sqrt(),
            arm_squared: arm_m * arm_m,
            friction,
        }
    }

    fn norm_squared(&self, vector: &Vector6<f64>) -> f64 {
        let [a, b, c, x, y, z]: [f64; 6] = (*vector).into();
        (a * a + b * b + c * c) * self.arm_squared + (x * x + y * y + z * z)
    }
}

/// State of the checks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct DisturbanceMonitor {
    since_start_s: f64,
    payload: f64,
    usual_payload: f64,
    impact_s: f64,
    /// Acceleration by forces that limits removed recently \[m/s^2\].
    removed_acceleration: f64,
    oscillation: Oscillation,
}

/// Swings of the error between reversals.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Oscillation {
    /// Error at the last reversal, and the error farthest from it since.
    error_at_reversal: Vector6<f64>,
    farthest: Vector6<f64>,
    swing_squared: f64,
    last_swing_squared: f64,
    since_turn_s: f64,
    swings: u32,
    /// Slow part of the reference acceleration, and the largest recent square of the rest.
    slow_acceleration: Vector6<f64>,
    shaking_squared: f64,
}

impl DisturbanceMonitor {
    /// Records the acceleration by forces that limits removed.
    pub fn record_removed_acceleration(
        &mut self,
        bounds: &DisturbanceBounds,
        FeedbackAcceleration(removed): &FeedbackAcceleration,
    ) {
        self.removed_acceleration = self.removed_acceleration.max(bounds.norm_squared(removed).sqrt());
    }

    /// Checks the estimate after a measurement, `dt_s` seconds after the previous one. `sudden` is the
    /// disturbance without its mean; 0 if the force of one leg explains it.
    pub fn check(
        &mut self,
        bounds: &DisturbanceBounds,
        estimate: &ErrorEstimate,
        reference: &Motion,
        (sudden, friction): (&Vector6<f64>, &UnstatedFriction),
        dt_s: f64,
    ) -> Result<(), Diagnostic> {
        self.since_start_s += dt_s;
        self.removed_acceleration *= 1.0 - (dt_s / CUT_FORCE_DECAY_TIME_CONSTANT_S).min(1.0);
        let by_friction = friction.payload_change_range_kg(&bounds.friction);
        let payload = self.check_payload(
            bounds,
            &estimate.disturbance_acceleration,
            &reference.acceleration,
            by_friction,
            dt_s,
        );
        let impact = self.check_impact(bounds, sudden, friction, dt_s);
        let by_friction = bounds.swing_by_friction * friction.swing_acceleration(&bounds.friction);
        let reference = reference.acceleration.vector();
        let oscillation = self.oscillation.check(bounds, &estimate.value, &reference, by_friction, dt_s);
        // Control begins with an unknown payload, and the error rings.
        let oscillation = if self.since_start_s < START_S { Ok(()) } else { oscillation };
        oscillation?;
        impact?;
        payload
    }

    fn check_payload(
        &mut self,
        bounds: &DisturbanceBounds,
        disturbance: &Vector6<f64>,
        acceleration: &Acceleration,
        [least_by_friction, most_by_friction]: [f64; 2],
        dt: f64,
    ) -> Result<(), Diagnostic> {
        let weight_ratio =
            (1.0 - acceleration.linear.dot(&bounds.gravity_over_square)).max(LEAST_APPARENT_GRAVITY_RATIO);
        let payload = bounds.payload_by_disturbance.dot(disturbance) / weight_ratio;
        self.payload += (payload - self.payload) * (dt / PAYLOAD_TIME_CONSTANT_S).min(1.0);
        let change = self.payload - self.usual_payload;
        let is_starting = self.since_start_s < START_S;
        let share = if is_starting { 1.0 } else { (dt / USUAL_PAYLOAD_S).min(1.0) };
        self.usual_payload += change * share;
        let bound = bounds.max_payload_change_kg + bounds.payload_by_norm * self.removed_acceleration;
        let bound = bound + if change > 0.0 { most_by_friction } else { -least_by_friction };
        if is_starting || change.abs() <= bound {
            return Ok(());
        }
        Err(Diagnostic::new(DiagnosticCode::PayloadChanged, change, bound.copysign(change)))
    }

    fn check_impact(
        &mut self,
        bounds: &DisturbanceBounds,
        sudden: &Vector6<f64>,
        friction: &UnstatedFriction,
        dt: f64,
    ) -> Result<(), Diagnostic> {
        let bound = bounds.max_sudden_acceleration_m_s2 + self.removed_acceleration;
        let is_within = |sudden: &Vector6<f64>| bounds.norm_squared(sudden) <= bound * bound;
        if is_within(sudden) || is_within(&friction.unexplained(&bounds.friction, sudden)) {
            self.impact_s = 0.0;
            return Ok(());
        }
        self.impact_s += dt;
        if self.impact_s > MAX_IMPACT_S {
            return Err(Diagnostic::new(DiagnosticCode::DisturbanceLasting, self.impact_s, MAX_IMPACT_S));
        }
        Err(Diagnostic::new(DiagnosticCode::Impact, bounds.norm_squared(sudden).sqrt(), bound))
    }
}

impl Oscillation {
    fn check(
        &mut self,
        bounds: &DisturbanceBounds,
        error: &Vector6<f64>,
        acceleration: &Vector6<f64>,
        by_friction: f64,
        dt: f64,
    ) -> Result<(), Diagnostic> {
        let share = (dt * core::f64::consts::PI / bounds.max_reversal_interval_s).min(1.0);
        let shaking = acceleration - self.slow_acceleration;
        self.slow_acceleration += shaking * share;
        self.shaking_squared =
            (self.shaking_squared * (1.0 - FORGETTING_RATIO * share)).max(bounds.norm_squared(&shaking));
        self.since_turn_s += dt;
        let back = error - self.farthest;
        if bounds.norm_squared(&back) > bounds.swing * bounds.swing
            && back.dot(&(self.farthest - self.error_at_reversal)) <= 0.0
        {
            return self.count(bounds, error, bounds.norm_squared(&back), by_friction);
        }
        let swing_squared = bounds.norm_squared(&(error - self.error_at_reversal));
        if swing_squared >= self.swing_squared {
            (self.farthest, self.swing_squared) = (*error, swing_squared);
        }
        if self.since_turn_s > bounds.max_reversal_interval_s {
            self.restart(error);
        }
        Ok(())
    }

    /// Restarts at the present error.
    // Rarely called, like `count`: moving it out of the main path keeps the cycle short.
    #[cold]
    #[inline]
    fn restart(&mut self, error: &Vector6<f64>) {
        (self.error_at_reversal, self.farthest, self.swing_squared) = (*error, *error, 0.0);
        (self.since_turn_s, self.swings, self.last_swing_squared) = (0.0, 0, 0.0);
    }

    /// Counts a reversal, unless the motion of the reference or friction explains it.
    #[cold]
    #[inline]
    fn count(
        &mut self,
        bounds: &DisturbanceBounds,
        error: &Vector6<f64>,
        back_squared: f64,
        by_friction: f64,
    ) -> Result<(), Diagnostic> {
        let by_shaking = bounds.swing_by_acceleration * self.shaking_squared.sqrt();
        let bound = bounds.swing + by_shaking + by_friction;
        if back_squared <= bound * bound {
            return Ok(());
        }
        let swing_squared = self.swing_squared;
        let decays = swing_squared < LEAST_GROWTH * LEAST_GROWTH * self.last_swing_squared;
        (self.error_at_reversal, self.farthest, self.swing_squared) = (self.farthest, *error, back_squared);
        self.last_swing_squared = swing_squared;
        (self.since_turn_s, self.swings) = (0.0, if decays { 1 } else { self.swings.saturating_add(1) });
        if self.swings < MIN_OSCILLATION_SWINGS {
            return Ok(());
        }
        Err(Diagnostic::new(DiagnosticCode::Oscillation, 0.5 * swing_squared.sqrt(), 0.5 * bound))
    }
}

#[cfg(test)]
mod tests;
