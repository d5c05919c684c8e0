//! The real-time budget of a cgroup, where the kernel has them (CONFIG_RT_GROUP_SCHED).

use std::fs;
use std::path::{Path, PathBuf};

use super::Shortfall;

/// Real-time budget of the cgroup of this process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GroupBudget {
    /// Not limited by group: no such kernel, or the root group.
    Unlimited,
    /// cgroup v1 \[us\] per period; with 0 every FIFO thread is refused.
    Limited {
        /// The file that sets it.
        file: PathBuf,
        /// Per period. Negative: all of it.
        budget_us: i64,
        /// The period.
        period_us: i64,
    },
    /// A group of cgroup v2, which has no file for it: a kernel with such budgets gives it none.
    Unknown {
        /// Its folder.
        group: PathBuf,
    },
}

impl GroupBudget {
    /// Reads the budget of this process' cgroup.
    pub fn of_this_process() -> Self {
        let [groups, mounts] = ["/proc/self/cgroup", "/proc/self/mountinfo"]
            .map(|path| fs::read_to_string(path).unwrap_or_default());
        if let Some(folder) = folder(&groups, &mounts, Hierarchy::Cpu) {
            let file = folder.join("cpu.rt_runtime_us");
            let read = |file: &Path| fs::read_to_string(file).ok()?.trim().parse().ok();
            let period_us = read(&folder.join("cpu.rt_period_us")).unwrap_or(USUAL_PERIOD_US);
            let limited = |budget_us| Self::Limited { file: file.clone(), budget_us, period_us };
            return read(&file).map_or(Self::Unlimited, limited);
        }
        // The root group alone has no type.
        folder(&groups, &mounts, Hierarchy::Unified)
            .filter(|folder| folder.join("cgroup.type").exists())
            .map_or(Self::Unlimited, |group| Self::Unknown { group })
    }
}

/// Period of the kernel's default.
const USUAL_PERIOD_US: i64 = 1_000_000;

impl GroupBudget {
    /// What is missing for threads that need a share of a processor: with less the kernel holds them at the end of every period.
    pub fn shortfall(&self, needed: f64) -> Option<Shortfall> {
        let Self::Limited { file, budget_us, period_us } = self else { return None };
        let needed_us = (needed * *period_us as f64).floor();
        // Without any, FIFO priority is refused, which is said there.
        let is_too_small = *budget_us > 0 && (*budget_us as f64) < needed_us;
        is_too_small.then(|| Shortfall {
            what: "sufficient real-time budget of its cgroup".into(),
            reason: format!(
                "{budget_us} us of {period_us} us, and about {needed_us} us are needed ({})",
                file.display()
            ),
            remedy: format!("write more, in the groups above it first (echo 950000 > {})", file.display()),
        })
    }
}

#[derive(Clone, Copy)]
enum Hierarchy {
    /// cgroup v1, controller `cpu`.
    Cpu,
    /// cgroup v2.
    Unified,
}

impl Hierarchy {
    /// Whether `controllers` of a line of `/proc/self/cgroup` is this.
    fn is(self, number: &str, controllers: &str) -> bool {
        match self {
            Self::Cpu => controllers.split(',').any(|controller| controller == "cpu"),
            Self::Unified => number == "0",
        }
    }

    fn is_mounted_as(self, kind: &str, options: &str) -> bool {
        match self {
            Self::Cpu => kind == "cgroup" && options.split(',').any(|option| option == "cpu"),
            Self::Unified => kind == "cgroup2",
        }
    }
}

/// The folder of this process' group.
fn folder(groups: &str, mounts: &str, hierarchy: Hierarchy) -> Option<PathBuf> {
    let path = groups.lines().find_map(|line| {
        let mut fields = line.splitn(3, ':');
        let (number, controllers, path) = (fields.next()?, fields.next()?, fields.next()?);
        hierarchy.is(number, controllers).then_some(path)
    })?;
    let (root, mount_point) = mounts.lines().find_map(|line| {
        let (mount, kind) = line.split_once(" - ")?;
        let (mut mount, mut kind) = (mount.split(' ').skip(3), kind.split(' '));
        let place = (mount.next()?, mount.next()?);
        let (kind, options) = (kind.next()?, kind.nth(1)?);
        hierarchy.is_mounted_as(kind, options).then_some(place)
    })?;
    // A container may see only its own branch, mounted as the whole.
    let below = Path::new(path).strip_prefix(root).unwrap_or(Path::new(""));
    Some(Path::new(mount_point).join(below))
}

#[cfg(test)]
mod tests {
    use super::*;

    const V1: &str = "32 31 0:29 / /sys/fs/cgroup/cpu rw,relatime - cgroup cgroup rw,cpu,cpuacct\n\
                      41 31 0:38 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw\n";
    const BRANCH: &str = "32 31 0:29 /docker/5e /sys/fs/cgroup/cpu ro - cgroup cgroup rw,cpu\n";
    const V2: &str = "30 23 0:26 / /sys/fs/cgroup rw,nosuid shared:9 - cgroup2 cgroup2 rw,nsdelegate\n";

    #[test]
    fn the_folder_of_a_group_is_found() {
        let in_v1 = "4:cpu,cpuacct:/machine\n0::/unit\n";
        let in_branch = "4:cpu:/docker/5e\n";
        let in_v2 = "0::/system.slice/hexad.service\n";
        for (groups, mounts, hierarchy, expected) in [
            (in_v1, V1, Hierarchy::Cpu, Some("/sys/fs/cgroup/cpu/machine")),
            (in_v1, V1, Hierarchy::Unified, Some("/sys/fs/cgroup/unified/unit")),
            (in_branch, BRANCH, Hierarchy::Cpu, Some("/sys/fs/cgroup/cpu")),
            (in_v2, V2, Hierarchy::Cpu, None),
            (in_v2, V2, Hierarchy::Unified, Some("/sys/fs/cgroup/system.slice/hexad.service")),
            ("", "", Hierarchy::Unified, None),
        ] {
            assert_eq!(folder(groups, mounts, hierarchy).as_deref(), expected.map(Path::new), "{groups}");
        }
    }
}
