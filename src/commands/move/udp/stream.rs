//! Options of `hexad move --udp`, and the blend to its stream.

use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

use crate::commands::quantity::{angle, length, list};
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::motion::minimum_jerk::{rise, straight_move};

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

/// A pose of the stream, blended from the pose at which the platform stood.
pub fn blended(from: &[f64; 6], to: &[f64; 6], since_ns: u64, now_ns: u64) -> [f64; 6] {
    straight_move(&(*from).into(), &(*to).into(), &rise(seconds_since_or_0(since_ns, now_ns), BLEND_S))
        .x
        .into()
}
