//! Examination of single values that are probably in a wrong unit, in a wrong place, or of another host.

use super::Examiner;
use crate::config::geometry::exchanged_home;
use crate::config::machine::rounded;
use hexad_client::realtime::setup::cpus::Cpus;

/// Usual radius of gyration of the platform, as a multiple of the radius of its joints. The payload may be small and between
/// the joints, or high above them; a unit that is wrong by a thousand changes the ratio by 32.
const USUAL_GYRATION: core::ops::RangeInclusive<f64> = 0.05..=3.0;

/// Shortest plausible delay between processes and drives \[us\]: a bus alone takes longer.
const MIN_DELAY_US: f64 = 10.0;
/// Shortest plausible lead or lateness of a thread \[us\]: about the time of one reading of the clock and one system call.
const MIN_THREAD_TIME_US: f64 = 1.0;

pub(super) fn examine(examiner: &mut Examiner) {
    examine_gyration(examiner);
    examine_times(examiner);
    examine_processors(examiner);
    if let Some(exchanged) = exchanged_home(&examiner.config.machine) {
        let value = format!("{:?}", examiner.config.machine.home);
        examiner.warn("home.pose", value, format!("the order is {exchanged}, and further from its ends"));
    }
}

/// Warns of an inertia that does not fit mass and size: `radius of gyration^2 = trace / (2 mass)`.
fn examine_gyration(examiner: &mut Examiner) {
    let machine = &examiner.config.machine;
    let (platform, radius) = (&machine.platform, machine.joints.radius);
    let gyration = (0.5 * platform.inertia.trace() / platform.mass).sqrt();
    if USUAL_GYRATION.contains(&(gyration / radius)) {
        return;
    }
    let bound = format!(
        "usual is {} to {} times the radius of the joints on the platform, {} m; check the units of inertia and mass",
        USUAL_GYRATION.start(),
        USUAL_GYRATION.end(),
        rounded(radius)
    );
    let value = format!("a radius of gyration of {} m", rounded(gyration));
    examiner.warn("platform.inertia_kg_m2", value, bound);
}

/// Warns of times that are shorter than any hardware allows. 0 means that there is none.
fn examine_times(examiner: &mut Examiner) {
    let deployment = &examiner.config.deployment;
    let (realtime, drive) = (&deployment.realtime, &deployment.drive);
    let dead_time_us = 1e-3 * deployment.plant.imperfections.drive.dead_time_ns as f64;
    for (key, time_us, least_us) in [
        ("drive.delay_us", 1e6 * drive.delay_s.unwrap_or_default(), MIN_DELAY_US),
        ("drive.lag_us", 1e6 * drive.lag_s, MIN_DELAY_US),
        ("plant.drive.dead_time_us", dead_time_us, MIN_DELAY_US),
        ("realtime.max_lead_us", 1e6 * realtime.max_lead_s, MIN_THREAD_TIME_US),
        ("realtime.io_lead_us", 1e6 * realtime.io_lead_s, MIN_THREAD_TIME_US),
        ("realtime.late_wakeup_us", 1e6 * realtime.late_wakeup_s, MIN_THREAD_TIME_US),
    ] {
        if time_us > 0.0 && rounded(time_us) < least_us {
            let bound = format!("plausible is 0, or at least {least_us}; the unit is a microsecond");
            examiner.warn(key, format!("{}", rounded(time_us)), bound);
        }
    }
}

/// Warns of processors that this host does not have. The file may be for another one.
fn examine_processors(examiner: &mut Examiner) {
    let realtime = &examiner.config.deployment.realtime;
    let online = Cpus::online();
    for (key, cpu) in [("realtime.cpu", realtime.cpu), ("realtime.io_cpu", realtime.io_cpu)] {
        let Some(cpu) = cpu.filter(|cpu| !online.is_empty() && !online.contains(*cpu)) else { continue };
        let bound =
            format!("this host has the processors {online}; correct it unless the file is for another host");
        examiner.warn(key, format!("{cpu}"), bound);
    }
}
