//! The sections `[[frame]]`: named tool and work frames, for commands. The control loop does not read them.

use core::f64::consts::TAU;
use core::fmt;

use thiserror::Error;

use super::Config;
use super::reader::SectionReader;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::TaskState;
use hexad_core::motion::frames::Frames;

/// Largest length of a frame's name.
pub const MAX_FRAME_NAME_LENGTH: usize = 16;

hexad_core::named! {
    /// Where a frame is fixed.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
    pub enum FrameKind {
        /// In the platform
        Tool => "tool",
        /// In the base
        Work => "work",
    }
}

/// A frame of the machine file.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedFrame {
    /// Unique among all frames of the file.
    pub name: String,
    /// Where it is fixed.
    pub kind: FrameKind,
    /// X of its axes and origin in the platform frame or in the base frame.
    pub x: [f64; 6],
}

/// Names for which the machine file has no frame of the kind. Displayed with a line for each.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}", self.lines().join("\n"))]
pub struct UnknownFrames {
    place: String,
    wanted: Vec<(FrameKind, String)>,
    known: Vec<(FrameKind, String)>,
}

impl UnknownFrames {
    fn lines(&self) -> Vec<String> {
        let line = |(kind, name): &(FrameKind, String)| {
            let names = self.known.iter().filter(|(other, _)| other == kind).map(|(_, name)| name.as_str());
            let names: Vec<_> = names.collect();
            let known = if names.is_empty() { "none".into() } else { names.join(", ") };
            format!(
                "{}: no {kind} frame {name:?}, must be one of: {known}; add a [[frame]], or use hexad frame set",
                self.place
            )
        };
        self.wanted.iter().map(line).collect()
    }
}

impl Config {
    /// The frames with these names. Without a name: the platform, the base.
    pub fn frames_named(&self, tool: Option<&str>, work: Option<&str>) -> Result<Frames, UnknownFrames> {
        let mut wanted = Vec::new();
        let mut find = |kind: FrameKind, name: Option<&str>, default: Pose| {
            let Some(name) = name else { return default };
            let found = self.frames.iter().find(|frame| frame.kind == kind && frame.name == name);
            if found.is_none() {
                wanted.push((kind, name.into()));
            }
            found.map_or(default, |frame| TaskState::at_rest(frame.x).motion().pose)
        };
        let default = Frames::default();
        let tool = find(FrameKind::Tool, tool, default.tool);
        let work = find(FrameKind::Work, work, default.work);
        if wanted.is_empty() {
            return Ok(Frames { work, tool });
        }
        let known = self.frames.iter().map(|frame| (frame.kind, frame.name.clone())).collect();
        Err(UnknownFrames { place: self.place.clone(), wanted, known })
    }
}

/// Reads all frames.
pub(super) fn read(root: &mut SectionReader) -> Vec<NamedFrame> {
    let mut frames: Vec<NamedFrame> = Vec::new();
    for mut reader in root.optional_rows("frame") {
        let name = reader.name("name", MAX_FRAME_NAME_LENGTH);
        if let Some(earlier) = frames.iter().position(|frame| frame.name == name && !name.is_empty()) {
            reader.reject("name", format!("must differ from the name of frame[{}]", earlier + 1));
        }
        let options = FrameKind::ALL.map(|kind| (kind.name(), kind));
        let kind = reader.choice("kind", &options).unwrap_or(FrameKind::Tool);
        let x: [f64; 6] = reader.vector("pose");
        let [alpha, beta, gamma, ..] = x;
        if [alpha, beta, gamma].into_iter().any(|angle| angle.abs() > TAU) {
            reader.reject(
                "pose",
                "must have angles in [-2 pi, 2 pi]: alpha, beta, gamma [rad], then x, y, z [m]",
            );
        }
        frames.push(NamedFrame { name, kind, x });
    }
    frames
}

impl fmt::Display for FrameKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
