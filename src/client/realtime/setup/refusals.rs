//! Reason and remedy of every set-up step that the kernel refuses.
//!
//! Reasons are checked in the order in which the kernel checks them, so that each remedy leads one check further.

use core::fmt::{self, Display, Formatter};
use std::fs;
use std::io::Error;
use std::os::unix::fs::MetadataExt;

use super::Shortfall;
use super::budget::GroupBudget;
use super::deadline::Reservation;
use super::permissions::{CPU_DMA_LATENCY, Permissions};

/// Locked memory that the ports of peers may still add \[kB\]: with a limit below, one that connects later
/// could not be served.
const ROOM_FOR_PEERS_KB: u64 = 16 * 1024;

/// A step of the set-up that the kernel may refuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetupStep {
    /// SCHED_FIFO at this priority.
    Fifo(i32),
    /// SCHED_DEADLINE.
    Deadline(Reservation),
    /// One CPU for the thread.
    Cpu(usize),
    /// Every page in memory, now and later.
    LockedMemory,
    /// Processors kept out of deep idle states.
    WakeupLatency,
}

impl Display for SetupStep {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fifo(priority) => write!(out, "FIFO priority {priority}"),
            Self::Deadline(reservation) => write!(out, "deadline scheduling with {reservation}"),
            Self::Cpu(cpu) => write!(out, "binding to CPU {cpu}"),
            Self::LockedMemory => out.write_str("locked memory"),
            Self::WakeupLatency => out.write_str("bound on idle states"),
        }
    }
}

/// A reason and its remedy.
type Explanation = (String, String);

impl Permissions {
    /// The refusal to expect for a step; `None` if the permissions suffice.
    pub fn refusal_of(&self, step: &SetupStep) -> Option<Shortfall> {
        let why = match step {
            SetupStep::Fifo(priority) => self.why_no_fifo(*priority),
            SetupStep::Deadline(reservation) => self.why_no_deadline(reservation),
            SetupStep::Cpu(cpu) => self.why_no_cpu(*cpu),
            SetupStep::LockedMemory => self.why_no_locked_memory(),
            SetupStep::WakeupLatency => self.why_no_wakeup_latency(),
        };
        why.map(|why| shortfall(step, why))
    }

    fn why_no_fifo(&self, priority: i32) -> Option<Explanation> {
        let limit = self.priority_limit;
        if !self.sys_nice && limit < u64::try_from(priority).unwrap_or_default() {
            let reason = format!("{}, and RLIMIT_RTPRIO is {limit}", self.without("CAP_SYS_NICE"));
            let [unit, container] = [
                format!("LimitRTPRIO={priority} (ulimit -r {priority})"),
                format!("--ulimit rtprio={priority}"),
            ];
            let remedy = self.capability_or_limit("SYS_NICE", &unit, &container);
            return Some((reason, remedy));
        }
        match &self.group_budget {
            GroupBudget::Limited { file, budget_us: 0, .. } => Some((
                format!("its cgroup has no real-time budget ({} is 0)", file.display()),
                "write one there, in the groups above it first (echo 950000), or start it in another cgroup"
                    .into(),
            )),
            _ => None,
        }
    }

    fn why_no_deadline(&self, reservation: &Reservation) -> Option<Explanation> {
        let fifo = "or choose realtime.scheduler = \"fifo\"";
        if !self.sys_nice {
            let remedy = if self.user_namespace {
                "choose realtime.scheduler = \"fifo\"".into()
            } else {
                format!("give it (AmbientCapabilities=CAP_SYS_NICE, docker --cap-add=SYS_NICE), {fifo}")
            };
            return Some((format!("{}, and no limit replaces it", self.without("CAP_SYS_NICE")), remedy));
        }
        let (shortest, longest) = self.deadline_period_us;
        let period_us = reservation.period_ns / 1000;
        if period_us < shortest || period_us > longest {
            return Some((
                format!("a period of {period_us} us is not within the kernel's {shortest} to {longest} us"),
                format!("set kernel.sched_deadline_period_min_us and _max_us (sysctl), {fifo}"),
            ));
        }
        let missing = self.cpus_online.without(&self.cpus_isolated).without(&self.cpus);
        (!missing.is_empty()).then(|| {
            (
                format!("it may run on CPU {} only, and such threads must be free to run on all", self.cpus),
                format!("allow it CPU {missing} too (CPUAffinity=, taskset, cpuset), {fifo}"),
            )
        })
    }

    fn why_no_cpu(&self, cpu: usize) -> Option<Explanation> {
        let Self { cpus_online, cpus_permitted, .. } = self;
        if !cpus_online.contains(cpu) {
            return Some((
                format!("it is not online ({cpus_online} are)"),
                "choose one that is, or boot with it".into(),
            ));
        }
        (!cpus_permitted.contains(cpu)).then(|| {
            (
                format!("the cpuset of its cgroup allows only {cpus_permitted}"),
                "choose one of these, or allow it there (AllowedCPUs=, docker --cpuset-cpus)".into(),
            )
        })
    }

    fn why_no_locked_memory(&self) -> Option<Explanation> {
        let limit_kb = self.locked_limit_kb.filter(|_| !self.ipc_lock)?;
        let needed_kb = self.mapped_kb + ROOM_FOR_PEERS_KB;
        (limit_kb < needed_kb).then(|| {
            let lacking = format!("{}, and RLIMIT_MEMLOCK is {limit_kb} kB", self.without("CAP_IPC_LOCK"));
            let unit = "LimitMEMLOCK=infinity (ulimit -l unlimited)";
            let remedy = self.capability_or_limit("IPC_LOCK", unit, "--ulimit memlock=-1");
            (format!("{lacking}, of {needed_kb} kB of address space with room for peers"), remedy)
        })
    }

    fn why_no_wakeup_latency(&self) -> Option<Explanation> {
        Some(match self.cpu_dma_latency.err()? {
            libc::ENOENT => (
                format!("there is no {CPU_DMA_LATENCY}"),
                if self.container {
                    format!("start the container with --device={CPU_DMA_LATENCY}")
                } else {
                    "use a kernel with CONFIG_CPU_IDLE".into()
                },
            ),
            libc::EACCES => (
                format!("{CPU_DMA_LATENCY} is {}", owner_and_mode()),
                format!("give this user's group the right to it (chgrp and chmod 660 {CPU_DMA_LATENCY})"),
            ),
            // The file allows it: the list of devices of the cgroup does not.
            libc::EPERM => (
                format!("the cgroup does not allow {CPU_DMA_LATENCY}"),
                format!("allow it (DeviceAllow={CPU_DMA_LATENCY} rw, docker --device={CPU_DMA_LATENCY})"),
            ),
            number => (Error::from_raw_os_error(number).to_string(), format!("look at {CPU_DMA_LATENCY}")),
        })
    }

    /// The remedy where one of the two suffices. A container cannot grant a right that it does not have.
    fn capability_or_limit(&self, capability: &str, unit: &str, container: &str) -> String {
        let first = "the container needs it first";
        match (self.user_namespace, self.container) {
            (true, _) => format!("give {unit}; {first} ({container})"),
            (_, true) => format!(
                "give CAP_{capability} or {unit}; {first} (docker --cap-add={capability} or {container})"
            ),
            _ => format!("give CAP_{capability} or {unit}"),
        }
    }

    /// "no CAP_...", in a user namespace "of the host".
    fn without(&self, capability: &str) -> String {
        let whose = if self.user_namespace { " of the host (this is a user namespace)" } else { "" };
        format!("no {capability}{whose}")
    }

    /// Reason and remedy of a refusal that [`Permissions::refusal_of`] does not foresee.
    fn unforeseen(&self, step: &SetupStep, error: &Error) -> Explanation {
        let fifo = matches!(step, SetupStep::Fifo(_));
        match (error.raw_os_error(), &self.group_budget) {
            (Some(libc::EPERM), _) if self.filtered => (
                "a filter of system calls refuses it".into(),
                "RestrictRealtime=no in the unit; in a container, a seccomp profile that allows it".into(),
            ),
            (Some(libc::EPERM), GroupBudget::Unknown { group }) if fifo => (
                format!("cgroup {} has no real-time budget (CONFIG_RT_GROUP_SCHED)", group.display()),
                "boot with rt_group_sched=0 (Linux 6.16 and newer), or start it in the root cgroup".into(),
            ),
            (Some(libc::EBUSY), _) => (
                "other deadline threads leave less than that of what the kernel admits in total".into(),
                "end some, or raise kernel.sched_rt_runtime_us (sysctl)".into(),
            ),
            _ => (error.to_string(), "see sched(7) and mlock(2)".into()),
        }
    }
}

/// The refusal of a step by the last system call of this thread.
pub(super) fn of(step: &SetupStep) -> Shortfall {
    explained(step, &Error::last_os_error())
}

/// The refusal of a step with this error.
pub(super) fn explained(step: &SetupStep, error: &Error) -> Shortfall {
    let facts = Permissions::of_this_process();
    facts.refusal_of(step).unwrap_or_else(|| shortfall(step, facts.unforeseen(step, error)))
}

fn shortfall(step: &SetupStep, (reason, remedy): Explanation) -> Shortfall {
    Shortfall { what: step.to_string(), reason, remedy }
}

/// As `ls` shows it.
fn owner_and_mode() -> String {
    let Ok(about) = fs::metadata(CPU_DMA_LATENCY) else { return "not to be seen".into() };
    format!("of user {} and group {}, mode {:o}", about.uid(), about.gid(), about.mode() & 0o777)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::setup::cpus::Cpus;

    /// Two processors, no right at all, in a container that does not see the host's.
    fn contained() -> Permissions {
        let cpus = || Cpus::parse("0-1").unwrap();
        Permissions {
            sys_nice: false,
            ipc_lock: false,
            user_namespace: false,
            container: true,
            filtered: false,
            priority_limit: 0,
            locked_limit_kb: Some(8192),
            mapped_kb: 1000,
            cpus: cpus(),
            cpus_permitted: cpus(),
            cpus_online: cpus(),
            cpus_isolated: Cpus::default(),
            group_budget: GroupBudget::Unlimited,
            deadline_period_us: (100, 4_194_304),
            cpu_dma_latency: Err(libc::ENOENT),
        }
    }

    const DEADLINE: SetupStep = SetupStep::Deadline(Reservation { budget_ns: 400_000, period_ns: 1_000_000 });

    #[test]
    fn a_container_gets_the_options_to_start_it_with() {
        let facts = contained();
        for (step, reason, remedy) in [
            (
                SetupStep::Fifo(80),
                "no CAP_SYS_NICE, and RLIMIT_RTPRIO is 0",
                "--cap-add=SYS_NICE or --ulimit rtprio=80",
            ),
            (DEADLINE, "no CAP_SYS_NICE, and no limit replaces it", "--cap-add=SYS_NICE), or choose"),
            (
                SetupStep::LockedMemory,
                "RLIMIT_MEMLOCK is 8192 kB, of 17384 kB",
                "--cap-add=IPC_LOCK or --ulimit memlock=-1",
            ),
            (SetupStep::WakeupLatency, "there is no /dev/cpu_dma_latency", "--device=/dev/cpu_dma_latency"),
        ] {
            let shortfall = facts.refusal_of(&step).unwrap();
            assert!(shortfall.reason.contains(reason), "{shortfall}");
            assert!(shortfall.remedy.contains(remedy), "{shortfall}");
        }
    }

    #[test]
    fn a_granted_step_is_not_refused() {
        let limits = Permissions { priority_limit: 80, locked_limit_kb: None, ..contained() };
        let capable = Permissions { sys_nice: true, ipc_lock: true, cpu_dma_latency: Ok(()), ..contained() };
        for (facts, step) in [
            (&limits, SetupStep::Fifo(80)),
            (&limits, SetupStep::LockedMemory),
            (&capable, SetupStep::Fifo(80)),
            (&capable, SetupStep::LockedMemory),
            (&capable, DEADLINE),
            (&capable, SetupStep::Cpu(1)),
            (&capable, SetupStep::WakeupLatency),
        ] {
            assert_eq!(facts.refusal_of(&step), None);
        }
        let almost = limits.refusal_of(&SetupStep::Fifo(81)).unwrap();
        assert!(almost.reason.contains("RLIMIT_RTPRIO is 80"), "{almost}");
        // Isolated processors are none that such a thread has to be free to run on.
        let isolated = Permissions {
            cpus: Cpus::parse("0").unwrap(),
            cpus_isolated: Cpus::parse("1").unwrap(),
            ..capable
        };
        assert_eq!(isolated.refusal_of(&DEADLINE), None);
    }

    #[test]
    fn an_unforeseen_refusal_is_explained_by_the_error() {
        let group = GroupBudget::Unknown { group: "/sys/fs/cgroup/a.slice".into() };
        let grouped = Permissions { group_budget: group, ..contained() };
        let filtered = Permissions { filtered: true, ..grouped.clone() };
        for (facts, step, number, expected) in [
            (
                &grouped,
                SetupStep::Fifo(80),
                libc::EPERM,
                "cgroup /sys/fs/cgroup/a.slice has no real-time budget",
            ),
            (&grouped, DEADLINE, libc::EPERM, "Operation not permitted"),
            (&filtered, SetupStep::Fifo(80), libc::EPERM, "a filter of system calls"),
            (&grouped, DEADLINE, libc::EBUSY, "other deadline threads"),
        ] {
            let (reason, _) = facts.unforeseen(&step, &Error::from_raw_os_error(number));
            assert!(reason.contains(expected), "{reason}");
        }
    }
}
