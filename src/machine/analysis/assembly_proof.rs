//! All poses with given leg lengths, by intervals over orientations: a proof that none is missing.
//!
//! Orientations up to a rotation from one of them are divided into balls. With `p_i = R (CB_i - mean)`, c the mean of the joints on the
//! platform, and `d_i = c + p_i - A_i`, a ball of radius rho leaves each leg a shell: `| |c - A_i + p_i| - L_i | <= rho |p_i|`.
//!
//! 1. The shells bound c: less their mean, their squares are linear in c; the mean gives its height over the joints, on either side.
//! 2. Newton's operator bounds a solution `[w; t]` of the region, `L - |d_i| = J [w; t] + e`, with e bounded by second derivatives: it
//!    excludes the region or makes it smaller.
//! 3. Two solutions in one region have `m_i . (t + w x q_i) = 0`, with the mean `m_i` of their legs, `q_i` of their arms, and w along the axis
//!    of the rotation between them. If this matrix is regular for all such means, the region has at most one, which
//!    the method of Levenberg and Marquardt finds.
//!
//! Otherwise the ball is divided. Merlet (2004, Int. J. Robotics Research 23(3)) does the same with coordinates of three joints. All lengths
//! within [`LENGTH_MARGIN_RATIO`] of the given ones are decided at once; rounding is far below. Near a singular pose with these lengths
//! nothing is proved.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::{Pose, Twist, exp, log};

/// Error of a length that the proof includes, as a share of the radius.
pub const LENGTH_MARGIN_RATIO: f64 = 1e-5;
/// Half of the edge of a cell of rotation vectors: at first, and the last that is divided \[rad\].
const FIRST_HALF_EDGE_RAD: f64 = 0.15;
const LAST_HALF_EDGE_RAD: f64 = 3e-4;
/// Of the moment of the joints, as a share of the largest: below it rounding decides what the linear equations give.
const LEAST_EIGENVALUE: f64 = 1e-9;
/// Cells of one proof: three seconds.
const MAX_CELLS: usize = 1 << 20;
/// Steps by which Newton's operator makes a region smaller.
const MAX_NEWTON_STEPS: usize = 8;
/// A solution is known if it is in a region so many times as large, which has at most one.
const INFLATION: f64 = 2.0;

/// Bound on the steps from a start; most need three.
const MAX_STEPS: usize = 60;
/// Largest norm of the residual of a solution, as a share of the radius: rounding.
const LENGTH_TOLERANCE: f64 = 1e-12;
/// Distance (radian, or radius) below which two poses are the same.
const SAME_POSE_DISTANCE: f64 = 1e-7;
/// First damping as a share of the usual largest eigenvalue of `J^T J`; then its factor after each step that succeeds or fails.
const FIRST_DAMPING: f64 = 1e-2;
const DAMPING_DECREASE: f64 = 0.2;
const DAMPING_INCREASE: f64 = 5.0;

/// Poses with the same lengths.
#[derive(Clone, Debug, Default)]
pub struct Modes {
    /// Each once.
    pub poses: Vec<KinematicState>,
    /// Whether it is proved that none is missing.
    pub is_proved_complete: bool,
}

/// The poses with these lengths \[m\] that are rotated from an orientation by at most `max_turn` \[rad\], on all sides of the singular poses.
pub fn all_modes(
    machine: &Machine,
    lengths: &[f64; LEGS],
    orientation: &Matrix3<f64>,
    max_turn: f64,
) -> Modes {
    let legs = Legs::new(machine, lengths);
    let reach = (max_turn / (2.0 * FIRST_HALF_EDGE_RAD)).ceil() as i32;
    let axis = || -reach..=reach;
    let mut cells: VecDeque<Cell> = axis()
        .flat_map(|x| axis().flat_map(move |y| axis().map(move |z| Vector3::new(x, y, z))))
        .map(|k| Cell { turn: k.map(f64::from) * 2.0 * FIRST_HALF_EDGE_RAD, half: FIRST_HALF_EDGE_RAD })
        .collect();
    let (mut modes, mut examined) = (Modes { poses: vec![], is_proved_complete: true }, 0);
    while let Some(cell) = cells.pop_front() {
        if cell.turn.norm() - cell.radius() > max_turn {
            continue;
        }
        examined += 1;
        let is_last = cell.half <= LAST_HALF_EDGE_RAD || examined >= MAX_CELLS;
        let regions = legs.regions(exp(&cell.turn) * orientation, cell.radius());
        let undecided =
            regions.into_iter().flatten().filter(|it| !legs.decides(*it, &mut modes.poses, is_last));
        match undecided.count() {
            0 => {}
            _ if is_last => modes.is_proved_complete = false,
            _ => cells.extend(cell.eighths()),
        }
    }
    modes
}

/// Cube of rotation vectors \[rad\].
struct Cell {
    turn: Vector3<f64>,
    half: f64,
}

impl Cell {
    /// Largest rotation from the middle, at most the distance of the rotation vectors.
    fn radius(&self) -> f64 {
        self.half * 3.0_f64.sqrt()
    }

    fn eighths(&self) -> impl Iterator<Item = Self> {
        let half = self.half / 2.0;
        let sign = move |corner: u8, bit: u8| if corner & bit == 0 { -half } else { half };
        let turn = self.turn;
        (0..8).map(move |k| Self { turn: turn + Vector3::new(sign(k, 1), sign(k, 2), sign(k, 4)), half })
    }
}

/// Poses with `R = exp(w) R0`, `|w| <= rho`, `c = c0 + t`, `|t| <= tau`.
#[derive(Clone, Copy)]
struct Region {
    rotation: Matrix3<f64>,
    center: Vector3<f64>,
    rho: f64,
    tau: f64,
}

/// Geometry and lengths of the legs, one in each column or row.
struct Legs<'a> {
    machine: &'a Machine,
    base: Matrix3x6<f64>,
    /// From their mean, in platform axes, and their distances from it.
    platform: Matrix3x6<f64>,
    arms: Vector6<f64>,
    mean: Vector3<f64>,
    lengths: Vector6<f64>,
    /// Error of a length \[m\].
    margin: f64,
}

impl<'a> Legs<'a> {
    fn new(machine: &'a Machine, lengths: &[f64; LEGS]) -> Self {
        let joints = &machine.joints;
        let [base, mut platform] = [&joints.base, &joints.platform]
            .map(|it| Matrix3x6::from_columns(&joints.triples.unpack_vectors(it)));
        let mean = platform.column_mean();
        platform.column_iter_mut().for_each(|mut joint| joint -= mean);
        let arms = norms(&platform);
        let margin = LENGTH_MARGIN_RATIO * joints.radius_m;
        Self { machine, base, platform, arms, mean, lengths: Vector6::from(*lengths), margin }
    }

    /// Where the mean of the joints can be with an orientation of a ball: up to two balls.
    fn regions(&self, rotation: Matrix3<f64>, rho: f64) -> [Option<Region>; 2] {
        let mut e = self.base - rotation * self.platform;
        let mean = e.column_mean();
        e.column_iter_mut().for_each(|mut e| e -= mean);
        // |u - e_i|^2 = L_i^2 + error, with u from the mean of the e_i to c. On average, |u|^2 = error - excess.
        let excess = norms(&e).map(|norm| norm * norm) - self.lengths.map(|length| length * length);
        let shell = (self.arms * rho).add_scalar(self.margin);
        let error = shell.component_mul(&(self.lengths * 2.0 + shell));
        // Principal axes of the joints, the one across them last.
        let mut axes = (e * e.transpose()).symmetric_eigen();
        let across = axes.eigenvalues.imin();
        axes.eigenvectors.swap_columns(across, 2);
        axes.eigenvalues.swap_rows(across, 2);
        // u along the axes, from the linear equations.
        let smallest = LEAST_EIGENVALUE * axes.eigenvalues.max();
        let halved = axes.eigenvalues.map(|value| if value > smallest { 0.5 / value } else { f64::NAN });
        let shares = Matrix3::from_diagonal(&halved) * axes.eigenvectors.tr_mul(&e);
        let (middle, half) = (shares * excess, shares.abs() * error);
        let least = (middle.abs() - half).xy().map(|u| u.max(0.0)).norm_squared();
        let largest = (middle.abs() + half).xy().norm_squared();
        let low = (-excess.mean() - error.mean() - largest).max(0.0).sqrt();
        let high = (-excess.mean() + error.mean() - least).sqrt();
        let sides =
            if low > 0.0 { [Some((low, high)), Some((-high, -low))] } else { [Some((-high, high)), None] };
        sides.map(|side| {
            let (low, high) = side.filter(|_| high >= low)?;
            // Of joints in a plane the linear equations give no height, but NaN, which min and max leave out.
            let (low, high) = (low.max(middle.z - half.z), high.min(middle.z + half.z));
            let u = Vector3::new(middle.x, middle.y, (high + low) / 2.0);
            let tau = Vector3::new(half.x, half.y, (high - low) / 2.0).norm();
            (low <= high).then(|| Region { rotation, center: mean + axes.eigenvectors * u, rho, tau })
        })
    }

    /// In the middle of a region: lengths of the legs, and the inverse of J; `None` if it is singular.
    fn middle(&self, region: &Region) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let arms = region.rotation * self.platform;
        let mut legs = arms - self.base;
        legs.column_iter_mut().for_each(|mut leg| leg += region.center);
        let lengths = norms(&legs);
        legs.column_iter_mut().zip(&lengths).for_each(|(mut leg, length)| leg /= *length);
        let mut transposed = Matrix6::zeros();
        for ((mut column, arm), n) in
            transposed.column_iter_mut().zip(arms.column_iter()).zip(legs.column_iter())
        {
            column.fixed_rows_mut::<3>(0).copy_from(&arm.cross(&n));
            column.fixed_rows_mut::<3>(3).copy_from(&n);
        }
        Some((lengths, transposed.try_inverse()?.transpose()))
    }

    /// Whether a region has no solution but known ones.
    fn decides(&self, mut region: Region, found: &mut Vec<KinematicState>, is_last: bool) -> bool {
        for _ in 0..MAX_NEWTON_STEPS {
            let Some((middle, half)) = self.newton(&region) else { break };
            let ([w, t], [rho, tau]) = (
                [middle.fixed_rows::<3>(0).into_owned(), middle.fixed_rows::<3>(3).into_owned()],
                [half.fixed_rows::<3>(0).norm(), half.fixed_rows::<3>(3).norm()],
            );
            if w.norm() - rho > region.rho || t.norm() - tau > region.tau {
                return true;
            }
            let is_smaller = rho < 0.9 * region.rho || tau < 0.9 * region.tau;
            if rho < region.rho {
                region.rotation = exp(&w) * region.rotation;
                region.rho = rho;
            }
            if tau < region.tau {
                region.center += t;
                region.tau = tau;
            }
            if !is_smaller {
                break;
            }
        }
        let wide = Region { rho: INFLATION * region.rho, tau: INFLATION * region.tau, ..region };
        let has_at_most_one = self.has_at_most_one(&wide);
        let is_known = |found: &[KinematicState]| found.iter().any(|it| self.contains(&wide, it.pose()));
        if !is_known(found) && (has_at_most_one || is_last) {
            let Region { rotation, center, .. } = region;
            let start = Pose { rotation, position: center - rotation * self.mean };
            found.extend(self.solve(start).filter(|new| self.is_new(new, found)));
        }
        has_at_most_one && is_known(found)
    }

    fn is_new(&self, new: &KinematicState, found: &[KinematicState]) -> bool {
        let distance = |it: &KinematicState| self.machine.joints.distance(it.pose(), new.pose());
        found.iter().all(|it| distance(it) > SAME_POSE_DISTANCE)
    }

    /// Middle and half widths that contain all solutions `[w; t]` of a region.
    fn newton(&self, region: &Region) -> Option<(Vector6<f64>, Vector6<f64>)> {
        let (lengths, inverse) = self.middle(region)?;
        let away = (self.arms * region.rho).add_scalar(region.tau);
        let shortest = lengths - away;
        // Second order of the rotation, on either side; of the length, which is convex, on one.
        let turned = self.arms * (0.5 * region.rho * region.rho);
        let curved = away.component_mul(&away).component_div(&shortest) * 0.25;
        let rest = self.lengths - lengths - curved;
        let error = (turned + curved).add_scalar(self.margin);
        (shortest.min() > 0.0).then(|| (inverse * rest, inverse.abs() * error))
    }

    /// Whether no two poses of a region have the same lengths: `|J^-1 (J' - J)| < 1` for all J' of step 3, blocks of angles and shifts apart.
    fn has_at_most_one(&self, region: &Region) -> bool {
        let Some((lengths, inverse)) = self.middle(region) else { return false };
        let direction = (self.arms * region.rho).add_scalar(region.tau).component_div(&lengths);
        let moment = self.arms.component_mul(&(direction.add_scalar(region.rho) + direction * region.rho));
        let [angles, shifts] = [0, 3].map(|row| norms(&inverse.fixed_rows::<3>(row).into_owned()));
        let [ww, wt] = [moment, direction].map(|change| angles.dot(&change));
        let [tw, tt] = [moment, direction].map(|change| shifts.dot(&change));
        ww < 1.0 && (1.0 - ww) * (1.0 - tt) > wt * tw
    }

    fn contains(&self, region: &Region, pose: &Pose) -> bool {
        let center = pose.position + pose.rotation * self.mean;
        let turn = log(&(pose.rotation * region.rotation.transpose())).norm();
        turn <= region.rho && (center - region.center).norm() <= region.tau
    }

    /// The pose with these lengths that is found from a start.
    fn solve(&self, start: Pose) -> Option<KinematicState> {
        let Self { machine, lengths, .. } = *self;
        let radius = machine.joints.radius_m;
        let scale = Vector6::new(1.0, 1.0, 1.0, radius, radius, radius);
        let residual = |pose: &Pose| lengths - Vector6::from(leg_lengths(machine, pose));
        let (mut pose, mut rest) = (start, residual(&start));
        let mut damping = FIRST_DAMPING * radius * radius;
        for _ in 0..MAX_STEPS {
            if rest.norm() < LENGTH_TOLERANCE * radius {
                return Some(KinematicState::new(machine, pose));
            }
            let jacobian = leg_wrenches(machine, &pose).transpose() * Matrix6::from_diagonal(&scale);
            let normal = jacobian.tr_mul(&jacobian) + Matrix6::identity() * damping;
            let step = normal.cholesky()?.solve(&jacobian.tr_mul(&rest)).component_mul(&scale);
            let next = pose.displaced(&Twist::from_vector(&step));
            let left = residual(&next);
            if left.norm() < rest.norm() {
                (pose, rest, damping) = (next, left, damping * DAMPING_DECREASE);
            } else {
                damping *= DAMPING_INCREASE;
            }
        }
        None
    }
}

/// Norms of the columns.
fn norms(columns: &Matrix3x6<f64>) -> Vector6<f64> {
    Vector6::from_iterator(columns.column_iter().map(|column| column.norm()))
}

#[cfg(test)]
mod tests;
