//! `hexad export`: the configured machine for other tools, as MJCF (MuJoCo) or URDF.
//!
//! | | name, i = 1..6 | frame, axis, sign |
//! | --- | --- | --- |
//! | world, `base` | | the base frame of the configuration; gravity may point anywhere in it |
//! | body | `platform` | the platform axes, origin C |
//! | body | `cylinder_i` | origin `A_i`; z along the leg, towards the platform; x the second axis of the universal joint |
//! | body | `rod_i` | origin `B_i`, axes as `cylinder_i` |
//! | joint | `platform_free` | six freedoms of the platform against the base |
//! | joint | `universal_first_i` | about `universal_axis`, fixed in the base; 0 at home |
//! | joint | `universal_second_i` | about the normal of `universal_axis` and leg; 0 at home |
//! | joint | `prismatic_i` | along z of the leg; its position is the leg's length L, its velocity L' |
//! | site, frame | `ball_rod_i`, `ball_platform_i` | `B_i` as the rod and as the platform has it: they coincide |
//! | actuator | `force_i` | Gamma \[N\]: positive pushes the platform away from the base |
//!
//! Rotations are right-handed. MJCF closes the loops by `connect` constraints `ball_i`; URDF cannot, and
//! leaves it to its reader that `ball_rod_i` and `ball_platform_i` coincide.
//!
//! | of the configuration | MJCF | URDF |
//! | --- | --- | --- |
//! | masses, centres, inertias | exact, one body a link | the same |
//! | `c + q (L - l0)^2` | its value at home, and `c q l0` in `custom/numeric` | its value at home |
//! | reflected mass | `armature` of `prismatic_i` | none: URDF has no word for it |
//! | viscous friction | `damping` | `damping` |
//! | Coulomb friction | `frictionloss`: a constraint, creeps where hexad's is proportional | `friction` |
//! | stroke, force, rate | `range`, `ctrlrange`, none | `limit` |
//!
//! A transverse inertia that varies with the length belongs to no rigid body, so no engine of rigid bodies
//! can carry it: a mass that moved along the leg would add `dI/dt omega`, which the paper leaves out. What
//! the paper does, Newton-Euler with the instantaneous value, a reader of the MJCF does by setting
//! `body_inertia` from the numbers before each step (`tests/clients/machine.py`).
//!
//! What it does not do: brakes, drives, controllers. Without forces the machine falls.

use std::path::Path;

use crate::config::Config;
use crate::output::files::{FileError, print, write_whole};

mod layout;
mod mjcf;
mod urdf;

/// A language for machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MuJoCo's own.
    Mjcf,
    /// The Unified Robot Description Format of ROS.
    Urdf,
}

/// The machine in this format.
pub fn text(config: &Config, format: Format) -> String {
    match format {
        Format::Mjcf => mjcf::text(config),
        Format::Urdf => urdf::text(config),
    }
}

/// Writes the machine to a file, or to standard output.
pub fn export(config: &Config, format: Format, output: Option<&Path>) -> Result<(), FileError> {
    let text = text(config, format);
    match output {
        Some(path) => write_whole(path, text.as_bytes()),
        None => print(text),
    }
}
