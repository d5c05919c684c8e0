//! `hexad run`: the daemon, and the recording of every cycle ([`recording`]).
//!
//! Start: configuration, ports, threads, real-time set-up, then the first release. End, in this order: the
//! platform comes to rest; the real-time thread ends its cycle and writes an output without valid forces; the
//! I/O thread publishes it; the log thread empties its queues; the recorder completes its files; the report
//! is written.
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))] // They panic where a pipe is closed.

use std::io;
use std::path::PathBuf;

use tracing::{info, warn};

use self::control_socket::location::{self, SocketError};
use self::emergency_latch::EmergencyLatch;
use self::leg_confirmation::LegConfirmation;
use self::recorder::Folders;
use self::reload::Loaded;
use self::report::Report;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Claim, PortError};
use hexad_client::operator::signal::RequestSignal;
use hexad_client::realtime::request_signal::post_on_signals;
use hexad_client::realtime::request_word::RequestWord;
use hexad_client::realtime::setup::{Shortfall, open_files};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::state::Request;
use hexad_core::model::machine::has_native_arithmetic;
use hexad_machine::config::{Config, ConfigError};
use hexad_machine::text::files::{FileError, write_whole};

pub mod control_socket;
pub mod cycle;
mod emergency_latch;
mod end_watch;
mod hints;
mod io_thread;
pub mod leg_confirmation;
mod log_thread;
mod memory_queue;
pub mod motion_requests;
mod parameters;
mod pose_gate;
mod pose_search;
pub mod precheck;
pub mod process_names;
pub mod rate_change;
pub mod recorder;
pub mod recording;
pub mod reload;
pub mod replay;
pub mod report;
mod snapshot;
pub mod start;
mod statistics;
mod supervision;
pub mod target_source;
mod threads;
pub mod time_histogram;
pub mod version;

pub use self::parameters::{constants, nanoseconds, parameters, timing};

/// Name of the real-time thread. Other programs find a running daemon by it.
pub const REALTIME_THREAD: &str = "hexad-rt";

/// Reason why the daemon did not run.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The machine cannot be run with this configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A call to the shared memory failed, such as opening a topic.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The control socket could not be opened.
    #[error(transparent)]
    Socket(#[from] SocketError),
    /// The signals for requests could not be installed.
    #[error("cannot handle SIGUSR1 and SIGUSR2: {0}")]
    Signals(io::Error),
    /// The operating system refused to start a thread.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] io::Error),
    /// The kernel refused steps of the real-time set-up, and the deployment requires them all.
    #[error("realtime.require_realtime is set, and there is {}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    NotRealtime(Vec<Shortfall>),
    /// The limit of open files is too low.
    #[error(transparent)]
    Files(Shortfall),
    /// The named thread panicked or ended before it was stopped.
    #[error("the {0} thread ended unexpectedly")]
    Died(&'static str),
    /// The report or another file of the run could not be written.
    #[error(transparent)]
    Report(#[from] FileError),
}

/// Files that the daemon writes; `None` for those that it does not.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Report as JSON, at the end.
    pub report: Option<PathBuf>,
    /// Histograms of the times as CSV, at the end.
    pub histogram: Option<PathBuf>,
    /// Folders of the recordings.
    pub folders: Folders,
    /// Folder of the emergency latch and of the confirmation of the legs, which outlive the daemon.
    pub state: Option<PathBuf>,
}

/// Largest number of open files: all connections and the files that they pass, shared memory, recordings.
const OPEN_FILES: u64 = 512;

/// Target of the log of warnings about the configuration.
pub const CONFIGURATION_LOG: &str = "hexad_machine::config";

/// Warning about a processor without [`has_native_arithmetic`].
pub const SLOW_ARITHMETIC: &str = "the processor has no SSE4.2: the lanes repeat the bits of AVX2 in software, as all \
    processors must repeat a recording; a cycle takes seven times as long";

/// Runs the daemon until `stop`.
pub fn run(config: &Config, files: &Files, stop: &Stop) -> Result<Report, DaemonError> {
    for warning in config.examine().into_result(config)? {
        warn!(target: CONFIGURATION_LOG, "{warning}");
    }
    if !has_native_arithmetic(config.machine.level) {
        warn!("{SLOW_ARITHMETIC}");
    }
    open_files::permit(OPEN_FILES).map_err(DaemonError::Files)?;
    let mut claim = Claim::take(&config.name)?;
    // Leaked, because signals may arrive until the process ends.
    let word: &'static RequestWord = Box::leak(Box::default());
    let requests = [RequestSignal::User1, RequestSignal::User2].map(|signal| signal.request() as u32);
    post_on_signals(word, requests).map_err(DaemonError::Signals)?;
    // After the signals: a client that finds the socket may send them.
    let socket = location::open(&config.name, &config.deployment.operator)?;
    info!("control socket: {}", socket.path.display());
    claim.record(&socket.path, &config.deployment.realtime.processors())?;
    let latch = files.state.as_deref().map(EmergencyLatch::open).transpose()?;
    if latch.as_ref().is_some_and(EmergencyLatch::is_set) {
        warn!("an emergency stop was not cleared before the daemon ended: it is still in force; hexad clear");
        let _ = word.post(Request::Estop as u32, monotonic_ns());
    }
    // Simulated time has no cables.
    let has_cables = !config.deployment.realtime.is_simulated();
    let legs = files.state.as_deref().filter(|_| has_cables).map(LegConfirmation::open).transpose()?;
    let (report, counts_csv) =
        threads::run(Loaded::new(config.clone()), &files.folders, (latch, legs), socket, word, stop)?;
    if let Some(path) = &files.report {
        report.write(path)?;
    }
    if let Some(path) = &files.histogram {
        write_whole(path, counts_csv.as_bytes())?;
    }
    Ok(report)
}
