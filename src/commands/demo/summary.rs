//! What a demonstration prints at its end.

use core::fmt;

use crate::daemon::report::Report;
use crate::messages::{Times, WorstCycle};

/// The table printed at the end.
pub struct Summary<'a> {
    pub title: &'a str,
    pub report: &'a Report,
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { cycles, rate_hz, deadline_misses, tracking, rt_thread, faults, .. } = self.report;
        writeln!(f, "{}: {cycles} cycles at {rate_hz} Hz\n", self.title)?;
        writeln!(f, "tracking               RMS          max")?;
        let (position, orientation) = (tracking.position_rms_m, tracking.orientation_rms_rad);
        writeln!(f, "  position    {:>9.3} µm {:>9.3} µm", position * 1e6, tracking.position_max_m * 1e6)?;
        writeln!(
            f,
            "  orientation {:>9.3} µrad {:>7.3} µrad\n",
            orientation * 1e6,
            tracking.orientation_max_rad * 1e6
        )?;
        writeln!(f, "time [µs]            p50        p99      p99.9        max")?;
        for (name, times) in [
            ("wake-up", &self.report.wakeup_ns),
            ("compute", &self.report.compute_ns),
            ("end to end", &self.report.end_to_end_ns),
        ] {
            let Times { p50, p99, p999, max, .. } = *times;
            let [p50, p99, p999, max] = [p50, p99, p999, max].map(|ns| ns as f64 * 1e-3);
            writeln!(f, "  {name:<11} {p50:>10.1} {p99:>10.1} {p999:>10.1} {max:>10.1}")?;
        }
        writeln!(
            f,
            "\ndeadline misses  {} late wake-ups, {} overruns, {} skipped cycles",
            deadline_misses.late_wakeup, deadline_misses.overrun, deadline_misses.skipped
        )?;
        writeln!(
            f,
            "real-time thread {} allocations, {} page faults, {} involuntary switches",
            rt_thread.allocations,
            rt_thread.minor_faults + rt_thread.major_faults,
            rt_thread.involuntary_switches
        )?;
        if let Some(worst) = self.report.worst_cycles.first() {
            writeln!(f, "worst cycle      {}", described(worst))?;
        }
        writeln!(f, "faults           {}", faults.len())?;
        for fault in faults {
            writeln!(f, "  cycle {}: {} {}", fault.cycle, fault.number, fault.name)?;
        }
        Ok(())
    }
}

/// A slow cycle, and what may have made it so.
fn described(worst: &WorstCycle) -> String {
    let WorstCycle {
        cycle, wakeup_ns, compute_ns, io_late, involuntary_switches, page_faults, steal_ms, ..
    } = *worst;
    let [late_us, computed_us] = [wakeup_ns, compute_ns].map(|ns| ns as f64 * 1e-3);
    let hints = [
        (steal_ms, "ms taken by the host"),
        (involuntary_switches, "involuntary switches"),
        (page_faults, "page faults"),
        (io_late, "time without new inputs"),
    ];
    let hints: Vec<_> =
        hints.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    let around = if hints.is_empty() {
        "nothing that the kernel saw (a pause of the host, or of the firmware)".into()
    } else {
        hints.join(", ")
    };
    format!(
        "number {cycle}, woken {late_us:.1} µs late, {computed_us:.1} µs long; in the 20 ms around it: {around}"
    )
}
