//! First guess: where the tracker's frame and the mount are if the machine is as drawn.
//!
//! With the poses `R, x` of the drawn machine at the measured lengths, and the probe's poses `R_m, p`:
//!
//! ```text
//! p = M x + R_m s + t          linear in M, s, t;   M is nearly the rotation from base to tracker
//! ```
//!
//! The probe of reflectors is where they were in the row in which most were seen.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::model::{Geometry, Mount, Row, Seen, Unknowns};
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;

/// Least number of rows whose poses are found: of 15 unknowns.
const MIN_ROWS: usize = 5;
/// Singular value below which a direction of the linear equations counts as absent, as a share of the largest.
const LEAST_SINGULAR_VALUE: f64 = 1e-9;

/// First guess, with the drawn geometry; `None` if no pose suits the lengths of most rows.
pub fn start(machine: &Machine, rows: &[Row]) -> Option<Unknowns> {
    let by_lengths = |row: &Row| {
        let mut tracker = Tracker::new(machine, machine.home_pose());
        let found = tracker.find(machine, &row.lengths_m.into()).0 == TrackingResult::Found;
        found.then(|| *tracker.pose())
    };
    let poses: Vec<_> = rows.iter().map(by_lengths).collect();
    let seen = probes(rows);
    let pairs = poses.iter().zip(&seen).filter_map(|(pose, seen)| Some(((*pose)?, (*seen)?)));
    let pairs: Vec<(Pose, Pose)> = pairs.collect();
    if pairs.len() < MIN_ROWS.max(rows.len() / 2) {
        return None;
    }
    let (linear, s, t) = frames(&pairs)?;
    let rotation = nearest_rotation(&linear)?;
    let tracker = Pose { rotation, position: t };
    let turn = pairs.iter().map(|(pose, seen)| (rotation * pose.rotation).tr_mul(&seen.rotation));
    let probe_rotation = nearest_rotation(&turn.sum())?;
    let probe = Pose { rotation: probe_rotation, position: probe_rotation * s };
    let poses: Vec<Pose> = poses
        .iter()
        .zip(&seen)
        .map(|(pose, seen)| {
            let by_tracker = seen.map(|seen| joined(&joined(&inverse(&tracker), &seen), &inverse(&probe)));
            pose.or(by_tracker).unwrap_or_else(|| machine.home_pose())
        })
        .collect();
    let mount = match rows.first().map(|row| &row.seen)? {
        Seen::Probe(_) => Mount::Probe(probe),
        Seen::Reflectors(first) => Mount::Reflectors(
            (0..first.len()).map(|k| place(rows, &poses, &tracker, k)).collect::<Option<_>>()?,
        ),
    };
    Some(Unknowns { geometry: Geometry::of(machine), tracker, mount, poses })
}

/// M, s and t by least squares.
fn frames(pairs: &[(Pose, Pose)]) -> Option<(Matrix3<f64>, Vector3<f64>, Vector3<f64>)> {
    let mut matrix = DMatrix::zeros(3 * pairs.len(), 15);
    let mut right = DVector::zeros(3 * pairs.len());
    for (k, (pose, seen)) in pairs.iter().enumerate() {
        for axis in 0..3 {
            matrix.fixed_view_mut::<1, 3>(3 * k + axis, 3 * axis).copy_from(&pose.position.transpose());
        }
        matrix.fixed_view_mut::<3, 3>(3 * k, 9).copy_from(&seen.rotation);
        matrix.fixed_view_mut::<3, 3>(3 * k, 12).copy_from(&Matrix3::identity());
        right.fixed_rows_mut::<3>(3 * k).copy_from(&seen.position);
    }
    let svd = matrix.svd(true, true);
    let found = svd.solve(&right, LEAST_SINGULAR_VALUE * svd.singular_values.max()).ok()?;
    let vector = |first| Vector3::from(found.fixed_rows::<3>(first));
    Some((Matrix3::from_row_slice(found.rows(0, 9).as_slice()), vector(9), vector(12)))
}

/// Mean place of a reflector on the platform; `None` if it was never seen.
fn place(rows: &[Row], poses: &[Pose], tracker: &Pose, k: usize) -> Option<Vector3<f64>> {
    let on_platform = |(row, pose): (&Row, &Pose)| match &row.seen {
        Seen::Reflectors(seen) => {
            let seen = (*seen.get(k)?)?;
            let in_base = tracker.rotation.tr_mul(&(seen - tracker.position));
            Some(pose.rotation.tr_mul(&(in_base - pose.position)))
        }
        Seen::Probe(_) => None,
    };
    let all: Vec<_> = rows.iter().zip(poses).filter_map(on_platform).collect();
    (!all.is_empty()).then(|| all.iter().sum::<Vector3<f64>>() / all.len() as f64)
}

/// Pose of the probe in each row; `None` where fewer than three reflectors show it.
fn probes(rows: &[Row]) -> Vec<Option<Pose>> {
    let reflectors = |row: &Row| match &row.seen {
        Seen::Reflectors(seen) => seen.clone(),
        Seen::Probe(_) => vec![],
    };
    let count = |row: &&Row| reflectors(row).iter().flatten().count();
    let most = rows.iter().max_by_key(count).map(reflectors).unwrap_or_default();
    let probe = |row: &Row| match &row.seen {
        Seen::Probe(pose) => Some(*pose),
        Seen::Reflectors(seen) => {
            let both: Vec<_> = most.iter().zip(seen).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
            (both.len() >= 3).then(|| fitted(&both)).flatten()
        }
    };
    rows.iter().map(probe).collect()
}

/// A point before and after a motion.
type Pair = (Vector3<f64>, Vector3<f64>);

/// The rigid motion that takes the first of each pair nearest to the second (Kabsch).
pub fn fitted(pairs: &[Pair]) -> Option<Pose> {
    let mean =
        |of: fn(&Pair) -> Vector3<f64>| pairs.iter().map(of).sum::<Vector3<f64>>() / pairs.len() as f64;
    let (from, to) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let rotation = nearest_rotation(&pairs.iter().map(|(a, b)| (b - to) * (a - from).transpose()).sum())?;
    Some(Pose { rotation, position: to - rotation * from })
}

/// The rotation nearest to a matrix.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = matrix.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    // The smallest singular value is the last.
    let signs = Vector3::new(1.0, 1.0, (u * v_t).determinant().signum());
    Some(u * Matrix3::from_diagonal(&signs) * v_t)
}

/// The second pose, given in the frame of the first.
fn joined(first: &Pose, second: &Pose) -> Pose {
    Pose {
        rotation: first.rotation * second.rotation,
        position: first.rotation * second.position + first.position,
    }
}

fn inverse(pose: &Pose) -> Pose {
    let rotation = pose.rotation.transpose();
    Pose { rotation, position: -(rotation * pose.position) }
}
