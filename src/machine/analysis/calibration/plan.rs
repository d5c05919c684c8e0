//! Poses that determine the joints best.
//!
//! A design is D-optimal if the determinant of its information is the largest (Fedorov 1972). Poses are added one by one, each the best of
//! the candidates, and then exchanged while that helps. A pose informs by its six lengths against the tracker's pose:
//!
//! ```text
//! u = lengths by the tracker - lengths,   V = sigma_l^2 I + J V_tracker J^T,   M = (du/dx)^T V^-1 (du/dx)
//! ```

use nalgebra::{DMatrix, Matrix6, MatrixXx6, Vector6};

use super::model::{GEOMETRY_VALUES, Geometry, Mount, Noise, Row, Seen, Unknowns};
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;
use hexad_core::model::random::Random;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::pose_of;

/// Bisections to the edge of the workspace, and the largest motion from home that is tried, as a share of stroke and largest rotation.
const BISECTIONS: usize = 12;
const LARGEST_SHARE: f64 = 2.0;
/// Passes of exchanges; most designs need two.
const MAX_PASSES: usize = 3;

/// Poses from home in random directions, between these shares of the way to the edge of what is allowed.
pub fn spread_poses(
    machine: &Machine,
    count: usize,
    shares: [f64; 2],
    seed: u64,
    is_allowed: impl Fn(&Pose) -> bool,
) -> Vec<Pose> {
    let (mut random, home) = (Random::new(seed), Vector6::from(machine.home));
    let scale = [machine.max_rotation_rad, machine.actuator.stroke()];
    let is_within = |x: &Vector6<f64>| {
        let pose = pose_of(&(*x).into());
        let turn = machine.home_pose().displacement_to(&pose).angular.norm();
        turn <= machine.max_rotation_rad && is_allowed(&pose)
    };
    let draw = |_| {
        let way =
            Vector6::from_fn(|axis, _| random.near_gaussian() * if axis < 3 { scale[0] } else { scale[1] });
        let (mut inside, mut outside) = (0.0, LARGEST_SHARE);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (inside + outside);
            if is_within(&(home + way * middle)) { inside = middle } else { outside = middle }
        }
        let share = shares[0] + (shares[1] - shares[0]) * random.uniform();
        pose_of(&(home + way * (share * inside)).into())
    };
    (0..count).map(draw).collect()
}

/// Indices of `count` poses of the candidates, each once.
pub fn plan(
    machine: &Machine,
    candidates: &[Pose],
    count: usize,
    noise: &Noise,
    tolerance_m: f64,
) -> Vec<usize> {
    let absent = MatrixXx6::zeros(GEOMETRY_VALUES + 12);
    let sensitivities: Vec<_> =
        candidates.iter().map(|pose| sensitivity(machine, pose, noise).unwrap_or(absent.clone())).collect();
    let mut covariance = DMatrix::identity(GEOMETRY_VALUES + 12, GEOMETRY_VALUES + 12);
    covariance.view_mut((0, 0), (GEOMETRY_VALUES, GEOMETRY_VALUES)).fill_diagonal(tolerance_m.powi(2));
    let is_taken = vec![false; candidates.len()];
    let (mut design, mut chosen) = (Design { sensitivities, is_taken, covariance }, vec![]);
    for _ in 0..count {
        chosen.extend(design.add_best());
    }
    for _ in 0..MAX_PASSES {
        let mut has_changed = false;
        for index in &mut chosen {
            design.update(*index, -1.0);
            if let Some(best) = design.add_best() {
                has_changed |= best != *index;
                *index = best;
            }
        }
        if !has_changed {
            break;
        }
    }
    chosen
}

/// Candidates, and the covariance with those that were chosen.
struct Design {
    sensitivities: Vec<MatrixXx6<f64>>,
    is_taken: Vec<bool>,
    covariance: DMatrix<f64>,
}

impl Design {
    /// Adds the candidate with which the determinant of the covariance is the smallest.
    fn add_best(&mut self) -> Option<usize> {
        let gain = |g: &MatrixXx6<f64>| {
            let spread = self.covariance.tr_mul(g);
            (Matrix6::identity() + g.tr_mul(&spread)).determinant()
        };
        let free =
            self.sensitivities.iter().zip(&self.is_taken).enumerate().filter(|(_, (_, taken))| !**taken);
        let (best, _) = free.map(|(index, (g, _))| (index, gain(g))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        self.update(best, 1.0);
        Some(best)
    }

    /// The covariance with a row more or less (Woodbury).
    fn update(&mut self, index: usize, sign: f64) {
        let (Some(g), Some(is_taken)) = (self.sensitivities.get(index), self.is_taken.get_mut(index)) else {
            return;
        };
        *is_taken = sign > 0.0;
        let spread = self.covariance.tr_mul(g);
        let inner = Matrix6::identity() + g.tr_mul(&spread) * sign;
        let factor = inner.cholesky().map(|inner| inner.l());
        let change = factor.and_then(|factor| factor.solve_lower_triangular(&spread.transpose()));
        if let Some(change) = change {
            self.covariance -= change.tr_mul(&change) * sign;
        }
    }
}

/// `(V^-1/2 du/dx)^T` of a pose, 54 x 6: geometry, frame of the tracker, mount of its probe.
fn sensitivity(machine: &Machine, pose: &Pose, noise: &Noise) -> Option<MatrixXx6<f64>> {
    let unknowns = Unknowns {
        geometry: Geometry::of(machine),
        tracker: pose_of(&[0.0; 6]),
        mount: Mount::Probe(pose_of(&[0.0; 6])),
        poses: vec![],
    };
    let row = Row { lengths_m: unknowns.geometry.lengths(pose).0, seen: Seen::Probe(*pose) };
    let terms = unknowns.terms(&row, pose, noise);
    let [by_lengths, by_tracker] = [0, LEGS].map(|row| terms.pose.fixed_rows::<6>(row).into_owned());
    let by_tracker: Matrix6<f64> = by_lengths * by_tracker.try_inverse()?;
    let variance = Matrix6::identity() + by_tracker * by_tracker.transpose();
    let shared = terms.shared.fixed_rows::<6>(0) - by_tracker * terms.shared.fixed_rows::<6>(LEGS);
    Some(variance.cholesky()?.l().solve_lower_triangular(&shared)?.transpose())
}
