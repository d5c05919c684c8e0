//! Equations of a pose that legs and tracker have measured, and their derivatives.
//!
//! ```text
//! length      |X B_i - A_i| - o_i - l_i                        X pose of the row, A B o geometry, l measured lengths
//! probe       log(R_T R_X R_P R_m^T),   T X P 0 - p_m          T base in the tracker's frame, P probe on the platform
//! reflectors  T X r_k - q_k                                    r_k places on the platform, q_k as measured
//! ```
//!
//! Each is divided by its standard deviation. Rotations change by `R <- exp(w~) R`, as by
//! [`Pose::displaced`]. `d log(exp(w~) R) = w - f x w / 2 + f x (f x w) / 12` with `f = log(R)`: exact to the fourth order of f.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3x6, Matrix6, MatrixXx6, Vector3, Vector6};

use hexad_core::model::LEGS;
use hexad_core::model::machine::{Joints, Machine};
use hexad_core::model::rigid::{Pose, Twist, log};

/// Number of coordinates of the joints, and of all values of a [`Geometry`].
pub const JOINT_VALUES: usize = 6 * LEGS;
/// See [`JOINT_VALUES`].
pub const GEOMETRY_VALUES: usize = 7 * LEGS;

/// Geometry of six legs: what a calibration finds.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// `A_i`, base axes \[m\].
    pub base: Matrix3x6<f64>,
    /// `CB_i`, platform axes \[m\].
    pub platform: Matrix3x6<f64>,
    /// True less measured lengths \[m\].
    pub offset: Vector6<f64>,
}

impl Geometry {
    /// Geometry of a machine whose lengths are measured from the true zero.
    pub fn of(machine: &Machine) -> Self {
        let joints = &machine.joints;
        let [base, platform] = [&joints.base, &joints.platform]
            .map(|lanes| Matrix3x6::from_columns(&joints.triples.unpack_vectors(lanes)));
        Self { base, platform, offset: Vector6::zeros() }
    }

    /// The machine with these joints.
    pub fn applied_to(&self, machine: &Machine) -> Machine {
        let [base, platform] =
            [&self.base, &self.platform].map(|it| core::array::from_fn(|leg| it.column(leg).into_owned()));
        let axes = machine.joints.triples.unpack_vectors(&machine.joints.universal_axis);
        Machine { joints: Joints::new(&base, &platform, &axes, &machine.home_pose()), ..machine.clone() }
    }

    /// All values: `A_1 ... A_6, B_1 ... B_6, o_1 ... o_6`.
    pub fn values(&self) -> DVector<f64> {
        let joints = self.base.iter().chain(&self.platform);
        DVector::from_iterator(GEOMETRY_VALUES, joints.chain(&self.offset).copied())
    }

    /// The geometry with values that are changed by `change`, of which the first count.
    pub fn changed(&self, change: &DVector<f64>) -> Self {
        let half = JOINT_VALUES / 2;
        Self {
            base: self.base + Matrix3x6::from_column_slice(change.rows(0, half).as_slice()),
            platform: self.platform + Matrix3x6::from_column_slice(change.rows(half, half).as_slice()),
            offset: self.offset + change.fixed_rows::<6>(JOINT_VALUES),
        }
    }

    /// Lengths that are measured at a pose \[m\], and their derivatives by a displacement (rows) and by all values.
    pub fn lengths(&self, pose: &Pose) -> (Vector6<f64>, Matrix6<f64>, DMatrix<f64>) {
        let (mut lengths, mut by_pose) = (Vector6::zeros(), Matrix6::zeros());
        let mut by_values = DMatrix::zeros(LEGS, GEOMETRY_VALUES);
        for leg in 0..LEGS {
            let arm = pose.rotation * self.platform.column(leg);
            let s = pose.position + arm - self.base.column(leg);
            let (length, n) = (s.norm(), s.normalize());
            lengths.fixed_rows_mut::<1>(leg).fill(length);
            by_pose.fixed_view_mut::<1, 3>(leg, 0).copy_from(&arm.cross(&n).transpose());
            by_pose.fixed_view_mut::<1, 3>(leg, 3).copy_from(&n.transpose());
            by_values.fixed_view_mut::<1, 3>(leg, 3 * leg).copy_from(&-n.transpose());
            let on_platform = pose.rotation.tr_mul(&n).transpose();
            by_values.fixed_view_mut::<1, 3>(leg, JOINT_VALUES / 2 + 3 * leg).copy_from(&on_platform);
        }
        by_values.view_mut((0, JOINT_VALUES), (LEGS, LEGS)).fill_diagonal(-1.0);
        (lengths - self.offset, by_pose, by_values)
    }
}

/// What the tracker has measured of the platform, in its own frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// Pose of a probe on the platform.
    Probe(Pose),
    /// Places of reflectors on the platform \[m\]; `None` for one that was not seen.
    Reflectors(Vec<Option<Vector3<f64>>>),
}

/// Measurements at one pose at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// \[m\]
    pub lengths_m: Vector6<f64>,
    /// By the tracker.
    pub seen: Seen,
}

/// Standard deviations of measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of a length.
    pub length_m: f64,
    /// Of each coordinate of a place by the tracker.
    pub position_m: f64,
    /// Of the orientation by the tracker, about each axis.
    pub angle_rad: f64,
}

impl Noise {
    /// All deviations times a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        let Self { length_m, position_m, angle_rad } = *self;
        Self { length_m: factor * length_m, position_m: factor * position_m, angle_rad: factor * angle_rad }
    }
}

/// Where what the tracker sees is on the platform.
#[derive(Clone, Debug, PartialEq)]
pub enum Mount {
    /// Pose of the probe in the platform's frame.
    Probe(Pose),
    /// Places of the reflectors, platform axes \[m\].
    Reflectors(Vec<Vector3<f64>>),
}

/// Everything that measurements determine.
#[derive(Clone, Debug)]
pub struct Unknowns {
    /// Joints and offsets.
    pub geometry: Geometry,
    /// Base in the tracker's frame.
    pub tracker: Pose,
    /// On the platform.
    pub mount: Mount,
    /// Platform in the base frame, for each row.
    pub poses: Vec<Pose>,
}

/// Residuals of a row over their deviations, and their derivatives by what all rows share and by the pose of this one.
#[derive(Clone, Debug)]
pub struct RowTerms {
    /// Lengths first.
    pub residual: DVector<f64>,
    /// By [`Unknowns::shared_count`] values.
    pub shared: DMatrix<f64>,
    /// By a displacement.
    pub pose: MatrixXx6<f64>,
}

impl Unknowns {
    /// Number of values that all rows share: geometry, tracker, mount.
    pub fn shared_count(&self) -> usize {
        let of_mount = match &self.mount {
            Mount::Probe(_) => 6,
            Mount::Reflectors(places) => 3 * places.len(),
        };
        GEOMETRY_VALUES + 6 + of_mount
    }

    /// The unknowns after a step of the shared values and of each pose.
    pub fn displaced(&self, shared: &DVector<f64>, poses: &[Vector6<f64>]) -> Self {
        let step = |first| Twist::from_vector(&shared.fixed_rows::<6>(first).into_owned());
        let mount = match &self.mount {
            Mount::Probe(probe) => Mount::Probe(probe.displaced(&step(GEOMETRY_VALUES + 6))),
            Mount::Reflectors(places) => Mount::Reflectors(
                places
                    .iter()
                    .enumerate()
                    .map(|(k, place)| place + shared.fixed_rows::<3>(GEOMETRY_VALUES + 6 + 3 * k))
                    .collect(),
            ),
        };
        Self {
            geometry: self.geometry.changed(shared),
            tracker: self.tracker.displaced(&step(GEOMETRY_VALUES)),
            mount,
            poses: self
                .poses
                .iter()
                .zip(poses)
                .map(|(pose, step)| pose.displaced(&Twist::from_vector(step)))
                .collect(),
        }
    }

    /// Equations of a row at a pose.
    pub fn terms(&self, row: &Row, pose: &Pose, noise: &Noise) -> RowTerms {
        let seen: Vec<(usize, Vector3<f64>, Vector3<f64>)> = match (&row.seen, &self.mount) {
            (Seen::Reflectors(seen), Mount::Reflectors(places)) => seen
                .iter()
                .zip(places)
                .enumerate()
                .filter_map(|(k, (seen, place))| Some((GEOMETRY_VALUES + 6 + 3 * k, (*seen)?, *place)))
                .collect(),
            (Seen::Probe(seen), Mount::Probe(probe)) => {
                vec![(GEOMETRY_VALUES + 9, seen.position, probe.position)]
            }
            _ => vec![],
        };
        let (rotation, shared) = (self.tracker.rotation, self.shared_count());
        let is_probe = matches!(self.mount, Mount::Probe(_));
        let count = LEGS + 3 * seen.len() + if is_probe { 3 } else { 0 };
        let mut terms = RowTerms {
            residual: DVector::zeros(count),
            shared: DMatrix::zeros(count, shared),
            pose: MatrixXx6::zeros(count),
        };
        let (lengths, by_pose, by_values) = self.geometry.lengths(pose);
        terms.residual.fixed_rows_mut::<6>(0).copy_from(&((lengths - row.lengths_m) / noise.length_m));
        terms.pose.fixed_view_mut::<6, 6>(0, 0).copy_from(&(by_pose / noise.length_m));
        terms.shared.view_mut((0, 0), (LEGS, GEOMETRY_VALUES)).copy_from(&(by_values / noise.length_m));
        for (index, (column, seen, place)) in seen.into_iter().enumerate() {
            let (at, weight) = (LEGS + 3 * index, 1.0 / noise.position_m);
            let arm = pose.rotation * place;
            let [from_tracker, from_platform] = [rotation * (arm + pose.position), rotation * arm];
            let residual = (from_tracker + self.tracker.position - seen) * weight;
            terms.residual.fixed_rows_mut::<3>(at).copy_from(&residual);
            for (column, block) in [
                (GEOMETRY_VALUES, -from_tracker.cross_matrix()),
                (GEOMETRY_VALUES + 3, Matrix3::identity()),
                (column, rotation * pose.rotation),
            ] {
                terms.shared.fixed_view_mut::<3, 3>(at, column).copy_from(&(block * weight));
            }
            for (column, block) in [(0, -from_platform.cross_matrix() * rotation), (3, rotation)] {
                terms.pose.fixed_view_mut::<3, 3>(at, column).copy_from(&(block * weight));
            }
        }
        if let (Seen::Probe(seen), Mount::Probe(probe)) = (&row.seen, &self.mount) {
            let (at, weight) = (count - 3, 1.0 / noise.angle_rad);
            let of_platform = rotation * pose.rotation;
            let error = log(&(of_platform * probe.rotation * seen.rotation.transpose()));
            let cross = error.cross_matrix();
            let by_turn = (Matrix3::identity() - cross / 2.0 + cross * cross / 12.0) * weight;
            terms.residual.fixed_rows_mut::<3>(at).copy_from(&(error * weight));
            terms.shared.fixed_view_mut::<3, 3>(at, GEOMETRY_VALUES).copy_from(&by_turn);
            terms.shared.fixed_view_mut::<3, 3>(at, GEOMETRY_VALUES + 6).copy_from(&(by_turn * of_platform));
            terms.pose.fixed_view_mut::<3, 3>(at, 0).copy_from(&(by_turn * rotation));
        }
        terms
    }
}

impl RowTerms {
    /// Residuals, and derivatives by the shared values, with the pose that suits each best (Golub, Pereyra): without what the pose
    /// can take.
    pub fn reduced(&self) -> (DVector<f64>, DMatrix<f64>) {
        let q = self.pose.clone().qr().q();
        (&self.residual - &q * q.tr_mul(&self.residual), &self.shared - &q * q.tr_mul(&self.shared))
    }

    /// Displacement from the pose by the lengths to the pose by the tracker; `None` near a singular pose or with too few reflectors.
    pub fn difference(&self, residual: &DVector<f64>) -> Option<Vector6<f64>> {
        let seen = residual.len() - LEGS;
        let lengths: Matrix6<f64> = self.pose.fixed_rows::<6>(0).into_owned();
        let by_lengths = lengths.try_inverse()? * residual.fixed_rows::<6>(0);
        let pose = self.pose.rows(LEGS, seen);
        let normal = pose.tr_mul(&pose).cholesky()?;
        Some(by_lengths - normal.solve(&pose.tr_mul(&residual.rows(LEGS, seen))))
    }
}
