//! The io thread: owner of every port of the daemon, in phase with the cycle.
//!
//! It reads the newest messages a lead before the release and publishes when the output of the cycle
//! appears. When a peer comes or goes, the port calls here allocate and block for a moment; the real-time
//! thread meanwhile runs on with data it knows the age of.

use core::sync::atomic::{AtomicBool, Ordering};

use crate::control::controller::{Input, Measurement, Output, Setpoint};
use crate::control::state::{Cause, State};
use crate::host::report::Times;
use crate::ipc::exchange::{CycleOutput, IoSide};
use crate::ipc::messages::{ForceMessage, MeasuredMessage, SetpointMessage, StatusMessage};
use crate::ipc::ports::{Bus, PortError, Sink, Source};
use crate::model::task::{TaskState, task_coordinates};
use crate::realtime::clock::{Grid, monotonic_ns, sleep_until};
use crate::realtime::cyclic::Timing;
use crate::realtime::usage::ThreadUsage;

/// Inputs are read this long before the release, or a quarter of the period if that is less. It covers
/// the wake-up of this thread (about 50 us) and the reading.
const LEAD_NS: u64 = 100_000;

/// Pause between two looks for the output: short against the wake-up latency it adds to.
const POLL_NS: u64 = 10_000;

/// Messages kept per input between two reads. Only the newest counts.
const INPUT_DEPTH: usize = 8;

/// The ports of the daemon.
pub struct Ports {
    setpoint: Sink<SetpointMessage>,
    measured: Sink<MeasuredMessage>,
    force: Source<ForceMessage>,
    status: Source<StatusMessage>,
}

/// What the io thread saw.
#[derive(Debug, Default)]
pub struct IoReport {
    /// Release to force sent.
    pub end_to_end: Times,
    /// Messages that could not be sent.
    pub send_failures: u64,
    /// Messages passed over: other schema, older life of the source, seen before.
    pub rejected: u64,
    /// From the first cycle on. It allocates only while a peer comes or goes.
    pub usage: ThreadUsage,
}

impl Ports {
    /// Opens all.
    pub fn open(bus: &Bus) -> Result<Self, PortError> {
        Ok(Self {
            setpoint: bus.sink(INPUT_DEPTH)?,
            measured: bus.sink(INPUT_DEPTH)?,
            force: bus.source()?,
            status: bus.source()?,
        })
    }
}

/// Runs until `stop`, then publishes the last output there is.
///
/// Forces computed more than `longest_hold_ns` ago are not valid any more: the process was held (stopped,
/// or the host took the processor) between computing and sending them.
pub fn run(
    timing: &Timing,
    longest_hold_ns: u64,
    home: &[f64; 6],
    mut ports: Ports,
    mut side: IoSide,
    stop: &AtomicBool,
) -> IoReport {
    let mut report = IoReport::default();
    let at_start = ThreadUsage::of_this_thread();
    let grid = Grid::new(timing.period_ns, timing.phase_ns);
    let lead_ns = LEAD_NS.min(timing.period_ns / 4);
    let mut input = Input::default();
    let mut published = 0;
    while !stop.load(Ordering::Relaxed) {
        let release_ns = grid.next_after(monotonic_ns() + lead_ns);
        sleep_until(release_ns - lead_ns);
        read(&mut ports, &mut input);
        side.inputs.write(input);

        sleep_until(release_ns);
        let next_read_ns = release_ns + timing.period_ns - lead_ns;
        while !stop.load(Ordering::Relaxed) {
            let cycle = side.outputs.read();
            if cycle.release_ns > published {
                published = cycle.release_ns;
                publish(&mut ports, home, cycle, longest_hold_ns, &mut report);
            }
            let now_ns = monotonic_ns();
            if published >= release_ns || now_ns + POLL_NS >= next_read_ns {
                break;
            }
            sleep_until(now_ns + POLL_NS);
        }
    }
    publish(&mut ports, home, side.outputs.read(), longest_hold_ns, &mut report);
    report.usage = ThreadUsage::of_this_thread().since(&at_start);
    report.rejected = ports.setpoint.rejected() + ports.measured.rejected();
    report
}

fn read(ports: &mut Ports, input: &mut Input) {
    if let Some(message) = ports.setpoint.newest() {
        input.setpoint = Some(Setpoint {
            time_ns: message.header.time_ns,
            task: TaskState { x: message.x.into(), xd: message.x_rate.into(), xdd: message.x_accel.into() },
        });
    }
    if let Some(message) = ports.measured.newest() {
        input.measurement = Some(Measurement {
            time_ns: message.header.time_ns,
            length: message.length_m,
            rate: message.length_rate_m_s,
        });
    }
}

fn publish(
    ports: &mut Ports,
    home: &[f64; 6],
    cycle: &CycleOutput,
    longest_hold_ns: u64,
    report: &mut IoReport,
) {
    let mut cycle = *cycle;
    let now_ns = monotonic_ns();
    let held_ns = now_ns.saturating_sub(cycle.release_ns);
    if held_ns > longest_hold_ns && cycle.output.state == State::Active {
        cycle.output = Output { cause: Cause::MeasurementLost, ..Output::default() };
    }
    let sent = ports.force.publish(now_ns, force_message(&cycle));
    if cycle.output.state == State::Active {
        report.end_to_end.record(monotonic_ns().saturating_sub(cycle.release_ns));
    }
    let told = ports.status.publish(now_ns, status_message(home, &cycle));
    report.send_failures += u64::from(sent.is_err()) + u64::from(told.is_err());
}

fn force_message(cycle: &CycleOutput) -> ForceMessage {
    let Output { state, cause, force, limited, .. } = cycle.output;
    ForceMessage {
        force_n: force,
        valid: u32::from(state == State::Active),
        state: state as u32,
        fault: cause as u32,
        limited: u32::from(limited),
        release_ns: cycle.release_ns,
        ..ForceMessage::default()
    }
}

fn status_message(home: &[f64; 6], cycle: &CycleOutput) -> StatusMessage {
    let CycleOutput { output, counters, .. } = cycle;
    let mut message = StatusMessage {
        state: output.state as u32,
        fault: output.cause as u32,
        cycles: counters.cycles,
        late_wakeups: counters.late_wakeups,
        overruns: counters.overruns,
        skipped: counters.skipped,
        ..StatusMessage::default()
    };
    if let Some((pose, twist)) = &output.measured {
        message.pose_valid = 1;
        message.x = task_coordinates(pose, home);
        message.twist = twist.vector().into();
    }
    if let Some(error) = &output.error {
        message.error_valid = 1;
        message.position_error_m = error.pose.linear.into();
        message.orientation_error_rad = error.pose.angular.into();
    }
    message
}
