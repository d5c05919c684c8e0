//! Examination of single values that are probably in a wrong place, or of another host.

use super::Examiner;
use crate::config::geometry::exchanged_home;
use crate::config::machine::rounded;
use hexad_client::realtime::setup::cpus::Cpus;

/// Shortest plausible delay between processes and drives \[us\]: a bus alone takes longer.
const MIN_DELAY_US: f64 = 10.0;
/// Shortest plausible lead or lateness of a thread \[us\]: about the time of one reading of the clock and one system call.
const MIN_THREAD_TIME_US: f64 = 1.0;

pub(super) fn examine(examiner: &mut Examiner) {
    examine_times(examiner);
    examine_processors(examiner);
    if let Some(exchanged) = exchanged_home(&examiner.config.machine) {
        let value = format!("{:?}", examiner.config.machine.home);
        examiner.warn("home.pose", value, format!("the order is {exchanged}, and further from its ends"));
    }
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
