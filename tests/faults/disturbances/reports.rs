//! What a driver reports of its drives, and the pose of another sensor.

use hexad::control::signals::inputs::DriveStatus;
use hexad::model::LEGS;

use super::Moment;

const ALL: u32 = (1 << LEGS) - 1;
const LEG: usize = 2;

pub fn external_pose_beside(m: &mut Moment) {
    let mut x = m.world.x();
    x[5] += 0.002;
    m.measured().pose = Some(x.into());
}

pub fn drive_disabled(m: &mut Moment) {
    m.measured().drives = DriveStatus { enabled: Some(ALL & !(1 << LEG)), ..DriveStatus::default() };
}

pub fn drive_fault(m: &mut Moment) {
    m.measured().drives = DriveStatus { fault: Some(1 << LEG), ..DriveStatus::default() };
}

/// The lengths beside the report are none.
pub fn bus_failed(m: &mut Moment) {
    let measured = m.measured();
    measured.length_m = [0.0; LEGS];
    measured.drives = DriveStatus { fault: Some(DriveStatus::BUS_FAILED_BIT), ..DriveStatus::default() };
}

pub fn half_of_a_force(m: &mut Moment) {
    let mut force = m.world.rig.force.unwrap_or_default();
    force[LEG] *= 0.5;
    m.measured().drives = DriveStatus { force_n: Some(force), ..DriveStatus::default() };
}
