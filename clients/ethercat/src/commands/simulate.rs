//! `simulate`: the segment that a drives file describes, on a network interface.

use std::path::Path;

use hexad_client::realtime::setup::scheduling;
use hexad_client::realtime::stop_request::Stop;
use hexad_ethercat::link::Link;
use hexad_ethercat::link::MAX_FRAME;
use hexad_ethercat::raw_socket::RawSocket;
use hexad_ethercat::segment::device::Device;
use hexad_ethercat::simulation;
use tracing::info;

use super::{Failure, before_start, load_drives, load_machine};

/// As hardware, which does not wait for a processor.
const PRIORITY: i32 = 75;
/// Longest time without simulation \[ns\].
const MAX_WAIT_NS: u64 = 500_000;

pub fn simulate(
    drives: &Path,
    machine: &Path,
    interface: &str,
    is_uncoupled: bool,
    brake_n: f64,
) -> Result<(), Failure> {
    let (file, machine) = (load_drives(drives)?, load_machine(machine)?);
    let stop = Stop::on_signals().map_err(before_start)?;
    let mut socket = RawSocket::open(interface).map_err(before_start)?;
    scheduling::set_shortest_timer_slack();
    if let Err(shortfall) = scheduling::fifo_priority(PRIORITY) {
        info!("{shortfall}");
    }
    let actuator = &machine.machine.actuator;
    let mut segment = if is_uncoupled {
        let middle_m = actuator.min_length_m.midpoint(actuator.max_length_m);
        simulation::uncoupled_segment(&file, middle_m, socket.now_ns())
    } else {
        simulation::segment(&file, &machine, socket.now_ns())
    };
    segment.devices.iter_mut().for_each(|device| device.brake_n = brake_n);
    info!(name = %machine.name, interface, "six simulated drives are switched on");
    let mut buffer = [0; MAX_FRAME];
    let mut shown = segment.devices.each_ref().map(state);
    while !stop.is_requested() {
        socket.wait_for_frame(socket.now_ns() + MAX_WAIT_NS);
        segment.advance_to(socket.now_ns());
        while let Some(length) = socket.receive(&mut buffer) {
            let now_ns = socket.now_ns();
            segment.advance_to(now_ns);
            if let Some(frame) = buffer.get_mut(..length)
                && segment.process(now_ns, frame)
            {
                socket.send(frame);
            }
        }
        let states = segment.devices.each_ref().map(state);
        for (position, (state, shown)) in (1..).zip(states.iter().zip(&shown)) {
            if state != shown {
                let (al_status, drive, is_brake_open) = state;
                info!(position, al_status, ?drive, is_brake_open, "device");
            }
        }
        shown = states;
    }
    Ok(())
}

fn state(device: &Device) -> (u8, hexad_ethercat::cia402::DriveState, bool) {
    (device.al_status(), device.drive.state, device.drive.is_brake_open)
}
