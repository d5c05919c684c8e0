//! Why a command failed.

use super::advise::AdviseError;
use super::demo::DemoError;
use super::doctor::DoctorError;
use super::r#move::SetpointError;
use super::offline::OfflineError;
use super::operate::OperatorError;
use crate::config::ConfigError;
use crate::output::files::FileError;
use crate::output::svg::ChartError;

/// Why a command failed, and its exit code: 1 it ran and went wrong, 2 it could not begin.
#[derive(Debug)]
pub struct Failure {
    pub code: u8,
    pub what: String,
}

impl Failure {
    /// For everything that is found before the work.
    pub fn could_not_begin(error: impl core::error::Error) -> Self {
        Self { code: 2, what: error.to_string() }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::could_not_begin(error)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Self { code: 1, what: error.to_string() }
    }
}

impl From<ChartError> for Failure {
    fn from(error: ChartError) -> Self {
        Self { code: 1, what: error.to_string() }
    }
}

impl From<OperatorError> for Failure {
    fn from(error: OperatorError) -> Self {
        let code = if matches!(error, OperatorError::Port(_) | OperatorError::NoStatus(_)) { 2 } else { 1 };
        Self { code, what: error.to_string() }
    }
}

impl From<SetpointError> for Failure {
    fn from(error: SetpointError) -> Self {
        Self::could_not_begin(error)
    }
}

impl From<AdviseError> for Failure {
    fn from(error: AdviseError) -> Self {
        Self::could_not_begin(error)
    }
}

impl From<OfflineError> for Failure {
    fn from(error: OfflineError) -> Self {
        let code = if matches!(error, OfflineError::Unsolved { .. }) { 1 } else { 2 };
        Self { code, what: error.to_string() }
    }
}

impl From<DoctorError> for Failure {
    fn from(error: DoctorError) -> Self {
        let ran = matches!(error, DoctorError::Impossible(_) | DoctorError::Interrupted);
        Self { code: if ran { 1 } else { 2 }, what: error.to_string() }
    }
}

impl From<DemoError> for Failure {
    fn from(error: DemoError) -> Self {
        let code = if matches!(error, DemoError::Config(_) | DemoError::File(_) | DemoError::Port(_)) {
            2
        } else {
            1
        };
        Self { code, what: error.to_string() }
    }
}
