//! Bring-up: what succeeds, and every error in words.

use hexad_ethercat::al_state::{OP, PRE_OP, SAFE_OP};
use hexad_ethercat::bus::Frames;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::segment::mechanics::Mechanics;
use hexad_ethercat::simulation;

use super::common::*;

/// Errors of a bring-up after an edit of segment and file.
fn errors(edit: impl FnOnce(&mut Segment), file: &str) -> String {
    let frames = Frames::new();
    let mut segment = segment();
    edit(&mut segment);
    let mut bus = bus(&frames, segment);
    let file = hexad_ethercat::drives_file::DrivesFile::parse(file, "test").unwrap();
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
        &["leg 5: drive with serial number 105 instead of 205: measure its offset again"],
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
