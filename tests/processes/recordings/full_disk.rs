//! A disk that is full for a while interrupts the recording: it goes on in a new file, and no cycle is lost.

use std::fs::{self, File};
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::process::{self, Command};

use hexad::daemon::report::Report;

use super::{about, arguments, read, replays_exactly};
use crate::support::children::{Hexad, hexad};
use crate::support::machine::Machine;
use crate::support::socket::status;
use crate::support::trio::start_plant;
use hexad_support::not_run::lacking;

/// A file system of 40 MiB, most of it taken, for the command that follows the folder. Nobody else sees it.
const ON_SMALL_DISK: &str =
    "mount -t tmpfs -o size=40m none \"$0\" && head -c 38797312 /dev/zero > \"$0\"/ballast && exec \"$@\"";

/// `unshare` with what this user needs to mount; `None` where that is not possible.
fn unshare() -> Option<Vec<&'static str>> {
    let ways = [vec!["--mount"], vec!["--user", "--map-root-user", "--mount"]];
    ways.into_iter().find(|options| {
        let trial = ["sh", "-c", "mount -t tmpfs none /mnt"];
        let ended = Command::new("unshare").args(options).args(trial).output();
        ended.is_ok_and(|ended| ended.status.success())
    })
}

/// The recordings in a folder, the oldest first.
fn recordings(folder: &Path) -> Vec<PathBuf> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files.filter(|path| path.extension().is_some_and(|it| it == "mcap")).collect();
    files.sort();
    files
}

#[test]
#[ignore = "second tier: needs root"]
#[apply(beside_others)]
fn a_full_disk_interrupts_the_recording_and_no_cycle_is_lost() {
    let Some(options) = unshare() else {
        lacking("unshare cannot mount a file system");
        return;
    };
    let machine = Machine::patient("recorded-full");
    let record = machine.path("record");
    fs::create_dir(&record).unwrap();
    let plant = start_plant(&machine);
    let mut command = Command::new("unshare");
    command.args(options).args(["sh", "-c", ON_SMALL_DISK]).arg(&record);
    let daemon = hexad();
    command.arg(daemon.get_program()).args(["run", "--config"]).arg(&machine.file).args(arguments(&machine));
    command.envs(daemon.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let mut daemon = Hexad::spawn(&machine, "run", command);
    daemon.says("running");
    // The open folder keeps the file system, also behind the end of the daemon.
    let root = format!("/proc/{}/root{}", daemon.id(), record.display());
    let disk = File::open(root).unwrap();
    let disk = PathBuf::from(format!("/proc/{}/fd/{}", process::id(), disk.as_raw_fd()));
    daemon.says("the recording is interrupted: ");
    daemon.must_run();
    // Now there is no room for a head either. An open file would keep its room.
    let mut ballast = File::options().append(true).open(disk.join("ballast")).unwrap();
    io::copy(&mut io::repeat(0), &mut ballast).unwrap_err();
    drop(ballast);
    let before = recordings(&disk);
    let warnings = || status(&machine)["status"]["warnings"].to_string();
    let begin = format!("[\"the recording in {} has been interrupted for ", record.display());
    let lasted_s = || warnings().strip_prefix(&begin)?.split_once(" s, with 0.0 MiB free: ")?.0.parse().ok();
    daemon.waits(
        || lasted_s().is_some_and(|lasted_s: u32| lasted_s >= 7),
        "warn of 7 s, in which it has retried",
    );
    // Another one may be about to be removed.
    assert!(recordings(&disk).len() <= before.len() + 1, "{:?}", recordings(&disk));
    fs::remove_file(disk.join("ballast")).unwrap();
    daemon.says(" s nothing was written unwritten=0");
    assert_eq!(warnings(), "[]");
    let said = daemon.stops();
    plant.stops();
    assert_eq!(said.matches("the recording is interrupted: ").count(), 1, "{said}");
    assert!(said.contains("the recording goes on in "), "{said}");
    assert!(said.contains("No space left on device") && said.contains("once there is room"), "{said}");

    let after = recordings(&disk);
    assert!(after.len() > before.len(), "{after:?}");
    let mut next = 1;
    for file in &after {
        if about(&machine, "recover", file, &[]).stdout.contains(": it is complete") {
            assert_eq!(Some(file), after.last(), "only the last is whole");
        }
        replays_exactly(&machine, file);
        let (_, cycles) = read(file);
        assert!(cycles[0].cycle <= next, "cycles from {next} to {} are missing", cycles[0].cycle);
        assert!(cycles.windows(2).all(|two| two[0].cycle + 1 == two[1].cycle), "{}", file.display());
        next = next.max(cycles[cycles.len() - 1].cycle + 1);
    }
    let report = Report::read(&machine.path("report.json")).unwrap();
    assert_eq!((report.recording.missing, report.cycles + 1), (0, next));
}
