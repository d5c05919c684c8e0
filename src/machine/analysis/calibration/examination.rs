//! What a minimum is worth: deviations of the values, errors of poses, rows left out, outliers.

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector6};

use super::model::{GEOMETRY_VALUES, Geometry, JOINT_VALUES, Row, RowTerms, Unknowns};
use super::solve::{Minimum, OUTLIER_QUANTILE, chi_square, degrees};
use hexad_core::model::LEGS;
use hexad_core::model::rigid::Pose;

/// Deviation from which a direction stays as drawn, as a share of the tolerance.
const WEAK_RATIO: f64 = 0.5;
/// Deviations within which an error is, unless one of 370 errors is larger.
const WORST_DEVIATIONS: f64 = 3.0;

/// Errors of poses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseErrors {
    /// Root mean square of the distances.
    pub position_rms_m: f64,
    /// Largest distance.
    pub position_worst_m: f64,
    /// Root mean square of the angles.
    pub angle_rms_rad: f64,
    /// Largest angle.
    pub angle_worst_rad: f64,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct RowResult {
    /// From the pose by the lengths to the pose by the tracker, with the drawn machine and with the calibrated one \[rad\], \[m\].
    pub displacement_before: Option<Vector6<f64>>,
    /// See [`Self::displacement_before`].
    pub displacement_after: Option<Vector6<f64>>,
    /// The same with the machine that the other rows determine.
    pub displacement_left_out: Option<Vector6<f64>>,
    /// Length by the tracker less measured length of each leg, with the calibrated machine \[m\].
    pub legs_m: [f64; LEGS],
    /// The same with the drawn machine \[m\].
    pub legs_before_m: [f64; LEGS],
    /// Whether its measurements contradict the others.
    pub is_outlier: bool,
}

/// Directions of the geometry, beyond the places of base and platform in their frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// That the rows determine better than half of the tolerance.
    pub determined: usize,
    /// That stay as drawn.
    pub weak: usize,
    /// Condition of the information that the rows give about all of them.
    pub condition: f64,
}

impl PoseErrors {
    /// Errors by their squares: position \[m^2\] and angle \[rad^2\], mean and worst of each pose.
    fn of_squares(squares: &[[f64; 4]]) -> Self {
        let mean = |k: usize| {
            let sum: f64 = squares.iter().filter_map(|it| it.get(k)).sum();
            (sum / squares.len().max(1) as f64).sqrt()
        };
        let worst =
            |k: usize| squares.iter().filter_map(|it| it.get(k)).fold(0.0, |a: f64, b| a.max(*b)).sqrt();
        Self {
            position_rms_m: mean(0),
            position_worst_m: worst(1),
            angle_rms_rad: mean(2),
            angle_worst_rad: worst(3),
        }
    }

    /// Errors of displacements.
    pub fn of<'a>(displacements: impl Iterator<Item = &'a Vector6<f64>>) -> Self {
        let squares = |d: &Vector6<f64>| {
            let [angle, position] = [0, 3].map(|row| d.fixed_rows::<3>(row).norm_squared());
            [position, position, angle, angle]
        };
        Self::of_squares(&displacements.map(squares).collect::<Vec<_>>())
    }

    /// Errors that a covariance of the geometry lets expect at poses: RMS, and three deviations in the worst direction at the worst pose.
    pub fn expected(geometry: &Geometry, covariance: &DMatrix<f64>, poses: &[Pose]) -> Self {
        let squares = |pose: &Pose| {
            let by_values = sensitivity(geometry, pose)?;
            let covariance = &by_values * covariance * by_values.transpose();
            let worst = |row: usize| {
                let block = covariance.fixed_view::<3, 3>(row, row).into_owned();
                (block.trace(), WORST_DEVIATIONS.powi(2) * block.symmetric_eigenvalues().max())
            };
            let ((angle, worst_angle), (position, worst_position)) = (worst(0), worst(3));
            Some([position, worst_position, angle, worst_angle])
        };
        Self::of_squares(&poses.iter().filter_map(squares).collect::<Vec<_>>())
    }
}

/// Displacement of the pose that has measured lengths, by the values of the geometry; `None` at a singular pose.
fn sensitivity(geometry: &Geometry, pose: &Pose) -> Option<Matrix6xX<f64>> {
    let (_, by_pose, by_values) = geometry.lengths(pose);
    Some(-(by_pose.try_inverse()? * by_values))
}

/// Displacement between the poses of two geometries with the same measured lengths, to first order.
pub fn pose_change(geometry: &Geometry, other: &Geometry, pose: &Pose) -> Option<Vector6<f64>> {
    Some(sensitivity(geometry, pose)? * (other.values() - geometry.values()))
}

/// Covariance of the geometry, without what only places base and platform otherwise in their frames.
pub fn geometry_covariance(minimum: &Minimum) -> DMatrix<f64> {
    let covariance = minimum.covariance.view((0, 0), (GEOMETRY_VALUES, GEOMETRY_VALUES)).into_owned();
    without_rigid_motions(&minimum.unknowns.geometry, covariance)
}

/// Covariance that a tolerance of the drawing gives, without rigid motions.
pub fn drawn_covariance(geometry: &Geometry, tolerance_m: f64) -> DMatrix<f64> {
    let all = DMatrix::identity(GEOMETRY_VALUES, GEOMETRY_VALUES) * tolerance_m.powi(2);
    without_rigid_motions(geometry, all)
}

fn without_rigid_motions(geometry: &Geometry, covariance: DMatrix<f64>) -> DMatrix<f64> {
    let mut motions = DMatrix::zeros(GEOMETRY_VALUES, 12);
    for (body, joints) in [&geometry.base, &geometry.platform].into_iter().enumerate() {
        let center = joints.column_mean();
        for (leg, joint) in joints.column_iter().enumerate() {
            let row = JOINT_VALUES / 2 * body + 3 * leg;
            motions.fixed_view_mut::<3, 3>(row, 6 * body).copy_from(&(joint - center).cross_matrix());
            motions.fixed_view_mut::<3, 3>(row, 6 * body + 3).fill_with_identity();
        }
    }
    let q = motions.qr().q();
    let rest = DMatrix::identity(GEOMETRY_VALUES, GEOMETRY_VALUES) - &q * q.transpose();
    &rest * covariance * &rest
}

impl Directions {
    /// Of a covariance without rigid motions.
    pub fn of(covariance: &DMatrix<f64>, tolerance_m: f64) -> Self {
        let mut variances: Vec<_> = covariance.clone().symmetric_eigenvalues().iter().copied().collect();
        variances.sort_by(|a, b| b.total_cmp(a));
        variances.truncate(GEOMETRY_VALUES - 12);
        let prior = tolerance_m.powi(2);
        let information = |variance: Option<&f64>| {
            variance.map_or(0.0, |variance| (1.0 / variance - 1.0 / prior).max(1e-9 / prior))
        };
        let is_weak = |variance: &&f64| variance.sqrt() > WEAK_RATIO * tolerance_m;
        let weak = variances.iter().filter(is_weak).count();
        let condition = information(variances.last()) / information(variances.first());
        Self { determined: variances.len() - weak, weak, condition }
    }
}

/// Each row, with the drawn machine in its best frames and at the minimum.
pub fn row_results(
    rows: &[Row],
    drawn: &Unknowns,
    minimum: &Minimum,
    noise: &super::model::Noise,
) -> Vec<RowResult> {
    let pairs = rows.iter().zip(&drawn.poses).zip(minimum.unknowns.poses.iter().zip(&minimum.rows));
    pairs
        .map(|((row, drawn_pose), (pose, (terms, weight)))| {
            let before = drawn.terms(row, drawn_pose, noise);
            let before = before.difference(&before.residual);
            let after = terms.difference(&terms.residual);
            let legs = |unknowns: &Unknowns, pose, difference: Option<Vector6<f64>>| {
                let (_, by_pose, _) = unknowns.geometry.lengths(pose);
                difference.map_or([f64::NAN; LEGS], |difference| (by_pose * difference).into())
            };
            RowResult {
                displacement_before: before,
                displacement_after: after,
                displacement_left_out: left_out(terms, *weight, &minimum.covariance)
                    .and_then(|residual| terms.difference(&residual)),
                legs_m: legs(&minimum.unknowns, pose, after),
                legs_before_m: legs(drawn, drawn_pose, before),
                is_outlier: terms.residual.norm_squared() > chi_square(degrees(terms), OUTLIER_QUANTILE),
            }
        })
        .collect()
}

/// Residual of a row with the values that the other rows determine, to first order.
fn left_out(terms: &RowTerms, weight: f64, covariance: &DMatrix<f64>) -> Option<DVector<f64>> {
    let (residual, shared) = terms.reduced();
    let leverage = &shared * covariance * shared.transpose() * weight;
    (DMatrix::identity(leverage.nrows(), leverage.ncols()) - leverage).lu().solve(&residual)
}
