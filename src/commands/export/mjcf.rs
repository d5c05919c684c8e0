//! The machine as a MuJoCo model; [`super`] has names, frames and signs.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::layout::{LegLayout, Numbers, Shapes, home, legs, link_inertia, quaternion, realizable};
use hexad_core::model::machine::{Link, Machine};
use hexad_core::model::rigid::Pose;
use hexad_machine::config::Config;

/// Time step of MuJoCo \[s\]. With the constraints below the loops of a machine of a tonne stay closed to 1e-9 m.
const STEP_S: f64 = 1e-4;
/// Time constant of the stiffest constraints with that step. MuJoCo requires time constants of at least two steps
/// and impedances of at most 0.9999.
const CONSTRAINT_TIME_CONSTANT_S: f64 = 2.0 * STEP_S;
const CONSTRAINT_IMPEDANCE: f64 = 0.9999;

const HEADER_COMMENT: &str = "  Written by `hexad export`. SI units and radians. The world is the base frame of the configuration.
  Legs i = 1 to 6. At reset the machine is at home, without brakes: without forces it falls.
  body platform        origin and axes of the platform; joint platform_free: its position and quaternion w x y z in the
                       world; their rates: velocity of the origin in the world, angular velocity in the platform
  body cylinder_i      origin: joint centre on the base; z: along the leg to the platform; x: second universal axis
  body rod_i           origin: joint centre on the platform; axes as cylinder_i
  joint universal_first_i, universal_second_i    the first axis is fixed in the base; both 0 at home
  joint prismatic_i    position: LENGTH of the leg between joint centres; velocity: its rate
  equality ball_i      closes the loop between the sites ball_rod_i and ball_platform_i
  actuator force_i     command of the drive [N], positive pushes the platform away from the base; gear: force scale
  armature: reflected mass; damping: viscous friction; frictionloss: Coulomb friction. Load friction is left out.";

const VARYING_INERTIA_COMMENT: &str = "
  numeric LINK_transverse_inertia    c q l0: the link's transverse inertia is c + q (L - l0)^2 at length L; the model
                                     has its value at home. Set body_inertia before each step to follow it.";

/// Text of the MJCF file.
pub(super) fn text(config: &Config) -> String {
    let machine = &config.machine;
    let legs = legs(machine);
    let shapes = Shapes::new(machine, &legs);
    let laws: String = [("cylinder", &machine.cylinder), ("rod", &machine.rod)].map(law).concat();
    let (varying, custom) = match laws.as_str() {
        "" => ("", String::new()),
        laws => (VARYING_INERTIA_COMMENT, format!("  <custom>\n{laws}  </custom>\n")),
    };
    let bodies: String = legs.iter().map(|leg| leg_body(machine, leg, &shapes)).collect();
    let each = |line: fn(&LegLayout, &Machine) -> String| -> String {
        legs.iter().map(|leg| line(leg, machine)).collect()
    };
    format!(
        r#"<mujoco model="{name}">
<!--
{HEADER_COMMENT}{varying}
-->
  <compiler angle="radian"/>
  <option timestep="{STEP_S:?}" integrator="implicitfast" gravity="{gravity}">
    <flag contact="disable"/>
  </option>
{custom}  <default>
    <geom contype="0" conaffinity="0"/>
    <equality solref="{CONSTRAINT_TIME_CONSTANT_S:?} 1" solimp="{CONSTRAINT_IMPEDANCE:?} {CONSTRAINT_IMPEDANCE:?} 1 0.5 1"/>
  </default>
{looks}  <worldbody>
{scenery}{bodies}{platform}  </worldbody>
  <equality>
{loops}  </equality>
  <actuator>
{motors}  </actuator>
</mujoco>
"#,
        name = config.name,
        gravity = Numbers(machine.gravity_m_s2.as_slice()),
        looks = looks(&shapes),
        scenery = scenery(machine, &shapes),
        platform = platform_body(machine, &legs, &shapes),
        loops = each(|LegLayout { number: i, .. }, _| format!(
            "    <connect name=\"ball_{i}\" site1=\"ball_platform_{i}\" site2=\"ball_rod_{i}\"/>\n"
        )),
        motors = each(|leg, machine| {
            let i = leg.number;
            let (most, scale) = (machine.actuator.max_force_n, leg.of(&machine.actuator.force_scale));
            format!(
                "    <motor name=\"force_{i}\" joint=\"prismatic_{i}\" gear=\"{scale:?}\" ctrlrange=\"{:?} {most:?}\"/>\n",
                -most
            )
        }),
    )
}

/// Numbers `c q l0` of a link whose transverse inertia varies.
fn law((name, link): (&str, &Link)) -> String {
    let inertia = &link.transverse_inertia;
    if inertia.quadratic_kg == 0.0 {
        return String::new();
    }
    let data = [inertia.constant_kg_m2, inertia.quadratic_kg, inertia.reference_length_m];
    format!("    <numeric name=\"{name}_transverse_inertia\" data=\"{}\"/>\n", Numbers(&data))
}

fn leg_body(machine: &Machine, leg: &LegLayout, shapes: &Shapes) -> String {
    let LegLayout { number: i, base, rotation, first_axis, length, .. } = leg;
    let to = shapes.link_length;
    format!(
        r#"    <body name="cylinder_{i}" pos="{base}" quat="{orientation}">
      <joint name="universal_first_{i}" axis="{first_axis}"/>
      <joint name="universal_second_{i}" axis="1 0 0"/>
      {cylinder}
      <geom type="sphere" size="{ball:?}" material="joint"/>
      <geom type="cylinder" fromto="0 0 0 0 0 {to:?}" size="{cylinder_radius:?}" material="cylinder"/>
      <body name="rod_{i}" pos="0 0 {length:?}">
        {prismatic}
        {rod}
        <geom type="cylinder" fromto="0 0 0 0 0 {back:?}" size="{rod_radius:?}" material="rod"/>
        <site name="ball_rod_{i}" size="{ball:?}" material="joint"/>
      </body>
    </body>
"#,
        base = Numbers(base.as_slice()),
        orientation = Numbers(&quaternion(rotation)),
        first_axis = Numbers(first_axis.as_slice()),
        cylinder =
            inertial(machine.cylinder.mass_kg, machine.cylinder.center_of_mass_m, &machine.cylinder, *length),
        rod = inertial(machine.rod.mass_kg, -machine.rod.center_of_mass_m, &machine.rod, *length),
        ball = shapes.ball_radius,
        cylinder_radius = shapes.cylinder_radius,
        rod_radius = shapes.rod_radius,
        back = -to,
        prismatic = prismatic_joint(machine, leg),
    )
}

/// Prismatic joint of a leg, with the friction and the reflected mass of its drive.
fn prismatic_joint(machine: &Machine, leg: &LegLayout) -> String {
    let (LegLayout { number: i, length, .. }, actuator) = (leg, &machine.actuator);
    let [shortest, longest] = [actuator.min_length_m, actuator.max_length_m];
    let [reflected, viscous, coulomb] = [
        actuator.reflected_mass_kg,
        leg.of(&actuator.viscous_friction_n_s_m),
        leg.of(&actuator.coulomb_friction_n),
    ];
    format!(
        "<joint name=\"prismatic_{i}\" type=\"slide\" axis=\"0 0 1\" ref=\"{length:?}\" \
         range=\"{shortest:?} {longest:?}\" armature=\"{reflected:?}\" \
         damping=\"{viscous:?}\" frictionloss=\"{coulomb:?}\"/>"
    )
}

/// Inertia of a link whose centre of mass is at `z`.
fn inertial(mass: f64, z: f64, link: &Link, length: f64) -> String {
    let moments = link_inertia(link, length).diagonal();
    format!("<inertial pos=\"0 0 {z:?}\" mass=\"{mass:?}\" diaginertia=\"{}\"/>", Numbers(moments.as_slice()))
}

fn platform_body(machine: &Machine, legs: &[LegLayout], shapes: &Shapes) -> String {
    let Pose { rotation, position } = home(machine);
    let body = &machine.platform;
    let i = realizable(&body.inertia);
    let sites: String = (legs.iter())
        .map(|LegLayout { number, platform, .. }| {
            let at = Numbers(platform.as_slice());
            let size = shapes.ball_radius;
            format!(
                "      <site name=\"ball_platform_{number}\" pos=\"{at}\" size=\"{size:?}\" material=\"joint\"/>\n"
            )
        })
        .collect();
    format!(
        r#"    <body name="platform" pos="{at}" quat="{orientation}">
      <freejoint name="platform_free"/>
      <inertial pos="{center}" mass="{mass:?}" fullinertia="{inertia}"/>
      <geom type="mesh" mesh="platform" material="platform"/>
{sites}    </body>
"#,
        at = Numbers(position.as_slice()),
        orientation = Numbers(&quaternion(&Rotation3::from_matrix_unchecked(rotation))),
        center = Numbers(body.center_of_mass_m.as_slice()),
        mass = body.mass_kg,
        inertia = Numbers(&[i.m11, i.m22, i.m33, i.m12, i.m13, i.m23]),
    )
}

/// Meshes, colours, and the centre of the viewer's free camera.
fn looks(shapes: &Shapes) -> String {
    let mesh = |name: &str, corners: &[Vector3<f64>]| {
        let coordinates: Vec<f64> = corners.iter().flatten().copied().collect();
        format!("    <mesh name=\"{name}\" vertex=\"{}\"/>\n", Numbers(&coordinates))
    };
    let material = |(name, rgb): (&str, &str)| format!("    <material name=\"{name}\" rgba=\"{rgb} 1\"/>\n");
    let materials: String = [
        ("base", "0.35 0.37 0.4"),
        ("platform", "0.2 0.45 0.75"),
        ("cylinder", "0.25 0.25 0.28"),
        ("rod", "0.75 0.77 0.8"),
        ("joint", "0.9 0.55 0.15"),
    ]
    .map(material)
    .concat();
    format!(
        r#"  <statistic center="{center}" extent="{extent:?}"/>
  <visual>
    <global offwidth="1280" offheight="960"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.95 0.96 0.98" rgb2="0.6 0.68 0.78" width="256" height="256"/>
{materials}{base}{platform}  </asset>
"#,
        center = Numbers(shapes.center.as_slice()),
        extent = shapes.extent,
        base = mesh("base", &shapes.base_corners),
        platform = mesh("platform", &shapes.platform_corners),
    )
}

/// The base, a light from above, and a camera that is upright for any direction of gravity.
fn scenery(machine: &Machine, shapes: &Shapes) -> String {
    let up = (-machine.gravity_m_s2).try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z());
    // Any direction that is not up: the base axis that deviates most from it.
    let aside = Vector3::ith(up.iamin(), 1.0);
    let right = aside.cross(&up).normalize();
    // From the front right, a little above. The distance is chosen to show the whole machine.
    let away = (right * 0.5 + right.cross(&up) + up * 0.4).normalize();
    let image_right = up.cross(&away).normalize();
    let image_up = away.cross(&image_right);
    let axes = Matrix3::from_columns(&[image_right, image_up, away]);
    let eye = shapes.center + away * (1.3 * shapes.extent);
    format!(
        r#"    <light directional="true" dir="{down}" diffuse="0.6 0.6 0.6"/>
    <camera name="oblique" pos="{eye}" xyaxes="{axes}"/>
    <geom name="base" type="mesh" mesh="base" material="base"/>
"#,
        down = Numbers((-(up + away * 0.5)).as_slice()),
        eye = Numbers(eye.as_slice()),
        axes = Numbers(axes.as_slice().get(..6).unwrap_or_default()),
    )
}
