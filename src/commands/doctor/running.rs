//! Controllers that run on this host, which a measurement would delay.

use super::files::HostFiles;
use hexad_client::realtime::setup::cpus::Cpus;
use hexad_daemon::REALTIME_THREAD;

/// Processes with a real-time thread of the daemon that may run on a processor, or on any if `cpu` is `None`.
pub fn controllers(host: &HostFiles, cpu: Option<usize>) -> Vec<u32> {
    let controls = |process: &u32| {
        host.numbered(&format!("proc/{process}/task")).iter().any(|thread| {
            let about = |file| host.text(&format!("proc/{process}/task/{thread}/{file}"));
            about("comm").is_ok_and(|name| name == REALTIME_THREAD)
                && about("status").map_or(true, |status| may_run_on(&status, cpu))
        })
    };
    let mut processes = host.numbered("proc");
    processes.retain(controls);
    processes
}

/// Whether a thread with this status may run on a processor. True if the status does not contain it.
fn may_run_on(status: &str, cpu: Option<usize>) -> bool {
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
    let cpus = list.and_then(|list| Cpus::parse(list.trim()));
    cpus.zip(cpu).is_none_or(|(cpus, cpu)| cpus.contains(cpu))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::files::sample::host;

    #[test]
    fn controllers_on_the_same_processors_are_found() {
        let status = "Name:\thexad-rt\nCpus_allowed:\tc\nCpus_allowed_list:\t2-3\nMems_allowed:\t1";
        let host = host(&[
            ("proc/7/task/7/comm", "hexad"),
            ("proc/7/task/9/comm", REALTIME_THREAD),
            ("proc/7/task/9/status", status),
            ("proc/8/task/8/comm", "hexad"),
            ("proc/9/task/9/comm", REALTIME_THREAD),
            ("proc/self/task/9/comm", REALTIME_THREAD),
        ]);
        assert_eq!(controllers(&host.files, None), [7, 9]);
        assert_eq!(controllers(&host.files, Some(3)), [7, 9]);
        assert_eq!(controllers(&host.files, Some(1)), [9], "where it does not say, it may be anywhere");
    }
}
