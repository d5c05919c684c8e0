//! Permissions of this process for the real-time set-up, read from the kernel. Reading applies nothing.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::Path;

use super::budget::GroupBudget;
use super::cpus::Cpus;

/// Bits of `CapEff`; see capabilities(7).
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// Inodes of the namespaces that the kernel begins with; see `linux/nsfs.h`.
const INITIAL_USER_NAMESPACE: &str = "user:[4026531837]";
const INITIAL_PID_NAMESPACE: &str = "pid:[4026531836]";

/// `SECCOMP_MODE_FILTER` in `/proc/self/status`.
const SECCOMP_MODE_FILTER: u64 = 2;

/// Device for PM QoS requests on the wake-up latency of processors.
pub const CPU_DMA_LATENCY: &str = "/dev/cpu_dma_latency";

/// Permissions and limits of this process; those of the calling thread say so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Permissions {
    /// Whether `CAP_SYS_NICE` is in effect. Never in a user namespace: there the kernel does not honour it.
    pub sys_nice: bool,
    /// Whether `CAP_IPC_LOCK` is in effect, in the same way.
    pub ipc_lock: bool,
    /// Whether this is a user namespace other than the host's (rootless container).
    pub user_namespace: bool,
    /// Whether this is a container: it does not see the processes of the host.
    pub container: bool,
    /// Whether system calls are filtered.
    pub filtered: bool,
    /// `RLIMIT_RTPRIO`: highest FIFO priority without `CAP_SYS_NICE`.
    pub priority_limit: u64,
    /// `RLIMIT_MEMLOCK` without `CAP_IPC_LOCK` \[kB\]; `None` if there is no limit.
    pub locked_limit_kb: Option<u64>,
    /// Address space that locking all memory would count \[kB\].
    pub mapped_kb: u64,
    /// Affinity of the calling thread.
    pub cpus: Cpus,
    /// Processors that a thread may be bound to.
    pub cpus_permitted: Cpus,
    /// Processors that are online.
    pub cpus_online: Cpus,
    /// Processors among those that the scheduler does not spread threads over.
    pub cpus_isolated: Cpus,
    /// Budget of the cgroup for FIFO threads.
    pub group_budget: GroupBudget,
    /// Shortest and longest period of SCHED_DEADLINE \[us\].
    pub deadline_period_us: (u64, u64),
    /// The error number of opening `/dev/cpu_dma_latency` for writing, which requests nothing yet.
    pub cpu_dma_latency: Result<(), i32>,
}

impl Permissions {
    /// Reads the permissions. Allocates, reads files and starts a thread.
    pub fn of_this_process() -> Self {
        let status = fs::read_to_string("/proc/thread-self/status").unwrap_or_default();
        let user_namespace = !is_namespace("user", INITIAL_USER_NAMESPACE);
        let capabilities = field(&status, "CapEff:", 16);
        let has = |bit: u32| !user_namespace && capabilities >> bit & 1 == 1;
        let limits = fs::read_to_string("/proc/self/limits").unwrap_or_default();
        Self {
            sys_nice: has(CAP_SYS_NICE),
            ipc_lock: has(CAP_IPC_LOCK),
            user_namespace,
            container: !is_namespace("pid", INITIAL_PID_NAMESPACE),
            filtered: field(&status, "Seccomp:", 10) == SECCOMP_MODE_FILTER,
            priority_limit: limit(&limits, "Max realtime priority").unwrap_or(u64::MAX),
            locked_limit_kb: limit(&limits, "Max locked memory").map(|bytes| bytes / 1024),
            mapped_kb: field(&status, "VmSize:", 10),
            cpus: Cpus::of_this_thread(),
            cpus_permitted: Cpus::permitted(),
            cpus_online: Cpus::online(),
            cpus_isolated: Cpus::isolated(),
            group_budget: GroupBudget::of_this_process(),
            deadline_period_us: (
                kernel_setting("deadline_period_min_us"),
                kernel_setting("deadline_period_max_us"),
            ),
            cpu_dma_latency: open_cpu_dma_latency()
                .map(drop)
                .map_err(|error| error.raw_os_error().unwrap_or_default()),
        }
    }
}

/// Opens the device for writing a request and reading the one in force.
pub(super) fn open_cpu_dma_latency() -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(CPU_DMA_LATENCY)
}

/// A number of `/proc/.../status`; 0 if it is not there.
fn field(status: &str, name: &str, radix: u32) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix(name));
    let word = line.and_then(|line| line.split_whitespace().next());
    word.and_then(|word| u64::from_str_radix(word, radix).ok()).unwrap_or_default()
}

/// Whether this process is in this namespace. A kernel without namespaces has only the first.
fn is_namespace(kind: &str, name: &str) -> bool {
    fs::read_link(format!("/proc/self/ns/{kind}")).map_or(true, |link| link == Path::new(name))
}

/// `/proc/sys/kernel/sched_*`, 0 if it is not there.
fn kernel_setting(name: &str) -> u64 {
    let text = fs::read_to_string(format!("/proc/sys/kernel/sched_{name}"));
    text.ok().and_then(|text| text.trim().parse().ok()).unwrap_or_default()
}

/// A soft limit of `/proc/self/limits`; `None` if there is none.
fn limit(limits: &str, name: &str) -> Option<u64> {
    limits.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}
