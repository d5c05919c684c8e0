//! Quality of a pose: stroke margin, condition, largest force under given accelerations, payload.
//!
//! Around a pose at rest the forces are linear in the acceleration and in an added mass p, a point fixed to the
//! platform at its centre of mass c:
//!
//! ```text
//! Gamma(p) = g + p s + (K + p P) [omega'; v']
//! N g = W at rest     N K = M     N s = -[c x gravity; gravity]     N P = [-c~ c~, c~; -c~, U]
//! ```
//!
//! with M the mass matrix. Over all `|omega'| <= w` and, independently, `|v'| <= a`, a leg's largest force is
//!
//! ```text
//! f_i(p) = |g_i + p s_i| + coulomb + w |angular row i of K + p P| + a |linear row i of K + p P|
//! ```
//!
//! and each of these is attained: a row meets its own direction, and a creeping platform has Coulomb's force either way.
//! The worst force is the largest `f_i(0)`. The payload is the smallest `p >= 0` at which an `f_i` is the actuator's
//! limit, or a leg at rest needs the share of it that may be needed to hold the platform (`MAX_HOLDING_SHARE`, as for every
//! target): f is convex, so Newton's method from beyond the root always converges to it. A closed form by the triangle
//! inequality would give less than the machine carries.
//!
//! Where gravity may have any direction of a cone, `|g_i + p s_i|` is the largest over it ([`super::gravity_cone`]), convex as well.
//!
//! Valid at regular poses at rest: velocities add forces that are not included.

use nalgebra::{Matrix3, Matrix6, RowVector3, Vector3};

use super::gravity_cone::GravityCone;
use hexad_core::control::constants::MAX_HOLDING_SHARE;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::drive_loads::DriveLoads;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::mass_matrix::MassMatrix;
use hexad_core::model::rigid::Pose;

/// Bound on the steps of Newton's method for a payload; five are usual.
const MAX_PAYLOAD_STEPS: usize = 50;
/// Step of Newton's method, as a share of the payload, that ends it: rounding.
const PAYLOAD_TOLERANCE: f64 = 1e-12;

/// Accelerations that the platform must reach, in any direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationDemand {
    /// Largest `|v'|` of C \[m/s^2\].
    pub linear_m_s2: f64,
    /// Largest `|omega'|` \[rad/s^2\].
    pub angular_rad_s2: f64,
}

/// Evaluator of the quality of poses of one machine.
///
/// ```
/// use hexad_machine::analysis::pose_quality::{AccelerationDemand, PoseEvaluator};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let [still, agile] = [0.0, 2.0].map(|linear_m_s2| {
///     PoseEvaluator::new(&machine, AccelerationDemand { linear_m_s2, angular_rad_s2: 0.0 }).quality(&machine.home_pose())
/// });
/// assert!(still.within_reach() && still.condition > 1.0);
/// // Acceleration takes force that is then missing for payload.
/// assert!(agile.worst_force_n > still.worst_force_n && agile.payload_kg < still.payload_kg);
/// ```
#[derive(Clone, Debug)]
pub struct PoseEvaluator {
    model: InverseDynamics,
    mass: MassMatrix,
    demand: AccelerationDemand,
    gravity: GravityCone,
    /// Sign of `det N` at home.
    home_sign: f64,
}

/// Quality of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseQuality {
    /// Smallest distance of a leg from an end of its stroke; negative outside of it \[m\].
    pub stroke_margin_m: f64,
    /// `det N / radius^3`, positive on home's side of singular poses.
    pub determinant: f64,
    /// As [`hexad_core::model::sensitivity::Sensitivity::condition`].
    pub condition: f64,
    /// The largest force of any leg under the demanded accelerations; infinite at a singular pose \[N\].
    pub worst_force_n: f64,
    /// The largest point mass at the platform's centre of mass that the actuators can hold as every target must be held, and that leaves
    /// every force within their limit under the demanded accelerations; 0 if it is exceeded without payload, infinite without gravity and acceleration \[kg\].
    pub payload_kg: f64,
}

impl PoseQuality {
    /// Whether every leg is within its stroke and the pose on home's side of singular poses.
    pub fn within_reach(&self) -> bool {
        self.stroke_margin_m >= 0.0 && self.determinant > 0.0
    }
}

impl PoseEvaluator {
    /// Derives the constants.
    pub fn new(machine: &Machine, demand: AccelerationDemand) -> Self {
        let home = KinematicState::new(machine, machine.home_pose());
        Self {
            model: InverseDynamics::new(machine),
            mass: MassMatrix::new(machine),
            demand,
            gravity: GravityCone::new(machine.gravity_m_s2, 0.0),
            home_sign: home.sensitivity().determinant.signum(),
        }
    }

    /// The same under gravity in any direction within so much of the machine's.
    pub fn in_cone(self, half_angle_rad: f64) -> Self {
        Self { gravity: GravityCone::new(self.model.machine().gravity_m_s2, half_angle_rad), ..self }
    }

    /// The quality of a pose.
    pub fn quality(&self, pose: &Pose) -> PoseQuality {
        let machine = self.model.machine();
        let kinematic_state = KinematicState::new(machine, *pose);
        let sensitivity = kinematic_state.sensitivity();
        let legs = self.leg_forces(pose);
        let worst =
            |legs: [LegForceBound; LEGS]| legs.iter().map(|leg| leg.largest(0.0).0).fold(0.0, f64::max);
        let payload = |legs: [LegForceBound; LEGS]| {
            legs.iter()
                .map(|leg| leg.payload(machine.actuator.weakest_available_force_n()))
                .fold(f64::INFINITY, f64::min)
        };
        PoseQuality {
            stroke_margin_m: kinematic_state
                .lengths(machine)
                .map(|length| machine.actuator.margin(length))
                .into_iter()
                .fold(f64::INFINITY, f64::min),
            determinant: self.home_sign * sensitivity.determinant,
            condition: sensitivity.condition,
            worst_force_n: legs.map_or(f64::INFINITY, worst),
            payload_kg: legs.map_or(0.0, payload),
        }
    }

    /// The forces of every leg, `None` at a singular pose.
    fn leg_forces(&self, pose: &Pose) -> Option<[LegForceBound; LEGS]> {
        let machine = self.model.machine();
        let arm = pose.rotation * machine.platform.center_of_mass_m;
        let tilde = arm.cross_matrix();
        let mut mass = Matrix6::zeros();
        for (row, column, block) in
            [(0, 0, -tilde * tilde), (0, 3, tilde), (3, 0, -tilde), (3, 3, Matrix3::identity())]
        {
            mass.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        }
        let factors = leg_wrenches(machine, pose).lu();
        let [of_machine, of_mass] = [factors.solve(&self.mass.at(pose))?, factors.solve(&mass)?];
        let holding = DriveLoads::holding_rows(&self.model, pose)?;
        let row = |matrix: &Matrix6<f64>, leg: usize, first: usize| -> RowVector3<f64> {
            matrix.fixed_view::<1, 3>(leg, first).into()
        };
        let mut legs = [LegForceBound::default(); LEGS];
        let rest = holding.into_iter().zip(machine.actuator.coulomb_friction_n);
        for (i, (leg, (own, friction))) in legs.iter_mut().zip(rest).enumerate() {
            let pair = |first| [row(&of_machine, i, first), row(&of_mass, i, first)];
            *leg = LegForceBound {
                friction,
                gravity: self.gravity,
                // A mass under gravity takes the forces of one that accelerates the other way.
                still: [own, -row(&of_mass, i, 3).transpose()],
                angular: pair(0).map(|row| row * self.demand.angular_rad_s2),
                linear: pair(3).map(|row| row * self.demand.linear_m_s2),
            };
        }
        Some(legs)
    }
}

/// Bound on the force of one leg: of the machine without payload, and per kilogram of payload.
#[derive(Clone, Copy, Debug, Default)]
struct LegForceBound {
    friction: f64,
    gravity: GravityCone,
    /// At rest, per unit of gravity.
    still: [Vector3<f64>; 2],
    /// Under the demanded accelerations, by direction.
    angular: [RowVector3<f64>; 2],
    linear: [RowVector3<f64>; 2],
}

impl LegForceBound {
    /// f(p) and its slope.
    fn largest(&self, mass: f64) -> (f64, f64) {
        let [own, added] = self.still;
        let row = own + added * mass;
        let gravity = self.gravity.worst(&row);
        let (force, added) = (row.dot(&gravity), added.dot(&gravity));
        let (mut sum, mut slope) = (force.abs() + self.friction, force.signum() * added);
        for [own, added] in [self.angular, self.linear] {
            let row: Vector3<f64> = (own + added * mass).transpose();
            let norm = row.norm();
            sum += norm;
            slope += if norm > 0.0 { row.dot(&added.transpose()) / norm } else { added.norm() };
        }
        (sum, slope)
    }

    /// The smallest mass at which the force is the limit, or what may be needed at rest.
    fn payload(&self, limit: f64) -> f64 {
        let at_rest = Self { angular: Default::default(), linear: Default::default(), ..*self };
        self.payload_under(limit).min(at_rest.payload_under(MAX_HOLDING_SHARE * limit))
    }

    /// The smallest mass at which f is the limit.
    fn payload_under(&self, limit: f64) -> f64 {
        let [_, still] = self.still;
        let growth =
            still.dot(&self.gravity.worst(&still)).abs() + self.angular[1].norm() + self.linear[1].norm();
        let (bare, _) = self.largest(0.0);
        if !(bare <= limit) {
            return 0.0;
        }
        if growth == 0.0 {
            return f64::INFINITY;
        }
        // f(p) >= p growth - (f(0) - friction) + friction: here it is beyond the limit.
        let mut mass = (limit + bare - 2.0 * self.friction) / growth;
        for _ in 0..MAX_PAYLOAD_STEPS {
            let (force, slope) = self.largest(mass);
            let step = (force - limit) / slope;
            if !(step > PAYLOAD_TOLERANCE * mass) {
                break;
            }
            mass -= step;
        }
        mass
    }
}
