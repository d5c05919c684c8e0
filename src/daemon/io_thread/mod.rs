//! The I/O thread. It owns every port of the daemon and runs in phase with the cycle.
//!
//! It reads the newest messages a lead before the release, and publishes as soon as the output of the cycle
//! appears. With external release it waits for measured messages and signals the real-time thread; in
//! lock-step it waits for all participants. When a peer connects or disappears, the port calls here allocate
//! and block for a moment. The real-time thread then continues with older data, whose age it has from the
//! time stamps.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::Arc;

use heapless::spsc::Producer;

use self::inputs::Inputs;
use self::outputs::{OutputSettings, Outputs};
use super::cycle::{CycleOutput, IoSide};
use super::emergency_latch::LatchLink;
use super::pose_gate::PoseGate;
use super::reload::io_parameters::{IoParameters, IoParametersInForce};
use super::snapshot::Snapshot;
use super::supervision::Progress;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::lockstep::poll_until;
use hexad_client::messages::{Bus, IoCounters, PortError, RejectionCounts, StatisticsMessage};
use hexad_client::realtime::clock::{Clock, Grid, Monotonic, sleep_until};
use hexad_client::realtime::cyclic::{RECORD_QUEUE_LENGTH, ReleaseMode, Timing};
use hexad_client::realtime::request_word::RequestWord;
use hexad_client::realtime::triple_buffer::{Reader, Writer};
use hexad_client::realtime::usage::ThreadUsage;
use hexad_client::realtime::waiter::Waiter;

mod inputs;
mod outputs;

/// Pause between two polls for something that does not arrive at once \[ns\].
const POLL_INTERVAL_NS: u64 = 10_000;

/// Time for which it first polls without a pause \[ns\], at most an eighth of the period. An output arrives
/// one wake-up latency after the release, and a pause would cost as much again.
const BUSY_POLL_TIME_NS: u64 = 50_000;

/// Length of the queue of delays to the log thread, equal to the length of the queue of cycle records.
pub const DELAYS: usize = 1024;

/// Ports of the daemon.
pub struct Ports {
    inputs: Inputs,
    outputs: Outputs,
}

/// Links of the I/O thread to the other threads.
pub struct IoLinks<'a> {
    pub exchange: IoSide,
    /// Delays from release to force sent \[ns\], to the log thread.
    pub delays: Producer<'a, u64>,
    /// Statistics, from the log thread.
    pub statistics: Reader<StatisticsMessage>,
    /// Snapshot of every cycle, to the control thread.
    pub snapshots: Writer<Snapshot>,
    /// Link to the thread of the emergency latch, if there is one.
    pub latch: Option<LatchLink>,
    /// Request word of the control thread and of signals.
    pub word: &'static RequestWord,
    /// Parameters that a reload may change.
    pub parameters: &'a IoParametersInForce,
    /// Set when the daemon is to end. The platform then comes to rest.
    pub is_ending: &'a AtomicBool,
    /// Progress, for the main thread.
    pub progress: &'a Progress,
    /// Set by this thread when the daemon is to end and the platform is not under control.
    pub may_end: &'a AtomicBool,
    /// Number of the last cycle that the log thread has passed on.
    pub passed_on: &'a AtomicU64,
    /// Other poses in which the platform may be. In lock-step the next cycle waits for their search.
    pub gate: Arc<PoseGate>,
}

/// Settings of the I/O thread.
#[derive(Clone, Copy)]
pub struct IoSettings {
    pub timing: Timing,
    /// Lead before the release at which inputs are read \[ns\].
    pub lead_ns: u64,
    pub home: [f64; 6],
}

/// Totals of the I/O thread over a run.
#[derive(Debug, Default)]
pub struct IoReport {
    /// Messages that could not be sent.
    pub send_failures: u64,
    pub rejected: RejectionCounts,
    /// Resources from the first cycle on. The thread allocates only while a peer connects or disappears.
    pub usage: ThreadUsage,
}

impl Ports {
    /// Opens all ports. They belong to the calling thread.
    pub fn open(bus: &Bus, parameters: &IoParameters) -> Result<Self, PortError> {
        Ok(Self { inputs: Inputs::open(bus, parameters)?, outputs: Outputs::open(bus)? })
    }
}

/// Runs until `stop`, then publishes the last output.
pub fn run(settings: &IoSettings, ports: Ports, links: IoLinks<'_>, stop: &AtomicBool) -> IoReport {
    let at_start = ThreadUsage::of_this_thread();
    let Ports { inputs, outputs } = ports;
    let allocations_at_start = at_start.allocations;
    let (published, snapshot) = (0, Snapshot::default());
    // Used in the condition of every wait.
    let progress = links.progress;
    let mut io = IoThread {
        settings,
        inputs,
        outputs,
        links,
        published,
        has_control: false,
        snapshot,
        allocations_at_start,
    };
    let is_stopped = || {
        progress.count_io_round();
        stop.load(Ordering::Relaxed)
    };
    match settings.timing.release {
        ReleaseMode::Lockstep => io.run_in_lockstep(is_stopped),
        ReleaseMode::Sleep | ReleaseMode::Hybrid => io.run_in_phase(is_stopped),
        ReleaseMode::External => io.run_on_messages(is_stopped),
    }
    io.publish();
    IoReport {
        send_failures: io.outputs.send_failures,
        rejected: io.inputs.rejections(),
        usage: ThreadUsage::of_this_thread().since(&at_start),
    }
}

struct IoThread<'a> {
    settings: &'a IoSettings,
    inputs: Inputs,
    outputs: Outputs,
    links: IoLinks<'a>,
    /// Number of the last published cycle.
    published: u64,
    /// Whether the platform is under control.
    has_control: bool,
    /// The last snapshot sent to the control thread.
    snapshot: Snapshot,
    /// Allocations of this thread before the first cycle.
    allocations_at_start: u64,
}

impl IoThread<'_> {
    fn run_in_phase(&mut self, is_stopped: impl Fn() -> bool) {
        let IoSettings { timing, lead_ns, .. } = *self.settings;
        let Timing { period_ns, phase_ns, .. } = timing;
        let grid = Grid::new(period_ns, phase_ns);
        let mut waiter = Waiter::new(timing.spin_ns());
        while !is_stopped() {
            let release_ns = grid.next_after(monotonic_ns() + lead_ns);
            waiter.until(&mut Monotonic, release_ns - lead_ns);
            self.inputs.receive(self.has_control);
            self.hand_over_inputs();
            if timing.spin_ns() == 0 {
                sleep_until(release_ns);
            }
            let give_up_ns = release_ns + period_ns - lead_ns;
            let mut polling = Polling::new(monotonic_ns().max(release_ns), period_ns);
            while self.publish_if_new() < release_ns && monotonic_ns() + POLL_INTERVAL_NS < give_up_ns {
                if is_stopped() {
                    return;
                }
                polling.pause();
            }
        }
    }

    fn run_on_messages(&mut self, is_stopped: impl Fn() -> bool) {
        let period_ns = self.settings.timing.period_ns;
        let mut polling = Polling::new(monotonic_ns(), period_ns);
        while !is_stopped() {
            let published = self.published;
            let is_measured = self.inputs.receive(self.has_control);
            if is_measured {
                self.hand_over_inputs();
                self.links.exchange.event.signal();
            }
            self.publish_if_new();
            if is_measured || self.published > published {
                polling = Polling::new(monotonic_ns(), period_ns);
            }
            polling.pause();
        }
    }

    /// Runs a cycle for each measurement, as soon as the setpoint of its instant has arrived, and publishes
    /// the output before the next measurement is received. A request that is posted before that setpoint takes effect
    /// in the same cycle. The recorder holds the loop when it is behind, so that no cycle is lost.
    fn run_in_lockstep(&mut self, is_stopped: impl Fn() -> bool) {
        let mut answered_ns = None;
        let next_measurement = |io: &mut Self| {
            // Updates whether the daemon may end, even while all participants wait.
            io.publish_if_new();
            io.inputs.receive_next_measurement(io.has_control)
        };
        while let Some(measurement) = poll_until(&is_stopped, || next_measurement(self)) {
            let time_ns = measurement.time_ns;
            // A plant without a response repeats its message.
            if answered_ns == Some(time_ns) {
                continue;
            }
            answered_ns = Some(time_ns);
            self.inputs.set_measurement(measurement);
            let setpoint = poll_until(&is_stopped, || {
                self.inputs.receive_setpoint_of(time_ns, self.has_control).then_some(())
            });
            if setpoint.is_none() {
                return;
            }
            self.hand_over_inputs();
            self.links.exchange.event.signal();
            let before = self.published;
            poll_until(&is_stopped, || {
                self.publish_if_new();
                let waiting = self.published.saturating_sub(self.links.passed_on.load(Ordering::Relaxed));
                let has_room = waiting < RECORD_QUEUE_LENGTH as u64 / 2 && !self.links.gate.is_searching();
                (self.published > before && has_room).then_some(())
            });
        }
    }

    fn hand_over_inputs(&mut self) {
        self.links.exchange.inputs.write(self.inputs.cycle_input());
    }

    /// Publishes the newest output unless it was published before. Returns its release \[ns\].
    fn publish_if_new(&mut self) -> u64 {
        let CycleOutput { due_ns, counters, output, .. } = *self.links.exchange.outputs.read();
        self.has_control = output.state.has_control();
        self.inputs.set_timeouts(&self.links.parameters.get());
        let word = output.answered_message.sequence;
        (self.snapshot.answered, self.snapshot.refusal) = (word, output.request_diagnostic);
        self.links.word.set_seen(word);
        if self.links.is_ending.load(Ordering::Relaxed) && !self.has_control {
            self.links.may_end.store(true, Ordering::Relaxed);
        }
        if counters.cycles > self.published {
            self.published = counters.cycles;
            self.publish();
            if let Some(latch) = &mut self.links.latch {
                latch.send(&output, due_ns);
            }
        }
        due_ns
    }

    fn publish(&mut self) {
        let settings = OutputSettings { home: self.settings.home, parameters: self.links.parameters.get() };
        let counters = IoCounters {
            allocations: ThreadUsage::allocator_calls_of_this_thread() - self.allocations_at_start,
            rejected: self.inputs.rejections(),
        };
        let IoLinks { exchange, statistics, delays, snapshots, progress, .. } = &mut self.links;
        let cycle = *exchange.outputs.value();
        progress.set_output(&cycle.output);
        let input = self.inputs.input();
        let status = self.outputs.publish(&settings, cycle, input.setpoint.as_ref(), counters, delays);
        if statistics.update() {
            self.snapshot.window = statistics.value().window;
            self.outputs.publish_statistics(*statistics.value(), cycle.release_ns);
        }
        let [setpoint_rejection, measured_rejection] = self.inputs.last_rejections();
        self.snapshot = Snapshot {
            status,
            command_n: cycle.output.command_n,
            time_ns: monotonic_ns(),
            setpoint: input.setpoint,
            measurement: input.measurement,
            setpoint_publishers: input.setpoint_publishers,
            measured_publishers: input.measured_publishers,
            setpoint_rejection,
            measured_rejection,
            ..self.snapshot
        };
        snapshots.write(self.snapshot);
    }
}

/// Polls without a pause at first, then with sleeps.
struct Polling {
    busy_until_ns: u64,
}

impl Polling {
    fn new(now_ns: u64, period_ns: u64) -> Self {
        Self { busy_until_ns: now_ns + BUSY_POLL_TIME_NS.min(period_ns / 8) }
    }

    fn pause(&mut self) {
        let now_ns = Monotonic.now_ns();
        if now_ns < self.busy_until_ns {
            core::hint::spin_loop();
        } else {
            sleep_until(now_ns + POLL_INTERVAL_NS);
        }
    }
}
