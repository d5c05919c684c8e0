//! Drive response: detects forces that are sent but do not act, without a report from the driver.
//!
//! The estimated disturbance is the acceleration that model and forces do not explain. If the force of one
//! leg stops, the disturbance becomes, within milliseconds and in any motion, the acceleration that this
//! force should have caused:
//!
//! ```text
//! B = M^-1 N                       accelerations for unit forces of the legs; in modes on legs N^T M^-1 N
//! f_i = b_i . d / (b_i . b_i)      force of leg i that explains the disturbance best
//! cos = b_i . d / (|b_i| |d|)      quality of this explanation
//! ```
//!
//! d is the recent change of the disturbance. A payload and friction change slowly, or exist when control
//! begins. Angles are weighted by the radius of the platform. A force is missing if `cos` is near 1 and `f_i`
//! is a large share of the usual force, compared with noise, friction and payloads.
//!
//! Not detected: a leg with a small load, because friction may be as large; several drives at once. A drive
//! that pushes more than commanded shows in the leg lengths.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::control::constants::Constants;
use crate::control::monitoring::unstated_friction::USUAL_DISTURBANCE_S;
use crate::control::monitoring::weighting::{MIN_MISSING_PER_MAX_FORCE, weighted};
use crate::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use crate::model::LEGS;
use crate::model::rigid::Pose;

/// Time from the start of control in which any disturbance is usual \[s\], because the payload is still
/// unknown.
const START_S: f64 = 0.25;
/// Smallest missing force, relative to the force that is usually sent.
const MIN_MISSING_PER_USUAL_FORCE: f64 = 0.4;
/// Largest missing force, relative to the force that was sent: a drive that pushes the wrong way, with
/// reserve.
const MAX_MISSING_PER_SENT_FORCE: f64 = 2.5;
/// Smallest square of the cosine: 18 degrees. The accelerations by two legs differ by more.
const LEAST_COSINE_SQUARED: f64 = 0.9;
/// Time for which a force must be missing \[s\]. An impact is shorter, or passes through other directions.
const LEAST_MISSING_S: f64 = 0.006;

/// State of the drive response check.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::control) struct DriveResponse {
    usual_disturbance: Vector6<f64>,
    /// Forces that are usually sent, low-pass filtered \[N\].
    usual_force: Vector6<f64>,
    since_start_s: f64,
    missing_s: f64,
    /// Change of the disturbance; 0 if the force of one leg explains it.
    pub sudden_acceleration: Vector6<f64>,
}

impl DriveResponse {
    /// Checks the disturbance after a measurement, `dt_s` seconds after the previous one.
    pub fn check(
        &mut self,
        constants: &Constants,
        disturbance_acceleration: &Vector6<f64>,
        sent_n: &[f64; LEGS],
        pose: &Pose,
        dt_s: f64,
    ) -> Result<(), Diagnostic> {
        let sudden = disturbance_acceleration - self.usual_disturbance;
        self.since_start_s += dt_s;
        let is_starting = self.since_start_s < START_S;
        let share = if is_starting { 1.0 } else { (dt_s / USUAL_DISTURBANCE_S).min(1.0) };
        self.usual_disturbance += sudden * share;
        let sent = Vector6::from(*sent_n);
        self.usual_force += (sent - self.usual_force) * share;
        let arm = constants.angle_weighting_radius_m();
        self.sudden_acceleration = if is_starting { Vector6::zeros() } else { sudden };
        let sudden = weighted(&sudden, arm);
        if is_starting || sudden.norm_squared() < constants.least_missing_acceleration_squared_m2_s4 {
            self.missing_s = 0.0;
            return Ok(());
        }
        self.check_legs(constants, &sudden, &sent, pose, dt_s)
    }

    // Rarely called, hence out of line: the cycle stays short.
    #[inline(never)]
    fn check_legs(
        &mut self,
        constants: &Constants,
        sudden: &Vector6<f64>,
        sent: &Vector6<f64>,
        pose: &Pose,
        dt: f64,
    ) -> Result<(), Diagnostic> {
        let arm = constants.angle_weighting_radius_m();
        let mut by_force = constants.acceleration_by_command.acceleration_by_force(constants.machine(), pose);
        by_force.column_iter_mut().for_each(|mut column| {
            let scaled = weighted(&column.clone_owned(), arm);
            column.copy_from(&scaled);
        });
        let along = by_force.tr_mul(sudden);
        let squares = by_force.component_mul(&by_force).tr_mul(&Vector6::repeat(1.0));
        let least = LEAST_COSINE_SQUARED * sudden.norm_squared();
        let max_force = constants.machine().actuator.weakest_available_force_n();
        let mut missing = None;
        let forces = sent.iter().zip(&self.usual_force);
        for (leg, ((along, square), (sent, usual))) in along.iter().zip(&squares).zip(forces).enumerate() {
            let force = along / square * if *sent < 0.0 { -1.0 } else { 1.0 };
            let explains = along * along >= least * square;
            if explains {
                self.sudden_acceleration = Vector6::zeros();
            }
            let bound =
                (MIN_MISSING_PER_USUAL_FORCE * usual.abs()).max(MIN_MISSING_PER_MAX_FORCE * max_force);
            if explains && force >= bound && force <= MAX_MISSING_PER_SENT_FORCE * sent.abs() {
                missing = Some(Diagnostic::new(DiagnosticCode::DriveForceMissing, force, bound).at(leg));
            }
        }
        self.missing_s = if missing.is_some() { self.missing_s + dt } else { 0.0 };
        missing.filter(|_| self.missing_s > LEAST_MISSING_S).map_or(Ok(()), Err)
    }
}
