//! The handle: ports of the roles in which a program has joined.

use std::process;
use std::sync::{Mutex, TryLockError};

use ::hexad_client::messages::clock::monotonic_ns;
use ::hexad_client::messages::{
    Bus, ForceMessage, MeasuredMessage, Message, Publisher, SetpointMessage, StatisticsMessage,
    StatusMessage, Subscriber,
};
use ::hexad_client::operator::connection::Connection;

use crate::outcome::hexad_result::{HEXAD_BUSY, HEXAD_INTERNAL, HEXAD_INVALID, HEXAD_OK};
use crate::outcome::{Failure, Outcome};
use crate::request;
use crate::{HEXAD_DRIVER, HEXAD_MONITOR, HEXAD_SIMULATED, HEXAD_SOURCE};

/// Messages that a port keeps; only the newest counts.
const DEPTH: usize = 8;

/// A program that has joined the topics of a machine.
#[allow(non_camel_case_types, reason = "a name of C")]
pub struct hexad_client {
    ports: Mutex<Ports>,
    /// The process that has joined. A child of `fork` has a copy of the ports, and must not touch what the parent uses.
    process_id: u32,
}

/// Ports of all roles that were requested.
pub struct Ports {
    driver: Option<Driver>,
    source: Option<Source>,
    monitor: Option<Monitor>,
    _bus: Bus,
}

/// Ports of a driver.
pub struct Driver {
    measured: Publisher<MeasuredMessage>,
    forces: Subscriber<ForceMessage>,
    latest: ForceMessage,
    /// Time of the last measurement in simulated time \[ns\].
    simulated_ns: Option<u64>,
}

/// Ports of a setpoint source.
pub struct Source {
    setpoints: Publisher<SetpointMessage>,
    machine: String,
    /// Keeps the last request for a cycle.
    posted: Option<Connection>,
}

/// Ports that only receive.
pub struct Monitor {
    statuses: Subscriber<StatusMessage>,
    timings: Subscriber<StatisticsMessage>,
    measured: Subscriber<MeasuredMessage>,
    status: Option<StatusMessage>,
    statistics: Option<StatisticsMessage>,
    measurement: Option<MeasuredMessage>,
}

impl hexad_client {
    /// A handle of ports.
    pub fn new(ports: Ports) -> Self {
        Self { ports: Mutex::new(ports), process_id: process::id() }
    }

    /// Whether this process has joined, and not the one that has forked it.
    pub fn is_own(&self) -> bool {
        self.process_id == process::id()
    }
}

/// Uses the ports of a client, if no other thread does.
///
/// # Safety
///
/// `client` is NULL or from `hexad_open`, and not closed.
pub unsafe fn with<T>(
    client: *const hexad_client,
    act: impl FnOnce(&mut Ports) -> Result<T, Failure>,
) -> Result<T, Failure> {
    // SAFETY: the caller's promise. Ports may change threads: all that they share is in this handle, and the lock orders the calls.
    let client = unsafe { client.as_ref() };
    let client = client.ok_or_else(|| Failure::new(HEXAD_INVALID, "the client is NULL"))?;
    if !client.is_own() {
        let text =
            format!("the client is that of process {}: a child of fork opens its own", client.process_id);
        return Err(Failure::new(HEXAD_INVALID, text));
    }
    match client.ports.try_lock() {
        Ok(mut ports) => act(&mut ports),
        Err(TryLockError::WouldBlock) => Err(Failure::new(HEXAD_BUSY, "another thread uses the client")),
        Err(TryLockError::Poisoned(_)) => {
            Err(Failure::new(HEXAD_INTERNAL, "the client is not usable after an internal error"))
        }
    }
}

impl Ports {
    /// Joins the topics of a machine and opens every port of the roles.
    pub fn open(machine: &str, roles: u32) -> Result<Self, Failure> {
        let has = |role: u32| roles & role != 0;
        let known = HEXAD_DRIVER | HEXAD_SOURCE | HEXAD_MONITOR | HEXAD_SIMULATED;
        if roles & !known != 0 || roles & !HEXAD_SIMULATED == 0 {
            return Err(Failure::new(HEXAD_INVALID, format!("roles = {roles} are not a sum of roles")));
        }
        let join = if has(HEXAD_SIMULATED) { Bus::join_simulated } else { Bus::join };
        let bus = join(machine).map_err(Failure::of_port)?;
        let driver = if has(HEXAD_DRIVER) { Some(Driver::open(&bus)?) } else { None };
        let source = if has(HEXAD_SOURCE) { Some(Source::open(&bus, machine)?) } else { None };
        let monitor = if has(HEXAD_SOURCE | HEXAD_MONITOR) { Some(Monitor::open(&bus)?) } else { None };
        Ok(Self { driver, source, monitor, _bus: bus })
    }

    /// Ports of the driver.
    pub fn driver(&mut self) -> Result<&mut Driver, Failure> {
        self.driver.as_mut().ok_or_else(|| not_opened("HEXAD_DRIVER"))
    }

    /// Ports of the setpoint source.
    pub fn source(&mut self) -> Result<&mut Source, Failure> {
        self.source.as_mut().ok_or_else(|| not_opened("HEXAD_SOURCE"))
    }

    /// Ports of the source or monitor.
    pub fn monitor(&mut self) -> Result<&mut Monitor, Failure> {
        self.monitor.as_mut().ok_or_else(|| not_opened("HEXAD_MONITOR"))
    }
}

fn not_opened(role: &str) -> Failure {
    Failure::new(HEXAD_INVALID, format!("the client was opened without {role}"))
}

/// A publisher whose messages in simulated time are the same in each run.
fn publisher<T: Message>(bus: &Bus) -> Result<Publisher<T>, Failure> {
    let publisher = bus.publisher().map_err(Failure::of_port)?;
    Ok(if bus.is_simulated() { publisher.with_reproducible_epoch() } else { publisher })
}

fn subscriber<T: Message>(bus: &Bus) -> Result<Subscriber<T>, Failure> {
    bus.subscriber(DEPTH).map_err(Failure::of_port)
}

fn publish<T: Message>(publisher: &mut Publisher<T>, time_ns: u64, message: T) -> Outcome {
    publisher.publish(time_ns, message).map_err(Failure::of_port)?;
    Ok(HEXAD_OK)
}

impl Driver {
    fn open(bus: &Bus) -> Result<Self, Failure> {
        let (measured, forces) = (publisher(bus)?, subscriber(bus)?);
        let simulated_ns = bus.is_simulated().then_some(0);
        Ok(Self { measured, forces, latest: ForceMessage::default(), simulated_ns })
    }

    /// Publishes a measurement.
    pub fn publish(&mut self, time_ns: u64, message: MeasuredMessage) -> Outcome {
        self.simulated_ns = self.simulated_ns.map(|_| time_ns);
        publish(&mut self.measured, time_ns, message)
    }

    /// The newest force message, zeros before the first, and now \[ns\].
    pub fn latest_force(&mut self) -> (ForceMessage, u64) {
        self.latest = self.forces.receive_latest().unwrap_or(self.latest);
        // Not before: a message that arrives meanwhile would be from the future.
        (self.latest, self.simulated_ns.unwrap_or_else(monotonic_ns))
    }
}

impl Source {
    fn open(bus: &Bus, machine: &str) -> Result<Self, Failure> {
        Ok(Self { setpoints: publisher(bus)?, machine: machine.into(), posted: None })
    }

    /// Publishes a setpoint.
    pub fn publish_setpoint(&mut self, time_ns: u64, message: SetpointMessage) -> Outcome {
        publish(&mut self.setpoints, time_ns, message)
    }

    /// Posts a request for a cycle.
    pub fn request_in_cycle(&mut self, cycle_ns: u64, request: u32) -> Outcome {
        self.posted = Some(request::post(&self.machine, request, cycle_ns)?);
        Ok(HEXAD_OK)
    }
}

impl Monitor {
    fn open(bus: &Bus) -> Result<Self, Failure> {
        let (statuses, timings, measured) = (subscriber(bus)?, subscriber(bus)?, subscriber(bus)?);
        Ok(Self { statuses, timings, measured, status: None, statistics: None, measurement: None })
    }

    /// The newest status.
    pub fn latest_status(&mut self) -> Option<StatusMessage> {
        self.status = self.statuses.receive_latest().or(self.status);
        self.status
    }

    /// The newest statistics.
    pub fn latest_statistics(&mut self) -> Option<StatisticsMessage> {
        self.statistics = self.timings.receive_latest().or(self.statistics);
        self.statistics
    }

    /// The newest measurement.
    pub fn latest_measured(&mut self) -> Option<MeasuredMessage> {
        self.measurement = self.measured.receive_latest().or(self.measurement);
        self.measurement
    }
}
