//! Facts about the host beyond the kernel: virtualization, swap, huge pages, shared memory.

use std::path::Path;

use super::{Examined, Fact};
use crate::commands::doctor::files::HostFiles;

/// Fact for a host that is a virtual machine.
pub fn virtual_machine() -> Fact {
    Fact::bad(
        "virtual: its host can take the processors away at any time",
        "use a real computer, or processors that the host pins and reserves",
    )
}

/// Whether the host is a virtual machine, whose own host may preempt the processors.
pub fn machine(host: &HostFiles) -> Examined {
    let processors = host.text("proc/cpuinfo")?;
    let flags = processors.lines().find_map(|line| line.strip_prefix("flags"));
    let reported = flags.map(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"));
    let tree = "proc/device-tree";
    match reported.or_else(|| host.exists(tree).then(|| host.exists(&format!("{tree}/hypervisor")))) {
        Some(true) => Ok(virtual_machine()),
        Some(false) => Ok(Fact::good("real, by its processor flags")),
        None => Ok(Fact::unknown("this architecture does not show whether it is virtual", None)),
    }
}

/// Whether the kernel may move memory to a disk.
pub fn swap(host: &HostFiles) -> Examined {
    match host.text("proc/swaps").map(|text| text.lines().count().saturating_sub(1)) {
        Ok(0) => Ok(Fact::good("none")),
        Ok(_) => Ok(Fact::fair(
            "on: memory that is not locked may be on a disk, that of drivers included",
            "swapoff -a",
        )),
        Err(reason) => Ok(Fact::unknown(reason, None)),
    }
}

/// Whether the kernel moves memory into huge pages automatically.
pub fn huge_pages(host: &HostFiles) -> Examined {
    let setting = "sys/kernel/mm/transparent_hugepage/enabled";
    match host.text(setting) {
        Ok(text) if text.contains("[always]") => Ok(Fact::fair(
            "always: the kernel moves memory to make them",
            format!("echo madvise > /{setting}"),
        )),
        Ok(text) if text.contains("[madvise]") => Ok(Fact::good("only on request")),
        Ok(text) if text.contains("[never]") => Ok(Fact::good("never")),
        Ok(text) => Ok(Fact::unknown(format!("/{setting} is {text:?}"), None)),
        Err(reason) => Ok(Fact::unknown(reason, None)),
    }
}

/// File system of the shared memory, and `folder` with the files of iceoryx2 of this user.
pub fn shared_memory(host: &HostFiles, folder: &Path) -> Examined {
    let mounts = host.text("proc/self/mountinfo")?;
    // The last mount hides earlier ones.
    let kind = mounts.lines().rev().find_map(|line| {
        let (mount, kind) = line.split_once(" - ")?;
        (mount.split(' ').nth(4)? == "/dev/shm").then(|| kind.split(' ').next())?
    });
    match kind {
        Some("tmpfs") => {
            Ok(Fact::good(format!("/dev/shm, for all who run as this user: {}", folder.display())))
        }
        Some(kind) => {
            Ok(Fact::bad(format!("/dev/shm is {kind} and not memory"), "mount -t tmpfs tmpfs /dev/shm"))
        }
        None => Ok(Fact::bad("nothing is mounted on /dev/shm", "mount -t tmpfs tmpfs /dev/shm")),
    }
}

/// Largest user ID of a system user. logind does not delete the shared memory of system users.
const MAX_SYSTEM_USER: u32 = 999;

/// Whether systemd-logind deletes the shared memory of this user when the user's last session ends.
pub fn removed_memory(host: &HostFiles, user_id: u32) -> Examined {
    if user_id <= MAX_SYSTEM_USER {
        return Ok(Fact::good("stays: this is a system user"));
    }
    if !host.exists("run/systemd/system") {
        return Ok(Fact::good("stays: systemd does not run"));
    }
    let file = host.text("etc/systemd/logind.conf").unwrap_or_default();
    let setting = file.lines().rev().find_map(|line| line.trim().strip_prefix("RemoveIPC="));
    if setting.is_some_and(|value| ["no", "false", "off", "0"].contains(&value.trim())) {
        return Ok(Fact::good("stays: RemoveIPC=no"));
    }
    Ok(Fact::bad(
        "systemd-logind deletes it when this user's last session ends, also under a running daemon",
        "RemoveIPC=no in /etc/systemd/logind.conf, then systemctl restart systemd-logind; or run hexad as a system user",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::facts::tests::*;

    #[test]
    fn virtual_machines_are_distinguished_from_real_ones() {
        let cpuinfo = |text: &'static str| ("proc/cpuinfo", text);
        let plain = cpuinfo("processor : 0");
        assert_facts(
            machine,
            &[
                (&[cpuinfo("processor : 0\nflags\t\t: fpu hypervisor avx")], Bad),
                (&[cpuinfo("processor : 0\nflags\t\t: fpu avx")], Good),
                (&[plain, ("proc/device-tree/hypervisor/x", "")], Bad),
                (&[plain, ("proc/device-tree/model", "")], Good),
                (&[plain], Unknown),
                (&[], Unknown),
            ],
        );
    }

    #[test]
    fn swap_is_seen() {
        let header = ("proc/swaps", "Filename Type Size Used Priority");
        let used = ("proc/swaps", "Filename Type\n/dev/sda2 partition");
        assert_facts(swap, &[(&[header], Good), (&[used], Fair), (&[], Unknown)]);
    }

    #[test]
    fn huge_pages_are_good_where_nobody_makes_them_unasked() {
        let setting = |text: &'static str| ("sys/kernel/mm/transparent_hugepage/enabled", text);
        assert_facts(
            huge_pages,
            &[
                (&[setting("[always] madvise never")], Fair),
                (&[setting("always [madvise] never")], Good),
                (&[setting("always madvise [never]")], Good),
                (&[setting("always")], Unknown),
                (&[], Unknown),
            ],
        );
    }

    #[test]
    fn logind_deletes_the_shared_memory_of_users_who_log_out() {
        let systemd = ("run/systemd/system", "");
        let conf = |text: &'static str| ("etc/systemd/logind.conf", text);
        assert_facts(|files| removed_memory(files, 999), &[(&[systemd], Good)]);
        assert_facts(
            |files| removed_memory(files, 1000),
            &[
                (&[], Good),
                (&[systemd], Bad),
                (&[systemd, conf("[Login]\n#RemoveIPC=no")], Bad),
                (&[systemd, conf("[Login]\nRemoveIPC=no")], Good),
            ],
        );
    }

    #[test]
    fn shared_memory_is_in_memory() {
        let disk = "25 24 8:1 / /dev/shm rw - ext4 /dev/sda1 rw";
        let memory = "25 24 0:23 / /dev/shm rw shared:3 - tmpfs tmpfs rw,size=24684084k";
        let both = "25 24 8:1 / /dev/shm rw - ext4 /dev/sda1 rw\n26 25 0:23 / /dev/shm rw - tmpfs tmpfs rw";
        let elsewhere = "25 24 0:23 / /tmp rw - tmpfs tmpfs rw";
        for (mounts, assessment) in [(memory, Good), (both, Good), (disk, Bad), (elsewhere, Bad)] {
            let fact = |files: &HostFiles| shared_memory(files, Path::new("/run/hexad"));
            assert_facts(fact, &[(&[("proc/self/mountinfo", mounts)], assessment), (&[], Unknown)]);
        }
    }
}
