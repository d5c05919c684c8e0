//! Facts about the kernel: preemption, throttling of real-time threads, clock.

use super::{Examined, Fact};
use crate::commands::doctor::files::HostFiles;
use hexad_client::realtime::clock_cost::ClockCost;

/// Least share of the time that real-time threads must be allowed. A loop that sleeps or spins for half of
/// its period needs less, including the I/O thread.
const MIN_RUNTIME_SHARE: f64 = 0.9;

/// Largest cost of a clock reading without a system call, as a share of the cost of a system call.
const MAX_READING_SHARE: f64 = 0.75;

const REALTIME_KERNEL: &str =
    "use a kernel with PREEMPT_RT (Debian, Ubuntu: linux-image-rt-amd64, linux-realtime)";

/// Version and preemption model of the kernel.
pub fn preemption(host: &HostFiles) -> Examined {
    let read = |file: &str| host.text(&format!("proc/sys/kernel/{file}"));
    let (release, version) = (read("osrelease")?, read("version")?);
    let is = |word: &str| version.split_whitespace().any(|found| found == word);
    if is("PREEMPT_RT") || host.text("sys/kernel/realtime").is_ok_and(|text| text == "1") {
        return Ok(Fact::good(format!("Linux {release}, PREEMPT_RT")));
    }
    if is("PREEMPT_DYNAMIC") {
        return dynamic(host, &release);
    }
    if is("PREEMPT") {
        return Ok(Fact::fair(format!("Linux {release}, preemptible but not PREEMPT_RT"), REALTIME_KERNEL));
    }
    Ok(Fact::bad(format!("Linux {release}, not preemptible"), REALTIME_KERNEL))
}

/// Fact about a kernel whose preemption model is chosen at boot.
fn dynamic(host: &HostFiles, release: &str) -> Examined {
    let boot = format!("{REALTIME_KERNEL}, or boot with preempt=full");
    match mode(host, release) {
        Ok(mode) if mode == "full" || mode == "lazy" => {
            Ok(Fact::fair(format!("Linux {release}, preempt={mode}, not PREEMPT_RT"), REALTIME_KERNEL))
        }
        Ok(mode) => Ok(Fact::bad(format!("Linux {release}, preempt={mode}"), boot)),
        Err(reason) => Ok(Fact::unknown(
            format!("Linux {release}, not PREEMPT_RT; how it preempts was chosen at boot, and {reason}"),
            Some(&format!("as root, mount -t debugfs debugfs /sys/kernel/debug shows it; better {boot}")),
        )),
    }
}

/// Preemption mode of the running kernel: as reported, else from the boot parameters, else from the build.
fn mode(host: &HostFiles, release: &str) -> Result<String, String> {
    let reported = host.text("sys/kernel/debug/sched/preempt").and_then(|text| {
        let chosen = text.split_whitespace().find_map(|word| word.strip_prefix('(')?.strip_suffix(')'));
        chosen.map(Into::into).ok_or_else(|| format!("/sys/kernel/debug/sched/preempt is {text:?}"))
    });
    reported
        .or_else(|reason| boot_parameter(host, "preempt").ok_or(reason))
        .or_else(|reason| built(host, release).ok_or(reason))
}

fn built(host: &HostFiles, release: &str) -> Option<String> {
    let config = host.text(&format!("boot/config-{release}")).ok()?;
    let models = [("_NONE", "none"), ("_VOLUNTARY", "voluntary"), ("", "full"), ("_LAZY", "lazy")];
    let built = |key: &str| config.lines().any(|line| line == format!("CONFIG_PREEMPT{key}=y"));
    models.into_iter().find(|(key, _)| built(key)).map(|(_, mode)| mode.into())
}

/// Value of a parameter of the kernel's command line.
pub(super) fn boot_parameter(host: &HostFiles, name: &str) -> Option<String> {
    let line = host.text("proc/cmdline").ok()?;
    // The last one counts.
    line.split_whitespace().rev().find_map(|word| Some(word.strip_prefix(name)?.strip_prefix('=')?.into()))
}

/// Share of each processor that all real-time threads together may use.
pub fn throttling(host: &HostFiles) -> Examined {
    let read = |which| host.number(&format!("proc/sys/kernel/sched_rt_{which}_us"));
    let (runtime_us, period_us) = (read("runtime")?, read("period")?);
    if runtime_us < 0 {
        return Ok(Fact::good("none for real-time threads"));
    }
    let found = format!(
        "real-time threads may use {} of each {} ms",
        runtime_us as f64 / 1e3,
        period_us as f64 / 1e3
    );
    if runtime_us as f64 >= MIN_RUNTIME_SHARE * period_us as f64 {
        return Ok(Fact::good(found));
    }
    Ok(Fact::bad(found, "sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000"))
}

/// Clock source, and the cost of reading it.
pub fn clock(host: &HostFiles, cost: &ClockCost) -> Examined {
    let source = host.text("sys/devices/system/clocksource/clocksource0/current_clocksource")?;
    let ClockCost { reading_ns, system_call_ns } = *cost;
    if reading_ns < MAX_READING_SHARE * system_call_ns {
        return Ok(Fact::good(format!("{source}, {reading_ns:.0} ns a reading, without a system call")));
    }
    Ok(Fact::bad(
        format!("{source}, {reading_ns:.0} ns a reading: each is a system call"),
        "find the reason why the kernel abandoned a faster one: dmesg | grep -i -e clocksource -e tsc",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::facts::tests::*;

    const RELEASE: (&str, &str) = ("proc/sys/kernel/osrelease", "6.12.1");

    fn kernel(version: &str, more: &[(&str, &str)]) -> Fact {
        let mut files = vec![RELEASE, ("proc/sys/kernel/version", version)];
        files.extend(more);
        examined(preemption(&host(&files).files))
    }

    #[test]
    fn preemption_models_are_distinguished() {
        let debug = "sys/kernel/debug/sched/preempt";
        let line = |text: &'static str| ("proc/cmdline", text);
        let config = |text: &'static str| ("boot/config-6.12.1", text);
        let dynamic = "#1 SMP PREEMPT_DYNAMIC Debian 6.12.1";
        for (version, more, assessment, words) in [
            ("#1 SMP PREEMPT_RT Debian 6.12.1", vec![], Good, "Linux 6.12.1, PREEMPT_RT"),
            ("#1 SMP odd", vec![("sys/kernel/realtime", "1")], Good, "PREEMPT_RT"),
            ("#1 SMP odd", vec![("sys/kernel/realtime", "0")], Bad, "not preemptible"),
            ("#1 SMP PREEMPT x", vec![], Fair, "not PREEMPT_RT"),
            ("#1 SMP x", vec![], Bad, "not preemptible"),
            (dynamic, vec![(debug, "none voluntary (full) lazy")], Fair, "preempt=full"),
            (dynamic, vec![(debug, "none (voluntary) full")], Bad, "preempt=voluntary"),
            (dynamic, vec![(debug, "(none) full"), line("preempt=full")], Bad, "preempt=none"),
            (dynamic, vec![line("quiet preempt=none preempt=full")], Fair, "preempt=full"),
            (dynamic, vec![config("CONFIG_PREEMPT_BUILD=y\nCONFIG_PREEMPT_NONE=y")], Bad, "preempt=none"),
            (dynamic, vec![config("CONFIG_PREEMPT=y")], Fair, "preempt=full"),
            (dynamic, vec![line("quiet")], Unknown, "there is no /sys/kernel/debug/sched/preempt"),
            (dynamic, vec![(debug, "odd")], Unknown, "sched/preempt is \"odd\""),
        ] {
            let fact = kernel(version, &more);
            assert_eq!(fact.assessment, assessment, "{version} {more:?}: {fact:?}");
            assert!(fact.found.contains(words), "{fact:?}");
            assert_eq!(fact.remedy.is_none(), assessment == Good, "{fact:?}");
        }
        let unknown = examined(preemption(&host(&[RELEASE]).files));
        assert_eq!(unknown.found, "there is no /proc/sys/kernel/version");
    }

    #[test]
    fn throttling_is_good_where_the_loop_does_not_meet_it() {
        for (runtime, assessment) in
            [("-1", Good), ("950000", Good), ("500000", Bad), ("0", Bad), ("all", Unknown)]
        {
            let files = [
                ("proc/sys/kernel/sched_rt_runtime_us", runtime),
                ("proc/sys/kernel/sched_rt_period_us", "1000000"),
            ];
            assert_facts(throttling, &[(&files, assessment), (&[], Unknown)]);
        }
    }

    #[test]
    fn a_clock_that_costs_a_system_call_is_bad() {
        let host = host(&[("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc")]);
        let fact =
            |reading_ns| examined(clock(&host.files, &ClockCost { reading_ns, system_call_ns: 120.0 }));
        assert_eq!(fact(25.0), Fact::good("tsc, 25 ns a reading, without a system call"));
        assert_eq!(fact(125.0).assessment, Bad);
        let cost = ClockCost { reading_ns: 25.0, system_call_ns: 120.0 };
        assert_facts(|files| clock(files, &cost), &[(&[], Unknown)]);
    }
}
