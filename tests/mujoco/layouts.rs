//! The structs of `tests/clients/hexad.py` are those of `src/messages/structs.rs`. That they have the names of the
//! documentation shows when they connect.

use std::mem::{align_of, offset_of, size_of};

use crate::python;
use hexad::messages::{
    CommandMessage, ForceMessage, Header, MeasuredMessage, Message, SCHEMA, SetpointMessage, StatusMessage,
};
use hexad::messages::{LoopTimes, Statistics, Times, WorstCycle};

/// A line for the struct and one for each of its fields: a field that is not listed here does not compile.
macro_rules! layout {
    ($type:ident, $name:expr, $($field:ident)*) => {{
        let $type { $($field: _,)* } = $type::default();
        let mut lines = format!("{} {} {}\n", $name, size_of::<$type>(), align_of::<$type>());
        $(lines += &format!("  {} {}\n", stringify!($field), offset_of!($type, $field));)*
        lines
    }};
}

const PRINT: &str = "
import ctypes, hexad
print(hexad.SCHEMA)
for name in ['Header', 'Setpoint', 'Measured', 'Force', 'Command', 'Status',
             'Statistics', 'LoopTimes', 'Times', 'WorstCycle']:
    struct = getattr(hexad, name)
    print(getattr(struct, 'topic', name), ctypes.sizeof(struct), ctypes.alignment(struct))
    for field, *_ in struct._fields_:
        print(' ', field, getattr(struct, field).offset)
";

#[test]
fn python_declares_the_documented_structs() {
    let ours = [
        format!("{SCHEMA}\n"),
        layout!(Header, "Header", schema reserved epoch sequence time_ns),
        layout!(SetpointMessage, SetpointMessage::TOPIC, header x x_rate x_accel),
        layout!(MeasuredMessage, MeasuredMessage::TOPIC,
            header length_m length_rate_m_s pose_valid reserved x twist),
        layout!(ForceMessage, ForceMessage::TOPIC,
            header force_n valid state fault limiting release_ns checksum reserved),
        layout!(CommandMessage, CommandMessage::TOPIC, header request reserved),
        layout!(StatusMessage, StatusMessage::TOPIC,
            header state fault refused limiting fault_value fault_bound fault_index reserved
            answered_epoch answered_sequence pose_valid error_valid x twist condition singular_in_s
            position_error_m orientation_error_rad wrench_error
            cycles late_wakeups overruns skipped caught_up allocations io_allocations
            without_measurement without_setpoint
            rejected_schema rejected_older_source rejected_repeated statistics),
        layout!(Statistics, "Statistics", window total worst),
        layout!(LoopTimes, "LoopTimes", wakeup_ns compute_ns measured_age_ns end_to_end_ns),
        layout!(Times, "Times", count min mean p50 p90 p99 p999 p9999 max),
        layout!(WorstCycle, "WorstCycle",
            cycle due_ns wakeup_ns compute_ns io_late involuntary_switches page_faults steal_ms),
    ]
    .concat();
    assert_eq!(python::printed(PRINT), ours);
}

#[test]
fn the_documented_sizes_are_right() {
    let size = [
        format!("{} {}", SetpointMessage::TOPIC, size_of::<SetpointMessage>()),
        format!("{} {}", MeasuredMessage::TOPIC, size_of::<MeasuredMessage>()),
        format!("{} {}", CommandMessage::TOPIC, size_of::<CommandMessage>()),
        format!("{} {}", ForceMessage::TOPIC, size_of::<ForceMessage>()),
        format!("{} {}", StatusMessage::TOPIC, size_of::<StatusMessage>()),
    ]
    .join(", ");
    assert!(
        include_str!("../../src/messages/structs.rs").contains(&format!("| size in bytes | {size} |")),
        "{size}"
    );
}

/// A force of simulated time 1 s, good but for one thing at a time.
const JUDGE: &str = "
import hexad, zlib
def judged(now_ns=1_000_000_000, **fields):
    force = hexad.Force(hexad.Header(hexad.SCHEMA, 0, 7, 1, 1_000_000_000), valid=1, force_n=(1, 2, 3, 4, 5, 6))
    damaged = fields.pop('damaged', 0)
    for name, value in fields.items():
        setattr(force, name, value)
    force.checksum = damaged ^ zlib.crc32(bytes(force)[:hexad.Force.checksum.offset])
    return force.may_be_applied(now_ns)
print(judged(), judged(now_ns=1_050_000_000), judged(now_ns=1_050_000_001), judged(now_ns=999_999_999))
print(judged(valid=0), judged(damaged=1), judged(force_n=(1, 2, 3, 4, 5, float('nan'))))
";

#[test]
fn python_applies_no_force_that_is_old_or_early_or_not_valid_or_damaged() {
    assert_eq!(python::printed(JUDGE), "True True False False\nFalse False False\n");
}
