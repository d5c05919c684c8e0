//! Latch of the emergency stop: a file in the state directory, set from the stop until `clear`. It outlives
//! the daemon.
//!
//! The file exists from the start, and only its content changes, in place. So the latch needs no new file and
//! no free space on the disk. A separate thread writes it as soon as the I/O thread has published the stop;
//! neither the log nor the recorder can delay it.

use core::sync::atomic::{AtomicBool, Ordering};
use std::fs::{File, metadata, read};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tracing::{error, info};

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::clock::Monotonic;
use hexad_client::realtime::event::Event;
use hexad_client::realtime::triple_buffer::{Reader, Writer, triple_buffer};
use hexad_core::control::controller::Output;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::State;
use hexad_machine::text::files::{FileError, write_whole};

/// Name of the file in the state directory.
const FILE: &str = "emergency-stop";
/// Contents of the file, both of one length. Any other content, which an interrupted write may leave, counts
/// as an emergency stop.
const IN_FORCE: &[u8] = b"emergency stop: in force until an operator sends `clear`\n";
const CLEARED: &[u8] = b"emergency stop: cleared                                 \n";

/// Interval at which the thread checks whether the daemon ends \[ns\]. A change of state wakes it at once.
const STOP_POLL_INTERVAL_NS: u64 = 20_000_000;

/// Latch of the emergency stop.
#[derive(Debug)]
pub struct EmergencyLatch {
    path: PathBuf,
    file: File,
    is_set: bool,
}

/// State of the controller after a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Change {
    state: State,
    code: DiagnosticCode,
    /// Release of the cycle \[ns\].
    due_ns: u64,
}

/// I/O thread's end of the link to the thread of the latch.
pub struct LatchLink {
    changes: Writer<Change>,
    event: Arc<Event>,
    /// The last state that was sent, with its diagnostic.
    last: (State, DiagnosticCode),
}

/// Latch's end of the link, see [`LatchLink`].
pub struct LatchChanges {
    changes: Reader<Change>,
    event: Arc<Event>,
}

/// Creates both ends of the link.
pub fn latch_link() -> (LatchLink, LatchChanges) {
    let (writer, reader) = triple_buffer(Change::default());
    let event = Arc::new(Event::default());
    let link = LatchLink { changes: writer, event: event.clone(), last: Default::default() };
    (link, LatchChanges { changes: reader, event })
}

impl LatchLink {
    /// Wakes the thread of the latch if state or diagnostic has changed.
    pub fn send(&mut self, output: &Output, due_ns: u64) {
        let (state, code) = (output.state, output.diagnostic.code);
        // The output after the last cycle is not a state of the controller, and must not release the latch.
        if (state, code) != self.last && code != DiagnosticCode::DaemonEnding {
            self.last = (state, code);
            self.changes.write(Change { state, code, due_ns });
            self.event.signal();
        }
    }
}

impl EmergencyLatch {
    /// Latch in a folder, in the state that the last daemon left. An error if the file cannot be read or written.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        let path = folder.join(FILE);
        if !folder.is_dir() {
            let cause = format!("there must be a folder: mkdir -p {}", folder.display());
            return Err(FileError::on(folder)(io::Error::new(ErrorKind::NotFound, cause)));
        }
        let is_set = match read(&path) {
            Ok(content) => content != CLEARED,
            Err(error) if error.kind() == ErrorKind::NotFound => false,
            Err(error) => return Err(FileError::on(&path)(error)),
        };
        let file = create(&path, if is_set { IN_FORCE } else { CLEARED })?;
        Ok(Self { path, file, is_set })
    }

    /// Whether an emergency stop is in force.
    pub fn is_set(&self) -> bool {
        self.is_set
    }

    /// Follows the states of the controller until `stop`, including the last change.
    pub fn run(mut self, mut link: LatchChanges, stop: &AtomicBool) {
        loop {
            // Read before the wait, so that changes sent before the stop are processed.
            let is_ending = stop.load(Ordering::Relaxed);
            let until_ns = monotonic_ns() + STOP_POLL_INTERVAL_NS;
            if link.event.wait(&mut link.changes, &mut Monotonic, until_ns, stop) {
                self.follow(*link.changes.value());
            } else if is_ending {
                return;
            }
        }
    }

    /// Sets the latch at an emergency stop, and releases it when the fault ends.
    fn follow(&mut self, change: Change) {
        let Change { state, code, due_ns } = change;
        let is_stopped = state == State::Fault && (self.is_set || code == DiagnosticCode::EmergencyStop);
        if is_stopped == self.is_set {
            return;
        }
        match self.store(if is_stopped { IN_FORCE } else { CLEARED }) {
            Ok(()) => {
                self.is_set = is_stopped;
                let after_ms = monotonic_ns().saturating_sub(due_ns) as f64 * 1e-6;
                if is_stopped {
                    info!(
                        after_ms,
                        "the emergency stop will outlast a restart: stored {after_ms:.1} ms after its cycle"
                    );
                }
            }
            Err(cause) if is_stopped => {
                error!("the emergency stop is in force, but a restart would end it: {cause}");
            }
            Err(cause) => error!("after a restart the daemon will be in emergency stop again: {cause}"),
        }
    }

    /// Replaces the content durably. Creates the file again if somebody has removed it or replaced its
    /// folder.
    fn store(&mut self, content: &[u8]) -> Result<(), FileError> {
        let written = self.file.write_all_at(content, 0).and_then(|()| self.file.sync_data());
        let own = written.and_then(|()| self.file.metadata()).map_err(FileError::on(&self.path))?;
        let is_found = metadata(&self.path).is_ok_and(|it| (it.dev(), it.ino()) == (own.dev(), own.ino()));
        if !is_found {
            self.file = create(&self.path, content)?;
        }
        Ok(())
    }
}

/// Creates the file with a content, durably.
fn create(path: &Path, content: &[u8]) -> Result<File, FileError> {
    write_whole(path, content)?;
    File::options().write(true).open(path).map_err(FileError::on(path))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::thread::{scope, yield_now};

    use tempfile::TempDir;

    use super::*;

    const EMERGENCY: (State, DiagnosticCode) = (State::Fault, DiagnosticCode::EmergencyStop);
    const OFF: (State, DiagnosticCode) = (State::Off, DiagnosticCode::NoMeasurement);

    fn change((state, code): (State, DiagnosticCode)) -> Change {
        Change { state, code, due_ns: 0 }
    }

    fn output((state, code): (State, DiagnosticCode)) -> Output {
        Output { state, diagnostic: code.into(), ..Output::default() }
    }

    /// Whether the next daemon finds the latch set.
    fn is_kept(folder: &TempDir) -> bool {
        EmergencyLatch::open(folder.path()).unwrap().is_set()
    }

    #[test]
    fn an_emergency_stop_lasts_until_the_fault_is_left() {
        let folder = TempDir::new().unwrap();
        let mut latch = EmergencyLatch::open(folder.path()).unwrap();
        for (state, is_set) in [
            ((State::Active, DiagnosticCode::None), false),
            ((State::Fault, DiagnosticCode::MeasurementLost), false),
            (EMERGENCY, true),
            // A later fault does not replace it.
            ((State::Fault, DiagnosticCode::MeasurementLost), true),
            (OFF, false),
            ((State::Off, DiagnosticCode::EmergencyStop), false),
        ] {
            latch.follow(change(state));
            assert_eq!((latch.is_set(), is_kept(&folder)), (is_set, is_set), "{state:?}");
            // The other latch has replaced the file.
            latch.file = File::options().write(true).open(&latch.path).unwrap();
        }
    }

    #[test]
    fn the_file_is_overwritten_in_place() {
        let folder = TempDir::new().unwrap();
        let mut latch = EmergencyLatch::open(folder.path()).unwrap();
        let file =
            || metadata(folder.path().join(FILE)).map(|found| (found.ino(), found.blocks(), found.len()));
        let before = file().unwrap();
        for state in [EMERGENCY, OFF, EMERGENCY] {
            latch.follow(change(state));
            assert_eq!(file().unwrap(), before, "{state:?}");
        }
        assert!(is_kept(&folder));
    }

    #[test]
    fn a_file_that_was_removed_is_written_again() {
        let folder = TempDir::new().unwrap();
        let mut latch = EmergencyLatch::open(folder.path()).unwrap();
        fs::remove_file(&latch.path).unwrap();
        latch.follow(change(EMERGENCY));
        assert!(is_kept(&folder));
    }

    #[test]
    fn a_folder_that_was_replaced_has_the_file_again() {
        let parent = TempDir::new().unwrap();
        let [folder, moved] = ["state", "moved"].map(|name| parent.path().join(name));
        fs::create_dir(&folder).unwrap();
        let mut latch = EmergencyLatch::open(&folder).unwrap();
        fs::rename(&folder, moved).unwrap();
        fs::create_dir(&folder).unwrap();
        latch.follow(change(EMERGENCY));
        assert!(EmergencyLatch::open(&folder).unwrap().is_set());
    }

    #[test]
    fn a_folder_that_is_missing_is_named_with_the_remedy() {
        let parent = TempDir::new().unwrap();
        let folder = parent.path().join("missing");
        let error = EmergencyLatch::open(&folder).unwrap_err().to_string();
        assert!(error.contains(&format!("mkdir -p {}", folder.display())), "{error}");
    }

    #[test]
    fn what_is_not_known_to_be_cleared_is_in_force() {
        let folder = TempDir::new().unwrap();
        assert!(!is_kept(&folder), "nothing is there");
        // Interrupted writes.
        for content in [b"".as_slice(), b"\0\0\0\0", &IN_FORCE[..10], b"emergency stop: cle"] {
            fs::write(folder.path().join(FILE), content).unwrap();
            assert!(is_kept(&folder), "{content:?}");
        }
        fs::write(folder.path().join(FILE), CLEARED).unwrap();
        assert!(!is_kept(&folder));
        assert_eq!(IN_FORCE.len(), CLEARED.len());
    }

    #[test]
    fn its_thread_follows_every_change_but_the_end_of_the_daemon() {
        for (last, is_left) in [(OFF, false), ((State::Off, DiagnosticCode::DaemonEnding), true)] {
            let folder = TempDir::new().unwrap();
            let latch = EmergencyLatch::open(folder.path()).unwrap();
            let path = latch.path.clone();
            let (mut link, changes) = latch_link();
            let stop = AtomicBool::new(false);
            scope(|threads| {
                threads.spawn(|| latch.run(changes, &stop));
                for (state, content) in [(EMERGENCY, IN_FORCE), (OFF, CLEARED), (EMERGENCY, IN_FORCE)] {
                    link.send(&output(state), 0);
                    while read(&path).unwrap() != content {
                        yield_now();
                    }
                }
                link.send(&output(last), 0);
                stop.store(true, Ordering::Relaxed);
            });
            assert_eq!(is_kept(&folder), is_left, "{last:?}");
        }
    }
}
