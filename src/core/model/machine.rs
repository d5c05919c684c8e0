//! Machine: all constants of the equations, validated once and immutable afterwards.
//!
//! Symbols of the paper's section 2 stand beside the fields. Legs are stored as lanes ([`LegLanes`]): one
//! array per coordinate, so that the same instructions evaluate all six.
//!
//! This file neither reads nor validates values; `config::machine` does both and reports key, value and
//! bound.

use fearless_simd::Level;
#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::{Matrix3, Vector3};

use super::LEGS;
use super::rigid::{Pose, Twist};
use super::task::TaskState;
use super::triples::{LegLanes, Triples};

/// Constants of one Gough-Stewart platform: geometry, masses, actuators, home. SI units throughout.
///
/// ```
/// use hexad_core::model::inverse_geometry::leg_lengths;
/// use hexad_machine::config::Config;
/// let machine = Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let lengths = leg_lengths(&machine, &machine.home_pose());
/// assert!(lengths.iter().all(|length| machine.actuator.contains(*length)));
/// ```
#[derive(Clone, Debug)]
pub struct Machine {
    /// Acceleration of gravity in base axes, g \[m/s^2\].
    pub gravity_m_s2: Vector3<f64>,
    /// Everything that moves with the end effector, payload included.
    pub platform: Platform,
    /// Joint centres and universal-joint axes.
    pub joints: Joints,
    /// Link 1, between the universal joint and the prismatic joint.
    pub cylinder: Link,
    /// Link 2, between the prismatic joint and the spherical joint.
    pub rod: Link,
    /// The prismatic joint between the links, and its drive.
    pub actuator: Actuator,
    /// Task coordinates X of the home pose: Bryan angles \[rad\], position \[m\].
    pub home: [f64; 6],
    /// Largest rotation of the platform from home that its joints permit \[rad\].
    pub max_rotation_rad: f64,
    /// Instruction set of the lanes, detected once. See [`at_most_256_bits`].
    pub level: Level,
}

/// Instruction set to use on a CPU with `level`: lanes of at most 256 bits.
///
/// Measured (2026-11-20): 512-bit lanes have the same throughput, and one evaluation alone takes an eighth
/// longer. The 3 x 3 half of the computation cannot use them, and they block the second port for narrower
/// vectors.
pub fn at_most_256_bits(level: Level) -> Level {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    if let Some(avx2) = level.as_avx2() {
        return Level::Avx2(avx2);
    }
    level
}

/// Whether lanes on this instruction set use the processor's own multiplication and addition. Others, of x86 processors without
/// SSE4.2, repeat the bits of AVX2 in software.
#[inline(always)]
pub fn has_native_arithmetic(level: Level) -> bool {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    return !matches!(level, Level::Sse2(_));
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    return !level.is_fallback();
}

/// Mobile platform as a rigid body, in platform axes.
#[derive(Clone, Debug)]
pub struct Platform {
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// CG, from the platform origin C to the centre of mass \[m\].
    pub center_of_mass_m: Vector3<f64>,
    /// Inertia about the **centre of mass** \[kg m^2\].
    pub inertia: Matrix3<f64>,
}

/// Joint centres in lanes.
#[derive(Clone, Debug)]
pub struct Joints {
    /// Assignment of the legs to lanes.
    pub triples: Triples,
    /// `A_i`, joint centres on the base, in base axes \[m\].
    pub base: [LegLanes; 3],
    /// `CB_i`, joint centres on the platform, in platform axes \[m\].
    pub platform: [LegLanes; 3],
    /// `u_i`, first axis of the universal joint, fixed in the base, unit length.
    pub universal_axis: [LegLanes; 3],
    /// Characteristic length: root mean square distance of the `B_i` from their mean \[m\]. It converts
    /// radians to metres where a tolerance must not depend on the size of the machine.
    pub radius_m: f64,
    /// Cube of the radius \[m^3\], and its inverse with the parity of the lane order as sign.
    pub(super) radius_cubed_m3: f64,
    pub(super) inverse_radius_cubed_per_m3: f64,
    /// Mean of the `B_i`, from C, in platform axes \[m\]. This point does not depend on the choice of C.
    pub(super) center_m: Vector3<f64>,
    /// The `B_i` from their mean, in platform axes \[m\].
    pub(super) around_center: [LegLanes; 3],
    /// Length `a` of that arm relative to the radius, and `(1 + a^2) radius`: see `super::sensitivity`.
    pub(super) arm_share: LegLanes,
    pub(super) arm_curvature: LegLanes,
}

impl Machine {
    /// Machine whose stroke is shorter at both ends by a margin \[m\].
    pub fn with_stroke_margin(&self, margin_m: f64) -> Self {
        let mut machine = self.clone();
        machine.actuator.min_length_m += margin_m;
        machine.actuator.max_length_m -= margin_m;
        machine
    }

    /// Home pose.
    pub fn home_pose(&self) -> Pose {
        TaskState::at_rest(self.home).motion().pose
    }
}

impl Joints {
    /// Packs six legs into lanes and derives the characteristic length. The lane order is the best one at the
    /// home pose.
    pub fn new(
        base_m: &[Vector3<f64>; LEGS],
        platform_m: &[Vector3<f64>; LEGS],
        universal_axis: &[Vector3<f64>; LEGS],
        home: &Pose,
    ) -> Self {
        let mut directions = *base_m;
        for (direction, joint) in directions.iter_mut().zip(platform_m) {
            *direction = (home.position + home.rotation * joint - *direction).normalize();
        }
        let triples = Triples::best(&directions);
        let center_m = platform_m.iter().sum::<Vector3<f64>>() / LEGS as f64;
        let around_center = platform_m.map(|b| b - center_m);
        let mean_square = around_center.iter().map(Vector3::norm_squared).sum::<f64>() / LEGS as f64;
        let radius_m = mean_square.sqrt();
        Self {
            triples,
            base: triples.pack_vectors(base_m),
            platform: triples.pack_vectors(platform_m),
            universal_axis: triples.pack_vectors(universal_axis),
            radius_m,
            radius_cubed_m3: radius_m * radius_m * radius_m,
            inverse_radius_cubed_per_m3: triples.parity() / (radius_m * radius_m * radius_m),
            center_m,
            around_center: triples.pack_vectors(&around_center),
            arm_share: triples.pack(&around_center.map(|b| b.norm() / radius_m)),
            arm_curvature: triples.pack(&around_center.map(|b| radius_m + b.norm_squared() / radius_m)),
        }
    }

    /// Distance of two poses: norm of the rotation \[rad\] and of the shift of the mean of the joints
    /// \[radius\].
    pub fn distance(&self, a: &Pose, b: &Pose) -> f64 {
        let turn = a.displacement_to(b).angular;
        let center = |pose: &Pose| pose.position + pose.rotation * self.center_m;
        let shift = (center(b) - center(a)) / self.radius_m;
        (turn.norm_squared() + shift.norm_squared()).sqrt()
    }

    /// Converts a twist at the mean of the joints on the platform to a twist at C.
    pub(super) fn twist_of_origin(&self, twist: &Twist, rotation: &Matrix3<f64>) -> Twist {
        let arm = rotation * self.center_m;
        Twist { angular: twist.angular, linear: twist.linear - twist.angular.cross(&arm) }
    }

    /// The same joints, with a point of the platform (from C, in platform axes) in the first lane of padding.
    /// The leg in that lane begins far outside any platform.
    pub(super) fn with_point(&self, point_m: &Vector3<f64>) -> Self {
        let mut joints = self.clone();
        let around_center = point_m - self.center_m;
        let lanes = joints.platform.iter_mut().chain(&mut joints.around_center);
        for (lane, value) in lanes.zip(point_m.iter().chain(&around_center)) {
            *lane = lane.with_padding(*value);
        }
        let far = 1e3 * (self.radius_m + point_m.norm());
        joints.base = joints.base.map(|lane| lane.with_padding(far));
        joints
    }
}

/// One link of a leg: a body of revolution about the leg's axis.
#[derive(Clone, Debug)]
pub struct Link {
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Distance of the centre of mass from the link's own joint \[m\]: cylinder, `e1`, from `A_i`
    /// toward `B_i`; rod, `e2`, from `B_i` back toward `A_i`.
    pub center_of_mass_m: f64,
    /// Inertia about the leg's axis \[kg m^2\].
    pub axial_inertia_kg_m2: f64,
    /// Inertia about any axis through the centre of mass and normal to the leg \[kg m^2\].
    pub transverse_inertia: TransverseInertia,
}

/// Transverse inertia `constant_kg_m2 + quadratic_kg (L - reference_length_m)^2`, L the length of the leg.
///
/// With `quadratic_kg != 0` (the paper's Table 1) the body is not rigid. Newton-Euler uses the instantaneous
/// value, as in the paper. `dI/dt` terms are left out, so power does not balance exactly.
#[derive(Clone, Debug)]
pub struct TransverseInertia {
    /// Constant part \[kg m^2\].
    pub constant_kg_m2: f64,
    /// Quadratic coefficient \[kg\].
    pub quadratic_kg: f64,
    /// Reference length of the leg \[m\].
    pub reference_length_m: f64,
}

impl TransverseInertia {
    /// Inertia at the length L of the leg \[kg m^2\].
    pub fn at(&self, length_m: f64) -> f64 {
        let change = length_m - self.reference_length_m;
        self.constant_kg_m2 + self.quadratic_kg * change * change
    }
}

/// Prismatic joint and its drive.
#[derive(Clone, Debug)]
pub struct Actuator {
    /// Shortest leg \[m\].
    pub min_length_m: f64,
    /// Longest leg \[m\].
    pub max_length_m: f64,
    /// Largest speed of the leg \[m/s\].
    pub max_rate_m_s: f64,
    /// Largest command \[N\].
    pub max_force_n: f64,
    /// Inertia of motor and screw, seen along the leg \[kg\].
    pub reflected_mass_kg: f64,
    /// Viscous friction of each leg \[N s/m\].
    pub viscous_friction_n_s_m: [f64; LEGS],
    /// Coulomb friction of each leg \[N\].
    pub coulomb_friction_n: [f64; LEGS],
    /// Friction of each leg as a share of the force of its drive.
    pub load_friction_share: [f64; LEGS],
    /// Real over commanded force of each drive.
    pub force_scale: [f64; LEGS],
    /// Largest dry friction that the model may lack \[N\]. The checks under control permit it.
    pub friction_uncertainty_n: f64,
    /// Speed above which the Coulomb force has its full value \[m/s\]; below it the force is proportional to
    /// speed.
    pub coulomb_smoothing_m_s: f64,
}

impl Actuator {
    /// Value of `coulomb_smoothing_m_s` for controllers. sign(L') is exact above 0.1 mm/s, which is slow enough
    /// for the legs of a telescope. One count of a usual encoder at 1 kHz does not make the force chatter.
    pub const COULOMB_SMOOTHING_M_S: f64 = 1e-4;

    /// Force that every leg can get, whichever way it moves \[N\]: that of the weakest drive, less load friction. A
    /// machine is as strong as its weakest leg; the others differ by a few percent.
    pub fn weakest_available_force_n(&self) -> f64 {
        let share = |(scale, load_friction): (&f64, &f64)| scale * (1.0 - load_friction);
        self.max_force_n
            * self.force_scale.iter().zip(&self.load_friction_share).map(share).fold(f64::INFINITY, f64::min)
    }

    /// Whether legs get other forces than their drives are told.
    pub fn has_load_friction_or_scale(&self) -> bool {
        self.force_scale != [1.0; LEGS] || self.load_friction_share != [0.0; LEGS]
    }

    /// Largest viscous friction of a leg \[N s/m\].
    pub fn largest_viscous_friction(&self) -> f64 {
        self.viscous_friction_n_s_m.into_iter().fold(0.0, f64::max)
    }

    /// Largest Coulomb friction of a leg \[N\].
    pub fn largest_coulomb_friction(&self) -> f64 {
        self.coulomb_friction_n.into_iter().fold(0.0, f64::max)
    }

    /// sign(L') of dry friction, proportional to L' below the smoothing speed.
    pub fn sign(&self, rate_m_s: f64) -> f64 {
        (rate_m_s / self.coulomb_smoothing_m_s).clamp(-1.0, 1.0)
    }

    /// Length of the stroke \[m\].
    pub fn stroke(&self) -> f64 {
        self.max_length_m - self.min_length_m
    }

    /// Whether a leg length is within the stroke; false for NaN.
    pub fn contains(&self, length_m: f64) -> bool {
        (self.min_length_m..=self.max_length_m).contains(&length_m)
    }

    /// Distance of a leg length from the nearer end of the stroke \[m\]; negative outside the stroke.
    ///
    /// ```
    /// # let actuator = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine.actuator;
    /// let middle = 0.5 * (actuator.min_length_m + actuator.max_length_m);
    /// assert!((actuator.margin(middle) - 0.5 * actuator.stroke()).abs() < 1e-15);
    /// assert!(actuator.margin(actuator.max_length_m + 0.01) < 0.0);
    /// ```
    pub fn margin(&self, length_m: f64) -> f64 {
        (length_m - self.min_length_m).min(self.max_length_m - length_m)
    }
}
