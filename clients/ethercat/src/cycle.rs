//! The cycle: two exchanges in each period of SYNC0.
//!
//! 1. Shortly after SYNC0, at which the drives latch their encoders, a frame fetches the inputs.
//! 2. The lengths are published with the instant of that SYNC0 as their stamp.
//! 3. The forces that respond to it arrive within `answer_us`, and a second frame carries them: they act at the next SYNC0.
//!
//! A drive with a fault, a device that is missing or not in OP, or too many lost frames stop all six drives in the same cycle.

use ethercrab::{Command, RegisterAddress, SubDeviceState};
use hexad::messages::{ForceMessage, MeasuredMessage};
use hexad::model::LEGS;
use tracing::{info, warn};

use crate::bus::Bus;
use crate::cia402::Goal;
use crate::drives_file::{BusSection, DrivesFile, OnBrake};
use crate::leg_drive::LegDrive;
use crate::link::Link;
use crate::permission::Permission;
use crate::process_image::{Inputs, Outputs};
use crate::segment::device::al_state;
use crate::startup::{FIRST_ADDRESS, OpDevices};
use crate::sync_clock::SyncClock;

/// A drive adds one to the working counter for its inputs and two for its outputs.
const WORKING_COUNTER: u16 = 3 * LEGS as u16;
/// Interval at which the driver looks for the forces \[ns\].
const POLL_NS: u64 = 10_000;
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

/// Counts of cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Periods of SYNC0.
    pub cycles: u64,
    /// Exchanges without a response.
    pub lost_frames: u64,
    /// Measurements without forces in time.
    pub unanswered: u64,
    /// Forces that arrived too late for the next SYNC0.
    pub late: u64,
    /// Failures that stopped all drives.
    pub stops: u64,
}

/// Failure that only a new start of the bus can end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{reachable} of {LEGS} drives answer: look at their cables and power; the bus has to be started again"
)]
pub struct DevicesLost {
    /// Devices that still answer.
    pub reachable: usize,
}

/// Result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Exchange {
    /// All six drives have taken part, in OP.
    Complete,
    /// A device is missing or not in OP.
    Incomplete,
    /// No frame came back.
    Lost,
}

/// Driver of six drives.
pub struct Driver<D> {
    /// The other side.
    pub daemon: D,
    /// Drives in the order of the legs.
    pub drives: [LegDrive; LEGS],
    /// Counts since the start.
    pub counts: Counts,
    clock: SyncClock,
    permission: Permission,
    timing: BusSection,
    position_of_leg: [usize; LEGS],
    outputs: [Outputs; LEGS],
    sent: [Outputs; LEGS],
    states: [SubDeviceState; LEGS],
    lost_in_row: u32,
    missing_cycles: u64,
    resets_until_cycle: u64,
}

impl<D: Daemon> Driver<D> {
    /// Driver of drives in OP. Encoders are continued from the count nearest to `middle_m`, the middle of the stroke.
    pub fn new(file: &DrivesFile, middle_m: f64, clock: SyncClock, daemon: D) -> Self {
        let longest_age_ns = u64::from(file.bus.watchdog_ms) * 1_000_000;
        Self {
            daemon,
            drives: file.legs.each_ref().map(|leg| LegDrive::new(leg, middle_m)),
            counts: Counts::default(),
            clock,
            permission: Permission::new(longest_age_ns),
            timing: file.bus.clone(),
            position_of_leg: file.legs.each_ref().map(|leg| leg.position - 1),
            outputs: [Outputs::default(); LEGS],
            sent: [Outputs::default(); LEGS],
            states: [SubDeviceState::Op; LEGS],
            lost_in_row: 0,
            missing_cycles: 0,
            resets_until_cycle: 0,
        }
    }

    /// One period of SYNC0.
    pub fn cycle<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices) -> Result<(), DevicesLost> {
        self.counts.cycles += 1;
        let period_ns = u64::from(self.timing.period_us) * 1000;
        let fetch_ns = self.clock.next_sync0_ns() + u64::from(self.timing.shift_us) * 1000;
        bus.wire.link.sleep_until(fetch_ns);
        self.clock.advance_to(bus.wire.link.now_ns());
        let exchange = self.exchange(bus, devices, period_ns / 4);
        self.supervise(exchange);
        if exchange == Exchange::Complete {
            self.publish();
            self.wait_for_forces(bus);
        } else {
            self.receive_forces(bus.wire.link.now_ns());
        }
        self.command(bus.wire.link.now_ns());
        if self.outputs != self.sent {
            let last_ns = self.clock.next_sync0_ns() - period_ns / SECOND_EXCHANGE_SHARE;
            if bus.wire.link.now_ns() < last_ns {
                self.exchange(bus, devices, period_ns / SECOND_EXCHANGE_SHARE);
            } else {
                self.counts.late += 1;
            }
        }
        self.recover(bus);
        self.missing_cycles = if exchange == Exchange::Complete { 0 } else { self.missing_cycles + 1 };
        let reachable = self.states.iter().filter(|state| **state != SubDeviceState::None).count();
        if self.missing_cycles < MAX_MISSING_CYCLES || (reachable == LEGS && self.lost_in_row == 0) {
            return Ok(());
        }
        Err(DevicesLost { reachable: if self.lost_in_row > 0 { 0 } else { reachable } })
    }

    /// Sends the outputs, receives the inputs.
    fn exchange<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices, timeout_ns: u64) -> Exchange {
        for (outputs, position) in self.outputs.iter().zip(self.position_of_leg) {
            if let Ok(device) = devices.subdevice(&bus.main, position) {
                outputs.write(&mut device.outputs_raw_mut());
            }
        }
        let deadline_ns = bus.wire.link.now_ns() + timeout_ns;
        let Bus { main, wire } = bus;
        let Some(Ok(response)) = wire.run_until(devices.tx_rx_dc(main), deadline_ns) else {
            self.counts.lost_frames += 1;
            self.lost_in_row += 1;
            return Exchange::Lost;
        };
        self.lost_in_row = 0;
        self.sent = self.outputs;
        let frame_ns = wire.sent_ns.midpoint(wire.received_ns);
        self.clock.advance_to(frame_ns);
        self.clock.update(frame_ns, response.extra.cycle_start_offset.as_nanos() as u64);
        self.states = [SubDeviceState::None; LEGS];
        for (state, found) in self.states.iter_mut().zip(&response.subdevice_states) {
            *state = *found;
        }
        if response.working_counter != WORKING_COUNTER {
            return Exchange::Incomplete;
        }
        for (drive, position) in self.drives.iter_mut().zip(self.position_of_leg) {
            let Ok(device) = devices.subdevice(main, position) else { return Exchange::Incomplete };
            let Some(inputs) = Inputs::read(&device.inputs_raw()) else { return Exchange::Incomplete };
            drive.receive(inputs, frame_ns);
        }
        let all_op = self.states.iter().all(|state| *state == SubDeviceState::Op);
        if all_op { Exchange::Complete } else { Exchange::Incomplete }
    }

    /// Publishes what the drives latched at the last SYNC0.
    fn publish(&mut self) {
        let stamp_ns = self.clock.sync0_ns();
        let mut measured = MeasuredMessage { drive_valid: ALL_FIELDS, ..MeasuredMessage::default() };
        let fields = measured.length_m.iter_mut().zip(&mut measured.force_n);
        for ((index, drive), (length_m, force_n)) in (0..).zip(&self.drives).zip(fields) {
            let Some(length) = drive.length_m() else { return };
            (*length_m, *force_n) = (length, drive.force_n());
            measured.drive_enabled |= u32::from(drive.is_enabled()) << index;
            measured.brake_open |= u32::from(drive.is_brake_open(stamp_ns)) << index;
            measured.drive_fault |= u32::from(drive.state().is_fault()) << index;
        }
        self.daemon.publish(stamp_ns, measured);
    }

    /// Waits for the forces that respond to the last measurement, no longer than `answer_us`.
    fn wait_for_forces<L: Link>(&mut self, bus: &mut Bus<L>) {
        let link = &mut bus.wire.link;
        let until_ns = link.now_ns() + u64::from(self.timing.answer_us) * 1000;
        loop {
            self.receive_forces(link.now_ns());
            if self.permission.release_ns() == self.clock.sync0_ns() {
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
        if let Some(message) = self.daemon.receive(now_ns)
            && self.permission.receive(message)
        {
            info!("the daemon's fault is cleared: faults of drives are acknowledged");
            self.resets_until_cycle = self.counts.cycles + RECOVERY_CYCLES;
        }
    }

    /// Ends the permission at a failure.
    fn supervise(&mut self, exchange: Exchange) {
        let has_fault = self.drives.iter().any(|drive| drive.state().is_fault());
        let is_lost = self.lost_in_row >= self.timing.lost_frames;
        if !has_fault && !is_lost && exchange != Exchange::Incomplete {
            return;
        }
        if self.permission.stop() {
            self.counts.stops += 1;
            let states = self.states.map(u8::from);
            let errors = self.drives.map(|drive| drive.inputs().error_code);
            warn!(?states, ?errors, lost_frames = self.lost_in_row, "all drives are stopped");
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
        for ((drive, outputs), force) in self.drives.iter_mut().zip(&mut self.outputs).zip(forces) {
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
        for (position, state) in (0..).zip(self.states) {
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
