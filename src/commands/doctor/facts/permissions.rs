//! What this process is allowed: found by doing what the daemon does, explained by what the kernel tells.

use super::Fact;
use crate::config::deployment::{Realtime, Scheduler};
use crate::realtime::setup::Shortfall;
use crate::realtime::setup::budget::GroupBudget;
use crate::realtime::setup::permissions::Permissions;

/// What the set-up of the daemon was refused here.
#[derive(Clone, Debug, Default)]
pub struct Refused {
    /// To the real-time thread: its scheduling class, its processor.
    pub thread: Vec<Shortfall>,
    pub shallow_sleep: Option<Shortfall>,
    pub locked_memory: Option<Shortfall>,
}

impl Refused {
    /// All of it.
    pub fn all(&self) -> impl Iterator<Item = &Shortfall> {
        self.thread.iter().chain(&self.shallow_sleep).chain(&self.locked_memory)
    }
}

fn lacking(name: &str, shortfall: &Shortfall) -> Fact {
    let Shortfall { what, reason, remedy } = shortfall;
    Fact::bad(name, format!("no {what}: {reason}"), remedy.as_str())
}

/// Class and priority of the real-time thread, and its binding.
pub fn scheduling(permissions: &Permissions, realtime: &Realtime, refused: &Refused) -> Vec<Fact> {
    let name = "scheduling";
    if !refused.thread.is_empty() {
        return refused.thread.iter().map(|shortfall| lacking(name, shortfall)).collect();
    }
    let class = match realtime.scheduler {
        Scheduler::Fifo => format!("FIFO priority {}", realtime.priority),
        Scheduler::Deadline => "SCHED_DEADLINE".into(),
    };
    let limit = permissions.priority_limit;
    let by = if permissions.sys_nice { "CAP_SYS_NICE".into() } else { format!("RLIMIT_RTPRIO {limit}") };
    std::vec![Fact::good(name, format!("{class} granted ({by})"))]
}

/// Whether pages stay in memory.
pub fn locked_memory(permissions: &Permissions, realtime: &Realtime, refused: &Refused) -> Fact {
    let name = "locked memory";
    if !realtime.lock_memory {
        return Fact::bad(
            name,
            "not asked for: pages may have to be read again",
            "realtime.lock_memory = true",
        );
    }
    match (&refused.locked_memory, permissions.locked_limit_kb) {
        (Some(shortfall), _) => lacking(name, shortfall),
        (None, _) if permissions.ipc_lock => Fact::good(name, "granted (CAP_IPC_LOCK)"),
        (None, Some(limit)) => Fact::good(name, format!("granted (RLIMIT_MEMLOCK {limit} kB)")),
        (None, None) => Fact::good(name, "granted (RLIMIT_MEMLOCK unlimited)"),
    }
}

/// The group's budget of real-time scheduling.
pub fn cgroup(permissions: &Permissions, refused: &Refused) -> Fact {
    let name = "cgroup";
    match &permissions.group_budget {
        GroupBudget::Unlimited => Fact::good(name, "does not limit real-time threads"),
        GroupBudget::Limited { file, budget_us: 0 } => Fact::bad(
            name,
            format!("has no budget for real-time threads ({})", file.display()),
            format!("write one there, in the groups above it first: echo 950000 > {}", file.display()),
        ),
        GroupBudget::Limited { file, budget_us } => {
            Fact::good(name, format!("{budget_us} us a period for real-time threads ({})", file.display()))
        }
        GroupBudget::Unknown { group } if refused.thread.is_empty() => {
            Fact::good(name, format!("{} does not limit real-time threads", group.display()))
        }
        GroupBudget::Unknown { group } => {
            Fact::unknown(name, format!("{} does not tell its budget", group.display()), None)
        }
    }
}

/// Whether rights come from a container.
pub fn container(permissions: &Permissions) -> Fact {
    let name = "container";
    let found = match (permissions.container, permissions.user_namespace) {
        (false, false) => return Fact::good(name, "none"),
        (_, true) => "of a user: no capability of the host holds",
        (true, false) => "its rights come from how it was started",
    };
    Fact::fair(name, found, "or run the daemon on the host itself")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::demo::DEFAULT_MACHINE;
    use crate::commands::doctor::facts::Rating;
    use crate::config::Config;

    fn shortfall(what: &str) -> Shortfall {
        Shortfall { what: what.into(), reason: "it is not allowed".into(), remedy: "allow it".into() }
    }

    fn realtime() -> Realtime {
        Config::parse(DEFAULT_MACHINE, "test").unwrap().deployment.realtime
    }

    #[test]
    fn what_was_refused_is_bad_and_says_why() {
        let permissions = Permissions::of_this_process();
        let refused = Refused {
            thread: vec![shortfall("FIFO priority 80"), shortfall("binding to CPU 7")],
            locked_memory: Some(shortfall("locked memory")),
            shallow_sleep: None,
        };
        let facts = scheduling(&permissions, &realtime(), &refused);
        let found: Vec<_> = facts.iter().map(|fact| (fact.rating, fact.found.as_str())).collect();
        assert_eq!(
            found,
            [
                (Rating::Bad, "no FIFO priority 80: it is not allowed"),
                (Rating::Bad, "no binding to CPU 7: it is not allowed")
            ]
        );
        let fact = locked_memory(&permissions, &realtime(), &refused);
        assert_eq!(fact, Fact::bad("locked memory", "no locked memory: it is not allowed", "allow it"));
    }

    #[test]
    fn what_was_granted_says_by_what() {
        let refused = Refused::default();
        let lesser = Permissions {
            sys_nice: false,
            ipc_lock: false,
            priority_limit: 90,
            locked_limit_kb: None,
            ..Permissions::of_this_process()
        };
        let greater = Permissions { sys_nice: true, ipc_lock: true, ..lesser.clone() };
        let found = |permissions: &Permissions| {
            let facts = scheduling(permissions, &realtime(), &refused);
            [facts[0].clone(), locked_memory(permissions, &realtime(), &refused)].map(|fact| fact.found)
        };
        assert_eq!(
            found(&greater),
            ["FIFO priority 80 granted (CAP_SYS_NICE)", "granted (CAP_IPC_LOCK)"].map(ToString::to_string)
        );
        let limits = ["FIFO priority 80 granted (RLIMIT_RTPRIO 90)", "granted (RLIMIT_MEMLOCK unlimited)"];
        assert_eq!(found(&lesser), limits.map(ToString::to_string));
        let unlocked = Realtime { lock_memory: false, ..realtime() };
        assert_eq!(locked_memory(&greater, &unlocked, &refused).rating, Rating::Bad);
    }

    #[test]
    fn budgets_of_a_group_are_told_apart() {
        let of = |budget_us| GroupBudget::Limited { file: "/c/cpu.rt_runtime_us".into(), budget_us };
        let unseen = GroupBudget::Unknown { group: "/c/g".into() };
        let refused = Refused { thread: vec![shortfall("FIFO priority 80")], ..Refused::default() };
        for (group_budget, refused, rating) in [
            (GroupBudget::Unlimited, &refused, Rating::Good),
            (of(0), &refused, Rating::Bad),
            (of(-1), &refused, Rating::Good),
            (of(950_000), &refused, Rating::Good),
            (unseen.clone(), &refused, Rating::Unknown),
            (unseen, &Refused::default(), Rating::Good),
        ] {
            let permissions = Permissions { group_budget, ..Permissions::of_this_process() };
            let fact = cgroup(&permissions, refused);
            assert_eq!(fact.rating, rating, "{fact:?}");
        }
    }

    #[test]
    fn containers_are_told_apart() {
        for (inside, user_namespace, rating) in
            [(false, false, Rating::Good), (true, false, Rating::Fair), (true, true, Rating::Fair)]
        {
            let facts = Permissions { container: inside, user_namespace, ..Permissions::of_this_process() };
            assert_eq!(container(&facts).rating, rating);
        }
    }
}
