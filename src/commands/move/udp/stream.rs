//! Options of `hexad move --udp`, its errors, and the blend to its stream.

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;

use clap::Args;

use super::datagram_format::FormatError;
use crate::commands::failure::{CommandError, INTERRUPTED, default_exit_code};
use crate::commands::quantity::{angle, length, list};
use crate::output::svg::ChartError;
use hexad_core::motion::minimum_jerk::{rise, straight_move};
use hexad_daemon::target_source::TargetError;
use hexad_machine::text::files::FileError;

/// Duration of the blend from the pose at which the platform stands to the stream \[s\].
pub const BLEND_S: f64 = 3.0;

#[derive(Debug, Default, Args)]
pub struct StreamOptions {
    /// Format of the datagrams: x-plane, flypt-mover, simtools, or a file, see docs/motion_simulator.md
    #[arg(long, value_name = "NAME", requires = "udp")]
    pub format: Option<String>,
    /// Address from which datagrams are accepted; required unless --udp is of this host alone
    #[arg(long, value_name = "IP", requires = "udp")]
    pub from: Vec<IpAddr>,
    /// Pose at which people board, with units, as in 0,0,0,0,0,0.7m; without it, home, lowered to nine tenths of what the machine permits
    #[arg(long, value_name = "X", requires = "udp", value_parser = boarding, allow_hyphen_values = true)]
    pub boarding: Option<[f64; 6]>,
    /// Receive and examine the stream for --seconds; move nothing, and need no daemon
    #[arg(long, requires = "udp", conflicts_with_all = ["engage", "boarding"])]
    pub dry_run: bool,
    /// SVG file for the picture of the stream
    #[arg(long, value_name = "FILE", requires = "dry_run")]
    pub output: Option<PathBuf>,
}

fn boarding(text: &str) -> Result<[f64; 6], String> {
    list(text, [angle, angle, angle, length, length, length], "0,0,0,0,0,0.7m")
}

/// Reasons why no stream is followed.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    #[error("--udp: needs --format: x-plane, flypt-mover, simtools, or a file")]
    NoFormat,
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error("--udp {0}: must be the address of one interface")]
    AnyInterface(SocketAddr),
    #[error("--udp {0}: is open to other hosts: name those that may move the platform with --from")]
    NoSender(SocketAddr),
    #[error("--udp {0}: {1}")]
    Socket(SocketAddr, io::Error),
    #[error("--udp: poses alone need setpoint.on_violation = \"limit\" in the machine file (now \"stop\")")]
    Policy,
    #[error("signals of pause and resume: {0}")]
    Signals(io::Error),
    #[error("{0}")]
    Silence(String),
    #[error(transparent)]
    Picture(#[from] ChartError),
    #[error(transparent)]
    Output(#[from] FileError),
    #[error(transparent)]
    Target(#[from] TargetError),
    #[error("interrupted; the platform stands under control; hexad stop or park ends it")]
    Interrupted,
}

impl CommandError for StreamError {
    fn has_begun(&self) -> bool {
        match self {
            Self::Target(error) => error.has_begun(),
            Self::Silence(_) | Self::Picture(_) | Self::Output(_) => true,
            _ => false,
        }
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted => INTERRUPTED,
            _ => default_exit_code(self),
        }
    }
}

/// A pose of the stream, blended from the pose at which the platform stood.
pub fn blended(from: &[f64; 6], to: &[f64; 6], since_ns: u64, now_ns: u64) -> [f64; 6] {
    straight_move(&(*from).into(), &(*to).into(), &rise(seconds(since_ns, now_ns), BLEND_S)).x.into()
}

pub fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}
