//! Failure of a command, and its exit code.

use core::error::Error;

use crate::output::svg::ChartError;
use hexad_client::messages::PortError;
use hexad_client::operator::OperatorError;
use hexad_client::operator::protocol::RequestResult;
use hexad_daemon::DaemonError;
use hexad_daemon::control_socket::location::SocketError;
use hexad_daemon::recording::RecordingError;
use hexad_daemon::target_source::TargetError;
use hexad_machine::config::ConfigError;
use hexad_machine::text::files::FileError;

/// Exit code of a command that a signal has interrupted, as shells use it for SIGINT.
pub const INTERRUPTED: u8 = 130;

/// Error that ends a command, with the exit code of the process. 1: the command ran and failed. 2: it could
/// not begin, and cannot without a correction.
#[derive(Debug)]
pub struct Failure {
    pub exit_code: u8,
    pub message: String,
}

impl Failure {
    /// Failure of a command that could not begin.
    pub fn before_start(error: impl Error) -> Self {
        Self { exit_code: 2, message: error.to_string() }
    }
}

/// Error that can end a command.
pub trait CommandError: Error {
    /// Whether the command had begun.
    fn has_begun(&self) -> bool {
        false
    }

    /// Exit code of the process.
    fn exit_code(&self) -> u8 {
        default_exit_code(self)
    }
}

/// Exit code of a command that ran and failed, or could not begin.
pub fn default_exit_code(error: &(impl CommandError + ?Sized)) -> u8 {
    if error.has_begun() { 1 } else { 2 }
}

impl<E: CommandError> From<E> for Failure {
    fn from(error: E) -> Self {
        Self { exit_code: error.exit_code(), message: error.to_string() }
    }
}

impl CommandError for ConfigError {}

impl CommandError for DaemonError {
    /// A refusal of the system, or another daemon, may not persist. A service manager then tries again.
    fn has_begun(&self) -> bool {
        let is_configured =
            |error: &SocketError| matches!(error, SocketError::NoGroup(..) | SocketError::NotMember(..));
        match self {
            Self::NotRealtime(_) | Self::Files(_) | Self::Config(_) => false,
            Self::Socket(error) => !is_configured(error),
            Self::Port(_) | Self::Signals(_) | Self::Thread(_) | Self::Died(_) | Self::Report(_) => true,
        }
    }
}

impl CommandError for PortError {}
impl CommandError for RecordingError {}
impl CommandError for ctrlc::Error {}

impl CommandError for ChartError {
    fn has_begun(&self) -> bool {
        true
    }
}

impl CommandError for FileError {
    fn has_begun(&self) -> bool {
        true
    }
}

impl CommandError for OperatorError {
    fn has_begun(&self) -> bool {
        !matches!(self, Self::NoDaemon(_) | Self::NoMachine | Self::Several(_) | Self::Forbidden { .. })
    }
}

impl CommandError for TargetError {
    fn has_begun(&self) -> bool {
        match self {
            Self::Port(_) | Self::Simulated => false,
            Self::Operator(error) => error.has_begun(),
            _ => self.result() != RequestResult::Invalid,
        }
    }
}
