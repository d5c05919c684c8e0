//! Tracks: states, diagnostics and events as intervals along the time axis.

use serde::Serialize;

/// Largest number of intervals of a track of repeated events. More cannot be seen on a screen.
const MAX_INTERVALS: usize = 1000;

/// Interval between two instants \[s\].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Begin.
    pub from: f64,
    /// End.
    pub to: f64,
    /// Number of the state or code of the diagnostic; 1 for events of one kind.
    pub key: u32,
    /// Text of the interval.
    pub text: String,
}

/// A row of intervals.
#[derive(Clone, Debug, Serialize)]
pub struct Track {
    /// Heading of a group of tracks.
    pub group: &'static str,
    /// Name of the track.
    pub name: &'static str,
    /// Intervals in the order of time.
    pub intervals: Vec<Interval>,
    /// Intervals of the same key with a smaller gap are united \[s\].
    #[serde(skip)]
    gap: f64,
    /// Number of instants that were added.
    pub count: u64,
}

impl Track {
    /// Track without intervals. Instants of the same key closer than `gap` are one interval \[s\].
    pub fn new(group: &'static str, name: &'static str, gap: f64) -> Self {
        Self { group, name, intervals: vec![], gap, count: 0 }
    }

    /// Whether no interval may be left out or united with one of another kind, however many there are: states, configurations
    /// and requests, which change seldom.
    pub fn is_whole(&self) -> bool {
        matches!(self.group, "state" | "configuration" | "requests")
    }

    /// Adds an interval after all others. `text` is called if a new one begins.
    pub fn add(&mut self, from: f64, to: f64, key: u32, text: impl FnOnce() -> String) {
        self.count += 1;
        if let Some(last) = self.intervals.last_mut().filter(|it| it.key == key && from - it.to <= self.gap) {
            last.to = last.to.max(to);
            return;
        }
        if self.intervals.len() >= MAX_INTERVALS && !self.is_whole() {
            self.coarsen();
        }
        self.intervals.push(Interval { from, to, key, text: text() });
    }

    /// Unites neighbours until half of the intervals are left. Intervals of different keys get the key of the
    /// first.
    fn coarsen(&mut self) {
        while self.intervals.len() > MAX_INTERVALS / 2 {
            self.gap *= 2.0;
            let gap = self.gap;
            self.intervals.dedup_by(|next, kept| {
                let is_near = next.from - kept.to <= gap && next.to - kept.from <= 8.0 * gap;
                if is_near {
                    kept.to = next.to;
                }
                is_near
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_become_one_interval_and_their_number_is_bounded() {
        let mut track = Track::new("limits", "force", 0.0015);
        for millisecond in [0, 1, 2, 10, 11, 12] {
            let t = f64::from(millisecond) * 1e-3;
            track.add(t, t, u32::from(millisecond == 12), || format!("from {t}"));
        }
        let found: Vec<_> =
            track.intervals.iter().map(|it| (it.from, it.to, it.key, it.text.as_str())).collect();
        let expected =
            [(0.0, 0.002, 0, "from 0"), (0.01, 0.011, 0, "from 0.01"), (0.012, 0.012, 1, "from 0.012")];
        assert_eq!(found, expected);
        for k in 0..100_000 {
            track.add(f64::from(k), f64::from(k) + 0.5, k, String::new);
        }
        assert!(track.intervals.len() <= MAX_INTERVALS && track.intervals.len() > MAX_INTERVALS / 4);
        assert_eq!((track.count, track.intervals.last().unwrap().to), (100_006, 99_999.5));
    }
}
