//! Test of the brakes before they open for the first time.

use hexad_core::model::LEGS;
use hexad_ethercat::brake_test::{self, holding_forces, test_load_n};
use hexad_ethercat::bus::Frames;
use hexad_ethercat::cia402::DriveState;
use hexad_ethercat::drives_file::{DrivesFile, SdoWrite};
use hexad_ethercat::process_data::ProcessData;
use hexad_ethercat::segment::Segment;

use super::common::*;
use super::rig::Rig;

/// Forces on the brakes in their test at home \[N\].
fn test_loads() -> [f64; LEGS] {
    let machine = machine().machine;
    let holding_n = holding_forces(&machine, machine.home_pose()).unwrap();
    holding_n.map(|holding_n| test_load_n(holding_n, machine.actuator.max_force_n))
}

/// Tests the brakes of an edited segment; the result, the segment afterwards, the motion of each leg \[mm\].
fn tested(file: &DrivesFile, edit: impl FnOnce(&mut Segment)) -> (Result<(), String>, Segment, [f64; LEGS]) {
    let frames = Frames::new();
    let mut segment = segment();
    edit(&mut segment);
    let before = segment.mechanics.lengths();
    let mut bus = bus(&frames, segment);
    let held = file.clone().with_brakes_held();
    let (devices, clock) = up(&mut bus, &held).unwrap();
    let machine = machine().machine;
    let middle_m = machine.actuator.min_length_m.midpoint(machine.actuator.max_length_m);
    let mut data = ProcessData::new(file, middle_m, clock);
    let result = brake_test::test(&mut bus, &devices, &mut data, file, &machine, || false);
    let mut segment = bus.wire.link.segment;
    for device in &segment.devices {
        let is_off = matches!(device.drive.state, DriveState::SwitchOnDisabled | DriveState::Fault);
        assert!(is_off && !device.drive.is_brake_open, "{:?}", device.drive);
    }
    let after = segment.mechanics.lengths();
    let mut index = 0..;
    (
        result,
        segment,
        before.map(|before| {
            let leg = index.next().unwrap();
            (after[leg] - before) * 1e3
        }),
    )
}

#[test]
fn a_brake_bears_a_tenth_more_than_its_load_and_never_nothing() {
    for (holding_n, brake_n) in [(3000.0, 3300.0), (-3000.0, 3300.0), (100.0, 500.0), (0.0, 500.0)] {
        assert!((test_load_n(holding_n, 10_000.0) - brake_n).abs() < 1e-9, "{holding_n}");
    }
}

#[test]
fn good_brakes_pass_and_open_afterwards() {
    let file = testable_drives();
    let loads = test_loads();
    // Brakes that hold one per cent more than the test demands, and nothing beyond.
    let (result, segment, ways_mm) = tested(&file, |segment| {
        for (device, load_n) in segment.devices.iter_mut().zip(loads) {
            device.brake_n = 1.01 * load_n;
        }
    });
    assert_eq!((result, ways_mm), (Ok(()), [0.0; LEGS]));
    let frames = Frames::new();
    let mut rig = Rig::new(&frames, &file, segment);
    rig.engage();
    assert_eq!(rig.drive_states(), [DriveState::OperationEnabled; LEGS]);
}

#[test]
fn the_worn_brake_of_each_leg_is_refused() {
    let (file, loads) = (testable_drives(), test_loads());
    for leg in 0..LEGS {
        // It bears the load, but not the test.
        let (result, _, ways_mm) = tested(&file, |segment| segment.devices[leg].brake_n = 0.93 * loads[leg]);
        let error = result.unwrap_err();
        println!("{error}");
        for words in [
            &format!("leg {}: its closed brake slips by 0.5", leg + 1),
            &format!("under {:.0} N, more than 0.5 mm (max_slip_m): support the platform", loads[leg]),
        ] {
            assert!(error.contains(words), "{words:?} is not in {error:?}");
        }
        assert!((0.5..0.6).contains(&ways_mm[leg].abs()), "{ways_mm:?}");
    }
}

#[test]
fn a_brake_that_slips_by_less_than_the_bound_passes() {
    let (file, loads) = (testable_drives(), test_loads());
    let (result, _, ways_mm) = tested(&file, |segment| segment.devices[2].brake_n = loads[2] - 15.0);
    assert_eq!(result, Ok(()));
    assert!((0.1..0.5).contains(&ways_mm[2].abs()), "{ways_mm:?}");
    // The same brake, a smaller bound.
    let mut strict = file;
    strict.legs[2].max_slip_m = 1e-4;
    let (result, ..) = tested(&strict, |segment| segment.devices[2].brake_n = loads[2] - 15.0);
    assert!(result.unwrap_err().starts_with("leg 3: its closed brake slips by 0.1"));
}

#[test]
fn a_brake_that_opens_in_its_test_is_noticed_by_its_motion() {
    // The mask is missing: the brake opens as in operation, and the leg gives way under its load.
    let mut file = testable_drives();
    file.legs[4].brake_hold.pop();
    let (result, _, ways_mm) = tested(&file, |_| {});
    let error = result.unwrap_err();
    assert!(
        error.contains("leg 5: its closed brake slips") && error.contains("or correct brake_hold"),
        "{error}"
    );
    assert!((0.5..1.0).contains(&ways_mm[4].abs()), "{ways_mm:?}");
}

#[test]
fn a_drive_without_torque_in_the_test_is_refused() {
    // As drives that hold the brake by switching their power stage off.
    let mut file = testable_drives();
    file.legs[1].brake_hold.push(SdoWrite { index: 0x6072, sub: 0, bytes: 2, value: 0 });
    let (result, ..) = tested(&file, |_| {});
    let error = result.unwrap_err();
    assert!(error.contains("leg 2: its brake was not tested: the drive reports 0 N of -"), "{error}");
}

#[test]
fn a_fault_ends_the_test() {
    let (result, ..) = tested(&testable_drives(), |segment| segment.devices[3].drive.trip(0x7300));
    assert_eq!(result.unwrap_err(), "leg 4 has the fault 0x7300: reset it");
}

#[test]
fn a_file_says_which_brakes_are_not_tested() {
    assert_eq!(testable_drives().warnings(), [""; 0]);
    assert_eq!(drives().warnings(), ["the brakes of legs 1, 2, 3, 4, 5, 6 are not tested: no brake_hold"]);
    let lines = BRAKE_HOLD.replace("sdo = [{ index = 0x60fe, sub = 1, bytes = 4, value = 0 }, ", "sdo = [");
    let error = DrivesFile::parse(&DRIVES.replace("[drive]\n", &lines), "f").unwrap_err().to_string();
    assert!(error.contains("leg[1].brake_hold 0x60fe:1: sdo must contain the object"), "{error}");
    let error =
        DrivesFile::parse(&DRIVES.replace("[drive]\n", "[drive]\nmax_slip_m = 0.5\n"), "f").unwrap_err();
    assert!(error.to_string().contains("max_slip_m = 0.5: must be in [0.00001, 0.005]"), "{error}");
}
