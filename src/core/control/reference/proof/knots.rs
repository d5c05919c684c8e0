//! Knots: the instants at which a stop is examined. The intervals are shorter at both ends of the stop. At
//! the start the platform is fastest, at the end it comes to rest.
//!
//! ```text
//! t_k = T (u + g u (1 - u) (2 u - 1))      u = k / n, k = 0 .. n      T: duration of the stop
//! ```

/// Bounds on the number n of intervals.
const MIN_INTERVALS: u32 = 3;
pub(in crate::control::reference) const MAX_INTERVALS: u32 = 8;
/// g. The intervals are shorter by up to this ratio at the ends, and longer by up to half of it in the
/// middle.
const GRADING: f64 = 0.5;

/// Knots of a stop.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Knots {
    pub intervals: u32,
    duration: f64,
}

impl Knots {
    /// Chooses the number n of intervals: at least the square root of `square_s2` and the cube root of `cube_s3`,
    /// but at most [`MAX_INTERVALS`].
    pub fn new(duration_s: f64, square_s2: f64, cube_s3: f64) -> Self {
        let are_too_few = |n: &u32| f64::from(n * n * n) < cube_s3 || f64::from(n * n) < square_s2;
        let intervals = MIN_INTERVALS + (MIN_INTERVALS..MAX_INTERVALS).filter(are_too_few).count() as u32;
        Self { intervals, duration: duration_s }
    }

    /// Instant of a knot \[s\].
    #[inline(always)]
    pub fn instant(&self, k: u32) -> f64 {
        let u = f64::from(k) / f64::from(self.intervals);
        self.duration * (u + GRADING * u * (1.0 - u) * (2.0 * u - 1.0))
    }
}

/// Durations of the intervals before and after a knot \[s\]; 0 where there is none.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::control::reference) struct AdjacentIntervals {
    pub before_s: f64,
    pub after_s: f64,
}

impl AdjacentIntervals {
    /// Duration of the longer interval \[s\].
    #[inline(always)]
    pub fn longest(&self) -> f64 {
        self.before_s.max(self.after_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_lead_from_the_start_to_the_end_in_intervals_that_are_shorter_at_both() {
        for cube in [0.0, 60.0, 200.0, 1e9] {
            let knots = Knots::new(0.3, 0.0, cube);
            let n = knots.intervals;
            assert!(f64::from(n * n * n) >= cube || n == MAX_INTERVALS);
            assert_eq!((knots.instant(0), knots.instant(n)), (0.0, 0.3));
            let even = 0.3 / f64::from(n);
            let intervals: Vec<_> = (0..n).map(|k| knots.instant(k + 1) - knots.instant(k)).collect();
            assert!(intervals.iter().all(|dt| (0.5 * even..1.25 * even).contains(dt)), "{intervals:?}");
            let half = intervals.len().div_ceil(2);
            assert!(intervals[..half].windows(2).all(|pair| pair[0] < pair[1]), "{intervals:?}");
            assert!((intervals[0] - intervals[intervals.len() - 1]).abs() < 1e-15);
        }
        assert_eq!(Knots::new(0.3, 24.9, 0.0).intervals, 5);
        assert_eq!(Knots::new(0.3, 25.1, 0.0).intervals, 6);
    }
}
