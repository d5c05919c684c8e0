//! Calibration of the joints and of the zeros of the lengths, from poses that a tracker has measured.
//!
//! [`model`] has the equations, [`start`] the first guess, [`solve`] the method, [`mistakes`] what is wrong with a table that no joints
//! explain, [`examination`] what the result is worth, [`plan`] the poses that determine the joints best.
//!
//! The tracker's frame, where its probe or its reflectors are on the platform, and the pose of each row are unknown as well. Measurements do
//! not show where base and platform are in the frames of the drawing: both stay as near to the drawing as they can, by least squares.
//! It does not find scales of the lengths, direction of gravity or what yields under load.

use nalgebra::{DMatrix, DVector, Vector6};

use self::examination::{
    Directions, PoseErrors, RowResult, drawn_covariance, geometry_covariance, pose_change, row_results,
};
use self::mistakes::{Mistake, drawn_fit, likely_mistake};
use self::model::{GEOMETRY_VALUES, Geometry, Noise, Row, Seen, Unknowns};
use self::solve::{FINE_PRECISION, Minimum, Problem};
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use hexad_core::model::random::Random;
use hexad_core::model::rigid::Pose;

pub mod examination;
pub mod mistakes;
pub mod model;
pub mod plan;
pub mod solve;
pub mod start;

/// Combinations of joints, offsets, tracker's frame and mount that rows must determine at least.
const COMBINATIONS: usize = GEOMETRY_VALUES;
/// Largest change of a value of the drawing, and largest misfit of the drawn machine, over the tolerance.
const MAX_CHANGE_RATIO: f64 = 5.0;
/// Noise from which a mistake is searched, over the stated one.
const MAX_NOISE_FACTOR: f64 = 10.0;
/// Least noise over the stated one, of simulated measurements without any.
const MIN_NOISE_FACTOR: f64 = 0.01;
/// Predicted error over the error with the drawing, from which a result is no calibration.
const MAX_ERROR_RATIO: f64 = 1.0 / 3.0;
/// Rounds in which noise and minimum are found in turn, and the change of the noise that ends them.
const MAX_NOISE_ROUNDS: usize = 6;
const NOISE_CHANGE: f64 = 0.01;
/// Step of the second start: of the geometry over the tolerance, of poses and frames \[rad\], \[radius\].
const SECOND_START_RATIO: f64 = 2.0;
const SECOND_START_STEP: f64 = 0.02;

/// Why rows are no calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Fewer equations than combinations, both per six.
    TooFewRows {
        /// Rows with all measurements that are needed at least.
        needed: usize,
    },
    /// No pose of the drawn machine has the lengths of most rows.
    NoPose,
    /// The table has a mistake.
    Mistake(Mistake),
    /// The joints would be further off the drawing than the tolerance lets expect.
    FarFromDrawing {
        /// Largest change of a value, or misfit of the drawn machine.
        change_m: f64,
    },
    /// The poses are too much alike.
    PoorSpread {
        /// Directions of the geometry.
        directions: Directions,
        /// RMS error of a position over the workspace, predicted after and before.
        position_rms_m: [f64; 2],
    },
}

/// Task of a calibration.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// As drawn.
    pub machine: &'a Machine,
    /// Measurements.
    pub rows: &'a [Row],
    /// Their standard deviations.
    pub noise: Noise,
    /// Standard deviation of each coordinate of a joint and of each offset by the drawing.
    pub tolerance_m: f64,
    /// Poses over which errors are predicted.
    pub workspace: &'a [Pose],
}

/// Result of a calibration.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Joints and offsets.
    pub geometry: Geometry,
    /// Standard deviations of [`Geometry::values`] \[m\].
    pub deviations_m: DVector<f64>,
    /// Their covariance \[m^2\].
    pub covariance: DMatrix<f64>,
    /// In the order of the table.
    pub rows: Vec<RowResult>,
    /// Of the measurements, by the residuals.
    pub noise: Noise,
    /// This noise over the stated one.
    pub noise_factor: f64,
    /// See [`solve`].
    pub cost: f64,
    /// Difference of the cost from another start, over the cost.
    pub second_start_difference_ratio: f64,
    /// What the rows determine.
    pub directions: Directions,
    /// Errors over the workspace with the drawn machine.
    pub before: PoseErrors,
    /// The same with the calibrated machine, as its deviations let expect.
    pub after: PoseErrors,
}

impl Task<'_> {
    /// The most probable geometry.
    ///
    /// # Errors
    /// The rows are no calibration.
    pub fn calibrate(&self) -> Result<Calibration, Refusal> {
        let Self { machine, rows, tolerance_m, .. } = *self;
        self.check_count()?;
        let Some((drawn, misfit_m)) = drawn_fit(machine, rows) else {
            return Err(
                likely_mistake(machine, rows, f64::INFINITY).map_or(Refusal::NoPose, Refusal::Mistake)
            );
        };
        let far = |change_m: f64| {
            let mistake = likely_mistake(machine, rows, misfit_m);
            mistake.map_or(Refusal::FarFromDrawing { change_m }, Refusal::Mistake)
        };
        if misfit_m > MAX_CHANGE_RATIO * tolerance_m {
            return Err(far(misfit_m));
        }
        let nominal = Geometry::of(machine);
        let problem =
            |noise| Problem { rows, nominal: &nominal, tolerance_m, noise, precision: FINE_PRECISION };
        let (minimum, noise_factor) = self.minimum(&problem, &drawn).ok_or_else(|| far(misfit_m))?;
        let noise = self.noise.scaled(noise_factor);
        let change_m = (minimum.unknowns.geometry.values() - nominal.values()).amax();
        if change_m > MAX_CHANGE_RATIO * tolerance_m {
            return Err(far(change_m));
        }
        if noise_factor > MAX_NOISE_FACTOR
            && let Some(mistake) = likely_mistake(machine, rows, misfit_m)
        {
            return Err(Refusal::Mistake(mistake));
        }
        let second = problem(noise).minimum(self.second_start(&drawn)).map_or(f64::NAN, |second| second.cost);
        let covariance = geometry_covariance(&minimum);
        let geometry = minimum.unknowns.geometry.clone();
        let changes: Vec<_> =
            self.workspace.iter().filter_map(|pose| pose_change(&geometry, &nominal, pose)).collect();
        let calibration = Calibration {
            deviations_m: covariance.diagonal().map(|variance| variance.max(0.0).sqrt()),
            rows: row_results(rows, &drawn, &minimum, &noise),
            noise,
            noise_factor,
            cost: minimum.cost,
            second_start_difference_ratio: (second - minimum.cost).abs() / minimum.cost,
            directions: Directions::of(&covariance, tolerance_m),
            before: PoseErrors::of(changes.iter()),
            after: PoseErrors::expected(&geometry, &covariance, self.workspace),
            covariance,
            geometry,
        };
        self.check_spread(&calibration).map(|()| calibration)
    }

    fn check_count(&self) -> Result<(), Refusal> {
        let measured = |row: &Row| match &row.seen {
            Seen::Probe(_) => 6,
            Seen::Reflectors(seen) => (3 * seen.iter().flatten().count()).min(6),
        };
        let equations: usize = self.rows.iter().map(measured).sum();
        let needed = COMBINATIONS / 6;
        if equations < COMBINATIONS { Err(Refusal::TooFewRows { needed }) } else { Ok(()) }
    }

    fn check_spread(&self, found: &Calibration) -> Result<(), Refusal> {
        let drawn = drawn_covariance(&found.geometry, self.tolerance_m);
        let drawn = PoseErrors::expected(&found.geometry, &drawn, self.workspace);
        let position_rms_m = [found.after.position_rms_m, drawn.position_rms_m];
        if found.after.position_rms_m > MAX_ERROR_RATIO * drawn.position_rms_m {
            return Err(Refusal::PoorSpread { directions: found.directions, position_rms_m });
        }
        Ok(())
    }

    /// Minimum with the noise that the residuals show, and this over the stated noise.
    fn minimum<'p>(
        &self,
        problem: &impl Fn(Noise) -> Problem<'p>,
        start: &Unknowns,
    ) -> Option<(Minimum, f64)> {
        let mut factor = 1.0;
        let mut minimum = problem(self.noise).minimum(start.clone())?;
        for _ in 0..MAX_NOISE_ROUNDS {
            let change = minimum.noise_factor(self.tolerance_m);
            if (change - 1.0).abs() < NOISE_CHANGE {
                break;
            }
            factor = (factor * change).max(MIN_NOISE_FACTOR);
            minimum = problem(self.noise.scaled(factor)).minimum(minimum.unknowns)?;
        }
        Some((minimum, factor))
    }

    /// Another start: joints, frames and poses displaced.
    fn second_start(&self, drawn: &Unknowns) -> Unknowns {
        let (mut random, radius) = (Random::new(1), self.machine.joints.radius_m);
        let mut step = |k: usize| {
            let size = match k {
                _ if k < GEOMETRY_VALUES => SECOND_START_RATIO * self.tolerance_m,
                _ if k % 6 < 3 => SECOND_START_STEP,
                _ => SECOND_START_STEP * radius,
            };
            size * random.signed()
        };
        let shared = DVector::from_fn(drawn.shared_count(), |k, _| step(k));
        let poses: Vec<_> =
            drawn.poses.iter().map(|_| Vector6::from_fn(|k, _| step(GEOMETRY_VALUES + k))).collect();
        drawn.displaced(&shared, &poses)
    }
}

/// Offsets alone: true less measured lengths \[m\], from poses in the base frame that are known otherwise, and their standard deviations if
/// there are several poses.
pub fn offsets(machine: &Machine, rows: &[(Vector6<f64>, Pose)]) -> ([f64; LEGS], Option<[f64; LEGS]>) {
    let geometry = Geometry::of(machine);
    let each: Vec<_> = rows.iter().map(|(lengths, pose)| geometry.lengths(pose).0 - lengths).collect();
    let count = each.len() as f64;
    let mean = each.iter().sum::<Vector6<f64>>() / count;
    let squares: Vector6<f64> = each.iter().map(|it| (it - mean).component_mul(&(it - mean))).sum();
    let deviations = (each.len() > 1).then(|| (squares / (count - 1.0) / count).map(f64::sqrt).into());
    (mean.into(), deviations)
}
