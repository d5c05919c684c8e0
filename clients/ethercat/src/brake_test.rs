//! Test of the closed brakes, before the drives open them: each leg in turn bears more than its load.
//!
//! The load of a leg at rest acts on its closed brake already. The drive, whose operation is enabled while its brake stays closed
//! (`brake_hold`), pushes in the direction of the load with what is missing to the test load. All other drives have no power.

use hexad_core::model::LEGS;
use hexad_core::model::active_forces::inverse_dynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::forward_kinematics::{Tracker, TrackingResult};
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};

use crate::bus::Bus;
use crate::cia402::Goal;
use crate::drives_file::{DrivesFile, LegSection};
use crate::link::Link;
use crate::process_data::ProcessData;
use crate::startup::OpDevices;

/// Force on the brake, as a multiple of the load of the leg.
const LOAD_FACTOR: f64 = 1.1;
/// Smallest force on the brake, as a share of the largest force of an actuator: a leg may carry nearly nothing.
const MIN_LOAD_SHARE: f64 = 0.05;
/// Time in which the force of the drive rises, and until the end of the test of a leg \[ns\].
const RISE_NS: u64 = 100_000_000;
const END_NS: u64 = 500_000_000;
/// Time within which operation must be enabled \[ns\].
const READY_NS: u64 = 3_000_000_000;
/// Share of the commanded force that the drive must report: else the brake was not tested.
const MIN_FORCE_SHARE: f64 = 0.8;

/// Forces \[N\] of the actuators that hold the platform at a pose.
pub fn holding_forces(machine: &Machine, pose: Pose) -> Option<[f64; LEGS]> {
    let (twist, acceleration) = (Twist::default(), Acceleration::default());
    inverse_dynamics::<Exact>(machine, &Motion { pose, twist, acceleration })
}

/// Force on the brake \[N\] in the test of a leg whose load a force holds, and whose largest force is given.
pub fn test_load_n(holding_n: f64, max_force_n: f64) -> f64 {
    (LOAD_FACTOR * holding_n.abs()).max(MIN_LOAD_SHARE * max_force_n)
}

/// Tests each leg that has `brake_hold`, with devices that were brought up by [`DrivesFile::with_brakes_held`]. All drives are
/// without power at the end. The error names the first brake that slips.
pub fn test<L: Link>(
    bus: &mut Bus<L>,
    devices: &OpDevices,
    data: &mut ProcessData,
    file: &DrivesFile,
    machine: &Machine,
    is_stopped: impl Fn() -> bool,
) -> Result<(), String> {
    let mut test_legs = || {
        while !data.next_inputs(bus, devices)? {}
        let lengths_m = data.drives.map(|drive| drive.length_m().unwrap_or_default());
        let mut tracker = Tracker::new(machine, machine.home_pose());
        let is_found = tracker.find(machine, &lengths_m).0 == TrackingResult::Found;
        let holding_n = holding_forces(machine, *tracker.pose()).filter(|_| is_found);
        let holding_n =
            holding_n.ok_or(format!("no pose has the lengths {lengths_m:.4?} m: zero the legs"))?;
        for (leg, (section, holding_n)) in file.legs.iter().zip(holding_n).enumerate() {
            let brake_n = test_load_n(holding_n, machine.actuator.max_force_n);
            if !section.brake_hold.is_empty() && !is_stopped() {
                test_leg(bus, devices, data, (leg, section), (holding_n, brake_n))?;
            }
        }
        Ok(())
    };
    let outcome = test_legs();
    data.switch_off(bus, devices);
    outcome
}

/// Loads the brake of a leg, counted from 0, that bears the opposite of a holding force at rest.
fn test_leg<L: Link>(
    bus: &mut Bus<L>,
    devices: &OpDevices,
    data: &mut ProcessData,
    (leg, section): (usize, &LegSection),
    (holding_n, brake_n): (f64, f64),
) -> Result<(), String> {
    let (number, max_slip_m) = (leg + 1, section.max_slip_m);
    let drive_n = holding_n - brake_n.copysign(holding_n);
    let began_ns = bus.wire.link.now_ns();
    let (mut start_m, mut enabled_ns, mut reported_n, mut samples) = (None, None, 0.0, 0.0);
    loop {
        let Some(drive) = data.drives.get(leg) else { return Err(format!("there is no leg {number}")) };
        let length_m = drive.length_m().unwrap_or_default();
        let slip_m = (length_m - *start_m.get_or_insert(length_m)).abs();
        if slip_m > max_slip_m {
            return Err(format!(
                "leg {number}: its closed brake slips by {:.3} mm under {brake_n:.0} N, more than {} mm (max_slip_m): support \
                 the platform, then repair the brake, or correct brake_hold if the brake opens",
                slip_m * 1e3,
                max_slip_m * 1e3
            ));
        }
        let now_ns = bus.wire.link.now_ns();
        if drive.is_enabled() {
            enabled_ns.get_or_insert(now_ns);
        } else if enabled_ns.is_some() || now_ns > began_ns + READY_NS {
            return Err(format!(
                "leg {number}: its drive is not enabled for the brake test: {:?}",
                drive.state()
            ));
        }
        let age_ns = enabled_ns.map_or(0, |enabled_ns| now_ns - enabled_ns);
        if age_ns > 2 * RISE_NS {
            (reported_n, samples) = (reported_n + drive.force_n(), samples + 1.0);
        }
        if age_ns > END_NS {
            break;
        }
        data.command_one(leg, Goal::Enabled, drive_n * (age_ns as f64 / RISE_NS as f64).min(1.0));
        while !data.next_inputs(bus, devices)? {}
    }
    let reported_n: f64 = reported_n / samples;
    if !(reported_n / drive_n >= MIN_FORCE_SHARE) {
        return Err(format!(
            "leg {number}: its brake was not tested: the drive reports {reported_n:.0} N of {drive_n:.0} N: \
             correct brake_hold, so that it applies torque while its brake is closed"
        ));
    }
    Ok(())
}
