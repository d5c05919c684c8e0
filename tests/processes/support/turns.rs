//! Tests that measure run alone, and those of two clones on one host one after the other: they use the same processors, ports and
//! names. What fails while the host has taken a processor away is done once more: motions in true time need all of them. A fault of
//! ours shows again without the host.

use std::fs::{File, read_to_string};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{OnceLock, PoisonError, RwLock};
use std::time::Duration;

use hexad_support::stalls::Watchdog;

/// Who waits for it to write comes before who reads later.
static TURN: RwLock<()> = RwLock::new(());

/// Taken with the first turn of this process, and held until it ends.
static HOST: OnceLock<File> = OnceLock::new();

/// Shorter pauses of the host no test may mind.
const PAUSE: Duration = Duration::from_millis(50);

/// Time for which somebody has waited for a disk, of which the kernel has a count (`/proc/pressure/io`): processes that touch files,
/// or whose pages were dropped, stand still meanwhile.
const DISK_WAIT: Duration = Duration::from_millis(300);

/// So often a test that the host has disturbed is done.
const ATTEMPTS: usize = 4;

fn wait_for_other_processes() {
    HOST.get_or_init(|| {
        let path = std::env::temp_dir().join("hexad-processes.lock");
        // One that another user has made is only to be read.
        let file = File::open(&path).or_else(|_| File::create(&path));
        let file = file.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        file.lock().expect("the lock of the tests");
        file
    });
}

/// A test that runs alone.
macro_rules! alone {
    ($(#[$meta:meta])* fn $name:ident($($parameter:ident: $kind:ty),*) $body:block) => {
        $(#[$meta])*
        fn $name($($parameter: $kind),*) {
            $crate::support::turns::alone(|| $body);
        }
    };
}

/// A test that runs beside others that do not measure.
macro_rules! beside_others {
    ($(#[$meta:meta])* fn $name:ident($($parameter:ident: $kind:ty),*) $body:block) => {
        $(#[$meta])*
        fn $name($($parameter: $kind),*) {
            $crate::support::turns::beside_others(|| $body);
        }
    };
}

pub fn alone(test: impl Fn()) {
    wait_for_other_processes();
    let _turn = TURN.write().unwrap_or_else(PoisonError::into_inner);
    unless_the_host_pauses(&test);
}

pub fn beside_others(test: impl Fn()) {
    wait_for_other_processes();
    let _turn = TURN.read().unwrap_or_else(PoisonError::into_inner);
    unless_the_host_pauses(&test);
}

fn unless_the_host_pauses(test: &dyn Fn()) {
    for _ in 1..ATTEMPTS {
        let (host, before) = (Watchdog::start_ordinary(), waited_for_disks());
        let Err(failure) = catch_unwind(AssertUnwindSafe(test)) else { return };
        let (pause, disk) = (host.largest(), waited_for_disks().saturating_sub(before));
        if pause < PAUSE && disk < DISK_WAIT {
            resume_unwind(failure);
        }
        eprintln!("the host was away for {pause:?}, and its disks for {disk:?}: once more");
    }
    test();
}

/// Since the host began; zero where the kernel does not count it.
fn waited_for_disks() -> Duration {
    let text = read_to_string("/proc/pressure/io").unwrap_or_default();
    let total = text.lines().next().and_then(|line| line.rsplit_once("total="));
    Duration::from_micros(total.and_then(|(_, total)| total.parse().ok()).unwrap_or(0))
}
