//! A drives file from what is on the bus: the user completes it.

use std::fmt::Write;

use crate::bus::Bus;
use crate::identity::ambiguity;
use crate::inventory::identities;
use crate::link::Link;
use crate::objects;
use crate::startup::PreOpDevices;

/// Text of the file. Lines that only the user can complete are comments with `?`.
pub fn drives_file<L: Link>(bus: &mut Bus<L>, devices: &PreOpDevices, name: &str, interface: &str) -> String {
    let mut text = format!(
        "name = \"{name}\"\ninterface = \"{interface}\"\nperiod_us = 1000\nwatchdog_ms = 20\nlost_frames = 3\nanswer_us = 400\n\
         shift_us = 100\non_brake = \"quick_stop\"\n\n[drive]\n# For all legs; a [[leg]] may differ. Complete these:\n\
         # lead_m = ?        # travel for one revolution of the screw\n# sign = ?          # 1 or -1, see jog\n\
         # offset_m = ?      # length at count 0, see zero\n\
         # brake = ?         # {{ status_bit = 12 }}, {{ input_bit = 16 }} or {{ open_ms = 200 }}\n\
         position_bits = 32  # of the encoder: single-turn + multi-turn\ngear = 1.0\nefficiency = 1.0\n"
    );
    let all = identities(bus, devices);
    for (position, identity) in all.iter().enumerate() {
        let mut objects = bus.objects(devices, position);
        let mut read = |index, sub| objects.value(index, sub).ok().map(|value| value as f64);
        let rated_n_m = read(objects::RATED_TORQUE, 0).map(|value| value * 1e-3);
        let increments = read(objects::ENCODER_RESOLUTION, 1);
        let revolutions = read(objects::ENCODER_RESOLUTION, 2).unwrap_or(1.0);
        let max_torque = read(objects::MAX_TORQUE, 0);
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n[[leg]]\nposition = {}\nvendor = {:#x}\nproduct = {:#x}\nserial = {}\n",
            position + 1,
            identity.vendor,
            identity.product,
            identity.serial
        );
        if let Some(why) = ambiguity(*identity, &all) {
            let _ = writeln!(text, "# {why}");
        }
        for (key, value) in [
            ("counts_per_rev", increments.map(|increments| format!("{:?}", increments / revolutions))),
            ("rated_torque_n_m", rated_n_m.map(|value| format!("{value:?}"))),
            ("max_torque_permille", max_torque.map(|value| value.to_string())),
        ] {
            let _ = match value {
                Some(value) => writeln!(text, "{key} = {value}"),
                None => writeln!(text, "# {key} = ?"),
            };
        }
    }
    text
}
