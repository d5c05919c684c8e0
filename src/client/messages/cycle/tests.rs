//! Messages of cycles against inputs and outputs.

use super::*;
use crate::messages::layout::Declared as _;

/// A message of which no two floats are alike; odd flags are set.
fn message(flag: u32) -> CycleMessage {
    let mut bytes = vec![0; size_of::<CycleMessage>()];
    for (place, word) in bytes.chunks_exact_mut(8).enumerate() {
        word.copy_from_slice(&(place as f64 + 0.1).to_ne_bytes());
    }
    let message = CycleMessage::from_bytes(&bytes).unwrap();
    CycleMessage {
        io_late: 0,
        deadline_missed: flag,
        has_setpoint: flag,
        setpoint_kind: 3 * flag,
        has_measurement: flag,
        rates_valid: flag,
        pose_valid: flag,
        drive_valid: 15 * flag,
        other_poses: 2 * flag,
        has_request: flag,
        request: 6 * flag,
        state: State::Parking as u32,
        active_limits: 77,
        diagnostic: DiagnosticRecord { code: 108, index: 3, value: f64::INFINITY, bound: -0.0 },
        request_diagnostic: DiagnosticRecord { code: 4, index: 1, value: 2.0, bound: 3.0 },
        has_platform: flag,
        has_error: flag,
        has_reference: flag,
        reserved: 0,
        ..message
    }
}

#[test]
fn input_and_output_go_into_a_message_and_come_back_to_the_bit() {
    let full = message(1);
    let again = CycleMessage::new(&full.input().unwrap(), &full.output().unwrap());
    assert_eq!(again.with_number_and_timing_of(&full).bytes(), full.bytes());
    let empty = message(0);
    let (input, output) = (empty.input().unwrap(), empty.output().unwrap());
    assert_eq!((input.setpoint, input.measurement, input.request), (None, None, None));
    assert_eq!((output.platform, output.error, output.reference), (None, None, None));
    assert_eq!(CycleMessage { state: 99, ..full }.output(), None);
    assert_eq!(CycleMessage { request: 99, ..full }.input(), None);
    assert_eq!(CycleMessage::from_bytes(&full.bytes()[1..]), None);
}
