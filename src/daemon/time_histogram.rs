//! Histogram of a time. Recording and reading it allocate nothing.

use hdrhistogram::Histogram;

use hexad_client::messages::Times;

/// Longest time of the histogram \[ns\]. Longer times are counted as this one.
const LONGEST_NS: u64 = 60_000_000_000;

/// Histogram with three digits from 1 ns to a minute.
#[derive(Debug)]
pub struct TimeHistogram(Option<Histogram<u64>>);

impl TimeHistogram {
    /// Counts one time.
    pub fn record(&mut self, time_ns: u64) {
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(time_ns);
        }
    }

    /// Removes all times.
    pub fn clear(&mut self) {
        if let Some(histogram) = &mut self.0 {
            histogram.reset();
        }
    }

    /// Recorded times \[ns\], to three digits, each with its count.
    pub fn counts(&self) -> impl Iterator<Item = (u64, u64)> {
        let steps = self.0.iter().flat_map(Histogram::iter_recorded);
        steps.map(|step| (step.value_iterated_to(), step.count_at_value()))
    }

    /// Distribution of all recorded times.
    pub fn times(&self) -> Times {
        let Some(histogram) = self.0.as_ref().filter(|histogram| !histogram.is_empty()) else {
            return Times::default();
        };
        let quantile = |q| histogram.value_at_quantile(q);
        Times {
            count: histogram.len(),
            min: histogram.min(),
            mean: histogram.mean().round() as u64,
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p999: quantile(0.999),
            p9999: quantile(0.9999),
            max: histogram.max(),
        }
    }
}

impl Default for TimeHistogram {
    fn default() -> Self {
        // Fails only for invalid bounds, and these are constant.
        Self(Histogram::new_with_bounds(1, LONGEST_NS, 3).ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_within_a_thousandth_and_ends_are_exact() {
        let mut histogram = TimeHistogram::default();
        assert_eq!(histogram.times(), Times::default());
        (1..=100_000).for_each(|time_ns| histogram.record(time_ns));
        let Times { count, min, mean, p50, p90, p99, p999, p9999, max } = histogram.times();
        assert_eq!((count, min), (100_000, 1));
        for (found, exact) in [
            (mean, 50_000),
            (p50, 50_000),
            (p90, 90_000),
            (p99, 99_000),
            (p999, 99_900),
            (p9999, 99_990),
            (max, 100_000),
        ] {
            assert!(found.abs_diff(exact) * 1000 <= exact, "{found} for {exact}");
        }
        assert_eq!(histogram.counts().map(|(_, count)| count).sum::<u64>(), count);
        histogram.clear();
        histogram.record(7);
        histogram.record(7);
        assert!(histogram.counts().eq([(7, 2)]));
        histogram.clear();
        histogram.record(u64::MAX);
        assert!(histogram.times().p50.abs_diff(LONGEST_NS) * 1000 <= LONGEST_NS);
    }
}
