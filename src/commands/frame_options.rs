//! Options of a command for its coordinates: a tool and a work frame of the machine file, and units.

use clap::Args;

use super::failure::CommandError;
use hexad_client::operator::motion_fields::FrameField;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::task_coordinates;
use hexad_core::motion::rotation_order::RotationOrder;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::config::frames::UnknownFrames;
use hexad_machine::text::units::MotionUnits;

#[derive(Clone, Debug, Default, Args)]
pub struct FrameOptions {
    /// Coordinates describe this tool frame of the machine file, and rotations are about its origin; without it, the platform
    #[arg(long, value_name = "NAME")]
    pub tool: Option<String>,
    /// Coordinates are in this work frame of the machine file; without it, in the base frame
    #[arg(long, value_name = "NAME")]
    pub work: Option<String>,
}

#[derive(Clone, Copy, Debug, Args)]
pub struct UnitOptions {
    /// Units of the coordinates that are shown, a length and an angle: m, mm, um, nm and rad, mrad, urad, deg, arcmin, arcsec [default: mm,deg]
    #[arg(long, value_name = "LENGTH,ANGLE", value_parser = MotionUnits::read)]
    units: Option<MotionUnits>,
}

impl UnitOptions {
    pub fn is_empty(self) -> bool {
        self.units.is_none()
    }

    /// The chosen units, else millimetres and degrees.
    pub fn units(self) -> MotionUnits {
        self.units.unwrap_or_default()
    }
}

impl FrameOptions {
    pub fn is_empty(&self) -> bool {
        self.tool.is_none() && self.work.is_none()
    }

    /// The frames of a machine file with these names.
    pub fn coordinates(&self, config: &Config) -> Result<Coordinates, UnknownFrames> {
        let names = [self.tool.as_deref(), self.work.as_deref()];
        let [tool, work] = names;
        let frames = config.frames_named(tool, work)?;
        Ok(Coordinates::new(config, (!self.is_empty()).then_some(frames), names, RotationOrder::Xyz))
    }

    /// Fields of a request for a motion: the frames of this file. The daemon may have read an older one.
    pub fn fields(&self, config: &Config) -> Result<[Option<FrameField>; 2], UnknownFrames> {
        let frames = config.frames_named(self.tool.as_deref(), self.work.as_deref())?;
        let field = |name: &Option<String>, pose: &Pose| {
            name.as_ref().map(|_| FrameField::Pose(task_coordinates(pose, &[0.0; 6])))
        };
        Ok([field(&self.tool, &frames.tool), field(&self.work, &frames.work)])
    }
}

impl CommandError for UnknownFrames {}
