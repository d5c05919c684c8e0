//! Layout of the machine at home: frames, inertias that rigid-body engines accept, and shapes for display.

use core::fmt;

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};

use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::{leg_directions, leg_lengths};
use hexad_core::model::machine::{Link, Machine, TransverseInertia};
use hexad_core::model::rigid::Pose;

/// Least difference between the greatest principal moment and the sum of the others, as a share of the
/// former. For flat plates it is zero. Rounding may make it negative, and engines reject that.
const INERTIA_MARGIN: f64 = 1e-12;

/// Least principal moment \[kg m^2\]. MuJoCo refuses 1e-15 and less; thin rods may be configured with zero.
const MIN_PRINCIPAL_MOMENT: f64 = 1e-14;

/// Numbers of an XML attribute: shortest digits that read back the same, separated by blanks.
pub(super) struct Numbers<'a>(pub &'a [f64]);

impl fmt::Display for Numbers<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, x) in self.0.iter().enumerate() {
            // Avoids "-0".
            write!(f, "{}{:?}", if i == 0 { "" } else { " " }, x + 0.0)?;
        }
        Ok(())
    }
}

/// Frames of a leg at home.
pub(super) struct LegLayout {
    /// Number from 1.
    pub number: usize,
    /// `A_i`, base axes.
    pub base: Vector3<f64>,
    /// `B_i`, platform axes.
    pub platform: Vector3<f64>,
    /// Leg axes expressed in base axes: x the second axis of the universal joint, z the leg.
    pub rotation: Rotation3<f64>,
    /// First axis of the universal joint, leg axes.
    pub first_axis: Vector3<f64>,
    /// L
    pub length: f64,
}

impl LegLayout {
    /// The value of this leg.
    pub fn of(&self, values: &[f64; LEGS]) -> f64 {
        values.get(self.number - 1).copied().unwrap_or_default()
    }
}

/// The six legs at home.
pub(super) fn legs(machine: &Machine) -> Vec<LegLayout> {
    let pose = home(machine);
    let joints = &machine.joints;
    let universal_axes = joints.triples.unpack_vectors(&joints.universal_axis);
    (1..)
        .zip(joints.triples.unpack_vectors(&joints.base))
        .zip(joints.triples.unpack_vectors(&joints.platform))
        .zip(universal_axes.iter().zip(leg_directions(machine, &pose)))
        .zip(leg_lengths(machine, &pose))
        .map(|((((number, base), platform), (u, n)), length)| {
            let second = u.cross(&n).normalize();
            let third = n.cross(&second);
            let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[second, third, n]));
            let first_axis = Vector3::new(0.0, u.dot(&third), u.dot(&n));
            LegLayout { number, base, platform, rotation, first_axis, length }
        })
        .collect()
}

/// The home pose.
pub(super) fn home(machine: &Machine) -> Pose {
    machine.home_pose()
}

/// Quaternion `w x y z` of a rotation.
pub(super) fn quaternion(rotation: &Rotation3<f64>) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(rotation);
    [q.w, q.i, q.j, q.k]
}

/// The inertia of a link about its centre of mass, leg axes, at this length.
pub(super) fn link_inertia(link: &Link, length: f64) -> Matrix3<f64> {
    let TransverseInertia { constant_kg_m2, quadratic_kg, reference_length_m } = link.transverse_inertia;
    let transverse = constant_kg_m2 + quadratic_kg * (length - reference_length_m).powi(2);
    realizable(&Matrix3::from_diagonal(&Vector3::new(transverse, transverse, link.axial_inertia_kg_m2)))
}

/// The inertia with all principal moments raised by the same amount, until the greatest is at most the sum of
/// the others with [`INERTIA_MARGIN`], and the least is [`MIN_PRINCIPAL_MOMENT`]. Most bodies do not change;
/// none changes by more than 1e-9 of its greatest moment, the tolerance of the configuration.
pub(super) fn realizable(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    let principal = inertia.symmetric_eigenvalues();
    let greatest = principal.max();
    let lacking = 2.0 * greatest - principal.sum() + INERTIA_MARGIN * greatest;
    inertia + Matrix3::identity() * lacking.max(MIN_PRINCIPAL_MOMENT - principal.min()).max(0.0)
}

/// Shapes for display, without effect on the dynamics.
pub(super) struct Shapes {
    /// Radii of cylinders, rods and joints \[m\].
    pub cylinder_radius: f64,
    pub rod_radius: f64,
    pub ball_radius: f64,
    /// Length at which both links are drawn \[m\].
    pub link_length: f64,
    /// Corners of the plates that carry the joints, base axes and platform axes.
    pub base_corners: Vec<Vector3<f64>>,
    pub platform_corners: Vec<Vector3<f64>>,
    /// Middle of the machine, base axes, and its size \[m\]: twice the distance of the furthest joint.
    pub center: Vector3<f64>,
    pub extent: f64,
}

impl Shapes {
    pub fn new(machine: &Machine, legs: &[LegLayout]) -> Self {
        let Pose { rotation, position } = home(machine);
        let base: Vec<_> = legs.iter().map(|leg| leg.base).collect();
        let platform: Vec<_> = legs.iter().map(|leg| leg.platform).collect();
        let all: Vec<_> =
            base.iter().copied().chain(platform.iter().map(|b| position + rotation * b)).collect();
        let center = mean(&all);
        let length = legs.iter().map(|leg| leg.length).sum::<f64>() / legs.len() as f64;
        // Slim enough for six legs side by side. The links overlap from 0.7 to 1.4 of the length at home.
        Self {
            cylinder_radius: 0.03 * length,
            rod_radius: 0.018 * length,
            ball_radius: 0.035 * length,
            link_length: 0.7 * length,
            base_corners: plate(&base),
            platform_corners: plate(&platform),
            center,
            extent: 2.0 * all.iter().map(|point| (point - center).norm()).fold(0.0, f64::max),
        }
    }
}

fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len() as f64
}

/// Corners of a plate through these points: each on both sides of the best fitting plane.
fn plate(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let middle = mean(points);
    let spread: Matrix3<f64> = points.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
    let SymmetricEigen { eigenvectors, eigenvalues } = spread.symmetric_eigen();
    let normal: Vector3<f64> = eigenvectors.column(eigenvalues.imin()).into();
    // A visible thickness.
    let half = normal * (0.02 * spread.trace().sqrt());
    points.iter().flat_map(|point| [point + half, point - half]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Unit;

    use super::*;
    use hexad_core::model::inverse_geometry::universal_joint_angles;
    use hexad_core::model::task::pose_of;
    use hexad_machine::config::Config;

    /// The chain of joints of a leg, as a reader of the exported file computes it, ends at the joint of the platform.
    #[test]
    fn universal_joint_angles_take_each_leg_to_its_joint_on_the_platform() {
        for text in
            [include_str!("../../../config/motion_base.toml"), include_str!("../../../config/fried2008.toml")]
        {
            let machine = Config::parse(text, "a test").unwrap().machine;
            let home = home(&machine);
            for k in 0..50 {
                let of = |i: i32| 0.1 * f64::from((37 * k + 11 * i) % 19 - 9) / 9.0;
                let moved = pose_of(&[of(1), of(2), of(3), 0.5 * of(4), 0.5 * of(5), 0.5 * of(6)]);
                let pose = Pose {
                    position: home.position + moved.position,
                    rotation: home.rotation * moved.rotation,
                };
                let lengths = leg_lengths(&machine, &pose);
                for (leg, angles) in legs(&machine).iter().zip(universal_joint_angles(&machine, &pose)) {
                    let axes = [leg.first_axis, Vector3::x()];
                    let [first, second] = [0, 1].map(|axis| {
                        Rotation3::from_axis_angle(&Unit::new_normalize(axes[axis]), angles[axis])
                    });
                    let along = first * second * Vector3::z() * leg.of(&lengths);
                    let ball = pose.position + pose.rotation * leg.platform;
                    assert!((leg.base + leg.rotation * along - ball).norm() < 1e-12, "{angles:?}");
                }
            }
        }
    }
}
