//! Bounds on how much the forces of the drives change around a pose, and on the forces of velocities.
//!
//! A pose is turned by at most t, its legs by at most q. The forces change by a wrench, which N^-1 distributes,
//! and by a part along each leg:
//!
//! ```text
//! leg        f = proj(j aB - mu g)          |f - f0| <= q (j |aB| + mu g) + (|j'| |aB| + |mu'| g) L q + j |omega'| |b| t
//! platform   f = m (v' + omega' x c - g)    |f - f0| <= t m |omega'| |c|
//! torques    b x f, c x f, I omega'         |b| t |f| more, and 2 t |I| |omega'|
//! along      (mr + m2) n.aB - m2 n.g        q (mr + m2) |aB| + (mr + m2) |omega'| |b| t + q m2 g
//! ```
//!
//! j, mu and their derivatives are the largest over the stroke. Torques are about the mean of the joints and
//! divided by the radius. The change of the legs' spin is neglected: it is a part of 1e-2 of a force at most.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use super::LEGS;
use super::machine::{Link, Machine};

/// Lengths at which the inertia of a leg is evaluated, evenly over its stroke.
const LENGTHS: u32 = 64;

/// Bounds on a force: the part that N^-1 distributes, as a wrench, and the part along the leg \[N\].
#[derive(Clone, Copy, Debug, Default)]
pub struct ForceBound {
    /// Norm of the wrench.
    pub wrench: f64,
    /// Largest along a leg.
    pub axial_n: f64,
}

/// Largest accelerations and velocities of the platform.
#[derive(Clone, Copy, Debug, Default)]
pub struct LargestMotion {
    /// Angular acceleration \[rad/s^2\].
    pub angular_rad_s2: f64,
    /// Acceleration of C \[m/s^2\].
    pub linear_m_s2: f64,
    /// Angular velocity \[rad/s\].
    pub angular_velocity_rad_s: f64,
    /// Velocity of C \[m/s\].
    pub velocity_m_s: f64,
}

/// Factors of the bounds on changes of the forces, constant for a machine.
#[derive(Clone, Copy, Debug)]
pub struct ForceChangeBounds {
    /// Wrench at any pose: of the weight, per acceleration of C, per angular acceleration.
    whole: [f64; 3],
    /// Change of the wrench per t: of the weight, per acceleration of C, per angular acceleration.
    by_turn: [f64; 3],
    /// Change of the wrench per q: of the weight, per acceleration of a joint.
    by_turned_leg: [f64; 2],
    /// Wrench and axial force per square of the angular velocity, and of the velocity of a joint.
    by_velocity: [[f64; 2]; 2],
    /// Mass that moves along the leg, and its weight.
    axial_mass: f64,
    axial_weight: f64,
    viscous_friction: f64,
    coulomb_friction: f64,
    /// Largest rate of a leg \[m/s\].
    pub max_rate_m_s: f64,
    /// Largest distance of a joint from C \[m\].
    pub arm_m: f64,
}

impl ForceChangeBounds {
    /// Factors of a machine.
    pub fn new(machine: &Machine) -> Self {
        let (platform, actuator, joints) = (&machine.platform, &machine.actuator, &machine.joints);
        let (g, r) = (machine.gravity_m_s2.norm(), joints.radius_m);
        let arms = joints.triples.unpack_vectors(&joints.platform);
        let center = arms.iter().sum::<Vector3<f64>>() / LEGS as f64;
        let arm_m = arms.iter().map(Vector3::norm).fold(0.0, f64::max);
        let (mass, inertia) = (platform.mass_kg, platform.inertia.norm());
        let com = platform.center_of_mass_m.norm();
        let com_arm = (platform.center_of_mass_m - center).norm() / r;
        let com_wrench = (1.0 + com_arm * com_arm).sqrt();
        let legs = LegMasses::largest(machine);
        // Sums over the legs: of the arms, and of the wrenches of unit forces at the joints.
        let (mut arm_sum, mut wrench_sum) = (0.0, 0.0);
        for b in &arms {
            let arm = (b - center).norm() / r;
            arm_sum += arm;
            wrench_sum += (1.0 + arm * arm).sqrt();
        }
        let axial_mass = actuator.reflected_mass_kg + machine.rod.mass_kg;
        let length = actuator.min_length_m;
        Self {
            whole: [
                (mass * com_wrench + wrench_sum * legs.weight) * g,
                mass * com_wrench + wrench_sum * legs.inertia,
                mass * com * com_wrench + inertia / r + wrench_sum * legs.inertia * arm_m,
            ],
            by_turn: [
                (mass * com_arm + arm_sum * legs.weight) * g,
                mass * com_arm + arm_sum * legs.inertia,
                mass * com * (com_arm + com_wrench)
                    + 2.0 * inertia / r
                    + (arm_sum + wrench_sum) * legs.inertia * arm_m,
            ],
            by_turned_leg: [
                wrench_sum * (legs.weight + legs.weight_change) * g,
                wrench_sum * (legs.inertia + legs.inertia_change),
            ],
            by_velocity: [
                [
                    mass * com * com_wrench + inertia / r + wrench_sum * legs.inertia * arm_m,
                    wrench_sum * 2.0 * legs.coriolis / length,
                ],
                [
                    axial_mass * arm_m,
                    actuator.reflected_mass_kg / length
                        + machine.rod.mass_kg * machine.rod.center_of_mass_m / (length * length),
                ],
            ],
            axial_mass,
            axial_weight: machine.rod.mass_kg * g,
            viscous_friction: actuator.largest_viscous_friction(),
            coulomb_friction: actuator.largest_coulomb_friction(),
            max_rate_m_s: actuator.max_rate_m_s,
            arm_m,
        }
    }

    /// Changes of the forces at rest.
    pub fn at_rest(&self, turn_rad: f64, turned_leg: f64) -> ForceBound {
        let ([turned, ..], [leg, _]) = (self.by_turn, self.by_turned_leg);
        ForceBound {
            wrench: turned * turn_rad + leg * turned_leg,
            axial_n: self.axial_weight * turned_leg + self.coulomb_friction,
        }
    }

    /// Changes of the forces under accelerations, and forces of velocities.
    pub fn moving(&self, motion: &LargestMotion, turn_rad: f64, turned_leg: f64) -> ForceBound {
        let LargestMotion { angular_rad_s2, linear_m_s2, angular_velocity_rad_s, velocity_m_s } = *motion;
        let turning = angular_velocity_rad_s * angular_velocity_rad_s;
        let joint_acceleration = linear_m_s2 + self.arm_m * angular_rad_s2;
        let joint_speed = velocity_m_s + self.arm_m * angular_velocity_rad_s;
        let joint = joint_speed * joint_speed;
        let ([_, by_linear, by_angular], [_, by_joint]) = (self.by_turn, self.by_turned_leg);
        let [[wrench, joint_wrench], [axial, joint_axial]] = self.by_velocity;
        ForceBound {
            wrench: (by_linear * linear_m_s2 + by_angular * angular_rad_s2) * turn_rad
                + by_joint * joint_acceleration * turned_leg
                + wrench * turning
                + joint_wrench * joint,
            axial_n: self.axial_mass
                * (joint_acceleration * turned_leg + self.arm_m * angular_rad_s2 * turn_rad)
                + axial * turning
                + joint_axial * joint
                + self.viscous_friction * joint_speed.min(self.max_rate_m_s),
        }
    }

    /// Forces at any pose.
    pub fn whole(&self, motion: &LargestMotion) -> ForceBound {
        let ([weight, by_linear, by_angular], of_velocity) = (self.whole, self.moving(motion, 0.0, 0.0));
        let joint_acceleration = motion.linear_m_s2 + self.arm_m * motion.angular_rad_s2;
        ForceBound {
            wrench: weight
                + by_linear * motion.linear_m_s2
                + by_angular * motion.angular_rad_s2
                + of_velocity.wrench,
            axial_n: self.axial_mass * joint_acceleration
                + self.axial_weight
                + self.coulomb_friction
                + of_velocity.axial_n,
        }
    }

    /// Bound on the norm of the six forces along the legs.
    pub fn axial_norm(&self, motion: &LargestMotion) -> f64 {
        SQRT_LEGS
            * (self.axial_mass * (motion.linear_m_s2 + self.arm_m * motion.angular_rad_s2)
                + self.axial_weight)
    }
}

/// Root of the number of legs, rounded up.
const SQRT_LEGS: f64 = 2.45;

/// Masses of a leg as seen at its joint on the platform, the largest over the stroke \[kg\].
#[derive(Clone, Copy, Debug, Default)]
struct LegMasses {
    /// For accelerations across the leg, and its change per relative change of the length.
    inertia: f64,
    inertia_change: f64,
    /// For the weight across the leg, and its change.
    weight: f64,
    weight_change: f64,
    /// For Coriolis forces.
    coriolis: f64,
}

impl LegMasses {
    fn largest(machine: &Machine) -> Self {
        let actuator = &machine.actuator;
        let step = actuator.stroke() / f64::from(LENGTHS);
        let at = |k: u32| Self::at(machine, actuator.min_length_m + step * f64::from(k));
        let mut largest = at(0);
        for k in 1..=LENGTHS {
            let (before, now) = (at(k - 1), at(k));
            let per_length = actuator.max_length_m / step;
            largest = Self {
                inertia: largest.inertia.max(now.inertia),
                inertia_change: largest.inertia_change.max((now.inertia - before.inertia).abs() * per_length),
                weight: largest.weight.max(now.weight),
                weight_change: largest.weight_change.max((now.weight - before.weight).abs() * per_length),
                coriolis: largest.coriolis.max(now.coriolis),
            };
        }
        largest
    }

    /// j, mu and `|m2 r / L - j|` of [`crate::model::leg`].
    fn at(machine: &Machine, length: f64) -> Self {
        let (cylinder, rod) = (&machine.cylinder, &machine.rod);
        let r = length - rod.center_of_mass_m;
        let transverse = |link: &Link| link.transverse_inertia.at(length);
        let (e1, m1, m2) = (cylinder.center_of_mass_m, cylinder.mass_kg, rod.mass_kg);
        let inertia =
            (m1 * e1 * e1 + m2 * r * r + transverse(cylinder) + transverse(rod)) / (length * length);
        Self {
            inertia,
            weight: (m1 * e1 + m2 * r).abs() / length,
            coriolis: (m2 * r / length - inertia).abs(),
            ..Self::default()
        }
    }
}
