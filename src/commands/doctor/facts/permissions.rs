//! Facts about the rights of this process. They are found by requesting the daemon's rights, and explained by
//! kernel files.

use super::Fact;
use hexad_client::realtime::setup::Shortfall;
use hexad_client::realtime::setup::budget::GroupBudget;
use hexad_client::realtime::setup::permissions::Permissions;
use hexad_machine::config::deployment::{Realtime, Scheduler};

/// Rights that this host refused to the set-up of the daemon.
#[derive(Clone, Debug, Default)]
pub struct RefusedRights {
    /// Scheduling class and processor of the real-time thread.
    pub thread: Vec<Shortfall>,
    pub idle_bound: Option<Shortfall>,
    pub locked_memory: Option<Shortfall>,
}

impl RefusedRights {
    /// All refused rights.
    pub fn all(&self) -> impl Iterator<Item = &Shortfall> {
        self.thread.iter().chain(&self.idle_bound).chain(&self.locked_memory)
    }
}

/// Bad fact for a refused right.
fn refused_fact(shortfall: &Shortfall) -> Fact {
    let Shortfall { what, reason, remedy } = shortfall;
    Fact::bad(format!("no {what}: {reason}"), remedy.as_str())
}

/// Scheduling class, priority and binding of the real-time thread.
pub fn scheduling(permissions: &Permissions, realtime: &Realtime, refused: &RefusedRights) -> Vec<Fact> {
    if !refused.thread.is_empty() {
        return refused.thread.iter().map(refused_fact).collect();
    }
    let class = match realtime.scheduler {
        Scheduler::Fifo => format!("FIFO priority {}", realtime.priority),
        Scheduler::Deadline => "SCHED_DEADLINE".into(),
    };
    let limit = permissions.priority_limit;
    let by = if permissions.sys_nice { "CAP_SYS_NICE".into() } else { format!("RLIMIT_RTPRIO {limit}") };
    vec![Fact::good(format!("{class} granted ({by})"))]
}

/// Whether the pages of the process stay in memory.
pub fn locked_memory(permissions: &Permissions, realtime: &Realtime, refused: &RefusedRights) -> Fact {
    if !realtime.lock_memory {
        return Fact::bad(
            "not requested: the kernel may move pages to a disk",
            "realtime.lock_memory = true",
        );
    }
    match (&refused.locked_memory, permissions.locked_limit_kb) {
        (Some(shortfall), _) => refused_fact(shortfall),
        (None, _) if permissions.ipc_lock => Fact::good("granted (CAP_IPC_LOCK)"),
        (None, Some(limit)) => Fact::good(format!("granted (RLIMIT_MEMLOCK {limit} kB)")),
        (None, None) => Fact::good("granted (RLIMIT_MEMLOCK unlimited)"),
    }
}

/// Budget of the process's cgroup for real-time scheduling.
pub fn cgroup(permissions: &Permissions, realtime: &Realtime, refused: &RefusedRights) -> Fact {
    if let Some(shortfall) = permissions.group_budget.shortfall(realtime.needed_share()) {
        return refused_fact(&shortfall);
    }
    match &permissions.group_budget {
        GroupBudget::Unlimited => Fact::good("does not limit real-time threads"),
        GroupBudget::Limited { file, budget_us: 0, .. } => Fact::bad(
            format!("has no budget for real-time threads ({})", file.display()),
            format!("write one there, in the groups above it first: echo 950000 > {}", file.display()),
        ),
        GroupBudget::Limited { file, budget_us, .. } => {
            Fact::good(format!("{budget_us} us a period for real-time threads ({})", file.display()))
        }
        GroupBudget::Unknown { group } if refused.thread.is_empty() => {
            Fact::good(format!("{} does not limit real-time threads", group.display()))
        }
        GroupBudget::Unknown { group } => {
            Fact::unknown(format!("{} does not show its budget", group.display()), None)
        }
    }
}

/// Whether the process runs in a container, which limits its rights.
pub fn container(permissions: &Permissions) -> Fact {
    let found = match (permissions.container, permissions.user_namespace) {
        (false, false) => return Fact::good("none"),
        (_, true) => "of a user namespace: no capability of the host holds",
        (true, false) => "its rights come from how it was started",
    };
    Fact::fair(found, "or run the daemon on the host itself")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use crate::commands::doctor::facts::tests::*;
    use hexad_machine::config::Config;

    fn shortfall(what: &str) -> Shortfall {
        Shortfall { what: what.into(), reason: "it is not allowed".into(), remedy: "allow it".into() }
    }

    fn realtime() -> Realtime {
        Config::parse(DEFAULT_CONFIG, "test").unwrap().deployment.realtime
    }

    #[test]
    fn refused_rights_are_bad_and_have_a_reason() {
        let permissions = Permissions::of_this_process();
        let refused = RefusedRights {
            thread: vec![shortfall("FIFO priority 80"), shortfall("binding to CPU 7")],
            locked_memory: Some(shortfall("locked memory")),
            idle_bound: None,
        };
        let facts = scheduling(&permissions, &realtime(), &refused);
        let found: Vec<_> = facts.iter().map(|fact| (fact.assessment, fact.found.as_str())).collect();
        let [priority, binding] =
            ["no FIFO priority 80", "no binding to CPU 7"].map(|what| format!("{what}: it is not allowed"));
        assert_eq!(found, [(Bad, priority.as_str()), (Bad, binding.as_str())]);
        let fact = locked_memory(&permissions, &realtime(), &refused);
        assert_eq!(fact, Fact::bad("no locked memory: it is not allowed", "allow it"));
    }

    #[test]
    fn granted_rights_name_their_source() {
        let refused = RefusedRights::default();
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
        assert_eq!(locked_memory(&greater, &unlocked, &refused).assessment, Bad);
    }

    #[test]
    fn budgets_of_a_group_are_distinguished() {
        let of = |budget_us| {
            let file = "/c/cpu.rt_runtime_us".into();
            GroupBudget::Limited { file, budget_us, period_us: 1_000_000 }
        };
        let unseen = GroupBudget::Unknown { group: "/c/g".into() };
        let refused =
            RefusedRights { thread: vec![shortfall("FIFO priority 80")], ..RefusedRights::default() };
        for (group_budget, refused, assessment) in [
            (GroupBudget::Unlimited, &refused, Good),
            (of(0), &refused, Bad),
            (of(-1), &refused, Good),
            (of(4000), &refused, Bad),
            (of(950_000), &refused, Good),
            (unseen.clone(), &refused, Unknown),
            (unseen, &RefusedRights::default(), Good),
        ] {
            let permissions = Permissions { group_budget, ..Permissions::of_this_process() };
            let fact = cgroup(&permissions, &realtime(), refused);
            assert_eq!(fact.assessment, assessment, "{fact:?}");
        }
    }

    #[test]
    fn containers_are_distinguished() {
        for (inside, user_namespace, assessment) in
            [(false, false, Good), (true, false, Fair), (true, true, Fair)]
        {
            let facts = Permissions { container: inside, user_namespace, ..Permissions::of_this_process() };
            assert_eq!(container(&facts).assessment, assessment);
        }
    }
}
