//! Confirmation that each leg moves by its own number: a file in the state directory with what a person has seen.
//!
//! Legs that are exchanged as a whole, lengths and drives, measure and move like those of a machine without error. So `hexad confirm-legs`
//! moves one leg after the other, and a person names the one that moves. It counts for one geometry: with other joints in the machine
//! file it must be done again.

use std::fs::read;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;

use serde::{Deserialize, Serialize};
use sha1_smol::Sha1;
use tracing::{error, info};

use hexad_core::model::LEGS;
use hexad_machine::config::Config;
use hexad_machine::log::utc_now;
use hexad_machine::text::files::{FileError, write_json};

/// Name of the file in the state directory.
const FILE: &str = "confirmed-legs.json";

/// Each leg is the one of its number.
pub const IN_ORDER: [u32; LEGS] = [1, 2, 3, 4, 5, 6];

/// The confirmation, in memory and in its file.
#[derive(Debug)]
pub struct LegConfirmation {
    path: PathBuf,
    seen: Mutex<Option<SeenLegs>>,
}

/// What a person has seen.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct SeenLegs {
    /// [`geometry_sha1`] of the machine.
    geometry_sha1: String,
    /// The leg that moved, for each number, from 1.
    legs: [u32; LEGS],
    /// UTC, ISO 8601.
    time: String,
}

/// SHA-1 of what the numbers of the legs mean: the name of the machine, and the joint centres.
pub fn geometry_sha1(config: &Config) -> String {
    let joints = &config.machine.joints;
    let mut sha1 = Sha1::from(&config.name);
    for joint in [&joints.base, &joints.platform].into_iter().flat_map(|it| joints.triples.unpack_vectors(it))
    {
        joint.iter().for_each(|coordinate| sha1.update(&coordinate.to_le_bytes()));
    }
    sha1.hexdigest()
}

impl LegConfirmation {
    /// Confirmation in a folder. A file that cannot be understood counts as none.
    pub fn open(folder: &Path) -> Result<Arc<Self>, FileError> {
        let path = folder.join(FILE);
        let seen = match read(&path) {
            Ok(content) => serde_json::from_slice(&content).ok(),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(FileError::on(&path)(error)),
        };
        Ok(Arc::new(Self { path, seen: Mutex::new(seen) }))
    }

    /// Why the legs of a machine are not confirmed, with the remedy; `None` if they are.
    pub fn warning(&self, config: &Config) -> Option<String> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let reason = match seen {
            Some(SeenLegs { geometry_sha1: sha1, time, .. }) if sha1 != geometry_sha1(config) => {
                format!("the legs were confirmed at {time} with other joints in the machine file")
            }
            Some(SeenLegs { legs: IN_ORDER, .. }) => return None,
            Some(SeenLegs { legs, time, .. }) => {
                format!("at {time} the legs {legs:?} were seen to move by the numbers 1 to 6: some are exchanged")
            }
            None => "nobody has confirmed that each leg moves by its own number; exchanged legs look like correct ones".into(),
        };
        Some(format!("{reason}: hexad confirm-legs"))
    }

    /// Keeps what a person has seen. Another thread writes the file, because the caller serves stops.
    pub fn store(self: &Arc<Self>, config: &Config, legs: [u32; LEGS]) -> Receiver<Result<String, String>> {
        let (this, (sender, receiver)) = (self.clone(), channel());
        let failed = sender.clone();
        let seen = SeenLegs { geometry_sha1: geometry_sha1(config), legs, time: utc_now() };
        let write = move || {
            let written = write_json(&this.path, &seen);
            *this.seen.lock().unwrap_or_else(PoisonError::into_inner) = Some(seen);
            match &written {
                Ok(()) => {
                    info!(?legs, "legs seen to move by the numbers 1 to 6, kept in {}", this.path.display())
                }
                Err(cause) => {
                    error!(?legs, "legs seen to move by the numbers 1 to 6 are forgotten at the end: {cause}")
                }
            }
            let kept = written.map(|()| format!("kept in {}", this.path.display()));
            let _ = sender.send(kept.map_err(|error| error.to_string()));
        };
        if let Err(error) = Builder::new().name("hexad-legs".into()).spawn(write) {
            let _ = failed.send(Err(format!("no thread can write the file: {error}")));
        }
        receiver
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn only_legs_in_order_of_this_geometry_are_confirmed_and_it_outlives_the_daemon() {
        let text = include_str!("../../config/fried2008.toml");
        let config = |text: &str| Config::parse(text, "a test").unwrap();
        let (this, folder) = (config(text), TempDir::new().unwrap());
        let mut moved = this.clone();
        moved.machine.joints.platform[0] = moved.machine.joints.platform[1];
        let renamed = config(&text.replace("\"fried2008\"", "\"other\""));
        let heavier = config(&text.replacen("mass_kg = ", "mass_kg = 1", 1));
        let warning = |config: &Config| LegConfirmation::open(folder.path()).unwrap().warning(config);
        assert!(warning(&this).unwrap().starts_with("nobody has confirmed"));
        for (legs, words) in [(IN_ORDER, None), ([2, 1, 3, 4, 5, 6], Some("[2, 1, 3, 4, 5, 6] were seen"))] {
            let confirmation = LegConfirmation::open(folder.path()).unwrap();
            let answer = confirmation.store(&this, legs).recv().unwrap().unwrap();
            assert!(answer.starts_with("kept in /"), "{answer}");
            for found in [confirmation.warning(&this), warning(&this), warning(&heavier)] {
                assert!(words.map_or(found.is_none(), |words| found.unwrap().contains(words)), "{legs:?}");
            }
            for other in [&moved, &renamed] {
                assert!(
                    warning(other).unwrap().ends_with("other joints in the machine file: hexad confirm-legs")
                );
            }
        }
        std::fs::write(folder.path().join(FILE), "{").unwrap();
        assert!(warning(&this).unwrap().starts_with("nobody has confirmed"), "half a file");
        std::fs::remove_dir_all(folder.path()).unwrap();
        let confirmation = LegConfirmation::open(folder.path()).unwrap();
        let error = confirmation.store(&this, IN_ORDER).recv().unwrap().unwrap_err();
        assert!(error.contains(FILE), "{error}");
    }
}
