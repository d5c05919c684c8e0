//! Options of a command for its coordinates: a tool and a work frame of the machine file.

use clap::Args;

use super::failure::CommandError;
use crate::config::Config;
use crate::config::coordinates::Coordinates;
use crate::config::frames::UnknownFrames;
use crate::model::rigid::Pose;
use crate::model::task::task_coordinates;
use crate::motion::rotation_order::RotationOrder;
use crate::operator::motion_fields::FrameField;

#[derive(Clone, Debug, Default, Args)]
pub struct FrameOptions {
    /// Coordinates describe this tool frame of the machine file, and rotations are about its origin; without it, the platform
    #[arg(long, value_name = "NAME")]
    pub tool: Option<String>,
    /// Coordinates are in this work frame of the machine file; without it, in the base frame
    #[arg(long, value_name = "NAME")]
    pub work: Option<String>,
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
