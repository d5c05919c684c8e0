//! Motion of one leg.

use hexad_ethercat::bus::Frames;
use hexad_ethercat::cia402::DriveState;
use hexad_ethercat::jog::{Jog, MAX_WAY_M, jog};
use hexad_ethercat::process_data::ProcessData;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::segment::mechanics::Mechanics;
use hexad_ethercat::simulation;

use super::common::*;

/// Jogs leg 3 and returns the result with the true changes of all lengths \[mm\].
fn jogged(edit: impl FnOnce(&mut Segment), force_n: f64, cycles: u64) -> (Result<Jog, String>, [f64; 6]) {
    let file = drives();
    let frames = Frames::new();
    let mut segment = simulation::uncoupled_segment(&file, 1.7, START_NS);
    edit(&mut segment);
    let mut bus = bus(&frames, segment);
    let (devices, clock) = up(&mut bus, &file).unwrap();
    let mut data = ProcessData::new(&file, 1.7, clock);
    let result = jog(&mut bus, &devices, &mut data, 2, force_n, cycles, || false);
    for (position, device) in bus.wire.link.segment.devices.iter().enumerate() {
        let is_off = matches!(device.drive.state, DriveState::SwitchOnDisabled | DriveState::Fault);
        assert!(is_off && !device.drive.is_brake_open, "{position}: {:?}", device.drive.state);
    }
    let Mechanics::Uncoupled { length, .. } = bus.wire.link.segment.mechanics else { panic!("uncoupled") };
    (result, length.map(|length| (length - 1.7) * 1e3))
}

#[test]
fn a_jog_moves_one_leg_by_two_millimetres() {
    for force_n in [340.0, -340.0] {
        let (result, ways_mm) = jogged(|_| {}, force_n, 1000);
        let Jog { way_m, is_direction_right } = result.unwrap();
        assert!(is_direction_right && (MAX_WAY_M..1.3 * MAX_WAY_M).contains(&way_m.abs()), "{way_m} m");
        assert!((ways_mm[2] - way_m * 1e3).abs() < 0.5 && ways_mm[2] * force_n > 0.0, "{ways_mm:?}");
        for leg in [0, 1, 3, 4, 5] {
            assert_eq!(ways_mm[leg], 0.0, "leg {leg}");
        }
    }
}

#[test]
fn a_jog_ends_after_its_time() {
    let (result, ways_mm) = jogged(|_| {}, 20.0, 50);
    assert!(result.unwrap().way_m.abs() < 0.5e-3 && ways_mm[2].abs() < 0.5, "{ways_mm:?}");
}

#[test]
fn a_wrong_direction_of_an_encoder_is_found() {
    // The encoder counts the other way round; torque does as the file says.
    let (result, _) = jogged(|segment| segment.devices[2].is_encoder_reversed = true, 340.0, 1000);
    let Jog { way_m, is_direction_right } = result.unwrap();
    assert!(!is_direction_right && way_m < 0.0, "{way_m}");
}

#[test]
fn a_fault_ends_a_jog() {
    let (result, ways_mm) = jogged(|segment| segment.devices[4].trip(0x7300), 340.0, 1000);
    assert_eq!(result.unwrap_err(), "leg 5 has the fault 0x7300: reset it");
    assert_eq!(ways_mm, [0.0; 6]);
}
