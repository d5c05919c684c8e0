//! Emergency stop that outlives the daemon: a file in the state directory, from the stop until `clear`.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use tracing::error;

use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::State;
use crate::output::files::{FileError, write_whole};

/// Name of the file in the state directory.
const FILE: &str = "emergency-stop";
const CONTENT: &[u8] = b"Emergency stop. The daemon starts in it until an operator sends `clear`.\n";

/// Latch of the emergency stop; without a folder it lasts as long as the daemon.
#[derive(Debug, Default)]
pub struct EmergencyLatch {
    path: Option<PathBuf>,
    is_set: bool,
}

impl EmergencyLatch {
    /// Latch in a folder, as the daemon before has left it. An error if that cannot be known or changed.
    pub fn open(folder: Option<&Path>) -> Result<Self, FileError> {
        let Some(folder) = folder else { return Ok(Self::default()) };
        let path = folder.join(FILE);
        let is_set = path.try_exists().map_err(FileError::on(&path))?;
        Ok(Self { path: Some(path), is_set })
    }

    /// Whether an emergency stop has not been cleared.
    pub fn is_set(&self) -> bool {
        self.is_set
    }

    /// Follows the state of the controller: an emergency stop sets the latch, the end of the fault releases it.
    pub fn follow(&mut self, state: State, code: DiagnosticCode) {
        let is_stopped = state == State::Fault && (self.is_set || code == DiagnosticCode::EmergencyStop);
        let Some(path) = self.path.as_ref().filter(|_| is_stopped != self.is_set) else { return };
        let changed = if is_stopped { write_whole(path, CONTENT) } else { remove(path) };
        match changed {
            Ok(()) => self.is_set = is_stopped,
            Err(cause) if is_stopped => {
                error!("the emergency stop is in force, but a restart would end it: {cause}");
            }
            Err(cause) => error!("after a restart the daemon will be in emergency stop again: {cause}"),
        }
    }
}

fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => path.parent().map_or(Ok(()), sync),
    }
    .map_err(FileError::on(path))
}

/// Makes the names in a folder durable.
fn sync(folder: &Path) -> io::Result<()> {
    fs::File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_emergency_stop_lasts_until_the_fault_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let open = || EmergencyLatch::open(Some(folder.path())).unwrap();
        let mut latch = open();
        let emergency = DiagnosticCode::EmergencyStop;
        for (state, code, is_set) in [
            (State::Active, DiagnosticCode::None, false),
            (State::Fault, DiagnosticCode::MeasurementLost, false),
            (State::Fault, emergency, true),
            // A later fault does not replace it.
            (State::Fault, DiagnosticCode::MeasurementLost, true),
            (State::Off, DiagnosticCode::NoMeasurement, false),
            (State::Off, emergency, false),
        ] {
            latch.follow(state, code);
            assert_eq!((latch.is_set(), open().is_set()), (is_set, is_set), "{state:?}, {code:?}");
        }
    }

    #[test]
    fn without_a_folder_nothing_is_kept() {
        let mut latch = EmergencyLatch::open(None).unwrap();
        latch.follow(State::Fault, DiagnosticCode::EmergencyStop);
        assert!(!latch.is_set());
    }
}
