//! Real-time set-up of the daemon. Each thread prepares itself; the main thread prepares what the process
//! shares.
//!
//! A step that the kernel refuses is logged with reason and remedy. With `realtime.require_realtime` the
//! daemon then does not start, and its error lists all refused steps.

use std::sync::mpsc;

use tracing::warn;

use super::{DaemonError, nanoseconds};
use hexad_client::realtime::cyclic::ReleaseMode;
use hexad_client::realtime::setup::budget::GroupBudget;
use hexad_client::realtime::setup::deadline::Reservation;
use hexad_client::realtime::setup::idle::PmQosRequest;
use hexad_client::realtime::setup::{Shortfall, deadline, denormals, idle, memory, scheduling};
use hexad_core::control::controller::Controller;
use hexad_core::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;
use hexad_machine::config::deployment::{Realtime, Scheduler};

/// Cycles computed before the first release, to load code and data into memory and cache.
const WARM_UP_CYCLES: u32 = 1000;

/// Result of preparing a thread: its shortfalls, or the reason why it cannot run.
pub(super) type Ready = Result<Vec<Shortfall>, DaemonError>;

/// Collects and logs the shortfalls of threads and process, and starts the loop if they are acceptable. While
/// the result exists, idle states of the processors are limited.
pub(super) fn start(
    realtime: &Realtime,
    ready: &mpsc::Receiver<Ready>,
    go: &mpsc::Sender<()>,
) -> Result<Option<PmQosRequest>, DaemonError> {
    let mut shortfalls = Vec::new();
    for _ in ["io", "real-time"] {
        shortfalls.extend(ready.recv().map_err(|_| DaemonError::Died("io or real-time"))??);
    }
    let mut pm_qos = None;
    if !realtime.is_simulated() {
        shortfalls.extend(GroupBudget::of_this_process().shortfall(realtime.needed_share()));
        pm_qos = idle::limit_wakeup_latency(realtime.cpu_dma_latency_us)
            .map_err(|shortfall| shortfalls.push(shortfall))
            .ok();
        if realtime.lock_memory {
            // Last, when all memory has been allocated.
            shortfalls.extend(memory::lock_all().err());
        }
    }
    for shortfall in &shortfalls {
        warn!("{shortfall}");
    }
    if realtime.require_realtime && !shortfalls.is_empty() {
        return Err(DaemonError::NotRealtime(shortfalls));
    }
    go.send(()).map_err(|_| DaemonError::Died("real-time"))?;
    Ok(pm_qos)
}

/// Prepares the calling thread for I/O. This thread allocates while a peer connects.
pub(super) fn prepare_io(realtime: &Realtime) -> Vec<Shortfall> {
    memory::prefault_heap();
    let scheduled = scheduling::fifo_priority(realtime.io_priority);
    prepare(realtime.io_cpu, scheduled)
}

/// FIFO priority of the threads of requests and of motions: above ordinary processes and above all threads that write files, so
/// that they do not delay an emergency stop.
pub(super) const REQUESTS_PRIORITY: i32 = 2;

/// FIFO priority of log and recorder: above ordinary processes, below all other real-time threads.
pub(super) const RECORDS_PRIORITY: i32 = 1;

/// Prepares the calling thread to answer requests or to follow the loop on a busy host, if permitted. Without
/// this priority requests are delayed and cycles are missing in the recording; nothing else is affected. The
/// priority is always below the loop's.
pub(super) fn prepare_support(realtime: &Realtime, priority: i32) {
    if !realtime.is_simulated() && realtime.priority.min(realtime.io_priority) > priority {
        let _ = scheduling::fifo_priority(priority);
    }
}

/// Prepares the calling thread for the loop. The warm-up runs before SCHED_DEADLINE, because it would use up
/// the budget.
pub fn prepare_loop(realtime: &Realtime, warm_up: impl FnOnce()) -> Vec<Shortfall> {
    denormals::flush();
    warm_up();
    let scheduled = match realtime.scheduler {
        Scheduler::Fifo => scheduling::fifo_priority(realtime.priority),
        Scheduler::Deadline => deadline::reserve(&reservation(realtime)),
    };
    prepare(realtime.cpu, scheduled)
}

/// Prepares the calling thread for the loop in simulated time: the same set-up at ordinary priority, because
/// a thread that waits for other processes must not block them.
pub(super) fn prepare_simulated(warm_up: impl FnOnce()) -> Vec<Shortfall> {
    denormals::flush();
    warm_up();
    vec![]
}

fn prepare(cpu: Option<usize>, scheduled: Result<(), Shortfall>) -> Vec<Shortfall> {
    scheduling::set_shortest_timer_slack();
    memory::prefault_stack();
    let bound = cpu.and_then(|cpu| scheduling::bind_to_cpu(cpu).err());
    scheduled.err().into_iter().chain(bound).collect()
}

/// Reservation of `realtime.scheduler = "deadline"`.
///
/// With `release = "external"` the period is the expected period of the drives. An early message begins a new
/// period with the full budget, unless the share of the last period is used up. If drives are so fast that
/// they need more than this share, their cycles are throttled, and this is counted.
pub fn reservation(realtime: &Realtime) -> Reservation {
    let spin_s = if realtime.release == ReleaseMode::Hybrid { realtime.max_lead_s } else { 0.0 };
    Reservation::new(nanoseconds(realtime.period_s()), nanoseconds(spin_s))
}

/// Runs a controller at rest at home and discards its outputs.
pub(super) fn warm_up(mut controller: Controller, machine: &Machine) {
    let task = TaskState::at_rest(machine.home);
    let length_m = leg_lengths(machine, &task.motion().pose);
    let input = Input {
        release_ns: 1,
        setpoint: Some(Setpoint::motion(1, task)),
        measurement: Some(Measurement {
            time_ns: 1,
            length_m,
            rate_m_s: Some([0.0; 6]),
            ..Measurement::default()
        }),
        ..Input::default()
    };
    for _ in 0..WARM_UP_CYCLES {
        core::hint::black_box(controller.step(core::hint::black_box(&input)));
    }
}
