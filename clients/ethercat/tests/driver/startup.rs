//! Bring-up: what succeeds, and every error in words.

use hexad_ethercat::al_state::{OP, PRE_OP, SAFE_OP};
use hexad_ethercat::bus::Frames;
use hexad_ethercat::drives_file::DrivesFile;
use hexad_ethercat::identity::Identity;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::segment::device::{Device, DeviceModel};
use hexad_ethercat::segment::mechanics::Mechanics;
use hexad_ethercat::simulation;

use super::common::*;

/// Errors of a bring-up after an edit of segment and file.
fn errors(edit: impl FnOnce(&mut Segment), file: &str) -> String {
    let frames = Frames::new();
    let mut segment = segment();
    edit(&mut segment);
    let mut bus = bus(&frames, segment);
    let file = DrivesFile::parse(file, "test").unwrap();
    up(&mut bus, &file).map(|_| ()).map_or_else(|errors| errors.to_string(), |()| String::new())
}

#[test]
fn six_drives_reach_op_and_the_grid_follows_their_clock() {
    let frames = Frames::new();
    let mut bus = bus(&frames, segment());
    let (devices, clock) = up(&mut bus, &drives()).unwrap();
    assert_eq!(devices.len(), 6);
    let segment = &bus.wire.link.segment;
    assert!(segment.devices.iter().all(|device| device.al_status() == OP), "OP");
    let now_ns = hexad_ethercat::link::Link::now_ns(&bus.wire.link);
    let next_ns = segment.devices[0].due_ns(now_ns);
    let error_ns = next_ns as i64 - clock.next_sync0_ns() as i64;
    assert!(error_ns.abs() < 2_000, "{error_ns} ns from SYNC0 of the reference clock");
}

#[test]
fn the_drives_agree_about_sync0() {
    let frames = Frames::new();
    let mut bus = bus(&frames, segment());
    up(&mut bus, &drives()).unwrap();
    let now_ns = hexad_ethercat::link::Link::now_ns(&bus.wire.link);
    let due: Vec<u64> = bus.wire.link.segment.devices.iter().map(|device| device.due_ns(now_ns)).collect();
    let spread_ns = due.iter().max().unwrap() - due.iter().min().unwrap();
    assert!(spread_ns < 2_000, "{spread_ns} ns");
}

type Row = (&'static str, fn(&mut Segment), &'static str, &'static str, &'static [&'static str]);

fn set_serial(segment: &mut Segment, position: usize, serial: u32) {
    let device = &mut segment.devices[position];
    let identity = Identity { serial, ..device.model.identity };
    *device = Device::new(DeviceModel { identity, ..device.model }, 0);
}

fn exchange_drives_without_serials(segment: &mut Segment) {
    (0..6).for_each(|position| set_serial(segment, position, 0));
    segment.devices.swap(0, 1);
    segment.leg_of_device.swap(0, 1);
}

/// Drives 1 and 2 exchange their cables: motor and encoder together, so that no reading shows it.
#[test]
fn drives_without_a_serial_number_reach_op_only_where_the_file_accepts_it() {
    let file = without_serials();
    let found = errors(exchange_drives_without_serials, &file);
    for leg in 1..=6 {
        let words =
            format!("leg {leg}: its drive has no serial number (0): exchanged cables or a replaced drive");
        assert!(found.contains(&words) && found.contains("identity = \"position\""), "{words:?}: {found}");
    }
    let parsed = |text: &str| DrivesFile::parse(text, "test").unwrap();
    assert_eq!(
        parsed(&file).unchecked_directions(),
        parsed(&file).unidentified(),
        "jogged_serial = 0 is none"
    );
    // Accepted: they start, and each start warns.
    assert_eq!(errors(exchange_drives_without_serials, &by_position()), "");
    let accepted = parsed(&by_position());
    assert_eq!(accepted.unchecked_directions(), [""; 0]);
    let warning = &accepted.warnings()[0];
    assert!(warning.contains("legs 1, 2, 3, 4, 5, 6 are known by their position alone"), "{warning}");
    assert!(warning.contains("exchanged cables or a replaced drive are not noticed"), "{warning}");
    // The direction has to be jogged all the same, at this position.
    for record in ["", "jogged_serial = 0", "jogged_position = 3"] {
        let found = parsed(&by_position().replace("jogged_position = 2", record)).unchecked_directions();
        assert_eq!(
            found,
            ["leg 2: its direction was not checked with the drive at position 2: jog"],
            "{record}"
        );
    }
    // A drive of another product, or with a number, is refused all the same.
    let numbered = errors(
        |segment| {
            exchange_drives_without_serials(segment);
            set_serial(segment, 3, 7)
        },
        &by_position(),
    );
    assert!(
        numbered.contains("leg 4: drive with serial number 7 instead of no serial number (0)"),
        "{numbered}"
    );
    let unneeded = parsed(&DRIVES.replace("[drive]", "[drive]\nidentity = \"position\"")).unidentified();
    assert_eq!(unneeded[5], "leg 6: serial = 106 identifies its drive: remove identity = \"position\"");
}

#[test]
fn a_scan_of_drives_without_serial_numbers_names_the_remedies_and_takes_none() {
    let frames = Frames::new();
    let mut bus = bus(
        &frames,
        simulation::segment(&DrivesFile::parse(&without_serials(), "test").unwrap(), &machine(), START_NS),
    );
    let devices = hexad_ethercat::startup::find(&mut bus).unwrap();
    let scanned = hexad_ethercat::scan::drives_file(&mut bus, &devices, "motion_base", "ec0");
    let comment = "# its drive has no serial number (0): exchanged cables or a replaced drive would not be noticed; give it a number";
    assert_eq!(scanned.matches(comment).count(), 6, "{scanned}");
    assert!(!scanned.lines().any(|line| line.starts_with("identity")), "{scanned}");
}

/// Situation, edits of segment and file, and the words that each error contains.
const ROWS: &[Row] = &[
    ("no devices", |s| s.reachable = 0, "", "", &["no device answers: look at cable and power"]),
    (
        "cut",
        |s| s.reachable = 4,
        "",
        "",
        &["4 of 6 drives on the bus", "leg 5: no device at position 5", "leg 6: no device at position 6"],
    ),
    (
        "exchanged legs",
        |s| s.devices.swap(1, 2),
        "",
        "",
        &[
            "leg 2: its drive, serial number 102, is at position 3: cables exchanged?",
            "leg 3: its drive, serial number 103, is at position 2: cables exchanged?",
        ],
    ),
    (
        "another drive",
        |_| {},
        "\nserial = 105",
        "\nserial = 205",
        &[
            "leg 5: drive with serial number 105 instead of serial number 205: measure its offset again (zero), then jog",
        ],
    ),
    (
        "a number in the file, none in the drive",
        |s| set_serial(s, 4, 0),
        "",
        "",
        &["leg 5: drive with no serial number (0) instead of serial number 105: measure"],
    ),
    (
        "a number in the drive, none in the file",
        |_| {},
        "\nserial = 105",
        "\nserial = 0",
        &["leg 5: drive with serial number 105 instead of no serial number (0): measure"],
    ),
    (
        "one number in two drives",
        |s| set_serial(s, 4, 104),
        "\nserial = 105",
        "\nserial = 104",
        &[
            "leg 4: its drive has serial number 104, as 2 drives have: exchanged cables",
            "leg 5: its drive has",
        ],
    ),
    (
        "another product",
        |_| {},
        "product = 0x4020001",
        "product = 7",
        &["leg 1: vendor 0xb95, product 0x4020001 instead of vendor 0xb95, product 0x7", "leg 6: "],
    ),
    (
        "no torque mode",
        |s| s.devices[2].objects.set(0x6502, 0x180),
        "",
        "",
        &["leg 3: has no cyclic synchronous torque"],
    ),
    ("no object", |s| s.devices[0].objects.remove(0x6071), "", "", &["leg 1: object 0x6071:0: "]),
    (
        "another motor",
        |s| s.devices[5].objects.set(0x6076, 12_000),
        "",
        "",
        &["leg 6: rated torque 12 N m (0x6076), the file has 24"],
    ),
    (
        "weak drive",
        |s| s.devices[5].objects.set(0x6072, 1500),
        "",
        "",
        &["max_torque_permille = 3000 exceeds"],
    ),
    (
        "no watchdog",
        |s| s.devices[0].is_watchdog_fixed = true,
        "",
        "",
        &["leg 1: the watchdog is 1000 units of divider 2498, must be 200 of 2498"],
    ),
    (
        "no PRE-OP",
        |s| s.devices[3].refusal = Some((PRE_OP, 0x16)),
        "",
        "",
        &["position 4: AL status code 0x0016"],
    ),
    (
        "no SAFE-OP",
        |s| s.devices[1].refusal = Some((SAFE_OP, 0x1e)),
        "",
        "",
        &[
            "do not reach SAFE-OP: the device at position 2: AL status code 0x001e: Invalid Input Configuration",
        ],
    ),
    (
        "no OP",
        |s| s.devices[4].refusal = Some((OP, 0x32)),
        "",
        "",
        &["do not reach OP: the device at position 5: AL status code 0x0032: PLL Error"],
    ),
];
#[test]
fn every_error_of_the_start_is_in_words() {
    for (name, edit, from, to, words) in ROWS {
        let found = errors(edit, &DRIVES.replace(from, to));
        for expected in *words {
            assert!(found.contains(expected), "{name}: {expected:?} is not in {found:?}");
        }
    }
}

#[test]
fn an_emergency_at_the_start_does_no_harm() {
    let found = errors(|segment| segment.devices[2].emergency = Some(0x8130), DRIVES);
    assert_eq!(found, "");
}

#[test]
fn the_watchdog_of_each_drive_is_that_of_the_file() {
    let frames = Frames::new();
    let mut bus = bus(&frames, segment());
    up(&mut bus, &drives()).unwrap();
    for device in &bus.wire.link.segment.devices {
        assert_eq!(device.watchdog_ns(), 20_000_000);
    }
}

#[test]
fn uncoupled_legs_start_as_well() {
    let frames = Frames::new();
    let mut bus = bus(&frames, simulation::uncoupled_segment(&drives(), 1.7, START_NS));
    up(&mut bus, &drives()).unwrap();
    assert!(matches!(bus.wire.link.segment.mechanics, Mechanics::Uncoupled { .. }));
}
