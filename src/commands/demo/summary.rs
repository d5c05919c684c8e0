//! Summary that `hexad demo` prints at its end.

use core::fmt;

use hexad_client::messages::{Times, WorstCycle};
use hexad_daemon::report::Report;
use hexad_machine::text::text_table::{Left, Right, text_table};

/// Tracking, timing and faults of a run. Displays as text.
pub struct Summary<'a> {
    pub title: &'a str,
    pub report: &'a Report,
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { cycles, rate_hz, deadline_misses, rt_thread, faults, .. } = self.report;
        writeln!(
            f,
            "{}: {cycles} cycles at {rate_hz} Hz\n\n{}\n{}",
            self.title,
            self.tracking(),
            self.times()
        )?;
        writeln!(
            f,
            "deadline misses  {} late wake-ups, {} overruns, {} skipped cycles",
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

impl Summary<'_> {
    fn tracking(&self) -> String {
        let tracking = &self.report.tracking;
        let row = |name: &str, unit: &str, rms: f64, max: f64| {
            [name.into(), format!("{:.3} {unit}", rms * 1e6), format!("{:.3} {unit}", max * 1e6)]
        };
        text_table(
            2,
            &[("setpoint less true pose", Left), ("RMS", Right), ("max", Right)],
            [
                row("  position", "µm", tracking.position_rms_m, tracking.position_max_m),
                row("  orientation", "µrad", tracking.orientation_rms_rad, tracking.orientation_max_rad),
            ],
        )
    }

    fn times(&self) -> String {
        let Report { wakeup_ns, compute_ns, end_to_end_ns, .. } = self.report;
        let row = |(name, times): (&str, &Times)| {
            let [p50, p99, p999, max] = [times.p50, times.p99, times.p999, times.max]
                .map(|time_ns| format!("{:.1}", time_ns as f64 * 1e-3));
            [name.into(), p50, p99, p999, max]
        };
        text_table(
            2,
            &[("time [µs]", Left), ("p50", Right), ("p99", Right), ("p99.9", Right), ("max", Right)],
            [("  wake-up", wakeup_ns), ("  compute", compute_ns), ("  end to end", end_to_end_ns)].map(row),
        )
    }
}

/// A slow cycle, and the events around it that may have delayed it.
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
        "no event that the kernel counts (a pause of the host, or of the firmware)".into()
    } else {
        hints.join(", ")
    };
    format!(
        "number {cycle}, woken {late_us:.1} µs late, {computed_us:.1} µs long; in the 20 ms around it: {around}"
    )
}
