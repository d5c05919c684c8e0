//! Statistics of the daemon: histograms per second and since start, and the worst cycles with hints. Only
//! construction allocates.

use super::cycle::{CycleRecord, measured_age_ns};
use super::hints::SlowCycleHints;
use super::time_histogram::TimeHistogram;
use hexad_client::messages::{LoopTimes, StatisticsMessage, WORST_CYCLES, WorstCycle};

/// Histograms of one interval.
#[derive(Debug, Default)]
struct Span {
    wakeup: TimeHistogram,
    compute: TimeHistogram,
    measured_age: TimeHistogram,
    end_to_end: TimeHistogram,
}

impl Span {
    fn clear(&mut self) {
        let Self { wakeup, compute, measured_age, end_to_end } = self;
        [wakeup, compute, measured_age, end_to_end].into_iter().for_each(TimeHistogram::clear);
    }

    fn times(&self) -> LoopTimes {
        LoopTimes {
            wakeup_ns: self.wakeup.times(),
            compute_ns: self.compute.times(),
            measured_age_ns: self.measured_age.times(),
            end_to_end_ns: self.end_to_end.times(),
        }
    }
}

/// Timing statistics of the cycles.
#[derive(Debug, Default)]
pub struct CycleStatistics {
    window: Span,
    total: Span,
    worst: [WorstCycle; WORST_CYCLES],
    /// The last cycle for which hints were added.
    hinted: u64,
    last: u64,
}

impl CycleStatistics {
    /// Adds a cycle.
    pub fn add(&mut self, record: &CycleRecord) {
        for span in [&mut self.window, &mut self.total] {
            span.wakeup.record(record.wakeup_ns);
            span.compute.record(record.compute_ns);
            if let Some(age_ns) = measured_age_ns(record) {
                span.measured_age.record(age_ns);
            }
        }
        self.last = record.cycle;
        self.rank(WorstCycle {
            cycle: record.cycle,
            due_ns: record.due_ns,
            wakeup_ns: record.wakeup_ns,
            compute_ns: record.compute_ns,
            io_late: record.io_late.into(),
            ..WorstCycle::default()
        });
    }

    /// Adds the delay from a release to its force sent.
    pub fn add_delay(&mut self, end_to_end_ns: u64) {
        for span in [&mut self.window, &mut self.total] {
            span.end_to_end.record(end_to_end_ns);
        }
    }

    /// Adds the hints for the cycles added since the last call.
    pub fn add_hints(&mut self, hints: &SlowCycleHints) {
        let clipped = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        for cycle in self.worst.iter_mut().filter(|cycle| cycle.cycle > self.hinted) {
            cycle.involuntary_switches = clipped(hints.involuntary_switches);
            cycle.page_faults = clipped(hints.page_faults);
            cycle.steal_ms = clipped(hints.steal_ms);
        }
        self.hinted = self.last;
    }

    /// Ends the window and returns the statistics so far.
    pub fn end_window(&mut self) -> StatisticsMessage {
        let statistics = self.statistics();
        self.window.clear();
        statistics
    }

    /// The statistics so far.
    pub fn statistics(&self) -> StatisticsMessage {
        let (window, total) = (self.window.times(), self.total.times());
        StatisticsMessage { window, total, worst: self.worst, ..StatisticsMessage::default() }
    }

    /// `time,ns,count`: how often each time occurred since start. Allocates.
    pub fn counts_csv(&self) -> String {
        let Span { wakeup, compute, measured_age, end_to_end } = &self.total;
        let mut csv = String::from("time,ns,count\n");
        for (time, histogram) in [
            ("wakeup", wakeup),
            ("compute", compute),
            ("measured_age", measured_age),
            ("end_to_end", end_to_end),
        ] {
            csv.extend(histogram.counts().map(|(ns, count)| format!("{time},{ns},{count}\n")));
        }
        csv
    }

    fn rank(&mut self, cycle: WorstCycle) {
        let time_ns = |cycle: &WorstCycle| cycle.wakeup_ns + cycle.compute_ns;
        let place = self.worst.iter().position(|other| time_ns(other) < time_ns(&cycle));
        if let Some(tail) = place.and_then(|place| self.worst.get_mut(place..)) {
            tail.rotate_right(1);
            tail.iter_mut().take(1).for_each(|first| *first = cycle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::control::signals::inputs::{Input, Measurement};

    fn record(cycle: u64, wakeup_ns: u64) -> CycleRecord {
        let measurement = Some(Measurement { time_ns: 11, ..Measurement::default() });
        let input = Input { release_ns: 20, measurement, ..Input::default() };
        CycleRecord { cycle, wakeup_ns, compute_ns: 7, input, ..CycleRecord::default() }
    }

    #[test]
    fn the_worst_cycles_carry_the_hints_of_their_own_time() {
        let mut collector = CycleStatistics::default();
        (1..=20).for_each(|cycle| collector.add(&record(cycle, 100 + cycle)));
        collector.add_hints(&SlowCycleHints { steal_ms: 20, ..SlowCycleHints::default() });
        collector.add(&record(21, 5000));
        collector.add(&record(22, 1));
        collector.add_hints(&SlowCycleHints { involuntary_switches: 3, ..SlowCycleHints::default() });
        let worst = collector.statistics().worst;
        assert_eq!(worst.map(|cycle| cycle.cycle), [21, 20, 19, 18, 17, 16, 15, 14]);
        assert_eq!(worst.map(|cycle| cycle.steal_ms), [0, 20, 20, 20, 20, 20, 20, 20]);
        assert_eq!(worst.map(|cycle| cycle.involuntary_switches), [3, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn a_window_ends_and_the_total_goes_on() {
        let mut collector = CycleStatistics::default();
        collector.add(&record(1, 10));
        collector.add_delay(33);
        let first = collector.end_window();
        assert_eq!((first.window.wakeup_ns.max, first.window.end_to_end_ns.count), (10, 1));
        collector.add(&record(2, 4));
        let second = collector.end_window();
        assert_eq!((second.window.wakeup_ns.max, second.window.end_to_end_ns.count), (4, 0));
        assert_eq!((second.total.wakeup_ns.max, second.total.wakeup_ns.count), (10, 2));
        assert_eq!(second.total.measured_age_ns.p50, 9);
    }
}
