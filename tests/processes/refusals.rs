//! What Linux refuses is told with the reason that holds and the remedy for it; with `require_realtime` it is
//! a refusal to start. Each case is a real refusal by the kernel.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::thread::available_parallelism;
use std::{fs, process};

use crate::support::children::{Ended, Hexad};
use crate::support::machine::Machine;
use crate::support::nobody::{AS_NOBODY, NO_LIMITS_RAISED, OWN_PLACES, cannot, wrapped};
use hexad_support::not_run::{lacking, not_run};

/// Priorities for a user: what a unit has with `AmbientCapabilities=CAP_SYS_NICE`.
const NICE: &[&str] = &["--inh-caps=-all,+sys_nice", "--ambient-caps=-all,+sys_nice"];

/// Moves itself to a cgroup, then becomes what follows.
const MOVED: &str = "echo $$ > \"$0\"/cgroup.procs && exec \"$@\"";

#[test]
#[ignore = "second tier: needs root"]
fn a_user_without_rights() {
    refuses(
        "a_user_without_rights",
        "",
        &[OWN_PLACES, NO_LIMITS_RAISED, AS_NOBODY],
        &[
            "no FIFO priority 80: no CAP_SYS_NICE, and RLIMIT_RTPRIO is 0; give CAP_SYS_NICE or LimitRTPRIO=80",
            "no FIFO priority 79: no CAP_SYS_NICE, and RLIMIT_RTPRIO is 0; give CAP_SYS_NICE or LimitRTPRIO=79",
            "no bound on idle states: /dev/cpu_dma_latency is of user ",
            "no locked memory: no CAP_IPC_LOCK, and RLIMIT_MEMLOCK is 64 kB, ",
        ],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn a_user_with_one_capability() {
    refuses(
        "a_user_with_one_capability",
        "",
        &[OWN_PLACES, NO_LIMITS_RAISED, AS_NOBODY, NICE],
        &["no bound on idle states: ", "no locked memory: no CAP_IPC_LOCK, and RLIMIT_MEMLOCK is 64 kB, "],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn a_user_who_wants_sched_deadline() {
    let deadline = "scheduler = \"deadline\"";
    refuses(
        "a_user_who_wants_sched_deadline",
        deadline,
        &[OWN_PLACES, NO_LIMITS_RAISED, AS_NOBODY],
        &[
            "no deadline scheduling with 400 us of every 1000 us: no CAP_SYS_NICE, and no limit replaces it; give it \
         (AmbientCapabilities=CAP_SYS_NICE, docker --cap-add=SYS_NICE), or choose realtime.scheduler = \"fifo\"",
            "no FIFO priority 79: ",
            "no bound on idle states: ",
            "no locked memory: ",
        ],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn root_of_a_user_namespace_only() {
    let namespace = &["unshare", "--user", "--map-root-user"];
    let lacking = "of the host (this is a user namespace), and RLIMIT_";
    refuses(
        "root_of_a_user_namespace_only",
        "",
        &[OWN_PLACES, NO_LIMITS_RAISED, namespace],
        &[
            &format!(
                "no FIFO priority 80: no CAP_SYS_NICE {lacking}RTPRIO is 0; give LimitRTPRIO=80 (ulimit -r 80); the container"
            ),
            "no FIFO priority 79: no CAP_SYS_NICE of the host",
            &format!("no locked memory: no CAP_IPC_LOCK {lacking}MEMLOCK is 64 kB"),
        ],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn a_cgroup_without_a_real_time_budget() {
    let Some(group) = Group::new("a_cgroup_without_a_real_time_budget", "cpu", "cpu.rt_runtime_us") else {
        return;
    };
    let reason =
        format!("its cgroup has no real-time budget ({}/cpu.rt_runtime_us is 0); write", group.path());
    refuses(
        "a_cgroup_without_a_real_time_budget",
        "",
        &[&["sh", "-c", MOVED, group.path()]],
        &[&format!("no FIFO priority 80: {reason}"), &format!("no FIFO priority 79: {reason}")],
    );
}

#[test]
fn a_processor_that_is_not_there() {
    refuses(
        "a_processor_that_is_not_there",
        "io_cpu = 1023",
        &[&["env"]],
        &["no binding to CPU 1023: it is not online (0"],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn a_processor_outside_the_cpuset() {
    let Some(group) = Group::new("a_processor_outside_the_cpuset", "cpuset", "cpuset.cpus") else { return };
    if available_parallelism().is_ok_and(|count| count.get() == 1) {
        not_run("this machine has one processor");
        return;
    }
    group.set("cpuset.cpus", "0");
    group.set("cpuset.mems", "0");
    refuses(
        "a_processor_outside_the_cpuset",
        "cpu = 1",
        &[&["sh", "-c", MOVED, group.path()]],
        &["no binding to CPU 1: the cpuset of its cgroup allows only 0; choose"],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn sched_deadline_on_some_processors_only() {
    if available_parallelism().is_ok_and(|count| count.get() == 1) {
        not_run("this machine has one processor");
        return;
    }
    let deadline = "scheduler = \"deadline\"";
    refuses(
        "sched_deadline_on_some_processors_only",
        deadline,
        &[&["taskset", "-c", "0"]],
        &[
            "no deadline scheduling with 400 us of every 1000 us: it may run on CPU 0 only, and such threads must be \
         free to run on all; allow it CPU 1",
        ],
    );
}

#[test]
#[ignore = "second tier: needs root"]
fn sched_deadline_at_20_khz() {
    let settings = "scheduler = \"deadline\"\nrate_hz = 20000";
    refuses(
        "sched_deadline_at_20_khz",
        settings,
        &[&["env"]],
        &[
            "no deadline scheduling with 20 us of every 50 us: a period of 50 us is not within the kernel's 100 to ",
        ],
    );
}

/// With these keys of `[realtime]` and behind these wrappers the daemon does not start, for these reasons
/// and no other.
#[apply(beside_others)]
fn refuses(test: &str, settings: &str, wrappers: &[&[&str]], reasons: &[&str]) {
    if cannot(&[&["chrt", "-f", "1"]]) || cannot(wrappers) {
        return;
    }
    let machine = Machine::with(test, &format!("[realtime]\nrequire_realtime = true\n{settings}\n"));
    let mut command = wrapped(&machine, wrappers);
    command.args(["run", "--config"]).arg(&machine.file);
    let Ended { status, stderr, .. } = Hexad::spawn(&machine, "run", command).ends();
    assert_eq!(status.code(), Some(2), "{stderr}");
    assert!(!stderr.contains("running"), "{stderr}");
    let refusal = stderr.lines().find_map(|line| line.strip_prefix("hexad: ")).unwrap_or_default();
    let named = refusal.strip_prefix("realtime.require_realtime is set, and there is ").unwrap_or_default();
    for reason in reasons {
        assert!(named.contains(reason), "{reason:?} must be in\n{stderr}");
    }
    // Besides what the file's examination warns of, by its key.
    let warnings = stderr.lines().filter_map(|line| line.split_once(" WARN "));
    let told: Vec<_> = warnings.filter(|(_, warning)| !warning.starts_with("realtime.")).collect();
    // A container may lack this device.
    let is_more =
        !Path::new("/dev/cpu_dma_latency").exists() && reasons.iter().all(|it| !it.contains("idle states"));
    assert_eq!(told.len(), reasons.len() + usize::from(is_more), "{stderr}");
    assert!(told.iter().all(|(_, warning)| named.contains(warning)), "{stderr}");
}

/// A cgroup (v1) of a test's own, removed when dropped.
struct Group(PathBuf);

impl Group {
    /// Says why there is none where the controller is not mounted, or has no such file.
    fn new(test: &str, controller: &str, file: &str) -> Option<Self> {
        let path = PathBuf::from(format!("/sys/fs/cgroup/{controller}/hexad-{test}-{}", process::id()));
        let group = match fs::create_dir(&path) {
            Ok(()) => Self(path),
            Err(error) => {
                let why = format!("{}: {error}", path.display());
                let say = if error.kind() == ErrorKind::PermissionDenied { lacking } else { not_run };
                say(&why);
                return None;
            }
        };
        if group.0.join(file).exists() {
            return Some(group);
        }
        not_run(&format!("this kernel has no {file}"));
        None
    }

    fn path(&self) -> &str {
        self.0.to_str().expect("a plain name")
    }

    fn set(&self, file: &str, value: &str) {
        fs::write(self.0.join(file), value).expect("a setting of the group");
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        // Its processes have ended; if it stays it is empty.
        let _ = fs::remove_dir(&self.0);
    }
}
