//! Motion of one leg by a small torque, to see which way it goes. The other drives stay without power and their brakes closed.

use crate::bus::Bus;
use crate::cia402::Goal;
use crate::link::Link;
use crate::process_data::ProcessData;
use crate::startup::OpDevices;

/// The motion ends after this way \[m\].
pub const MAX_WAY_M: f64 = 0.002;
/// Cycles within which the drive must be enabled and its brake open.
const MAX_READY_CYCLES: u64 = 3000;

/// Result of a jog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jog {
    /// Change of the length that the encoder shows \[m\].
    pub way_m: f64,
    /// Whether the leg moved as the force pushes it.
    pub is_direction_right: bool,
}

/// Pushes a leg, from 0, with a force until it has moved, or for so many cycles; `is_stopped` ends it at once.
pub fn jog<L: Link>(
    bus: &mut Bus<L>,
    devices: &OpDevices,
    data: &mut ProcessData,
    leg: usize,
    force_n: f64,
    cycles: u64,
    is_stopped: impl Fn() -> bool,
) -> Result<Jog, String> {
    let mut push = || {
        let (mut start_m, mut way_m, mut pushed, mut waited) = (None, 0.0f64, 0, 0);
        while pushed < cycles && way_m.abs() < MAX_WAY_M && !is_stopped() {
            if !data.next_inputs(bus, devices)? {
                continue;
            }
            let Some(drive) = data.drives.get(leg) else {
                return Err(format!("there is no leg {}", leg + 1));
            };
            let now_ns = bus.wire.link.now_ns();
            let is_ready = drive.is_enabled() && drive.is_brake_open(now_ns);
            if let Some(length_m) = drive.length_m().filter(|_| is_ready) {
                way_m = length_m - *start_m.get_or_insert(length_m);
                pushed += 1;
            } else {
                waited += 1;
            }
            if waited > MAX_READY_CYCLES {
                return Err(format!("the drive is not ready: {:?}, brake closed", drive.state()));
            }
            data.command_one(leg, Goal::Enabled, if is_ready { force_n } else { 0.0 });
        }
        Ok(way_m)
    };
    let outcome: Result<f64, String> = push();
    data.switch_off(bus, devices);
    let way_m = outcome?;
    let is_direction_right = way_m * force_n > 0.0;
    Ok(Jog { way_m, is_direction_right })
}
