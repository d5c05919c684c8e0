//! How often each time occurred, at the resolution it was measured with.

use std::collections::BTreeMap;

/// Shares per decade at which a curve has a point: close enough for the eye.
const POINTS_PER_DECADE: f64 = 12.0;

/// Counts by time \[ns\].
#[derive(Clone, Debug, Default)]
pub struct Distribution {
    counts: BTreeMap<u64, u64>,
    total: u64,
}

impl Distribution {
    pub fn add(&mut self, time_ns: u64, count: u64) {
        *self.counts.entry(time_ns).or_default() += count;
        self.total += count;
    }

    pub fn merge(&mut self, other: &Self) {
        other.counts.iter().for_each(|(time_ns, count)| self.add(*time_ns, *count));
    }

    pub fn count(&self) -> u64 {
        self.total
    }

    /// The smallest time that a share `q` of all does not exceed \[ns\]; 0 where there is none.
    pub fn quantile(&self, q: f64) -> u64 {
        let rank = (q * self.total as f64).ceil().max(1.0) as u64;
        let mut below = 0;
        let found = self.counts.iter().find(|(_, count)| {
            below += **count;
            below >= rank
        });
        found.map_or(0, |(time_ns, _)| *time_ns)
    }

    pub fn max(&self) -> u64 {
        self.counts.last_key_value().map_or(0, |(time_ns, _)| *time_ns)
    }

    /// How many exceed a time.
    pub fn later_than(&self, time_ns: u64) -> u64 {
        self.counts.range(time_ns + 1..).map(|(_, count)| count).sum()
    }

    /// Time \[us\] against the share that is later, from all down to one.
    pub fn curve(&self) -> Vec<(f64, f64)> {
        let decades = (self.total.max(1) as f64).log10();
        let points = (decades * POINTS_PER_DECADE) as i32;
        let shares = (0..=points).map(|point| 10f64.powf(-f64::from(point) / POINTS_PER_DECADE));
        let last = (us(self.max()), 10f64.powf(-decades));
        // Of all, all are as late as the earliest.
        shares.map(|share| (us(self.quantile(1.0 - share)), share)).chain([last]).collect()
    }
}

impl FromIterator<(u64, u64)> for Distribution {
    fn from_iter<I: IntoIterator<Item = (u64, u64)>>(counts: I) -> Self {
        let mut distribution = Self::default();
        counts.into_iter().for_each(|(time_ns, count)| distribution.add(time_ns, count));
        distribution
    }
}

/// Nanoseconds as microseconds.
pub fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}
