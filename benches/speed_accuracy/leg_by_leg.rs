//! The exact model one leg after the other, in plain numbers: the equations of `hexad::model::leg` without lanes.

use hexad::model::LEGS;
use hexad::model::machine::Machine;
use hexad::model::rigid::Motion;
use nalgebra::{Matrix6, Vector3, Vector6};

use super::methods::Forces;

/// What differs from leg to leg.
struct Leg {
    base: Vector3<f64>,
    platform: Vector3<f64>,
    universal_axis: Vector3<f64>,
    viscous_friction: f64,
    coulomb_friction: f64,
}

/// Model of one machine.
pub struct LegByLeg {
    machine: Machine,
    legs: [Leg; LEGS],
}

/// What the legs need: N, the load without its part along the legs, and that part.
pub struct Load {
    leg_wrenches: Matrix6<f64>,
    wrench: Vector6<f64>,
    axial: Vector6<f64>,
}

impl LegByLeg {
    pub fn new(machine: &Machine) -> Self {
        let joints = &machine.joints;
        let [bases, platforms, axes] = [&joints.base, &joints.platform, &joints.universal_axis]
            .map(|lanes| joints.triples.unpack_vectors(lanes));
        let mut friction =
            machine.actuator.viscous_friction_n_s_m.into_iter().zip(machine.actuator.coulomb_friction_n);
        let mut places = bases.into_iter().zip(platforms).zip(axes);
        let legs = core::array::from_fn(|_| {
            let ((base, platform), universal_axis) = places.next().unwrap_or_default();
            let (viscous_friction, coulomb_friction) = friction.next().unwrap_or_default();
            Leg { base, platform, universal_axis, viscous_friction, coulomb_friction }
        });
        Self { machine: machine.clone(), legs }
    }

    /// The part that the legs share among lanes.
    #[inline]
    pub fn load(&self, motion: &Motion) -> Load {
        let (mut load, [torque, force]) = (
            Load { leg_wrenches: Matrix6::zeros(), wrench: Vector6::zeros(), axial: Vector6::zeros() },
            self.platform_wrench(motion),
        );
        load.wrench = Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
        let columns = load.leg_wrenches.column_iter_mut().zip(load.axial.iter_mut());
        for (leg, (mut column, axial)) in self.legs.iter().zip(columns) {
            let arm = motion.pose.rotation * leg.platform;
            let (n, reaction, along) = self.reaction(leg, motion, &arm);
            let [moment, torque] = [arm.cross(&n), arm.cross(&reaction)];
            column.copy_from(&Vector6::new(moment.x, moment.y, moment.z, n.x, n.y, n.z));
            load.wrench += Vector6::new(torque.x, torque.y, torque.z, reaction.x, reaction.y, reaction.z);
            *axial = along;
        }
        load
    }

    /// Forces of the six legs, the balance by LU.
    #[inline]
    pub fn forces(&self, motion: &Motion) -> Forces {
        let load = self.load(motion);
        Some((load.leg_wrenches.lu().solve(&load.wrench)? + load.axial).into())
    }

    fn platform_wrench(&self, motion: &Motion) -> [Vector3<f64>; 2] {
        let (rotation, omega) = (&motion.pose.rotation, &motion.twist.angular);
        let (body, omega_rate) = (&self.machine.platform, &motion.acceleration.angular);
        let c = rotation * body.center_of_mass_m;
        let accel = motion.acceleration.linear + omega_rate.cross(&c) + omega.cross(&omega.cross(&c));
        let force = (accel - self.machine.gravity_m_s2) * body.mass_kg;
        let [turning, turning_rate] = [omega, omega_rate].map(|vector| rotation.tr_mul(vector));
        let torque = body.inertia * turning_rate + turning.cross(&(body.inertia * turning));
        [rotation * torque + c.cross(&force), force]
    }

    /// Direction of a leg, force of the platform on it normal to it, and load along it.
    fn reaction(&self, leg: &Leg, motion: &Motion, arm: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>, f64) {
        let Machine { cylinder, rod, actuator, gravity_m_s2, .. } = &self.machine;
        let (omega, omega_rate) = (&motion.twist.angular, &motion.acceleration.angular);
        let span = motion.pose.position + arm - leg.base;
        let length = span.norm();
        let n = span / length;
        let velocity = motion.twist.linear + omega.cross(arm);
        let rate = n.dot(&velocity);
        let n_rate = (velocity - n * rate) / length;
        let accel = motion.acceleration.linear + omega_rate.cross(arm) + omega.cross(&omega.cross(arm));
        let turning = n_rate.norm_squared();
        let length_accel = n.dot(&accel) + length * turning;

        let (e1, r) = (cylinder.center_of_mass_m, length - rod.center_of_mass_m);
        let inertia = cylinder.mass_kg * e1 * e1
            + rod.mass_kg * r * r
            + cylinder.transverse_inertia.at(length)
            + rod.transverse_inertia.at(length);
        let (j, mu) = (inertia / (length * length), (cylinder.mass_kg * e1 + rod.mass_kg * r) / length);
        let across = accel * j - gravity_m_s2 * mu + n_rate * (2.0 * rate * (rod.mass_kg * r / length - j));
        let k = leg.universal_axis.cross(&n);
        let (un, un_rate, p) = (leg.universal_axis.dot(&n), leg.universal_axis.dot(&n_rate), n_rate.dot(&k));
        let un_over_yy = un / k.norm_squared();
        let spin = un_over_yy * p;
        let p_rate = (accel.dot(&k) - 2.0 * rate * p) / length;
        let spin_rate = (un_rate * (p + 2.0 * un * spin) + un * p_rate) / k.norm_squared();
        let axial_inertia = (cylinder.axial_inertia_kg_m2 + rod.axial_inertia_kg_m2) / length;
        let across = across + (n_rate.cross(&n) * spin + k * (un_over_yy * spin_rate)) * axial_inertia;
        let along = rod.mass_kg * ((accel - gravity_m_s2).dot(&n) + rod.center_of_mass_m * turning);
        let drive = actuator.reflected_mass_kg * length_accel
            + leg.viscous_friction * rate
            + leg.coulomb_friction * actuator.sign(rate);
        (n, across - n * across.dot(&n), along + drive)
    }
}
