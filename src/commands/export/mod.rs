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
//! leaves it to the reader of the file to make `ball_rod_i` and `ball_platform_i` coincide.
//!
//! | of the configuration | MJCF | URDF |
//! | --- | --- | --- |
//! | masses, centres, inertias | exact, one body a link | the same |
//! | `c + q (L - l0)^2` | its value at home, and `c q l0` in `custom/numeric` | its value at home |
//! | reflected mass | `armature` of `prismatic_i` | none: URDF has no element for it |
//! | viscous friction | `damping` | `damping` |
//! | Coulomb friction | `frictionloss`: a constraint, creeps where hexad's is proportional | `friction` |
//! | stroke, force, rate | `range`, `ctrlrange`, none | `limit` |
//!
//! A transverse inertia that varies with the length belongs to no rigid body, so no engine of rigid bodies
//! can carry it: a mass that moved along the leg would add `dI/dt omega`, which the paper leaves out. What
//! the paper does, Newton-Euler with the instantaneous value, a reader of the MJCF does by setting
//! `body_inertia` from the numbers before each step (`tests/clients/mujoco_machine.py`).
//!
//! The models have no brakes, drives or controllers. Without forces the machine falls.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::arguments::MachineFile;
use super::failure::Failure;
use hexad_machine::config::Config;
use hexad_machine::text::files::{print, write_whole};

mod layout;
mod mjcf;
mod urdf;

#[derive(Debug, Args)]
pub struct ExportArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// The language of the model
    #[arg(long, value_enum)]
    format: ModelFormat,
    /// File to write [default: standard output]
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Format of a machine model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModelFormat {
    /// A model for MuJoCo, its loops closed
    Mjcf,
    /// URDF, its loops open at the platform
    Urdf,
}

/// The machine as text in a format.
pub fn text(config: &Config, format: ModelFormat) -> String {
    match format {
        ModelFormat::Mjcf => mjcf::text(config),
        ModelFormat::Urdf => urdf::text(config),
    }
}

impl ExportArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let text = text(&self.machine.load()?, self.format);
        match &self.output {
            Some(path) => write_whole(path, text.as_bytes()),
            None => print(text),
        }
        .map_err(Failure::before_start)
    }
}
