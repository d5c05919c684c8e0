//! Reduction of a recording to the size of a page: the smallest and the largest value of every signal in equal
//! intervals, in several levels.
//!
//! A level covers the whole recording, or a window of it. A sample covers `step` cycles. Two samples are the extremes of
//! their `2 step` cycles, in the order in which they occurred, so no peak is lost and a line through the samples stays
//! within the signal. With `step = 1` every cycle is a sample.

use super::signals::{COLUMNS, Row};

/// Samples of the level that is drawn first, two per pixel of a wide chart.
const OVERVIEW_SAMPLES: u64 = 3000;

/// Half of a window around an event in which every cycle is kept \[s\]: a fault and its causes.
const HALF_WINDOW_S: f64 = 0.5;

/// Reciprocal of the share of the size for windows, and least number of windows that fit.
const WINDOWS_SHARE: u64 = 2;
const LEAST_WINDOWS: u64 = 6;

/// Extent of a level in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Index of its first cycle on the grid of the releases.
    pub first: u64,
    /// Cycles for each sample.
    pub step: u64,
    /// Number of samples.
    pub samples: u64,
}

impl Extent {
    /// Extent of all cycles, in about `samples` samples.
    fn whole(span: u64, samples: u64) -> Self {
        let step = span.div_ceil(samples.max(1)).max(1);
        // Even, because samples are pairs of extremes.
        Self { first: 0, step, samples: span.div_ceil(step).next_multiple_of(2) }
    }

    /// Index after its last cycle.
    pub fn end(&self) -> u64 {
        self.first + self.step * self.samples
    }
}

/// Chooses the levels of a recording of `span` cycles that fit into `bytes`: a coarse one, one of the whole
/// recording as fine as possible, and every cycle around the events. The most important events come first.
pub fn plan(span: u64, events: &[u64], rate_hz: f64, bytes: usize) -> Vec<Extent> {
    let budget = (bytes / (COLUMNS * size_of::<f32>())) as u64;
    let overview = Extent::whole(span, OVERVIEW_SAMPLES);
    if overview.step == 1 {
        return vec![overview];
    }
    // One less, because the number of samples is even.
    let rest = budget.saturating_sub(overview.samples + 1);
    if span < rest {
        return vec![overview, Extent::whole(span, span)];
    }
    let for_windows = rest / WINDOWS_SHARE;
    let half = ((HALF_WINDOW_S * rate_hz) as u64).min(for_windows / LEAST_WINDOWS / 2);
    let mut windows: Vec<Extent> = vec![];
    let mut used = 0;
    for event in events {
        let window = Extent { first: event.saturating_sub(half), step: 1, samples: 2 * half };
        let is_seen = windows.iter().any(|it| it.first < window.end() && window.first < it.end());
        if !is_seen && used + window.samples <= for_windows {
            used += window.samples;
            windows.push(window);
        }
    }
    let whole = Extent::whole(span, rest - used);
    let is_finer = whole.step < overview.step;
    [overview].into_iter().chain(is_finer.then_some(whole)).chain(windows).collect()
}

/// A level with its samples, column by column.
pub struct Level {
    /// Extent of the level.
    pub extent: Extent,
    samples: Vec<f32>,
}

impl Level {
    /// Level without cycles: all numbers are NaN.
    pub fn new(extent: Extent) -> Self {
        Self { extent, samples: vec![f32::NAN; extent.samples as usize * COLUMNS] }
    }

    /// Adds a cycle by its index.
    pub fn add(&mut self, index: u64, row: &Row) {
        let Extent { first, step, samples } = self.extent;
        let Some(sample) = index.checked_sub(first).map(|behind| behind / step) else { return };
        if sample >= samples {
            return;
        }
        let width = if step == 1 { 1 } else { 2 };
        let begin = (sample - sample % width) as usize;
        for (column, number) in self.samples.chunks_exact_mut(samples as usize).zip(row) {
            match column.get_mut(begin..).unwrap_or_default() {
                [only, ..] if width == 1 => *only = *number,
                [earlier, later, ..] => keep_extremes(earlier, later, *number),
                _ => {}
            }
        }
    }

    /// One of the samples, column by column.
    pub fn sample(&self, sample: usize) -> impl Iterator<Item = f32> {
        self.samples
            .chunks_exact(self.extent.samples as usize)
            .filter_map(move |column| column.get(sample).copied())
    }

    /// The samples, column by column, as little-endian numbers of four bytes.
    pub fn bytes(&self) -> impl Iterator<Item = u8> {
        self.samples.iter().flat_map(|number| number.to_le_bytes())
    }
}

/// Replaces the two extremes, in the order of their instants, by the extremes of both and a later number.
fn keep_extremes(earlier: &mut f32, later: &mut f32, number: f32) {
    if number.is_nan() {
        return;
    }
    if earlier.is_nan() {
        (*earlier, *later) = (number, number);
        return;
    }
    let (low, high) = (earlier.min(*later), earlier.max(*later));
    if number < low {
        (*earlier, *later) = (high, number);
    } else if number > high {
        (*earlier, *later) = (low, number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BYTES: usize = 12_000_000;

    fn numbers(level: &Level, column: usize) -> Vec<f32> {
        let samples = level.extent.samples as usize;
        level.samples.chunks_exact(samples).nth(column).unwrap().to_vec()
    }

    #[test]
    fn no_peak_is_lost_and_extremes_stay_in_order() {
        let mut level = Level::new(Extent { first: 10, step: 3, samples: 4 });
        // Six cycles per pair. One cycle of the second pair, one before the level, one after it.
        for (index, number) in
            [(9, 99.0), (10, 1.0), (11, 5.0), (12, -2.0), (13, 0.0), (15, 4.0), (17, 7.0), (22, 99.0)]
        {
            level.add(index, &[number; COLUMNS]);
        }
        for column in [0, COLUMNS - 1] {
            assert_eq!(numbers(&level, column), [5.0, -2.0, 7.0, 7.0]);
        }
        let mut every = Level::new(Extent { first: 0, step: 1, samples: 3 });
        every.add(2, &[3.0; COLUMNS]);
        assert!(numbers(&every, 1).iter().map(|it| it.is_nan()).eq([true, true, false]));
    }

    #[test]
    fn a_short_recording_is_kept_whole_and_a_long_one_within_the_bytes() {
        assert_eq!(plan(2000, &[], 1e3, BYTES), [Extent { first: 0, step: 1, samples: 2000 }]);
        let kept = plan(20_000, &[7], 1e3, BYTES);
        assert_eq!(kept.iter().map(|it| it.step).collect::<Vec<_>>(), [7, 1]);
        for rate_hz in [1e3, 4e3, 2e4] {
            let span = (3600.0 * rate_hz) as u64;
            // The third event is in the window of the second.
            let events = [span - 2, span / 2, span / 2 + 9, 0];
            let kept = plan(span, &events, rate_hz, BYTES);
            let bytes: u64 = kept.iter().map(|it| it.samples * COLUMNS as u64 * 4).sum();
            assert!(bytes <= BYTES as u64 && bytes > BYTES as u64 * 9 / 10, "{rate_hz} Hz: {bytes}");
            let [overview, whole, windows @ ..] = &*kept else { panic!("two levels of the whole") };
            assert!(overview.step > whole.step && whole.step > 1);
            assert!([overview, whole].iter().all(|it| it.first == 0 && it.end() >= span));
            assert_eq!(windows.len(), 3);
            let has = |event: u64| windows.iter().any(|it| (it.first..it.end()).contains(&event));
            assert!(windows.iter().all(|it| it.step == 1) && events.into_iter().all(has));
        }
    }
}
