//! The simulated segment that a drives file describes: try a file without its machine.

use hexad_core::model::LEGS;
use hexad_machine::config::Config;

use crate::drives_file::DrivesFile;
use crate::identity::Identity;
use crate::segment::Segment;
use crate::segment::device::DeviceModel;
use crate::segment::mechanics::Mechanics;

/// Deviations of the devices' clocks, in millionths: cheap crystals.
const DRIFTS_PPM: [f64; LEGS] = [30.0, -12.0, 45.0, -40.0, 8.0, -50.0];

/// Devices as the file expects them, with the simulated platform of the machine.
pub fn segment(file: &DrivesFile, machine: &Config, now_ns: u64) -> Segment {
    with_mechanics(
        file,
        Mechanics::Platform(Box::new(machine.deployment.plant.hardware(&machine.machine))),
        now_ns,
    )
}

/// Devices as the file expects them, with legs that are not coupled to a platform and stand at a length.
pub fn uncoupled_segment(file: &DrivesFile, length_m: f64, now_ns: u64) -> Segment {
    with_mechanics(file, Mechanics::uncoupled([length_m; LEGS]), now_ns)
}

fn with_mechanics(file: &DrivesFile, mechanics: Mechanics, now_ns: u64) -> Segment {
    let mut drifts = DRIFTS_PPM.into_iter();
    let legs = file.by_position();
    let models = legs.map(|(_, leg)| DeviceModel {
        identity: Identity { vendor: leg.vendor, product: leg.product, serial: leg.serial },
        units: leg.units(),
        max_torque_permille: leg.max_torque_permille.unsigned_abs(),
        drift_ppm: drifts.next().unwrap_or_default(),
    });
    Segment::new(models, legs.map(|(index, _)| index), mechanics, now_ns)
}
