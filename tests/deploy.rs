//! The systemd units, judged by systemd itself. `tests/boot` shows what they do.

#![allow(clippy::expect_used, reason = "a test helper that fails is a failed test")]

use std::fs;
use std::process::Command;

const UNITS: [&str; 3] = [
    concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/hexad@.service"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/hexad-driver@.service"),
    concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/hexad-zenoh@.service"),
];

/// Standard output and standard error of `systemd-analyze` with these arguments, and its exit code; none where it is
/// not installed.
fn systemd_analyze(arguments: &[&str]) -> Option<(String, Option<i32>)> {
    let output = match Command::new("systemd-analyze").args(arguments).output() {
        Ok(output) => output,
        Err(error) => {
            hexad_support::not_run::lacking(&format!("systemd-analyze: {error}; apt-get install systemd"));
            return None;
        }
    };
    let text = [output.stdout, output.stderr].concat();
    Some((String::from_utf8_lossy(&text).into_owned(), output.status.code()))
}

#[test]
#[ignore = "second tier: needs systemd"]
fn verify_prints_nothing() {
    // It returns 0 for some mistakes, such as a misspelt Type, but never silently.
    let [daemon, driver, bridge] = UNITS;
    let Some((text, code)) = systemd_analyze(&["verify", daemon, driver, bridge]) else { return };
    assert_eq!(text, "");
    assert_eq!(code, Some(0));
}

#[test]
#[ignore = "second tier: needs systemd"]
fn the_sandbox_is_tight() {
    // Exposure in tenths, 0 is best. What keeps it from zero are shared memory and real time themselves; a driver needs more
    // of the host, and a bridge a network.
    for (unit, threshold) in UNITS.into_iter().zip(["--threshold=12", "--threshold=16", "--threshold=23"]) {
        let Some((text, code)) = systemd_analyze(&["security", "--offline=true", threshold, unit]) else {
            return;
        };
        assert_eq!(code, Some(0), "{text}");
    }
}

/// The unit of a driver with the drop-in for drives on EtherCAT.
#[test]
#[ignore = "second tier: needs systemd"]
fn the_unit_of_an_ethercat_driver_needs_little_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let drop_in = folder.path().join("hexad-driver@.service.d");
    fs::create_dir(&drop_in).expect("a folder");
    let unit = folder.path().join("hexad-driver@.service");
    fs::copy(UNITS[1], &unit).expect("a copy");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/ethercat.conf");
    fs::copy(source, drop_in.join("ethercat.conf")).expect("a copy");
    let unit = unit.to_str().expect("a path");
    let Some((text, code)) = systemd_analyze(&["verify", unit]) else { return };
    assert_eq!((text.as_str(), code), ("", Some(0)));
    let Some((text, code)) = systemd_analyze(&["security", "--offline=true", "--threshold=21", unit]) else {
        return;
    };
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("✗ RestrictAddressFamilies=~AF_PACKET"), "the drop-in counts: {text}");
}
