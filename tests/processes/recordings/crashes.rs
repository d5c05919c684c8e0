//! A daemon that is killed, and disks that are full: what is complete in a file is recovered.

use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::{about, arguments, files, read, replays_exactly, start_recording};
use crate::support::children::{Ended, HANG, Hexad};
use crate::support::machine::Machine;
use crate::support::random::Random;
use crate::support::trio::start_plant;
use hexad_support::certificate::Certificate;

const KILLS: u64 = 12;
const LONG_KILLS: u64 = 500;

/// Numbers in the records of MCAP.
const CHUNK: u8 = 6;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;

/// The records in bytes, as far as they are complete: number and content.
fn records(mut bytes: &[u8]) -> Vec<(u8, &[u8])> {
    let mut found = vec![];
    while let Some(((kind, length), rest)) = head(bytes) {
        let Some((content, rest)) = rest.split_at_checked(length) else { break };
        found.push((kind, content));
        bytes = rest;
    }
    found
}

fn head(bytes: &[u8]) -> Option<((u8, usize), &[u8])> {
    let (kind, rest) = bytes.split_first()?;
    let (length, rest) = rest.split_first_chunk()?;
    Some(((*kind, u64::from_le_bytes(*length) as usize), rest))
}

/// Cycles in the complete chunks of a file, counted without the reader under test.
fn complete_cycles(path: &Path) -> u64 {
    let bytes = fs::read(path).unwrap();
    let (mut channel, mut cycles) = (None, 0);
    for (_, chunk) in
        records(bytes.get(8..).unwrap_or_default()).into_iter().filter(|(kind, _)| *kind == CHUNK)
    {
        // Times, size and checksum; an empty name of a compression; a length.
        for (kind, content) in records(&chunk[8 + 8 + 8 + 4 + 4 + 8..]) {
            let number = u16::from_le_bytes([content[0], content[1]]);
            if kind == CHANNEL && content[8..].starts_with(b"/hexad/cycle") {
                channel = Some(number);
            }
            cycles += u64::from(kind == MESSAGE && Some(number) == channel);
        }
    }
    cycles
}

/// Whether there was anything to recover.
fn is_recovered(machine: &Machine, file: &Path) -> bool {
    let complete = complete_cycles(file);
    let Ended { status, stdout, stderr } = about(machine, "recover", file, &[]);
    if complete == 0 && status.code() == Some(2) {
        assert!(stderr.contains("nothing can be recovered"), "{stderr}");
        return false;
    }
    assert_eq!(status.code(), Some(0), "{stderr}");
    assert!(stdout.contains(" cycles, "), "{stdout}");
    replays_exactly(machine, file);
    let (summary, _) = read(file);
    assert!(summary.cycles >= complete, "{} of {complete} cycles", summary.cycles);
    assert_eq!(complete_cycles(file), summary.cycles);
    let again = about(machine, "recover", file, &[]);
    assert!(again.stdout.ends_with(": it is complete\n"), "{}", again.stdout);
    true
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn certificate_what_a_killed_daemon_has_recorded_is_recovered() {
    let certificate = Certificate::new("recordings of killed daemons", KILLS, LONG_KILLS);
    let kills = certificate.total();
    let machine = Machine::patient("recorded-killed");
    let _plant = start_plant(&machine);
    let mut random = Random::new(certificate.seed());
    let mut recovered = 0;
    for _ in 0..kills {
        let mut daemon = start_recording(&machine);
        daemon.says("running");
        sleep(Duration::from_millis(random.below(1500)));
        daemon.kill();
        for file in files(&machine, "record") {
            recovered += u64::from(is_recovered(&machine, &file));
            fs::remove_file(file).unwrap();
        }
        certificate.advance(1);
    }
    assert!(recovered * 2 > kills, "{recovered} of {kills}");
    certificate.finish(format_args!(
        "{recovered} of {kills} recovered and replayed, the others were killed before the first chunk"
    ));
}

/// A crash of the host leaves a file of any length, also an empty one.
#[test]
#[apply(beside_others)]
fn a_recording_that_was_cut_anywhere_is_recovered_or_refused() {
    let machine = Machine::patient("recorded-cut");
    let plant = start_plant(&machine);
    let daemon = start_recording(&machine);
    sleep(Duration::from_millis(1500));
    for process in [daemon, plant] {
        process.stops();
    }
    let whole = fs::read(&files(&machine, "record")[0]).unwrap();
    let cut = machine.path("cut.mcap");
    let mut random = Random::new(1);
    let lengths =
        [0, 1, 7, 8, 9].into_iter().chain((0..12).map(|_| random.below(whole.len() as u64) as usize));
    // The last ones end within what repeats the rest.
    let lengths = lengths.chain([8, 100].map(|missing| whole.len() - missing));
    let mut recovered = 0;
    for length in lengths {
        fs::write(&cut, &whole[..length]).unwrap();
        recovered += u64::from(is_recovered(&machine, &cut));
    }
    assert!((3..=14).contains(&recovered), "{recovered}");
}

#[test]
#[apply(beside_others)]
fn the_size_of_recordings_is_bounded_over_all_runs() {
    let machine = Machine::patient("recorded-bounded");
    let plant = start_plant(&machine);
    for _ in 0..2 {
        let bounds = ["--record-file-mib", "1", "--record-total-mib", "3"].map(Into::into);
        let daemon = Hexad::start(&machine, "run", &[arguments(&machine), bounds.into()].concat());
        daemon.says("the recordings exceed 3 MiB: ");
        // Also its own first file is deleted.
        let began = Instant::now();
        while files(&machine, "record").iter().any(|file| file.to_string_lossy().ends_with(".001.mcap")) {
            assert!(began.elapsed() < HANG, "its first file stays");
            sleep(Duration::from_millis(20));
        }
        daemon.stops();
    }
    plant.stops();
    let left = files(&machine, "record");
    let bytes: u64 = left.iter().map(|file| fs::metadata(file).unwrap().len()).sum();
    // A file ends with its second, which is up to 1.4 MiB more.
    assert!(bytes < 5 << 20, "{bytes} in {left:?}");
    for file in &left {
        assert!(read(file).1[0].cycle > 1, "the first files were deleted: {left:?}");
        replays_exactly(&machine, file);
    }
}
