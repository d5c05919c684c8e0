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
        match self.next_exchange(bus, devices) {
            Exchange::Complete | Exchange::Early => {}
            Exchange::Incomplete => return Err("a drive is missing or has left OP".into()),
            Exchange::Lost if self.lost_in_row >= self.max_lost_frames => {
                return Err("frames do not come back".into());
            }
            Exchange::Lost => return Ok(false),
        }
        match (1..=LEGS).zip(&self.drives).find(|(_, drive)| drive.state().is_fault()) {
            Some((leg, drive)) => {
                Err(format!("leg {leg} has the fault {:#06x}: reset it", drive.inputs().error_code))
            }
            None => Ok(true),
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

    /// Whether a drive has a fault.
    pub fn has_fault(&self) -> bool {
        self.drives.iter().any(|drive| drive.state().is_fault())
    }
}
