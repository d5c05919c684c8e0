//! The cycle: two exchanges in each period of SYNC0.
//!
//! 1. Shortly after SYNC0, at which the drives latch their encoders, a frame fetches the inputs.
//! 2. The lengths are published with the instant of that SYNC0 as their stamp.
//! 3. The forces that respond to it arrive within `answer_us`, and a second frame carries them: they act at the next SYNC0.
//!
//! A drive with a fault, a device that is missing or not in OP, or too many lost frames stop all six drives in the same cycle.

use ethercrab::{Command, RegisterAddress, SubDeviceState};
use hexad_client::messages::{ForceMessage, MeasuredMessage};
use hexad_core::control::signals::inputs::DriveStatus;
use hexad_core::model::LEGS;

use crate::al_state;
use crate::bus::Bus;
use crate::cia402::Goal;
use crate::drives_file::{BusSection, OnBrake};
use crate::link::Link;
use crate::permission::Permission;
use crate::process_data::{Exchange, ProcessData, StopCause};
use crate::startup::{FIRST_ADDRESS, OpDevices};

/// Interval at which the driver looks for the forces \[ns\].
pub(crate) const POLL_NS: u64 = 10_000;
/// Time that the second exchange needs before SYNC0, as a share of the period.
const SECOND_EXCHANGE_SHARE: u64 = 8;
/// Cycles between attempts to bring a device back to OP, and cycles for which a fault is acknowledged.
const RECOVERY_CYCLES: u64 = 20;
/// Cycles without a device after which the bus must be started again.
const MAX_MISSING_CYCLES: u64 = 200;
/// All four fields of the drives' status are filled in.
const ALL_FIELDS: u32 = 0xf;

/// The daemon: measurements out, forces in.
pub trait Daemon {
    /// Publishes a measurement of an instant \[ns\].
    fn publish(&mut self, stamp_ns: u64, measured: MeasuredMessage);

    /// The newest force that has arrived until now, if there is a new one.
    fn receive(&mut self, now_ns: u64) -> Option<ForceMessage>;
}

/// Counts of cycles, and what happened last. Another thread logs it: a log allocates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Periods of SYNC0.
    pub cycles: u64,
    /// Measurements without forces in time.
    pub unanswered: u64,
    /// Forces that arrived too late for the next SYNC0.
    pub late: u64,
    /// Failures that stopped all drives.
    pub stops: u64,
    /// Of the last of these.
    pub stop_cause: Option<StopCause>,
    /// Times that faults of drives were acknowledged, because the daemon had none any more.
    pub acknowledgements: u64,
}

/// Failure that only a new start of the bus can end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reachable} of {LEGS} drives answer: look at cables and power; the bus has to be started again")]
pub struct DevicesLost {
    /// Devices that still answer, in OP or SAFE-OP.
    pub reachable: usize,
}

/// Driver of six drives.
pub struct Driver<D> {
    /// The other side.
    pub daemon: D,
    /// Drives and their process data.
    pub data: ProcessData,
    /// Counts since the start.
    pub counts: Counts,
    permission: Permission,
    /// The bus failed, and the daemon has not responded to it yet.
    has_bus_failed: bool,
    timing: BusSection,
    missing_cycles: u64,
    resets_until_cycle: u64,
}

impl<D: Daemon> Driver<D> {
    /// Driver of drives in OP.
    pub fn new(data: ProcessData, timing: &BusSection, daemon: D) -> Self {
        let longest_age_ns = u64::from(timing.watchdog_ms) * 1_000_000;
        Self {
            daemon,
            data,
            counts: Counts::default(),
            permission: Permission::new(longest_age_ns),
            has_bus_failed: false,
            timing: timing.clone(),
            missing_cycles: 0,
            resets_until_cycle: 0,
        }
    }

    /// The drives stop, whatever the daemon sends, for as many cycles as the caller still makes.
    pub fn end(&mut self) {
        self.permission.end();
    }

    /// One period of SYNC0.
    pub fn cycle<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices) -> Result<(), DevicesLost> {
        self.counts.cycles += 1;
        let exchange = self.data.next_exchange(bus, devices);
        self.supervise(exchange);
        if exchange == Exchange::Complete || self.has_bus_failed {
            self.publish();
        }
        if exchange == Exchange::Complete {
            self.wait_for_forces(bus);
        } else {
            self.receive_forces(bus.wire.link.now_ns());
        }
        self.command(bus.wire.link.now_ns());
        if self.data.outputs != self.data.sent {
            let now_ns = bus.wire.link.now_ns();
            if now_ns < self.second_exchange_ns() {
                self.data.exchange(bus, devices, self.data.clock.next_sync0_ns());
            } else {
                self.counts.late += 1;
            }
        }
        self.recover(bus);
        let is_answered = matches!(exchange, Exchange::Complete | Exchange::Early);
        self.missing_cycles = if is_answered { 0 } else { self.missing_cycles + 1 };
        let is_usable =
            |state: &&SubDeviceState| matches!(state, SubDeviceState::Op | SubDeviceState::SafeOp);
        let usable = self.data.states.iter().filter(is_usable).count();
        let reachable = if self.data.lost_in_row > 0 { 0 } else { usable };
        // Devices in SAFE-OP are on their way back.
        if self.missing_cycles < MAX_MISSING_CYCLES || reachable == LEGS {
            return Ok(());
        }
        Err(DevicesLost { reachable })
    }

    /// Latest instant of a second exchange in this period \[ns\].
    fn second_exchange_ns(&self) -> u64 {
        let period_ns = u64::from(self.timing.period_us) * 1000;
        self.data.clock.next_sync0_ns() - period_ns / SECOND_EXCHANGE_SHARE
    }

    /// Publishes what the drives latched at the last SYNC0, or that the bus failed.
    fn publish(&mut self) {
        let stamp_ns = self.data.clock.sync0_ns();
        let mut measured = MeasuredMessage { drive_valid: ALL_FIELDS, ..MeasuredMessage::default() };
        let fields = measured.length_m.iter_mut().zip(&mut measured.force_n);
        for ((index, drive), (length_m, force_n)) in (0..).zip(&self.data.drives).zip(fields) {
            let Some(length) = drive.length_m() else { return };
            (*length_m, *force_n) = (length, drive.force_n());
            measured.drive_enabled |= u32::from(drive.is_enabled()) << index;
            measured.brake_open |= u32::from(drive.is_brake_open(stamp_ns)) << index;
            measured.drive_fault |= u32::from(drive.state().is_fault()) << index;
        }
        measured.drive_fault |= if self.has_bus_failed { DriveStatus::BUS_FAILED_BIT } else { 0 };
        self.daemon.publish(stamp_ns, measured);
    }

    /// Waits for the forces that respond to the last measurement, no longer than `answer_us`.
    fn wait_for_forces<L: Link>(&mut self, bus: &mut Bus<L>) {
        let last_ns = self.second_exchange_ns();
        let link = &mut bus.wire.link;
        let answer_ns = u64::from(self.timing.answer_us) * 1000;
        let until_ns = (link.now_ns() + answer_ns).min(last_ns);
        loop {
            self.receive_forces(link.now_ns());
            if self.permission.release_ns() == self.data.clock.sync0_ns() {
                return;
            }
            if link.now_ns() >= until_ns {
                self.counts.unanswered += 1;
                return;
            }
            link.sleep_until(link.now_ns() + POLL_NS);
        }
    }

    fn receive_forces(&mut self, now_ns: u64) {
        let Some(message) = self.daemon.receive(now_ns) else { return };
        self.has_bus_failed &= message.valid == 1;
        if self.permission.receive(message) {
            self.counts.acknowledgements += 1;
            self.resets_until_cycle = self.counts.cycles + RECOVERY_CYCLES;
        }
    }

    /// Ends the permission at a failure.
    fn supervise(&mut self, exchange: Exchange) {
        let Some(cause) = self.data.stop_cause(exchange) else { return };
        self.has_bus_failed |= !matches!(cause, StopCause::DriveFault { .. });
        if self.permission.stop() {
            self.counts.stops += 1;
            self.counts.stop_cause = Some(cause);
        }
    }

    /// Computes the outputs.
    fn command(&mut self, now_ns: u64) {
        let forces = self.permission.forces(now_ns);
        let goal = match (forces, self.timing.on_brake) {
            _ if self.counts.cycles < self.resets_until_cycle => Goal::Reset,
            (Some(_), _) => Goal::Enabled,
            (None, OnBrake::QuickStop) => Goal::Stopped,
            (None, OnBrake::DisableVoltage) => Goal::Disabled,
        };
        let forces = forces.unwrap_or_default();
        for ((drive, outputs), force) in self.data.drives.iter_mut().zip(&mut self.data.outputs).zip(forces) {
            *outputs = drive.command(goal, force);
        }
    }

    /// Brings devices that have left OP by their watchdog back to it, while no force may be applied.
    fn recover<L: Link>(&mut self, bus: &mut Bus<L>) {
        let is_due = self.counts.cycles.is_multiple_of(RECOVERY_CYCLES);
        if !is_due || self.permission.forces(bus.wire.link.now_ns()).is_some() {
            return;
        }
        let is_acknowledged = (self.counts.cycles / RECOVERY_CYCLES).is_multiple_of(2);
        let request = if is_acknowledged { al_state::OP } else { al_state::SAFE_OP | al_state::ERROR };
        for (position, state) in (0..).zip(self.data.states) {
            if state == SubDeviceState::SafeOp {
                let write = Command::fpwr(FIRST_ADDRESS + position, RegisterAddress::AlControl.into());
                let deadline_ns = bus.wire.link.now_ns() + POLL_NS * 10;
                // Repeated until the state is right.
                let _ =
                    bus.wire.run_until(write.ignore_wkc().send(&bus.main, u16::from(request)), deadline_ns);
            }
        }
    }
}
