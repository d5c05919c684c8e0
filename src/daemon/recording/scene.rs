//! The machine as ROS tools draw it: frames of base, platform and legs, and the legs as joints.
//!
//! `leg_i` is at the joint on the base, its z axis along the leg; `rod_i` is at the end of the leg. `platform_joint_i` is the
//! joint on the platform: in a correct machine `rod_i` is at the same place.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use hexad_client::messages::CycleMessage;
use hexad_client::messages::cdr::CdrWriter;
use hexad_core::control::sensing::localization::PlatformState;
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;

/// Writes the scene of cycles.
#[derive(Clone, Debug)]
pub struct Scene {
    base: [Vector3<f64>; LEGS],
    platform: [Vector3<f64>; LEGS],
    names: [String; LEGS],
    rods: [String; LEGS],
    joints: [String; LEGS],
}

impl Scene {
    /// Scene of a machine.
    pub fn new(machine: &Machine) -> Self {
        let [base, platform] = [&machine.joints.base, &machine.joints.platform]
            .map(|lanes| machine.joints.triples.unpack_vectors(lanes));
        let numbered = |name: &str| core::array::from_fn(|leg| format!("{name}_{}", leg + 1));
        Self {
            base,
            platform,
            names: numbered("leg"),
            rods: numbered("rod"),
            joints: numbered("platform_joint"),
        }
    }

    /// `tf2_msgs/TFMessage` at an instant since 1970 \[ns\].
    pub fn frames(&self, time_ns: u64, state: &PlatformState, buffer: Vec<u8>) -> Vec<u8> {
        let mut message = CdrWriter::new(buffer);
        let pose = &state.pose;
        message.u32(1 + 3 * LEGS as u32);
        transform(&mut message, time_ns, ["base", "platform"], &pose.position, &quaternion(&pose.rotation));
        let none = UnitQuaternion::identity();
        let names = self.names.iter().zip(&self.rods).zip(&self.joints);
        for ((base, platform), ((name, rod), joint)) in self.base.iter().zip(&self.platform).zip(names) {
            let leg = pose.position + pose.rotation * platform - base;
            let along = UnitQuaternion::rotation_between(&Vector3::z(), &leg).unwrap_or(none);
            transform(&mut message, time_ns, ["base", name], base, &along);
            transform(&mut message, time_ns, [name, rod], &Vector3::new(0.0, 0.0, leg.norm()), &none);
            transform(&mut message, time_ns, ["platform", joint], platform, &none);
        }
        message.finish()
    }

    /// `sensor_msgs/JointState`: lengths, rates (NaN if the driver measures none) and forces.
    pub fn joints(&self, time_ns: u64, cycle: &CycleMessage, buffer: Vec<u8>) -> Vec<u8> {
        let mut message = CdrWriter::new(buffer);
        message.time(time_ns);
        message.text("base");
        message.u32(LEGS as u32);
        self.names.iter().for_each(|name| message.text(name));
        let rates = if cycle.rates_valid == 1 { cycle.measured_length_rate_m_s } else { [f64::NAN; LEGS] };
        for numbers in [&cycle.measured_length_m, &rates, &cycle.force_n] {
            message.u32(LEGS as u32);
            message.floats(numbers);
        }
        message.finish()
    }
}

fn quaternion(rotation: &Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation))
}

fn transform(
    message: &mut CdrWriter,
    time_ns: u64,
    [parent, child]: [&str; 2],
    position: &Vector3<f64>,
    rotation: &UnitQuaternion<f64>,
) {
    message.time(time_ns);
    message.text(parent);
    message.text(child);
    message.floats(position.as_slice());
    // x, y, z, w.
    message.floats(rotation.coords.as_slice());
}
