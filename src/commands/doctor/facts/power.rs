//! Facts about the power management of the processors: frequency, idle states.

use super::processors::{CPU, LoopCpus};
use super::{Examined, Fact};
use crate::commands::doctor::files::HostFiles;
use hexad_client::realtime::setup::Shortfall;

/// Exit latency up to which an idle state hardly affects a wake-up, which takes tens of microseconds \[us\].
const MAX_SHALLOW_EXIT_US: i64 = 10;

/// Frequency governors of the processors.
pub fn frequency(host: &HostFiles, chosen: &LoopCpus) -> Examined {
    let mut others = vec![];
    for cpu in chosen.used() {
        match host.text(&format!("{CPU}/cpu{cpu}/cpufreq/scaling_governor")) {
            Ok(governor) if governor == "performance" => {}
            Ok(governor) => others.push(format!("{governor} on CPU {cpu}")),
            Err(reason) => {
                let reason = format!("not set by this kernel: {reason}");
                return Ok(Fact::unknown(reason, None));
            }
        }
    }
    if others.is_empty() {
        return Ok(Fact::good("governor performance"));
    }
    Ok(Fact::fair(format!("governor {}", others.join(", ")), "cpupower frequency-set --governor performance"))
}

/// Deepest idle state of the processors. `bound_us` is the bound that the daemon requests while it runs;
/// `refused` is the reason if it may not.
pub fn idle(host: &HostFiles, chosen: &LoopCpus, bound_us: i32, refused: Option<&Shortfall>) -> Examined {
    let Some((latency_us, state)) =
        deepest_state(host, chosen)?.filter(|(latency_us, _)| *latency_us > MAX_SHALLOW_EXIT_US)
    else {
        return Ok(Fact::good(format!("none takes longer than {MAX_SHALLOW_EXIT_US} us to leave")));
    };
    let found = format!("{state} takes {latency_us} us to leave");
    match refused {
        None if i64::from(bound_us) <= MAX_SHALLOW_EXIT_US => {
            Ok(Fact::good(format!("{found}; the daemon allows at most {bound_us} us while it runs")))
        }
        None => Ok(Fact::fair(
            format!("{found}; the daemon allows {bound_us} us"),
            "lower realtime.cpu_dma_latency_us",
        )),
        Some(Shortfall { reason, remedy, .. }) => {
            Ok(Fact::fair(format!("{found}, and the daemon cannot prevent it: {reason}"), remedy.as_str()))
        }
    }
}

/// Latency and name of the deepest enabled idle state; `None` if the processors have none.
fn deepest_state(host: &HostFiles, chosen: &LoopCpus) -> Result<Option<(i64, String)>, String> {
    let driver = host.text(&format!("{CPU}/cpuidle/current_driver"))?;
    if driver == "none" {
        return Ok(None);
    }
    let mut deepest = None;
    for cpu in chosen.used() {
        let mut states = (0..).map(|state| format!("{CPU}/cpu{cpu}/cpuidle/state{state}"));
        while let Some(state) = states.next().filter(|state| host.exists(state)) {
            if host.number(&format!("{state}/disable")) == Ok(1) {
                continue;
            }
            let found = (host.number(&format!("{state}/latency"))?, host.text(&format!("{state}/name"))?);
            deepest = deepest.max(Some(found));
        }
    }
    Ok(deepest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::doctor::facts::processors::tests::chosen;
    use crate::commands::doctor::facts::tests::*;

    #[test]
    fn governors_of_the_used_processors_count() {
        let governor = |cpu: u32| format!("sys/devices/system/cpu/cpu{cpu}/cpufreq/scaling_governor");
        let files = [(governor(0), "powersave"), (governor(1), "performance"), (governor(2), "performance")];
        let files: Vec<_> = files.iter().map(|(path, text)| (path.as_str(), *text)).collect();
        let host = host(&files);
        for (realtime, io, permitted, assessment) in [
            (Some(1), Some(2), "0-2", Good),
            (Some(1), Some(0), "0-2", Fair),
            (None, None, "0-2", Fair),
            (None, None, "1-2", Good),
            (Some(1), Some(3), "0-3", Unknown),
        ] {
            let fact = examined(frequency(&host.files, &chosen(realtime, io, permitted)));
            assert_eq!(fact.assessment, assessment, "{realtime:?} {io:?}: {fact:?}");
        }
        let fact = examined(frequency(&host.files, &chosen(None, None, "0-2")));
        assert_eq!(fact.found, "governor powersave on CPU 0");
    }

    #[test]
    fn deep_idle_states_are_good_only_if_the_daemon_can_prevent_them() {
        let state =
            |number: u32, file: &str| format!("sys/devices/system/cpu/cpu0/cpuidle/state{number}/{file}");
        let files = |deep: &'static str, off: &'static str| {
            let text = [
                ("sys/devices/system/cpu/cpuidle/current_driver".to_string(), "intel_idle"),
                (state(0, "latency"), "0"),
                (state(0, "name"), "POLL"),
                (state(1, "latency"), deep),
                (state(1, "name"), "C6"),
                (state(1, "disable"), off),
            ];
            let text: Vec<_> = text.iter().map(|(path, text)| (path.as_str(), *text)).collect();
            host(&text)
        };
        let against =
            Shortfall { what: "bound".into(), reason: "it is not allowed".into(), remedy: "allow it".into() };
        let one = chosen(Some(0), Some(0), "0");
        for (deep, off, bound_us, against, assessment) in [
            ("133", "0", 0, None, Good),
            ("133", "0", 200, None, Fair),
            ("133", "0", 0, Some(&against), Fair),
            ("133", "1", 0, Some(&against), Good),
            ("2", "0", 0, Some(&against), Good),
            ("deep", "0", 0, None, Unknown),
        ] {
            let fact = examined(idle(&files(deep, off).files, &one, bound_us, against));
            assert_eq!(fact.assessment, assessment, "{deep} {off} {bound_us}: {fact:?}");
        }
        let none = ("sys/devices/system/cpu/cpuidle/current_driver", "none");
        assert_facts(|files| idle(files, &one, 0, None), &[(&[none], Good), (&[], Unknown)]);
    }
}
