//! Forces on a moving base: of a ship that rolls, of a telescope that turns. Exact model.
//!
//! The paper has a base at rest; this is our extension of it. Base axes turn with `Omega`, and a point p with velocity v in them has the
//! acceleration `e(p, v)` more than there (Siciliano, Sciavicco, Villani, Oriolo, Robotics, 2009, sec. 7.5, with the base as the first link):
//!
//! ```text
//! e(p, v) = Omega' x p + Omega x (Omega x p) + 2 Omega x v           and the acceleration of the base origin, which g contains
//! body    dM = I (Omega' + Omega x w) + (w + Omega) x I (w + Omega) - w x I w      about its centre of mass, w in base axes
//! ```
//!
//! Platform: `m e` at its centre of mass, and dM. A leg, with n, n', L, L', its spin wx about n, and the first axis u of its universal joint:
//!
//! ```text
//! w     = n x n' + wx n      wx = (u.n) (n'.k) / k.k      k = u x n        see leg.rs
//! M     = sum over both links of (c x m e + dM)           about A, c = e1 n or (L - e2) n from there
//! F     = (M - (M.n) (n - (u.n) u) / k.k) x n / L         of the platform on the leg, across it; the universal joint takes (M.n)
//! axial = m2 n . e                                        at the centre of mass of the rod
//! ```
//!
//! Neglected: gyroscopic torques of the rotors of the drives. Relative errors grow with the condition of N.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::LEGS;
use super::active_forces::InverseDynamics;
use super::fidelity::Exact;
use super::inverse_jacobian::leg_wrenches;
use super::leg::MIN_UNIVERSAL_SINE_SQUARED;
use super::machine::Link;
use super::rigid::Motion;

/// Motion of the base in inertial space, in base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseMotion {
    /// Gravity less the acceleration of the base origin \[m/s^2\]; the negative of what an accelerometer there measures.
    pub gravity_m_s2: Vector3<f64>,
    /// Angular velocity Omega \[rad/s\].
    pub angular_velocity_rad_s: Vector3<f64>,
    /// Angular acceleration Omega' \[rad/s^2\].
    pub angular_acceleration_rad_s2: Vector3<f64>,
}

impl BaseMotion {
    /// e(p, v).
    fn acceleration(&self, p: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        let omega = &self.angular_velocity_rad_s;
        self.angular_acceleration_rad_s2.cross(p) + omega.cross(&(omega.cross(p) + v * 2.0))
    }

    /// dM of a body with angular velocity w in base axes.
    fn torque(&self, inertia: &Matrix3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
        let omega = &self.angular_velocity_rad_s;
        let whole = w + omega;
        inertia * (self.angular_acceleration_rad_s2 + omega.cross(w)) + whole.cross(&(inertia * whole))
            - w.cross(&(inertia * w))
    }
}

impl InverseDynamics {
    /// Actuator forces Gamma \[N\] as by [`InverseDynamics::forces`], for a motion of the platform relative to a base that moves; `None`
    /// at a singular pose.
    ///
    /// ```
    /// use hexad_core::model::{active_forces::InverseDynamics, moving_base::BaseMotion, task::TaskState};
    /// # let machine = hexad_machine::config::Config::load("../../config/motion_base.toml".as_ref()).unwrap().machine;
    /// let model = InverseDynamics::new(&machine);
    /// let rest = TaskState::at_rest(machine.home).motion();
    /// let base = BaseMotion { gravity_m_s2: machine.gravity_m_s2, ..BaseMotion::default() };
    /// assert_eq!(model.forces_on(&rest, &base), model.forces::<hexad_core::model::fidelity::Exact>(&rest));
    /// // A base in free fall leaves the legs without load.
    /// assert!(model.forces_on(&rest, &BaseMotion::default()).unwrap().iter().all(|force| force.abs() < 1e-9));
    /// ```
    pub fn forces_on(&self, motion: &Motion, base: &BaseMotion) -> Option<[f64; LEGS]> {
        let still = self.forces_under::<Exact>(motion, &base.gravity_m_s2)?;
        let turns = [base.angular_velocity_rad_s, base.angular_acceleration_rad_s2];
        if turns == [Vector3::zeros(); 2] {
            return Some(still);
        }
        let (wrench, axial) = self.load_of_turning(motion, base);
        let added = leg_wrenches(self.machine(), &motion.pose).lu().solve(&wrench)?;
        Some((Vector6::from(still) + added + axial).into())
    }

    /// W and the axial forces that a base adds by turning.
    fn load_of_turning(&self, motion: &Motion, base: &BaseMotion) -> (Vector6<f64>, Vector6<f64>) {
        let machine = self.machine();
        let (platform, joints, triples) = (&machine.platform, &machine.joints, &machine.joints.triples);
        let Motion { pose, twist, .. } = motion;
        let arm = pose.rotation * platform.center_of_mass_m;
        let at_center =
            base.acceleration(&(pose.position + arm), &(twist.linear + twist.angular.cross(&arm)));
        let mut force = at_center * platform.mass_kg;
        let inertia = pose.rotation * platform.inertia * pose.rotation.transpose();
        let mut torque = arm.cross(&force) + base.torque(&inertia, &twist.angular);
        let mut axial = Vector6::zeros();
        let places =
            triples.unpack_vectors(&joints.base).into_iter().zip(triples.unpack_vectors(&joints.platform));
        let places = places.zip(triples.unpack_vectors(&joints.universal_axis));
        for (axial, ((a, b), u)) in axial.iter_mut().zip(places) {
            let b = pose.rotation * b;
            let (across, along) =
                self.leg_on(base, &a, &(pose.position + b), &u, &(twist.linear + twist.angular.cross(&b)));
            force += across;
            torque += b.cross(&across);
            *axial = along;
        }
        let wrench = Vector6::from_iterator(torque.iter().chain(&force).copied());
        (wrench, axial)
    }

    /// F across a leg from `a` to `b`, which moves with `velocity`, and the axial force.
    fn leg_on(
        &self,
        base: &BaseMotion,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
        u: &Vector3<f64>,
        velocity: &Vector3<f64>,
    ) -> (Vector3<f64>, f64) {
        let (cylinder, rod) = (&self.machine().cylinder, &self.machine().rod);
        let length = (b - a).norm();
        let n = (b - a) / length;
        let rate = velocity.dot(&n);
        let n_rate = (velocity - n * rate) / length;
        let k = u.cross(&n);
        let (un, sine_squared) = (u.dot(&n), k.norm_squared().max(MIN_UNIVERSAL_SINE_SQUARED));
        let w = n.cross(&n_rate) + n * (un * n_rate.dot(&k) / sine_squared);
        let of_link = |link: &Link, from_a: f64, rate: f64| {
            let e = base.acceleration(&(a + n * from_a), &(n_rate * from_a + n * rate));
            let transverse = link.transverse_inertia.at(length);
            let inertia = Matrix3::identity() * transverse
                + n * n.transpose() * (link.axial_inertia_kg_m2 - transverse);
            (n.cross(&e) * (from_a * link.mass_kg) + base.torque(&inertia, &w), e * link.mass_kg)
        };
        let (of_cylinder, _) = of_link(cylinder, cylinder.center_of_mass_m, 0.0);
        let (of_rod, force) = of_link(rod, length - rod.center_of_mass_m, rate);
        let moment = of_cylinder + of_rod;
        let spin = moment.dot(&n) / sine_squared;
        ((moment - (n - u * un) * spin).cross(&n) / length, force.dot(&n))
    }
}
