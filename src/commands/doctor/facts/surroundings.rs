//! What is around the loop: a virtual machine's host, a container, memory and its sharing.

use super::Fact;
use crate::commands::doctor::files::HostFiles;

const MACHINE: &str = "machine";

/// The fact that this is one.
pub fn virtual_machine() -> Fact {
    Fact::bad(
        MACHINE,
        "virtual: its host can take the processors away at any time",
        "use a real computer, or processors that the host pins and reserves",
    )
}

/// Whether another system may take the processors away.
pub fn machine(host: &HostFiles) -> Fact {
    let name = MACHINE;
    let processors = match host.text("proc/cpuinfo") {
        Ok(processors) => processors,
        Err(reason) => return Fact::unknown(name, reason, None),
    };
    let flags = processors.lines().find_map(|line| line.strip_prefix("flags"));
    let told = flags.map(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"));
    let tree = "proc/device-tree";
    match told.or_else(|| host.exists(tree).then(|| host.exists(&format!("{tree}/hypervisor")))) {
        Some(true) => virtual_machine(),
        Some(false) => Fact::good(name, "real, as far as it tells"),
        None => Fact::unknown(name, "whether it is virtual is not told on this architecture", None),
    }
}

/// Whether memory can be moved to a disk.
pub fn swap(host: &HostFiles) -> Fact {
    let name = "swap";
    match host.text("proc/swaps").map(|text| text.lines().count().saturating_sub(1)) {
        Ok(0) => Fact::good(name, "none"),
        Ok(_) => Fact::fair(name, "on: what is not locked may be on a disk, peers included", "swapoff -a"),
        Err(reason) => Fact::unknown(name, reason, None),
    }
}

/// Whether the kernel rearranges memory on its own account.
pub fn huge_pages(host: &HostFiles) -> Fact {
    let name = "huge pages";
    let setting = "sys/kernel/mm/transparent_hugepage/enabled";
    match host.text(setting) {
        Ok(text) if text.contains("[always]") => Fact::fair(
            name,
            "always: the kernel moves memory to make them",
            format!("echo madvise > /{setting}"),
        ),
        Ok(text) if text.contains("[madvise]") => Fact::good(name, "only where asked for"),
        Ok(text) if text.contains("[never]") => Fact::good(name, "never"),
        Ok(text) => Fact::unknown(name, format!("/{setting} is {text:?}"), None),
        Err(reason) => Fact::unknown(name, reason, None),
    }
}

/// Where processes share memory; `others` says why this user has places of its own, if so.
pub fn shared_memory(host: &HostFiles, others: Option<&str>) -> Fact {
    let name = "shared memory";
    let mounts = match host.text("proc/self/mountinfo") {
        Ok(mounts) => mounts,
        Err(reason) => return Fact::unknown(name, reason, None),
    };
    // The last mount hides those before it.
    let kind = mounts.lines().rev().find_map(|line| {
        let (mount, kind) = line.split_once(" - ")?;
        (mount.split(' ').nth(4)? == "/dev/shm").then(|| kind.split(' ').next())?
    });
    match (kind, others) {
        (Some("tmpfs"), None) => Fact::good(name, "/dev/shm"),
        (Some("tmpfs"), Some(others)) => {
            Fact::fair(name, others, "run all participants of a machine as one user")
        }
        (Some(kind), _) => {
            Fact::bad(name, format!("/dev/shm is {kind} and not memory"), "mount -t tmpfs tmpfs /dev/shm")
        }
        (None, _) => Fact::bad(name, "nothing is mounted on /dev/shm", "mount -t tmpfs tmpfs /dev/shm"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::facts::Rating;
    use crate::commands::doctor::files::sample::host;

    #[test]
    fn virtual_machines_are_told_from_real_ones() {
        let cpuinfo = |text: &'static str| ("proc/cpuinfo", text);
        for (files, rating) in [
            (vec![cpuinfo("processor : 0\nflags\t\t: fpu hypervisor avx")], Rating::Bad),
            (vec![cpuinfo("processor : 0\nflags\t\t: fpu avx")], Rating::Good),
            (vec![cpuinfo("processor : 0"), ("proc/device-tree/hypervisor/x", "")], Rating::Bad),
            (vec![cpuinfo("processor : 0"), ("proc/device-tree/model", "")], Rating::Good),
            (vec![cpuinfo("processor : 0")], Rating::Unknown),
            (vec![], Rating::Unknown),
        ] {
            assert_eq!(machine(&host(&files).files).rating, rating, "{files:?}");
        }
    }

    #[test]
    fn swap_is_seen() {
        let header = "Filename Type Size Used Priority";
        for (files, rating) in [
            (vec![("proc/swaps", header)], Rating::Good),
            (vec![("proc/swaps", "Filename Type\n/dev/sda2 partition")], Rating::Fair),
            (vec![], Rating::Unknown),
        ] {
            assert_eq!(swap(&host(&files).files).rating, rating, "{files:?}");
        }
    }

    #[test]
    fn huge_pages_are_good_where_nobody_makes_them_unasked() {
        let setting = "sys/kernel/mm/transparent_hugepage/enabled";
        for (text, rating) in [
            ("[always] madvise never", Rating::Fair),
            ("always [madvise] never", Rating::Good),
            ("always madvise [never]", Rating::Good),
            ("always", Rating::Unknown),
        ] {
            assert_eq!(huge_pages(&host(&[(setting, text)]).files).rating, rating, "{text}");
        }
        assert_eq!(huge_pages(&host(&[]).files).rating, Rating::Unknown);
    }

    #[test]
    fn shared_memory_is_memory_and_this_user_s() {
        let disk = "25 24 8:1 / /dev/shm rw - ext4 /dev/sda1 rw";
        let memory = "25 24 0:23 / /dev/shm rw shared:3 - tmpfs tmpfs rw,size=24684084k";
        let both = "25 24 8:1 / /dev/shm rw - ext4 /dev/sda1 rw\n26 25 0:23 / /dev/shm rw - tmpfs tmpfs rw";
        let elsewhere = "25 24 0:23 / /tmp rw - tmpfs tmpfs rw";
        for (mounts, others, rating) in [
            (memory, None, Rating::Good),
            (both, None, Rating::Good),
            (memory, Some("/tmp/iceoryx2 belongs to user 0"), Rating::Fair),
            (disk, None, Rating::Bad),
            (elsewhere, None, Rating::Bad),
        ] {
            let fact = shared_memory(&host(&[("proc/self/mountinfo", mounts)]).files, others);
            assert_eq!(fact.rating, rating, "{mounts}: {fact:?}");
        }
        assert_eq!(shared_memory(&host(&[]).files, None).rating, Rating::Unknown);
    }
}
