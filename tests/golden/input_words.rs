//! An input of the controller as a row of 64-bit words, whatever the names of its types and fields.
//!
//! | words | meaning |
//! | --- | --- |
//! | 1 | flags, a bit each, from the lowest: deadline missed, then one for each optional part below, in this order |
//! | 2 | instant of release \[ns\]; offset of its clock \[ns\] |
//! | 2, 2 | processes that publish setpoints, and measurements: the one that counts, the one that is ignored |
//! | 21 | optional: number of the kind of the setpoint, its instant \[ns\], X, X', X'', speed of a target |
//! | 7 | optional: instant of the measurement \[ns\], six lengths |
//! | 6 | optional: six rates |
//! | 6 | optional: X by another sensor |
//! | 1, 1, 1 | each optional: drives that are enabled, brakes that are open, drives with a fault |
//! | 6 | optional: forces that act |
//! | 3 | optional: number of the request, its epoch and sequence number |
//!
//! Numbers are the bits of an `f64`. Words of a part that is missing repeat those of the row before.

use hexad::control::signals::inputs::DriveStatus;
use hexad::control::signals::inputs::{Input, Measurement, Publishers, Setpoint, SetpointKind};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request};
use hexad::model::task::TaskState;
use nalgebra::Vector6;

pub const WORDS: usize = 59;
pub type Row = [u64; WORDS];

/// The row of an input, after another row.
pub fn row(input: &Input, before: &Row) -> Row {
    let Input {
        release_ns,
        clock_offset_ns,
        setpoint,
        measurement,
        request,
        setpoint_publishers,
        measured_publishers,
        overrun_is_fault,
    } = *input;
    let mut writer = Writer { row: *before, next: 1, flags: u64::from(overrun_is_fault), flag: 1 };
    writer.words([release_ns, clock_offset_ns.cast_unsigned()]);
    for Publishers { used_pid, ignored_pid } in [setpoint_publishers, measured_publishers] {
        writer.words([used_pid, ignored_pid].map(u64::from));
    }
    writer.optional(setpoint.map(setpoint_words));
    let Measurement { time_ns, length, rate, pose, drives } = measurement.unwrap_or_default();
    let [l1, l2, l3, l4, l5, l6] = length.map(f64::to_bits);
    writer.optional(measurement.map(|_| [time_ns, l1, l2, l3, l4, l5, l6]));
    writer.optional(rate.map(|rate| rate.map(f64::to_bits)));
    writer.optional(pose.map(|pose| pose.map(f64::to_bits)));
    let DriveStatus { enabled, brake_open, fault, force } = drives;
    for set in [enabled, brake_open, fault] {
        writer.optional(set.map(|set| [set.into()]));
    }
    writer.optional(force.map(|force| force.map(f64::to_bits)));
    let request =
        request.map(|OperatorRequest { request, message }| [request as u64, message.epoch, message.sequence]);
    writer.optional(request);
    assert_eq!(writer.next, WORDS);
    writer.row[0] = writer.flags;
    writer.row
}

fn setpoint_words(Setpoint { kind, time_ns, task, target_speed }: Setpoint) -> [u64; 21] {
    let TaskState { x, xd, xdd } = task;
    let numbers = x.iter().chain(&xd).chain(&xdd).chain([&target_speed]).map(|number| number.to_bits());
    let mut words = [kind as u64, time_ns].into_iter().chain(numbers);
    core::array::from_fn(|_| words.next().expect("21 words"))
}

/// The input of a row.
pub fn input(row: &Row) -> Input {
    let mut reader = Reader { row, next: 1, flag: 1 };
    let [release_ns, clock_offset_ns] = reader.words();
    let [setpoint_publishers, measured_publishers] = [(); 2].map(|()| {
        let [used_pid, ignored_pid] = reader.words().map(|process: u64| process as u32);
        Publishers { used_pid, ignored_pid }
    });
    let setpoint = reader.optional().map(|words| setpoint(&words));
    let measurement = reader.optional().map(|[time_ns, length @ ..]: [u64; 7]| (time_ns, length));
    let [rate, pose] = [(); 2].map(|()| reader.optional().map(|six| six.map(f64::from_bits)));
    let [enabled, brake_open, fault] = [(); 3].map(|()| reader.optional().map(|[set]| set as u32));
    let force = reader.optional().map(|force| force.map(f64::from_bits));
    let drives = DriveStatus { enabled, brake_open, fault, force };
    let request = reader.optional().map(|[number, epoch, sequence]| OperatorRequest {
        request: Request::from_number(number as u32).expect("the number of a request"),
        message: MessageId { epoch, sequence },
    });
    Input {
        release_ns,
        clock_offset_ns: clock_offset_ns.cast_signed(),
        setpoint,
        measurement: measurement.map(|(time_ns, length)| {
            let length = length.map(f64::from_bits);
            Measurement { time_ns, length, rate, pose, drives }
        }),
        request,
        setpoint_publishers,
        measured_publishers,
        overrun_is_fault: row[0] & 1 == 1,
    }
}

fn setpoint([kind, time_ns, numbers @ .., target_speed]: &[u64; 21]) -> Setpoint {
    let six = |from: usize| Vector6::from_fn(|axis, _| f64::from_bits(numbers[from + axis]));
    let mut kinds = SetpointKind::ALL.into_iter().chain([SetpointKind::Unknown]);
    Setpoint {
        kind: kinds.find(|it| *it as u64 == *kind).expect("the number of a kind"),
        time_ns: *time_ns,
        task: TaskState { x: six(0), xd: six(6), xdd: six(12) },
        target_speed: f64::from_bits(*target_speed),
    }
}

struct Writer {
    row: Row,
    next: usize,
    flags: u64,
    flag: u32,
}

impl Writer {
    fn words<const N: usize>(&mut self, words: [u64; N]) {
        self.row[self.next..][..N].copy_from_slice(&words);
        self.next += N;
    }

    fn optional<const N: usize>(&mut self, words: Option<[u64; N]>) {
        self.flags |= u64::from(words.is_some()) << self.flag;
        self.flag += 1;
        match words {
            Some(words) => self.words(words),
            None => self.next += N,
        }
    }
}

struct Reader<'a> {
    row: &'a Row,
    next: usize,
    flag: u32,
}

impl Reader<'_> {
    fn words<const N: usize>(&mut self) -> [u64; N] {
        self.next += N;
        core::array::from_fn(|index| self.row[self.next - N + index])
    }

    fn optional<const N: usize>(&mut self) -> Option<[u64; N]> {
        let (words, is_set) = (self.words(), self.row[0] >> self.flag & 1 == 1);
        self.flag += 1;
        is_set.then_some(words)
    }
}
