//! Facts about the processors of the real-time and the I/O thread: number, isolation, siblings, interrupts.

use fearless_simd::Level;

use super::kernel::boot_parameter;
use super::{Examined, Fact};
use crate::commands::doctor::files::HostFiles;
use hexad_client::realtime::setup::cpus::Cpus;
use hexad_core::model::machine::has_native_arithmetic;
use hexad_daemon::SLOW_ARITHMETIC;
use hexad_daemon::recorder::instruction_set;

/// Least number of processors: one for the real-time thread and one for the I/O thread.
const MIN_PROCESSORS: usize = 2;

pub(super) const CPU: &str = "sys/devices/system/cpu";

/// Processors of the threads of a loop.
#[derive(Clone, Debug)]
pub struct LoopCpus {
    /// CPU of the real-time thread; `None` if the scheduler decides.
    pub realtime: Option<usize>,
    /// CPU of the I/O thread; `None` if the scheduler decides.
    pub io: Option<usize>,
    /// CPUs that this process may use.
    pub permitted: Cpus,
}

impl LoopCpus {
    /// CPUs on which the threads may run: the configured ones, or all permitted ones if a thread has no
    /// configured CPU.
    pub(super) fn used(&self) -> Vec<usize> {
        match (self.realtime, self.io) {
            (Some(realtime), Some(io)) if realtime == io => vec![realtime],
            (Some(realtime), Some(io)) => vec![realtime, io],
            _ => self.permitted.iter().collect(),
        }
    }
}

/// Set of processors in a file; empty if the file contains `(null)`.
fn set(host: &HostFiles, path: &str) -> Result<Cpus, String> {
    let text = host.text(path)?;
    if text == "(null)" {
        return Ok(Cpus::default());
    }
    Cpus::parse(&text).ok_or_else(|| format!("/{path} is {text:?} and no list of CPUs"))
}

/// Instruction set of the lanes.
pub fn arithmetic(level: Level) -> Fact {
    if has_native_arithmetic(level) {
        return Fact::good(instruction_set(level));
    }
    Fact::fair(
        SLOW_ARITHMETIC,
        "use a processor with SSE4.2 or AVX2, or a rate at which `compute` of `hexad status` fits",
    )
}

/// Number of processors.
pub fn count(chosen: &LoopCpus) -> Fact {
    let permitted = &chosen.permitted;
    if chosen.realtime.is_some() && chosen.realtime == chosen.io {
        let cpu = chosen.realtime.unwrap_or_default();
        let found = format!("real-time and io thread are both on CPU {cpu}: each delays the other");
        return Fact::bad(found, "choose different realtime.cpu and realtime.io_cpu");
    }
    let number = permitted.iter().count();
    if number < MIN_PROCESSORS {
        let found = format!("only CPU {permitted}: real-time and io thread delay each other");
        return Fact::bad(found, "allow this process at least two (cpuset, taskset), better three");
    }
    if number == MIN_PROCESSORS {
        let found = format!("{number} (CPU {permitted}): real-time and io thread leave none for the rest");
        return Fact::fair(found, "a third leaves one for everything else");
    }
    Fact::good(format!("{number} (CPU {permitted})"))
}

/// Whether the kernel keeps other threads and interrupts off the processor of the real-time thread.
pub fn isolation(host: &HostFiles, chosen: &LoopCpus) -> Examined {
    let isolated = set(host, &format!("{CPU}/isolated"))?;
    let Some(cpu) = chosen.realtime else {
        let found = format!("no CPU is chosen for the real-time thread; isolated: {isolated}");
        return Ok(Fact::fair(found, "choose realtime.cpu, and boot with isolcpus= for it"));
    };
    let boot = format!("boot with isolcpus=managed_irq,domain,{cpu} nohz_full={cpu} rcu_nocbs={cpu}");
    if !isolated.contains(cpu) {
        return Ok(Fact::fair(format!("CPU {cpu} is shared with everything else"), boot));
    }
    let no_ticks = set(host, &format!("{CPU}/nohz_full")).is_ok_and(|cpus| cpus.contains(cpu));
    let listed = boot_parameter(host, "rcu_nocbs").and_then(|list| Cpus::parse(&list));
    // `no_ticks` implies `no_callbacks`.
    let no_callbacks = no_ticks || listed.is_some_and(|cpus| cpus.contains(cpu));
    match (no_ticks, no_callbacks) {
        (true, _) => Ok(Fact::good(format!("CPU {cpu}: isolated, without ticks and RCU callbacks"))),
        (false, true) => Ok(Fact::fair(format!("CPU {cpu}: isolated, but ticking"), boot)),
        (false, false) => {
            Ok(Fact::fair(format!("CPU {cpu}: isolated, but ticking and with RCU callbacks"), boot))
        }
    }
}

/// Whether the real-time thread shares its core with another hardware thread.
pub fn siblings(host: &HostFiles, chosen: &LoopCpus) -> Examined {
    let Some(cpu) = chosen.realtime else {
        return match host.number(&format!("{CPU}/smt/active")) {
            Ok(0) => Ok(Fact::good("off")),
            Ok(_) => Ok(Fact::fair(
                "on: what runs on the other half of a core slows this one",
                "boot with nosmt, or choose realtime.cpu and switch its sibling off",
            )),
            Err(reason) => Ok(Fact::unknown(reason, None)),
        };
    };
    let siblings = set(host, &format!("{CPU}/cpu{cpu}/topology/thread_siblings_list"));
    match siblings.map(|siblings| siblings.iter().find(|sibling| *sibling != cpu)) {
        Ok(None) => Ok(Fact::good(format!("CPU {cpu} has its core to itself"))),
        Ok(Some(sibling)) => Ok(Fact::fair(
            format!("CPU {cpu} shares its core with CPU {sibling}"),
            format!("echo 0 > /{CPU}/cpu{sibling}/online"),
        )),
        Err(reason) => Ok(Fact::unknown(reason, None)),
    }
}

/// Interrupts that the processor of the real-time thread may receive. `None` if no processor is configured.
pub fn interrupts(host: &HostFiles, chosen: &LoopCpus) -> Option<Fact> {
    let cpu = chosen.realtime?;
    let lines = host.numbered("proc/irq");
    if lines.is_empty() {
        return Some(Fact::unknown("there is nothing in /proc/irq", None));
    }
    let allowed = |line: &&u32| {
        let place = |file| set(host, &format!("proc/irq/{line}/{file}"));
        place("effective_affinity_list")
            .or_else(|_| place("smp_affinity_list"))
            .map_or(true, |on| on.contains(cpu))
    };
    let hitting = lines.iter().filter(allowed).count();
    let balanced = host
        .numbered("proc")
        .iter()
        .any(|process| host.text(&format!("proc/{process}/comm")).is_ok_and(|name| name == "irqbalance"));
    let balance = if balanced { "; irqbalance moves them" } else { "" };
    if hitting == 0 && !balanced {
        return Some(Fact::good(format!("none of {} on CPU {cpu}", lines.len())));
    }
    Some(Fact::fair(
        format!("{hitting} of {} may hit CPU {cpu}{balance}", lines.len()),
        format!("boot with irqaffinity= without {cpu}, and IRQBALANCE_BANNED_CPULIST={cpu} or no irqbalance"),
    ))
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::commands::doctor::facts::tests::*;

    pub fn chosen(realtime: Option<usize>, io: Option<usize>, permitted: &str) -> LoopCpus {
        LoopCpus { realtime, io, permitted: Cpus::parse(permitted).unwrap() }
    }

    #[test]
    fn two_threads_need_two_processors() {
        for (realtime, io, permitted, assessment) in [
            (None, None, "0", Bad),
            (None, None, "0,5", Fair),
            (Some(1), Some(0), "0-1", Fair),
            (Some(1), Some(2), "0-3", Good),
            (Some(1), Some(1), "0-3", Bad),
        ] {
            let fact = count(&chosen(realtime, io, permitted));
            assert_eq!(fact.assessment, assessment, "{fact:?}");
        }
    }

    #[test]
    fn a_processor_without_sse4_2_is_slow() {
        assert_eq!(arithmetic(Level::baseline()).assessment, Fair);
        let best = Level::new();
        if let Some(sse4_2) = best.as_sse4_2() {
            assert_eq!(arithmetic(Level::Sse4_2(sse4_2)), Fact::good("Sse4_2"));
            assert_eq!(arithmetic(best).assessment, Good);
        }
    }

    #[test]
    fn isolation_is_complete_only_without_ticks() {
        let isolated = "sys/devices/system/cpu/isolated";
        let ticks = "sys/devices/system/cpu/nohz_full";
        let line = "proc/cmdline";
        let (mine, any) = (chosen(Some(3), None, "0-3"), chosen(None, None, "0-3"));
        for (files, chosen, assessment, words) in [
            (vec![(isolated, "")], &any, Fair, "isolated: none"),
            (vec![(isolated, "2-3")], &any, Fair, "isolated: 2-3"),
            (vec![(isolated, "")], &mine, Fair, "shared with everything"),
            (vec![(isolated, "2")], &mine, Fair, "shared with everything"),
            (vec![(isolated, "2-3")], &mine, Fair, "ticking and with RCU"),
            (vec![(isolated, "3"), (ticks, "(null)"), (line, "rcu_nocbs=3")], &mine, Fair, "ticking"),
            (vec![(isolated, "3"), (ticks, "1-3")], &mine, Good, "without ticks"),
            (vec![(isolated, "three")], &mine, Unknown, "no list of CPUs"),
            (vec![], &mine, Unknown, "there is no /sys/devices"),
        ] {
            let fact = examined(isolation(&host(&files).files, chosen));
            assert_eq!(fact.assessment, assessment, "{files:?}: {fact:?}");
            assert!(fact.found.contains(words), "{fact:?}");
        }
    }

    #[test]
    fn a_sibling_is_found() {
        let list = "sys/devices/system/cpu/cpu1/topology/thread_siblings_list";
        let active = "sys/devices/system/cpu/smt/active";
        let (mine, any) = (chosen(Some(1), None, "0-3"), chosen(None, None, "0-3"));
        let rows: [(&[_], _); 3] = [(&[(list, "1")], Good), (&[(list, "1,3")], Fair), (&[], Unknown)];
        assert_facts(|files| siblings(files, &mine), &rows);
        let rows: [(&[_], _); 3] = [(&[(active, "0")], Good), (&[(active, "1")], Fair), (&[], Unknown)];
        assert_facts(|files| siblings(files, &any), &rows);
        let fact = examined(siblings(&host(&[(list, "1,3")]).files, &mine));
        assert_eq!(fact.remedy.unwrap(), "echo 0 > /sys/devices/system/cpu/cpu3/online");
    }

    #[test]
    fn interrupts_on_the_chosen_processor_are_counted() {
        let mine = chosen(Some(1), None, "0-1");
        let elsewhere = ("proc/irq/24/effective_affinity_list", "0");
        let here = ("proc/irq/25/smp_affinity_list", "0-1");
        let balance = ("proc/77/comm", "irqbalance");
        for (files, assessment, words) in [
            (vec![elsewhere], Good, "none of 1 on CPU 1"),
            (vec![elsewhere, here], Fair, "1 of 2 may hit CPU 1"),
            (vec![elsewhere, balance], Fair, "irqbalance moves them"),
            (vec![], Unknown, "nothing in /proc/irq"),
        ] {
            let fact = interrupts(&host(&files).files, &mine).unwrap();
            assert_eq!(fact.assessment, assessment, "{fact:?}");
            assert!(fact.found.contains(words), "{fact:?}");
        }
        assert_eq!(interrupts(&host(&[here]).files, &chosen(None, None, "0-1")), None);
    }
}
