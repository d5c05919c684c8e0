//! Exchange of the process data of six drives.

use ethercrab::SubDeviceState;
use hexad_core::model::LEGS;

use crate::bus::Bus;
use crate::cia402::Goal;
use crate::drives_file::DrivesFile;
use crate::leg_drive::LegDrive;
use crate::link::Link;
use crate::process_image::{Inputs, Outputs};
use crate::startup::OpDevices;
use crate::sync_clock::SyncClock;

/// A drive adds one to the working counter for its inputs and two for its outputs.
const WORKING_COUNTER: u16 = 3 * LEGS as u16;
/// Cycles that close the brakes.
const OFF_CYCLES: u64 = 100;

/// Result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// All six drives have taken part, in OP.
    Complete,
    /// The same, but the frame came so soon after SYNC0 that the inputs may have been latched at the SYNC0 before.
    Early,
    /// A device is missing or not in OP.
    Incomplete,
    /// No frame came back.
    Lost,
}

/// Why all drives have to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StopCause {
    /// Frames that did not come back, in a row.
    #[error(
        "{0} frames in a row are lost or late: look at the cable to the first drive, and at the load of this computer (lost_frames)"
    )]
    LostFrames(u32),
    /// Drives did not take part in an exchange.
    #[error(
        "working counter {found}, must be {WORKING_COUNTER}: a drive is missing; states by position {states:?}, 8 is OP: look at \
         cable and power of the first one with another"
    )]
    WorkingCounter {
        /// Of the frame that came back.
        found: u16,
        /// AL states in the order of the bus, 0 of a device that is missing.
        states: [u8; LEGS],
    },
    /// All took part, and not all are in OP.
    #[error("a drive has left OP: states by position {0:?}, must be 8")]
    LeftOp([u8; LEGS]),
    /// A drive has a fault.
    #[error("leg {leg} has the fault {code:#06x}: reset it")]
    DriveFault {
        /// From 1.
        leg: usize,
        /// 0x603f
        code: u16,
    },
}

/// Process data of six drives, and the grid of their SYNC0.
#[derive(Clone, Copy, Debug)]
pub struct ProcessData {
    /// Drives in the order of the legs.
    pub drives: [LegDrive; LEGS],
    /// Commands of the next exchange.
    pub outputs: [Outputs; LEGS],
    /// Commands of the last exchange with a response.
    pub sent: [Outputs; LEGS],
    /// Grid of SYNC0.
    pub clock: SyncClock,
    /// States of the devices in the order of the bus; none of a device that is missing.
    pub states: [SubDeviceState; LEGS],
    /// Working counter of the last frame that came back.
    pub working_counter: u16,
    /// Exchanges without a response, in a row and since the start.
    pub lost_in_row: u32,
    /// The same since the start.
    pub lost_frames: u64,
    max_lost_frames: u32,
    position_of_leg: [usize; LEGS],
    period_ns: u64,
    shift_ns: u64,
}

impl ProcessData {
    /// Drives in OP. Encoders are continued from the count nearest to `middle_m`, the middle of the stroke.
    pub fn new(file: &DrivesFile, middle_m: f64, clock: SyncClock) -> Self {
        Self {
            drives: file.legs.each_ref().map(|leg| LegDrive::new(leg, middle_m)),
            outputs: [Outputs::default(); LEGS],
            sent: [Outputs::default(); LEGS],
            clock,
            states: [SubDeviceState::Op; LEGS],
            working_counter: 0,
            lost_in_row: 0,
            lost_frames: 0,
            max_lost_frames: file.bus.lost_frames,
            position_of_leg: file.legs.each_ref().map(|leg| leg.position - 1),
            period_ns: u64::from(file.bus.period_us) * 1000,
            shift_ns: u64::from(file.bus.shift_us) * 1000,
        }
    }

    /// Waits until `shift_us` after a SYNC0, and exchanges.
    pub fn next_exchange<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices) -> Exchange {
        let link = &mut bus.wire.link;
        link.sleep_until(self.clock.next_sync0_ns() + self.shift_ns);
        // After a pause of the host the next SYNC0 may have just passed.
        self.clock.advance_to(link.now_ns());
        link.sleep_until(self.clock.sync0_ns() + self.shift_ns);
        self.exchange(bus, devices, self.clock.sync0_ns() + self.period_ns / 2)
    }

    /// The next exchange, and whether its frame has come back. Errors are in words: a drive is missing or has a fault.
    pub fn next_inputs<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices) -> Result<bool, String> {
        let exchange = self.next_exchange(bus, devices);
        match self.stop_cause(exchange) {
            Some(cause) => Err(cause.to_string()),
            None => Ok(exchange != Exchange::Lost),
        }
    }

    /// Why all drives have to stop after an exchange, if they have to.
    pub fn stop_cause(&self, exchange: Exchange) -> Option<StopCause> {
        let states = self.states.map(u8::from);
        match exchange {
            Exchange::Incomplete if self.working_counter != WORKING_COUNTER => {
                Some(StopCause::WorkingCounter { found: self.working_counter, states })
            }
            Exchange::Incomplete => Some(StopCause::LeftOp(states)),
            Exchange::Lost if self.lost_in_row >= self.max_lost_frames => {
                Some(StopCause::LostFrames(self.lost_in_row))
            }
            _ => (1..)
                .zip(&self.drives)
                .find(|(_, drive)| drive.state().is_fault())
                .map(|(leg, drive)| StopCause::DriveFault { leg, code: drive.inputs().error_code }),
        }
    }

    /// Commands the drive of one leg, from 0. The others have no power.
    pub fn command_one(&mut self, leg: usize, goal: Goal, force_n: f64) {
        for (index, (drive, outputs)) in self.drives.iter_mut().zip(&mut self.outputs).enumerate() {
            let (goal, force_n) = if index == leg { (goal, force_n) } else { (Goal::Disabled, 0.0) };
            *outputs = drive.command(goal, force_n);
        }
    }

    /// Takes the power off all drives, and waits for their brakes.
    pub fn switch_off<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices) {
        for _ in 0..OFF_CYCLES {
            self.command_one(LEGS, Goal::Disabled, 0.0);
            self.next_exchange(bus, devices);
        }
    }

    /// Sends the outputs, receives the inputs. A frame that has not come back at an instant \[ns\] is lost.
    pub fn exchange<L: Link>(&mut self, bus: &mut Bus<L>, devices: &OpDevices, deadline_ns: u64) -> Exchange {
        let Bus { main, wire } = bus;
        for (outputs, position) in self.outputs.iter().zip(self.position_of_leg) {
            if let Ok(device) = devices.subdevice(main, position) {
                outputs.write(&mut device.outputs_raw_mut());
            }
        }
        let Some(Ok(response)) = wire.run_until(devices.tx_rx_dc(main), deadline_ns) else {
            self.lost_frames += 1;
            self.lost_in_row += 1;
            return Exchange::Lost;
        };
        self.lost_in_row = 0;
        self.sent = self.outputs;
        let frame_ns = wire.sent_ns.midpoint(wire.received_ns);
        let since_sync0_ns = self.clock.update(frame_ns, response.extra.dc_system_time);
        // ethercrab's own summary of the states does not notice a device that is missing.
        self.states = [SubDeviceState::None; LEGS];
        for (state, found) in self.states.iter_mut().zip(&response.subdevice_states) {
            *state = *found;
        }
        self.working_counter = response.working_counter;
        if response.working_counter != WORKING_COUNTER {
            return Exchange::Incomplete;
        }
        for (drive, position) in self.drives.iter_mut().zip(self.position_of_leg) {
            let Ok(device) = devices.subdevice(main, position) else { return Exchange::Incomplete };
            let Some(inputs) = Inputs::read(&device.inputs_raw()) else { return Exchange::Incomplete };
            drive.receive(inputs, frame_ns);
        }
        let all_op = self.states.iter().all(|state| *state == SubDeviceState::Op);
        match all_op {
            false => Exchange::Incomplete,
            true if since_sync0_ns < self.shift_ns / 2 => Exchange::Early,
            true => Exchange::Complete,
        }
    }
}
