//! The io thread: owner of every port of the daemon, in phase with the cycle.
//!
//! It reads the newest messages a lead before the release and publishes when the output of the cycle
//! appears; with external release it waits for measured messages and signals the real-time thread; in
//! lock-step it waits for everybody. When a peer comes or goes, the port calls here allocate and block for a
//! moment; the real-time thread meanwhile runs on with data it knows the age of.

use super::cycle::{CycleInput, CycleOutput, IoSide};
use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::Producer;

use super::translation::{force_message, measurement, status_message};
use crate::control::controller::{Output, Setpoint};
use crate::control::diagnostic::DiagnosticCode;
use crate::control::state::{OperatorRequest, Request, State};
use crate::messages::clock::monotonic_ns;
use crate::messages::lockstep::look_until;
use crate::messages::ports::{Bus, PortError, Rejected, Sink, Source, Time};
use crate::messages::statistics::Statistics;
use crate::messages::structs::{
    CommandMessage, ForceMessage, Header, MeasuredMessage, SetpointMessage, StatusMessage,
};
use crate::model::task::TaskState;
use crate::realtime::clock::{Clock, Grid, Monotonic, sleep_until};
use crate::realtime::cyclic::{Release, Timing};
use crate::realtime::triple_buffer::Reader;
use crate::realtime::usage::ThreadUsage;
use crate::realtime::waiter::Waiter;

/// Pause between two looks for something that does not come at once.
const POLL_NS: u64 = 10_000;

/// Before that it looks without a pause for this long, or an eighth of the period if that is less: an
/// output comes one wake-up latency after the release, and a pause costs as much again.
const AWAKE_NS: u64 = 50_000;

/// A request for force that is older than this is not carried out.
const OLDEST_REQUEST_NS: u64 = 1_000_000_000;

/// What the daemon asks itself for before it ends; no message of a source has this epoch.
const END: OperatorRequest = OperatorRequest { request: Request::Stop, message: (0, 1) };

/// Messages kept per input between two reads. Only the newest counts.
const INPUT_DEPTH: usize = 8;

/// Length of the queue of delays to the log thread, as of the cycle records.
pub const DELAYS: usize = 1024;

/// The ports of the daemon.
pub struct Ports {
    setpoint: Sink<SetpointMessage>,
    measured: Sink<MeasuredMessage>,
    command: Sink<CommandMessage>,
    force: Source<ForceMessage>,
    status: Source<StatusMessage>,
}

/// What the io thread shares with the others.
pub struct Sides<'a> {
    pub exchange: IoSide,
    /// Release to force sent \[ns\], to the log thread.
    pub sent: Producer<'a, u64>,
    /// From the log thread.
    pub statistics: Reader<Statistics>,
    /// The daemon wants to end: the platform is to come to rest.
    pub ending: &'a AtomicBool,
    /// The daemon wants to end and the platform is not under control.
    pub may_end: &'a AtomicBool,
}

/// What it needs to know.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub timing: Timing,
    /// Inputs are read this long before the release.
    pub lead_ns: u64,
    /// Forces computed longer ago are not valid any more: the process was held (stopped, or the host took
    /// the processor) between computing and sending them.
    pub longest_hold_ns: u64,
    /// Simulated: in lock-step.
    pub time: Time,
    pub home: [f64; 6],
}

/// What the io thread saw.
#[derive(Debug, Default)]
pub struct IoReport {
    /// Messages that could not be sent.
    pub send_failures: u64,
    /// Messages passed over.
    pub rejected: Rejected,
    /// From the first cycle on. It allocates only while a peer comes or goes.
    pub usage: ThreadUsage,
}

impl Ports {
    /// Opens all.
    pub fn open(bus: &Bus) -> Result<Self, PortError> {
        let force = bus.source()?;
        Ok(Self {
            setpoint: bus.sink(INPUT_DEPTH)?,
            measured: bus.sink(INPUT_DEPTH)?,
            command: bus.sink(usize::MAX)?,
            force: if bus.time() == Time::Simulated { force.reproducible() } else { force },
            status: bus.source()?,
        })
    }
}

/// Runs until `stop`, then publishes the last output there is.
pub fn run(settings: &Settings, ports: Ports, sides: Sides<'_>, stop: &AtomicBool) -> IoReport {
    let at_start = ThreadUsage::of_this_thread();
    let mut io = Io {
        settings,
        ports,
        sides,
        input: CycleInput::default(),
        published: 0,
        answered: (0, 0),
        send_failures: 0,
        allocations: at_start.allocations,
    };
    match (settings.time, settings.timing.release) {
        (Time::Simulated, _) => io.run_in_lockstep(stop),
        (_, Release::Grid { max_lead_ns }) => io.run_in_phase(max_lead_ns, stop),
        (_, Release::External { .. }) => io.run_on_messages(stop),
    }
    io.publish_newest();
    IoReport {
        send_failures: io.send_failures,
        rejected: io.rejected(),
        usage: ThreadUsage::of_this_thread().since(&at_start),
    }
}

struct Io<'a> {
    settings: &'a Settings,
    ports: Ports,
    sides: Sides<'a>,
    input: CycleInput,
    /// The cycle that was published last.
    published: u64,
    /// The last request that the controller has seen.
    answered: (u64, u64),
    send_failures: u64,
    /// Of this thread, before the first cycle.
    allocations: u64,
}

impl Io<'_> {
    fn run_in_phase(&mut self, max_lead_ns: u64, stop: &AtomicBool) {
        let Settings { timing: Timing { period_ns, phase_ns, .. }, lead_ns, .. } = *self.settings;
        let grid = Grid::new(period_ns, phase_ns);
        let mut waiter = Waiter::new(max_lead_ns);
        while !stop.load(Ordering::Relaxed) {
            let release_ns = grid.next_after(monotonic_ns() + lead_ns);
            waiter.until(&mut Monotonic, release_ns - lead_ns);
            self.read();
            self.hand_in();
            if max_lead_ns == 0 {
                sleep_until(release_ns);
            }
            let give_up_ns = release_ns + period_ns - lead_ns;
            let mut pause = Pause::new(monotonic_ns().max(release_ns), period_ns);
            while self.publish_new() < release_ns && monotonic_ns() + POLL_NS < give_up_ns {
                if stop.load(Ordering::Relaxed) {
                    return;
                }
                pause.pause();
            }
        }
    }

    fn run_on_messages(&mut self, stop: &AtomicBool) {
        let period_ns = self.settings.timing.period_ns;
        let mut pause = Pause::new(monotonic_ns(), period_ns);
        while !stop.load(Ordering::Relaxed) {
            let published = self.published;
            let measured = self.read();
            if measured {
                self.hand_in();
                self.sides.exchange.event.signal();
            }
            self.publish_new();
            if measured || self.published > published {
                pause = Pause::new(monotonic_ns(), period_ns);
            }
            pause.pause();
        }
    }

    /// A cycle for each measurement, once the setpoint of its instant is there, and nothing else before it is
    /// answered. What a setpoint source asked for before it sent that setpoint counts in the same cycle.
    fn run_in_lockstep(&mut self, stop: &AtomicBool) {
        let mut answered_ns = None;
        let stop = || stop.load(Ordering::Relaxed);
        let next = |io: &mut Self| {
            // Whether the daemon may end is heard while everybody waits, too.
            io.publish_new();
            io.ports.measured.receive()
        };
        while let Some(measured) = look_until(stop, || next(self)) {
            let time_ns = measured.header.time_ns;
            // Who is not answered at once says it again.
            if answered_ns == Some(time_ns) {
                continue;
            }
            answered_ns = Some(time_ns);
            self.input.input.measurement = Some(measurement(&measured));
            self.input.measurements += 1;
            if look_until(stop, || self.has_setpoint_of(time_ns).then_some(())).is_none() {
                return;
            }
            self.read_requests(time_ns);
            self.hand_in();
            self.sides.exchange.event.signal();
            let before = self.published;
            look_until(stop, || {
                self.publish_new();
                (self.published > before).then_some(())
            });
        }
    }

    /// Whether the setpoint of an instant has come. It never will if there was a source and it has left.
    fn has_setpoint_of(&mut self, time_ns: u64) -> bool {
        // In this order: its last message comes before its leave.
        let has_left = self.ports.setpoint.came() > 0 && self.ports.setpoint.sources() == 0;
        self.read_setpoint();
        has_left || self.input.input.setpoint.is_some_and(|setpoint| setpoint.time_ns == time_ns)
    }

    /// Takes in the newest messages; true if a measurement is among them.
    fn read(&mut self) -> bool {
        self.read_requests(monotonic_ns());
        self.read_setpoint();
        let measured = self.ports.measured.newest();
        if let Some(message) = &measured {
            self.input.input.measurement = Some(measurement(message));
            self.input.measurements = self.ports.measured.came();
        }
        measured.is_some()
    }

    fn read_setpoint(&mut self) {
        if let Some(message) = self.ports.setpoint.newest() {
            self.input.input.setpoint = Some(Setpoint {
                time_ns: message.header.time_ns,
                task: TaskState {
                    x: message.x.into(),
                    xd: message.x_rate.into(),
                    xdd: message.x_accel.into(),
                },
            });
        }
    }

    /// Of the requests not yet answered the strongest counts. An old one that asks for force does not: who
    /// sent it has long stopped waiting.
    fn read_requests(&mut self, now_ns: u64) {
        let ending = self.sides.ending.load(Ordering::Relaxed);
        while let Some(message) = self.ports.command.receive_from_any() {
            let Header { epoch, sequence, time_ns, .. } = message.header;
            let Some(request) = Request::from_number(message.request) else { continue };
            if request.can_begin_control() && (ending || now_ns.abs_diff(time_ns) > OLDEST_REQUEST_NS) {
                continue;
            }
            let pending = self.input.input.request.filter(|asked| asked.message != self.answered);
            if pending.is_none_or(|pending| pending.request <= request) {
                self.input.input.request = Some(OperatorRequest { request, message: (epoch, sequence) });
            }
        }
        let pending = self.input.input.request.is_some_and(|asked| asked.message != self.answered);
        if ending && !pending {
            self.input.input.request = Some(END);
        }
    }

    fn hand_in(&mut self) {
        self.input.handed_ns = monotonic_ns();
        self.sides.exchange.inputs.write(self.input);
    }

    /// Publishes the newest output unless it has been; returns when it was due.
    fn publish_new(&mut self) -> u64 {
        let CycleOutput { due_ns, counters, output, .. } = *self.sides.exchange.outputs.read();
        self.answered = output.answered;
        if self.sides.ending.load(Ordering::Relaxed) && !output.state.has_control() {
            self.sides.may_end.store(true, Ordering::Relaxed);
        }
        if counters.cycles > self.published {
            self.published = counters.cycles;
            self.publish_newest();
        }
        due_ns
    }

    fn publish_newest(&mut self) {
        let mut cycle = *self.sides.exchange.outputs.value();
        if self.settings.time == Time::Simulated {
            // In this order: who answers the next measurement has the status of this one.
            self.publish_status(&cycle, cycle.release_ns);
            self.publish_force(&cycle, cycle.release_ns);
            return;
        }
        let now_ns = monotonic_ns();
        let held_ns = now_ns.saturating_sub(cycle.due_ns);
        if held_ns > self.settings.longest_hold_ns && cycle.output.state.has_control() {
            // The loop finds the same at its next cycle, by the age of what it measured last.
            let output = &mut cycle.output;
            (output.state, output.diagnostic.code, output.force) =
                (State::Fault, DiagnosticCode::MeasurementLost, Output::default().force);
        }
        self.publish_force(&cycle, now_ns);
        self.publish_status(&cycle, now_ns);
    }

    fn publish_force(&mut self, cycle: &CycleOutput, now_ns: u64) {
        let sent = self.ports.force.publish(now_ns, force_message(cycle));
        self.send_failures += u64::from(sent.is_err());
        if cycle.output.state.has_control() {
            // Full only if the log thread is held; it loses statistics, not forces.
            let _ = self.sides.sent.enqueue(monotonic_ns().saturating_sub(cycle.due_ns));
        }
    }

    fn publish_status(&mut self, cycle: &CycleOutput, now_ns: u64) {
        let mut status = status_message(&self.settings.home, cycle);
        status.io_allocations = ThreadUsage::allocations_of_this_thread() - self.allocations;
        (status.rejected_schema, status.rejected_older_source, status.rejected_repeated) = {
            let Rejected { schema, older_source, repeated, .. } = self.rejected();
            (schema, older_source, repeated)
        };
        status.statistics = *self.sides.statistics.read();
        let told = self.ports.status.publish(now_ns, status);
        self.send_failures += u64::from(told.is_err());
    }

    fn rejected(&self) -> Rejected {
        self.ports.setpoint.rejected() + self.ports.measured.rejected() + self.ports.command.rejected()
    }
}

/// Between two looks: awake at first, then asleep.
struct Pause {
    awake_until_ns: u64,
}

impl Pause {
    fn new(now_ns: u64, period_ns: u64) -> Self {
        Self { awake_until_ns: now_ns + AWAKE_NS.min(period_ns / 8) }
    }

    fn pause(&mut self) {
        let now_ns = Monotonic.now_ns();
        if now_ns < self.awake_until_ns {
            core::hint::spin_loop();
        } else {
            sleep_until(now_ns + POLL_NS);
        }
    }
}
