//! Failure of a command, and its exit code.

use core::error::Error;
use core::fmt::Display;

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
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    pub exit_code: u8,
    pub message: String,
}

impl Failure {
    /// Failure of a command that could not begin.
    pub fn before_start(error: impl Display) -> Self {
        Self { exit_code: 2, message: error.to_string() }
    }

    /// Failure of a command that has run.
    pub fn after_start(error: impl Display) -> Self {
        Self { exit_code: 1, message: error.to_string() }
    }

    /// End of a command that a signal has interrupted.
    pub fn interrupted(error: impl Display) -> Self {
        Self { exit_code: INTERRUPTED, message: error.to_string() }
    }
}

/// Error that can end a command.
pub trait CommandError: Error {
    /// Exit code of the process: 1 if the command ran and failed, 2 if it could not begin.
    fn exit_code(&self) -> u8 {
        2
    }
}

impl<E: CommandError> From<E> for Failure {
    fn from(error: E) -> Self {
        Self { exit_code: error.exit_code(), message: error.to_string() }
    }
}

impl CommandError for ConfigError {}

impl CommandError for DaemonError {
    /// A refusal of the system, or another daemon, may not persist. A service manager then tries again.
    fn exit_code(&self) -> u8 {
        match self {
            Self::NotRealtime(_) | Self::Files(_) | Self::Config(_) => 2,
            Self::Socket(SocketError::NoGroup(..) | SocketError::NotMember(..)) => 2,
            _ => 1,
        }
    }
}

impl CommandError for PortError {}
impl CommandError for RecordingError {}
impl CommandError for ctrlc::Error {}

impl CommandError for ChartError {
    fn exit_code(&self) -> u8 {
        1
    }
}

impl CommandError for FileError {
    fn exit_code(&self) -> u8 {
        1
    }
}

impl CommandError for OperatorError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::NoDaemon(_) | Self::NoMachine | Self::Several(_) | Self::Forbidden { .. } => 2,
            _ => 1,
        }
    }
}

impl CommandError for TargetError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Port(_) | Self::Simulated => 2,
            Self::Operator(error) => error.exit_code(),
            _ if self.result() == RequestResult::Invalid => 2,
            _ => 1,
        }
    }
}
