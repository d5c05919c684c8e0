//! Clients that may not do what they attempt, and an admitted one that sends what is no setpoint.

use std::time::Duration;

use crate::{CABLE, Cell};

/// Whether a text was logged at all, and at most once in each second that it was caused.
fn check_lines(cell: &Cell, text: &str, longest: Duration) {
    let lines = cell.bridge_lines(text) as u64;
    assert!((1..=longest.as_secs() + 2).contains(&lines), "{text}: {lines} lines\n{}", cell.hosts.ends());
}

#[test]
fn what_is_no_setpoint_is_named_and_does_not_disturb_the_motion() {
    let Some(mut cell) = Cell::open("setpoints") else { return };
    cell.start(CABLE);
    // Its flood must not take the processors from the loop of the same host.
    cell.start_client_with("-o 0", "bad_setpoints", CABLE, "studio");
    if !cell.reaches("bad_setpoints", "end of disturbances") {
        return;
    }
    eprintln!("{}", cell.hosts.log("bad_setpoints"));
    for words in [
        "a number is not finite",
        "it has 30000 bytes instead of 196",
        "its kind is 2",
        "it is later than the stream",
        "its epoch 1 is before that of the source",
        "more than 2000 messages arrive in a second",
    ] {
        check_lines(&cell, words, Duration::from_secs(4));
    }
    // The source was followed all the time; in a flood its own messages may be late, before the flood is counted.
    let log = cell.hosts.log("bridge");
    let (before_flood, _) = log.rsplit_once("its epoch 1").unwrap();
    assert!(!before_flood.contains("has ended"), "{log}");
}

#[test]
fn a_certificate_permits_what_the_file_says_and_no_other_connects() {
    let Some(mut cell) = Cell::open("certificates") else { return };
    cell.start(CABLE);
    cell.start_client("follows", CABLE, "studio");
    if !cell.reaches("follows", "began") {
        return;
    }
    // Read and stop, with the key of another one.
    cell.start_client("denied", CABLE, "panel");
    if !cell.reaches("denied", "end of denied") {
        return;
    }
    check_lines(&cell, "panel: Put (ingress)", Duration::from_secs(4));
    check_lines(&cell, "panel: Query (ingress)", Duration::from_secs(4));
    // Of the authority, but not in the file; of another authority, with the name of the source; without a certificate.
    for who in ["stranger", "studio forged"] {
        cell.start_client("refused", CABLE, who);
        if !cell.reaches("refused", "end of refused") {
            return;
        }
        eprintln!("{who}\n{}", cell.hosts.log("refused"));
        assert_eq!(cell.hosts.log("refused").contains("has no rights"), who == "stranger");
    }
    check_lines(&cell, "the file names no client with this certificate", Duration::from_secs(8));
    check_lines(&cell, "the remote side is not admitted", Duration::from_secs(38));
    assert_eq!(cell.bridge_lines("has ended"), 0, "{}", cell.hosts.ends());
}
