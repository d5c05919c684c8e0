//! Drives files: errors, what `scan` prints, what a machine file contradicts.

use hexad_ethercat::bus::Frames;
use hexad_ethercat::drives_file::DrivesFile;
use hexad_ethercat::{inventory, machine_check, scan, startup};
use hexad_machine::config::Config;

use super::common::*;

#[test]
fn all_errors_of_a_file_are_reported_at_once() {
    let text = DRIVES
        .replace("interface = \"ec0\"", "interface = \"ec0\"\nperiod_us = 20\nanswer_us = 5000")
        .replace("sign = -1", "sign = 2\nlead_m = 7.0\nposition_bits = 33")
        .replace("\nserial = 104", "\nserial = \"x\"")
        .replace("\nserial = 105", "\nserial = 105\nposition = 1")
        .replace("\nserial = 106", "\nserial = 106\ncolour = 1");
    let errors = DrivesFile::parse(&text, "my.toml").unwrap_err().to_string();
    for expected in [
        "my.toml: period_us = 20: must be in [250, 10000]",
        "my.toml: answer_us = 5000: must be in [50, 10]",
        "my.toml: leg[3].lead_m = 7: must be in [0.0001, 1]",
        "my.toml: leg[3].position_bits = 33: must be in [8, 32]",
        "my.toml: leg[3].sign = 2: must be 1 or -1",
        "my.toml: leg[4].invalid type: string \"x\", expected u32",
        "my.toml: leg[6].unknown field `colour`",
        "is used twice",
    ] {
        assert!(errors.contains(expected), "{expected:?} is not in\n{errors}");
    }
    let errors = DrivesFile::parse("name = \"x\"\ninterface = \"y\"", "my.toml").unwrap_err().to_string();
    assert_eq!(errors, "my.toml: has 0 sections [[leg]], needs 6");
}

#[test]
fn a_scanned_file_is_right_but_for_what_only_the_user_knows() {
    let frames = Frames::new();
    let mut bus = bus(&frames, segment());
    let devices = startup::find(&mut bus).unwrap();
    let scanned = scan::drives_file(&mut bus, &devices, "motion_base", "ec0");
    let errors = DrivesFile::parse(&scanned, "scanned").unwrap_err().to_string();
    assert!(errors.contains("leg[1].missing field"), "{errors}");
    let completed = scanned
        .replace("# lead_m = ?", "lead_m = 0.02")
        .replace("# sign = ?", "sign = 1")
        .replace("# offset_m = ?", "offset_m = 1.2")
        .replace("# brake = ?", "brake = { status_bit = 12 }");
    let file =
        DrivesFile::parse(&completed, "completed").unwrap_or_else(|errors| panic!("{errors}\n{scanned}"));
    assert_eq!(inventory::contradictions(&mut bus, &devices, &file), [""; 0]);
    let known = drives();
    for (leg, known) in file.legs.iter().zip(&known.legs) {
        let numbers = |leg: &hexad_ethercat::drives_file::LegSection| {
            (
                leg.position,
                leg.serial,
                leg.counts_per_rev as u64,
                leg.rated_torque_n_m as u64,
                leg.max_torque_permille,
            )
        };
        assert_eq!(numbers(leg), numbers(known));
    }
}

#[test]
fn objects_are_read_whatever_their_length() {
    let frames = Frames::new();
    let mut bus = bus(&frames, segment());
    let devices = startup::find(&mut bus).unwrap();
    for (index, value) in [(0x6072, 3000), (0x60c2, 1), (0x6076, 24_000), (0x60ff, 0)] {
        let sub = u8::from(index == 0x60c2);
        match bus.objects(&devices, 2).value(index, sub) {
            Ok(found) => assert_eq!(found, value, "{index:#x}"),
            Err(error) => assert!(index == 0x60ff && error.contains("does not exist"), "{index:#x} {error}"),
        }
    }
}

#[test]
fn a_machine_file_that_disagrees_is_refused() {
    assert_eq!(machine_check::contradictions(&drives(), &machine()), [""; 0]);
    let text = machine().text;
    let edits: [(&str, &str, &str); 4] = [
        ("name = \"motion_base\"", "name = \"other\"", "the machine file has \"other\""),
        ("release = \"external\"", "release = \"sleep\"", "needs [realtime] release = \"external\""),
        ("[realtime]", "[realtime]\nrate_hz = 500.0", "period_us = 1000, the daemon's period is 2000 us"),
        (
            "max_force_n = 20000.0",
            "max_force_n = 30000.0",
            "24 N m are 20358 N, less than actuator.max_force_n = 30000",
        ),
    ];
    for (from, to, expected) in edits {
        let machine =
            Config::parse(&text.replace(from, to), "edited").unwrap_or_else(|error| panic!("{error}"));
        let errors = machine_check::contradictions(&drives(), &machine).join("\n");
        assert!(errors.contains(expected), "{expected:?} is not in\n{errors}");
    }
    // 60 revolutions are exactly the stroke of 1.2 m; the tolerance at its ends needs more.
    let short = DRIVES.replace("counts_per_rev = 1048576", "position_bits = 17\ncounts_per_rev = 2184.53333");
    let errors = machine_check::contradictions(&DrivesFile::parse(&short, "f").unwrap(), &machine());
    let expected = "leg[1]: position_bits = 17: the range of the encoder is 1.200 m, must exceed the stroke of 1.200 m by 0.01 m";
    assert_eq!((errors.len(), errors[0].as_str()), (6, expected));
    let lengths = [1.7, 1.09, 2.306, 2.0, 1.2, 1.8].map(Some);
    let errors = machine_check::lengths_outside(lengths, &machine());
    assert_eq!(errors.len(), 2, "{errors:?}");
    assert!(errors[0].starts_with("leg 2: length 1.0900 m is outside of the stroke [1.1, 2.3] m: measure"));
}

#[test]
fn a_direction_counts_for_the_drive_with_which_it_was_checked() {
    assert_eq!(drives().unchecked_directions(), [""; 0]);
    let text =
        DRIVES.replace("jogged_serial = 102\n", "").replace("jogged_serial = 105", "jogged_serial = 104");
    let errors = DrivesFile::parse(&text, "edited").unwrap().unchecked_directions();
    let expected = [2, 5].map(|leg| {
        format!("leg {leg}: its direction was not checked with the drive of serial number {}: jog", 100 + leg)
    });
    assert_eq!(errors, expected);
}
