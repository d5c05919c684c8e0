//! `hexad frame`: the named frames of a machine file, and a new file with a frame where the platform is.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::arguments::MachineFile;
use super::failure::Failure;
use super::frame_options::{FrameOptions, UnitOptions};
use super::machine_file::{difference, with_frame, write_new};
use hexad_client::operator::requests::status;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::{pose_of, task_coordinates};
use hexad_core::motion::frames::Frames;
use hexad_daemon::target_source::{Observation, TargetError, reason};
use hexad_machine::config::Config;
use hexad_machine::config::frames::{FrameKind, NamedFrame};
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::files::print;
use hexad_machine::text::text_table::{Left, Right, text_table};
use hexad_machine::text::units::MotionUnits;

#[derive(Debug, Args)]
pub struct FrameArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Show the frames of a machine file
    List(ListArguments),
    /// Write a new machine file with a frame where the platform is now
    Set(SetArguments),
}

#[derive(Debug, Args)]
struct ListArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    units: UnitOptions,
}

#[derive(Debug, Args)]
struct SetArguments {
    /// Name of the frame, of the file or new
    #[arg(value_name = "NAME")]
    name: String,
    #[command(flatten)]
    machine: MachineFile,
    /// Where the platform is now: under control its reference, else the measured pose
    #[arg(long, required = true)]
    here: bool,
    /// Kind of a new frame
    ///
    /// A work frame is set to where the platform, or --tool, is in the base frame. A tool frame is set to the frame of the platform
    /// that is now where the base frame, or --work, is.
    #[arg(long, value_enum)]
    kind: Option<FrameKind>,
    #[command(flatten)]
    frames: FrameOptions,
    /// New machine file
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
}

impl FrameArguments {
    pub fn execute(self) -> Result<(), Failure> {
        match self.action {
            Action::List(ListArguments { machine, units }) => {
                Ok(print(table(&machine.load()?, units.units()))?)
            }
            Action::Set(arguments) => arguments.execute(),
        }
    }
}

impl SetArguments {
    fn execute(self) -> Result<(), Failure> {
        let config = self.machine.load()?;
        let kind = self.kind(&config)?;
        let frames = config.frames_named(self.frames.tool.as_deref(), self.frames.work.as_deref())?;
        let answer = status(&config.name)?;
        let seen = Observation::of_answer(&answer, 0, &config.machine.home);
        let here = seen
            .and_then(|seen| seen.reference_or_measured_x)
            .ok_or(TargetError::UnknownPose(reason(&answer.text)))?;
        let x = task_coordinates(&frame_here(&frames, kind, &pose_of(&here)), &[0.0; 6]);
        let text = with_frame(&config.text, &NamedFrame { name: self.name, kind, x })?;
        Config::parse(&text, "the new machine file")?;
        write_new(&self.output, &text)?;
        let lines = difference(&config.text, &text);
        Ok(print(format_args!("{lines}\n{}: written\n", self.output.display()))?)
    }

    /// Kind of the frame of the file with this name, else of the option.
    fn kind(&self, config: &Config) -> Result<FrameKind, Failure> {
        let (place, name) = (&config.place, &self.name);
        let found = config.frames.iter().find(|frame| frame.name == *name).map(|frame| frame.kind);
        let kind = match (found, self.kind) {
            (Some(kind), Some(wanted)) if kind != wanted => {
                return Err(Failure::before_start(format_args!(
                    "{place}: {name:?} is a {kind} frame, not a {wanted} frame; choose another name, or leave out --kind"
                )));
            }
            (None, None) => {
                return Err(Failure::before_start(format_args!(
                    "{place}: no frame is named {name:?}; --kind tool or --kind work makes a new one"
                )));
            }
            (Some(kind), _) | (None, Some(kind)) => kind,
        };
        let (unused, other) = match kind {
            FrameKind::Tool => (&self.frames.tool, FrameKind::Work),
            FrameKind::Work => (&self.frames.work, FrameKind::Tool),
        };
        if unused.is_some() {
            let text = format!("a {kind} frame is set from a {other} frame: --{kind} must be left out");
            return Err(Failure::before_start(text));
        }
        Ok(kind)
    }
}

/// The frame in which the tool's pose is zero now.
fn frame_here(frames: &Frames, kind: FrameKind, platform: &Pose) -> Pose {
    match kind {
        FrameKind::Work => Frames { tool: frames.tool, ..Frames::default() }.tool_pose(platform),
        // Seen from the platform, the work frame is a tool.
        FrameKind::Tool => Frames { tool: frames.work, work: *platform }.tool_pose(&Frames::default().work),
    }
}

/// A line for each frame.
fn table(config: &Config, units: MotionUnits) -> String {
    if config.frames.is_empty() {
        return format!(
            "{}: no [[frame]]; hexad frame set NAME --here --kind tool|work adds one\n",
            config.place
        );
    }
    let format = CoordinateFormat::new(units, config.resolution());
    let names: Vec<_> = format.names().collect();
    let columns: Vec<_> = [("frame", Left), ("kind", Left)]
        .into_iter()
        .chain(names.iter().map(|name| (name.as_str(), Right)))
        .collect();
    let rows = config.frames.iter().map(|NamedFrame { name, kind, x }| {
        [name.clone(), kind.to_string()].into_iter().chain(format.numbers(x, 0)).collect::<Vec<_>>()
    });
    text_table(2, &columns, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_zero_in_a_frame_that_was_set_here() {
        let platform = pose_of(&[0.1, -0.2, 0.3, 0.4, 0.5, 0.6]);
        let frames = Frames {
            tool: pose_of(&[0.3, 0.2, 0.1, 0.0, 0.1, 0.35]),
            work: pose_of(&[-0.3, 0.5, 1.1, 0.2, -0.1, 0.9]),
        };
        for kind in [FrameKind::Work, FrameKind::Tool] {
            let here = frame_here(&frames, kind, &platform);
            let set = match kind {
                FrameKind::Work => Frames { work: here, ..frames },
                FrameKind::Tool => Frames { tool: here, ..frames },
            };
            let x = task_coordinates(&set.tool_pose(&platform), &[0.0; 6]);
            assert!(x.iter().all(|x| x.abs() < 1e-15), "{kind}: {x:?}");
        }
    }
}
