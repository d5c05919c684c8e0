//! Participants that are killed while they join, while they run and between: the daemon removes what they leave.

use std::collections::BTreeSet;
use std::fs::{self, File, read_dir};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::children::HANG;
use crate::support::host::{Host, OPERATOR};
use crate::support::machine::Machine;
use hexad_support::certificate::Certificate;

/// Delays of the kills: before a participant joins, until it publishes.
const FIRST_MS: u64 = 10;
const STEP_MS: u64 = 7;
const DELAYS: u64 = 23;

/// Each delay with each of two participants.
const KILLS: u64 = 2 * DELAYS;
const LONG_KILLS: u64 = 1000;

/// Segments of shared memory, and book-keeping of a folder.
fn entries(folder: &Path, segments: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in read_dir(next).into_iter().flatten().flatten() {
            folders.extend(entry.path().is_dir().then(|| entry.path()));
            found.insert(entry.path());
        }
    }
    found.extend(read_dir(segments).expect("shared memory").flatten().map(|entry| entry.path()));
    found
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn certificate_killed_participants_leave_nothing() {
    let certificate = Certificate::new("killed participants", KILLS, LONG_KILLS);
    let machine = Machine::patient("remains");
    // Shared memory of their own: the other tests have participants, too.
    let Some(host) = Host::start(machine) else { return };
    let command = |arguments: &[&str]| {
        let mut command = host.hexad(OPERATOR, &[], arguments);
        command.args(["--config", "/run/test/machine.toml"]);
        command
    };
    let daemon = host.daemon(OPERATOR, &[], None);
    let folder = host.path(&format!("/tmp/hexad-{OPERATOR}"));
    let segments = host.path("/dev/shm");
    let entries = || entries(&folder, &segments);
    let before = entries();
    let log = host.machine().path("killed.txt");
    for k in 0..certificate.total() {
        let arguments: &[&str] = if k % 2 == 0 { &["plant"] } else { &["move", "--motion", "settle"] };
        kill_after(command(arguments), &log, Duration::from_millis(FIRST_MS + STEP_MS * (k % DELAYS)));
        certificate.advance(1);
    }
    let began = Instant::now();
    let left = loop {
        let left: Vec<_> = entries().difference(&before).cloned().collect();
        if left.is_empty() || began.elapsed() > HANG {
            break left;
        }
        sleep(Duration::from_millis(100));
    };
    daemon.stops();
    assert!(left.is_empty(), "{left:#?}\n{}", fs::read_to_string(&log).unwrap_or_default());
    let kills = certificate.total();
    certificate.finish(format_args!("{kills} kills, nothing left in shared memory"));
}

fn kill_after(mut command: Command, log: &Path, delay: Duration) {
    let log = File::options().create(true).append(true).open(log).expect("a file");
    let mut child = command.stdout(Stdio::null()).stderr(log).spawn().expect("hexad");
    sleep(delay);
    // It may have ended by itself.
    let _ = child.kill();
    child.wait().expect("its end");
}
