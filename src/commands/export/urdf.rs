//! The machine as URDF, its loops open at the platform; [`super`] has names, frames and signs.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::layout::{LegLayout, Numbers, Shapes, home, legs, link_inertia, realizable};
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::task_coordinates;
use hexad_machine::config::Config;

const HEADER_COMMENT: &str = "  Written by `hexad export`. SI units and radians. The link base is the base frame of the configuration.
  Legs i = 1 to 6. URDF has no closed loops: the reader of this file must make the frames ball_rod_i and
  ball_platform_i coincide (universal joints at 0, prismatic_i at the length at home, platform_free at its origin: home).
  link platform        origin and axes of the platform
  link cross_i         the cross of the universal joint, without mass
  link cylinder_i      origin: joint centre on the base; z: along the leg to the platform; x: second universal axis
  link rod_i           origin: joint centre on the platform; axes as cylinder_i
  joint universal_first_i, universal_second_i    the first axis is fixed in the base; both 0 at home
  joint prismatic_i    position: LENGTH of the leg between joint centres; force: positive pushes the platform away";

/// Text of the URDF file.
pub(super) fn text(config: &Config) -> String {
    let machine = &config.machine;
    let legs = legs(machine);
    let shapes = Shapes::new(machine, &legs);
    let bodies: String = legs.iter().map(|leg| leg_links(machine, leg, &shapes)).collect();
    format!(
        r#"<robot name="{name}">
<!--
{HEADER_COMMENT}
  Not in URDF: gravity {gravity} m/s^2, reflected mass {reflected:?} kg of every prismatic joint, force scale and load
  friction of the drives.
-->
  <!-- Only for MuJoCo, which rejects links without mass: they get a negligible one. -->
  <mujoco><compiler boundmass="2e-15" boundinertia="2e-15"/></mujoco>
  <material name="cylinder"><color rgba="0.25 0.25 0.28 1"/></material>
  <material name="rod"><color rgba="0.75 0.77 0.8 1"/></material>
  <material name="platform"><color rgba="0.2 0.45 0.75 1"/></material>
  <link name="base"/>
{bodies}{platform}</robot>
"#,
        name = config.name,
        gravity = Numbers(machine.gravity_m_s2.as_slice()),
        reflected = machine.actuator.reflected_mass_kg,
        platform = platform_link(machine, &legs, &shapes),
    )
}

fn leg_links(machine: &Machine, leg: &LegLayout, shapes: &Shapes) -> String {
    let LegLayout { number: i, base, rotation, first_axis, length, .. } = leg;
    let (cylinder, rod, actuator) = (&machine.cylinder, &machine.rod, &machine.actuator);
    let to = shapes.link_length;
    format!(
        r#"  <link name="cross_{i}"/>
  <link name="cylinder_{i}">
    {cylinder_inertial}
    {cylinder_visual}
  </link>
  <link name="rod_{i}">
    {rod_inertial}
    {rod_visual}
  </link>
  <link name="ball_rod_{i}"/>
  <joint name="universal_first_{i}" type="continuous">
    <parent link="base"/><child link="cross_{i}"/>
    {at_base}
    <axis xyz="{first_axis}"/>
  </joint>
  <joint name="universal_second_{i}" type="continuous">
    <parent link="cross_{i}"/><child link="cylinder_{i}"/>
    <axis xyz="1 0 0"/>
  </joint>
  <joint name="prismatic_{i}" type="prismatic">
    <parent link="cylinder_{i}"/><child link="rod_{i}"/>
    <axis xyz="0 0 1"/>
    <limit lower="{:?}" upper="{:?}" effort="{:?}" velocity="{:?}"/>
    <dynamics damping="{:?}" friction="{:?}"/>
  </joint>
  <joint name="ball_rod_{i}_fixed" type="fixed">
    <parent link="rod_{i}"/><child link="ball_rod_{i}"/>
  </joint>
"#,
        actuator.min_length_m,
        actuator.max_length_m,
        actuator.max_force_n,
        actuator.max_rate_m_s,
        leg.of(&actuator.viscous_friction_n_s_m),
        leg.of(&actuator.coulomb_friction_n),
        cylinder_inertial = inertial(
            cylinder.mass_kg,
            &Vector3::new(0.0, 0.0, cylinder.center_of_mass_m),
            &link_inertia(cylinder, *length)
        ),
        cylinder_visual = visual(0.5 * to, shapes.cylinder_radius, to, "cylinder"),
        rod_inertial = inertial(
            rod.mass_kg,
            &Vector3::new(0.0, 0.0, -rod.center_of_mass_m),
            &link_inertia(rod, *length)
        ),
        rod_visual = visual(-0.5 * to, shapes.rod_radius, to, "rod"),
        at_base = origin(base, rotation),
        first_axis = Numbers(first_axis.as_slice()),
    )
}

fn platform_link(machine: &Machine, legs: &[LegLayout], shapes: &Shapes) -> String {
    let Pose { rotation, position } = home(machine);
    let body = &machine.platform;
    let balls: String = (legs.iter())
        .map(|LegLayout { number: i, platform, .. }| {
            let at = origin(platform, &Rotation3::identity());
            format!(
                r#"  <link name="ball_platform_{i}"/>
  <joint name="ball_platform_{i}_fixed" type="fixed">
    <parent link="platform"/><child link="ball_platform_{i}"/>
    {at}
  </joint>
"#
            )
        })
        .collect();
    // URDF has no convex hull of points, so the platform is drawn as a spoke from the origin to every joint.
    let spokes: String = (legs.iter())
        .map(|leg| {
            let length = leg.platform.norm();
            let turn = Rotation3::rotation_between(&Vector3::z(), &leg.platform).unwrap_or_default();
            let at = origin(&(leg.platform * 0.5), &turn);
            format!("    {}\n", visual_at(&at, shapes.cylinder_radius, length, "platform"))
        })
        .collect();
    format!(
        r#"  <link name="platform">
    {inertial}
{spokes}  </link>
  <joint name="platform_free" type="floating">
    <parent link="base"/><child link="platform"/>
    {at}
  </joint>
{balls}"#,
        inertial = inertial(body.mass_kg, &body.center_of_mass_m, &realizable(&body.inertia)),
        at = origin(&position, &Rotation3::from_matrix_unchecked(rotation)),
    )
}

/// Origin element. `rpy` are rotations about fixed axes, `R = Rz(yaw) Ry(pitch) Rx(roll)`: the negative Bryan
/// angles of the transpose.
fn origin(position: &Vector3<f64>, rotation: &Rotation3<f64>) -> String {
    let back = Pose { rotation: rotation.matrix().transpose(), position: Vector3::zeros() };
    let [roll, pitch, yaw, ..] = task_coordinates(&back, &[0.0; 6]).map(|angle| -angle);
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", Numbers(position.as_slice()), Numbers(&[roll, pitch, yaw]))
}

fn inertial(mass: f64, center: &Vector3<f64>, i: &Matrix3<f64>) -> String {
    format!(
        "<inertial><origin xyz=\"{}\"/><mass value=\"{mass:?}\"/>\
         <inertia ixx=\"{:?}\" iyy=\"{:?}\" izz=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\" iyz=\"{:?}\"/></inertial>",
        Numbers(center.as_slice()),
        i.m11,
        i.m22,
        i.m33,
        i.m12,
        i.m13,
        i.m23,
    )
}

/// A bar along z, with its middle at `z`.
fn visual(z: f64, radius: f64, length: f64, material: &str) -> String {
    visual_at(&origin(&Vector3::new(0.0, 0.0, z), &Rotation3::identity()), radius, length, material)
}

fn visual_at(origin: &str, radius: f64, length: f64, material: &str) -> String {
    format!(
        "<visual>{origin}<geometry><cylinder radius=\"{radius:?}\" length=\"{length:?}\"/></geometry>\
         <material name=\"{material}\"/></visual>"
    )
}
