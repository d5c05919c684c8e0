//! Smooth motion through poses that a source sends without derivatives, more slowly and less regularly than
//! the cycles.
//!
//! The motion is a cubic between past poses (Hermite's, with slopes by finite differences over the
//! neighbours), so that pose and twist are continuous. It lags the source by a delay that [`PoseSamples`]
//! estimates from the poses: twice their interval, plus the latency and the jitter of their arrival. With this delay each
//! cubic has the poses on both sides of its ends. A short extrapolation replaces a sample that is lost or
//! late. The correction afterwards may be a jump of a few millimetres, which the reference generator behind
//! this module smooths and limits. This module limits nothing.
//!
//! Time stamps are taken as true: the error of a stamp, times velocity, is an error of the target.
//!
//! Rotations are interpolated as rotation vectors from the earlier pose. Angular velocities are correct to
//! first order in the angle between two poses: at 0.1 rad their error is less than a thousandth of the
//! velocity.

mod timing;

use serde::{Deserialize, Serialize};

use crate::control::setpoint::pose_samples::timing::{SampleTiming, TargetLag};
use crate::control::signals::time::seconds_between;
use crate::model::rigid::{Acceleration, Motion, Pose, Twist};

/// Number of samples kept. With [`MIN_SPACING_S`] they cover at least 0.12 s, more than the delay, which is
/// twice the distance of two samples plus latency and jitter.
const CAPACITY: usize = 16;
/// Smallest distance of two samples \[s\]; closer ones are averaged. Slopes over shorter times amplify the
/// errors of stamps and poses. At 60 Hz with a jitter of 10 ms this affects nearly no sample.
const MIN_SPACING_S: f64 = 0.008;
/// Distance of two samples \[s\] beyond which the source has stopped and restarted: nothing is interpolated.
const MAX_GAP_S: f64 = 0.25;
/// Largest angle between samples for which series replace sine and cosine; their error is 3e-11.
const MAX_SERIES_ANGLE_RAD: f64 = 0.5;
/// Time after the newest sample for which the motion continues with its twist, as a ratio of the interval:
/// enough for two lost samples.
const EXTRAPOLATION_INTERVALS: f64 = 1.5;
/// Time after that in which the motion returns to the newest sample, as a ratio of the interval.
const RETURN_TO_NEWEST_SAMPLE_INTERVALS: f64 = 4.0;

/// A sample, or the average of samples close to each other.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Sample {
    time_ns: u64,
    /// Stamps of the first and the last of the averaged samples.
    first_ns: u64,
    last_ns: u64,
    /// Number of averaged samples.
    count: f64,
    pose: Pose,
    /// Slope at this sample by finite differences.
    slope: Twist,
    /// Displacement from the previous sample.
    step: Twist,
}

/// The newest poses of a source, and the delayed motion through them; see the module.
///
/// ```
/// use hexad_core::control::setpoint::pose_samples::PoseSamples;
/// use hexad_core::model::rigid::Pose;
/// use nalgebra::{Matrix3, Vector3};
/// let mut samples = PoseSamples::default();
/// for k in 0..60_u64 {
///     // 50 Hz, 0.5 m/s
///     let (time_ns, x) = (k * 20_000_000, 0.01 * k as f64);
///     let pose = Pose { rotation: Matrix3::identity(), position: Vector3::new(x, 0.0, 0.0) };
///     samples.push(time_ns, time_ns, &pose);
/// }
/// let now_ns = 59 * 20_000_000;
/// let target = samples.target(now_ns).unwrap();
/// assert!((target.twist.linear.x - 0.5).abs() < 1e-9);
/// // Twice the interval.
/// assert!((samples.delay_s(now_ns) - 0.040).abs() < 1e-9);
/// assert!((target.pose.position.x - 0.5 * (59.0 * 0.020 - 0.040)).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct PoseSamples {
    /// Ring buffer; `newest` is the index of the newest sample.
    samples: [Option<Sample>; CAPACITY],
    newest: usize,
    timing: SampleTiming,
    delay: TargetLag,
}

impl PoseSamples {
    /// Adds a pose that arrived at the instant `now_ns` and holds for `time_ns`, both on the clock of the
    /// releases. Samples that are not newer than the newest one are dropped. The caller has checked stamp and
    /// pose.
    pub fn push(&mut self, now_ns: u64, time_ns: u64, pose: &Pose) {
        let Some(last) = self.back(0).copied() else { return self.append(time_ns, pose) };
        if time_ns <= last.last_ns {
            return;
        }
        let interval = seconds_between(last.first_ns, time_ns);
        if interval < MIN_SPACING_S {
            return self.average(time_ns, pose);
        }
        if interval > MAX_GAP_S {
            self.samples = [None; CAPACITY];
            return self.append(time_ns, pose);
        }
        let is_first = self.timing.interval_count == 0.0;
        self.timing.update(interval, seconds_between(last.time_ns, now_ns));
        let delay = self.timing.interpolation_delay_s();
        self.delay = if is_first { TargetLag::new(delay, now_ns) } else { self.delay.toward(delay, now_ns) };
        self.append(time_ns, pose);
        self.update_slopes();
    }

    /// Forgets the samples and the timing of the source.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Motion that the source requested for the instant minus the delay; its acceleration is zero. After the
    /// newest sample the motion comes to rest at that sample; before the oldest it is at rest. `None` without
    /// a sample.
    pub fn target(&self, instant_ns: u64) -> Option<Motion> {
        let delay_ns = (self.delay.at(instant_ns) * 1e9) as u64;
        let wanted_ns = instant_ns.saturating_sub(delay_ns);
        let newest = self.back(0)?;
        let (pose, twist) = if wanted_ns >= newest.time_ns {
            self.after_newest(newest, wanted_ns)
        } else {
            self.between(newest, wanted_ns)
        };
        let twist = Twist::from_vector(&(twist.vector() * (1.0 - self.delay.rate_at(instant_ns))));
        Some(Motion { pose, twist, acceleration: Acceleration::default() })
    }

    /// Time by which the target lags the source \[s\].
    pub fn delay_s(&self, instant_ns: u64) -> f64 {
        self.delay.at(instant_ns)
    }

    /// The sample `count` places before the newest.
    fn back(&self, count: usize) -> Option<&Sample> {
        self.samples.get((self.newest + CAPACITY - count.min(CAPACITY)) % CAPACITY)?.as_ref()
    }

    fn back_mut(&mut self, count: usize) -> Option<&mut Sample> {
        self.samples.get_mut((self.newest + CAPACITY - count.min(CAPACITY)) % CAPACITY)?.as_mut()
    }

    fn append(&mut self, time_ns: u64, pose: &Pose) {
        self.newest = (self.newest + 1) % CAPACITY;
        let (slope, step) = (Twist::default(), Twist::default());
        if let Some(place) = self.samples.get_mut(self.newest) {
            *place = Some(Sample {
                time_ns,
                first_ns: time_ns,
                last_ns: time_ns,
                count: 1.0,
                pose: *pose,
                slope,
                step,
            });
        }
    }

    /// Adds a sample to the newest one, which is an average.
    fn average(&mut self, time_ns: u64, pose: &Pose) {
        if let Some(newest) = self.back_mut(0) {
            newest.last_ns = time_ns;
            newest.count += 1.0;
            let weight = 1.0 / newest.count;
            let toward = Twist::from_vector(&(newest.pose.displacement_to(pose).vector() * weight));
            newest.pose = newest.pose.displaced(&toward);
            newest.time_ns += (time_ns.saturating_sub(newest.time_ns) as f64 * weight) as u64;
        }
        self.update_slopes();
    }

    /// Updates the two slopes that depend on the newest sample: its own, from the chord to it, and the
    /// previous one, from the parabola through three samples.
    fn update_slopes(&mut self) {
        let (Some(newest), Some(before)) = (self.back(0), self.back(1)) else { return };
        let step = before.pose.displacement_to(&newest.pose);
        let interval = seconds_between(before.time_ns, newest.time_ns);
        let chord = step.vector() / interval;
        let slope = self.back(2).map_or(chord, |earlier| {
            let interval_before = seconds_between(earlier.time_ns, before.time_ns);
            let chord_before = before.step.vector() / interval_before;
            (chord_before * interval + chord * interval_before) / (interval + interval_before)
        });
        if let Some(before) = self.back_mut(1) {
            before.slope = Twist::from_vector(&slope);
        }
        if let Some(newest) = self.back_mut(0) {
            newest.step = step;
            newest.slope = Twist::from_vector(&chord);
        }
    }

    /// Pose and twist after the newest sample: first on with its twist, then back to it.
    fn after_newest(&self, newest: &Sample, wanted_ns: u64) -> (Pose, Twist) {
        let onward = EXTRAPOLATION_INTERVALS * self.timing.interval_s;
        let back = RETURN_TO_NEWEST_SAMPLE_INTERVALS * self.timing.interval_s;
        let elapsed = seconds_between(newest.time_ns, wanted_ns);
        let travel = |time: f64| Twist::from_vector(&(newest.slope.vector() * time));
        if elapsed >= onward + back {
            return (newest.pose, Twist::default());
        }
        if elapsed <= onward {
            return (newest.pose.displaced(&travel(elapsed)), newest.slope);
        }
        let turn = newest.pose.displaced(&travel(onward));
        hermite(&turn, &newest.slope, &travel(-onward), &Twist::default(), back, elapsed - onward)
    }

    /// Pose and twist between two samples, or at rest at the oldest.
    fn between(&self, newest: &Sample, wanted_ns: u64) -> (Pose, Twist) {
        let mut later = newest;
        for count in 1..CAPACITY {
            let Some(earlier) = self.back(count) else { break };
            if earlier.time_ns <= wanted_ns {
                let duration = seconds_between(earlier.time_ns, later.time_ns);
                let elapsed = seconds_between(earlier.time_ns, wanted_ns);
                return hermite(&earlier.pose, &earlier.slope, &later.step, &later.slope, duration, elapsed);
            }
            later = earlier;
        }
        (later.pose, Twist::default())
    }
}

/// Pose and twist on a cubic, `elapsed` seconds after its start. The cubic begins at the pose `from` with the
/// twist `start`. After `duration` it ends, displaced by `step`, with the twist `end`.
fn hermite(
    from: &Pose,
    start: &Twist,
    step: &Twist,
    end: &Twist,
    duration: f64,
    elapsed: f64,
) -> (Pose, Twist) {
    // The rotation vector's rate is the angular velocity minus half the product of rotation vector and
    // angular velocity.
    let end_rate = Twist { angular: end.angular - step.angular.cross(&end.angular) * 0.5, ..*end };
    let (m0, m1, chord) = (start.vector(), end_rate.vector(), step.vector() / duration);
    let s = elapsed / duration;
    let (c2, c3) = (chord * 3.0 - m0 * 2.0 - m1, m0 + m1 - chord * 2.0);
    let displacement = Twist::from_vector(&((m0 + (c2 + c3 * s) * s) * elapsed));
    let rate = Twist::from_vector(&(m0 + (c2 * 2.0 + c3 * (3.0 * s)) * s));
    let angular = rate.angular + displacement.angular.cross(&rate.angular) * 0.5;
    (displaced(from, &displacement), Twist { angular, ..rate })
}

/// Pose after a displacement, like [`Pose::displaced`] with half of its instructions. No rounding accumulates
/// here, and angles between samples are small.
fn displaced(pose: &Pose, Twist { angular, linear }: &Twist) -> Pose {
    let t = angular.norm_squared();
    if t > MAX_SERIES_ANGLE_RAD * MAX_SERIES_ANGLE_RAD {
        return pose.displaced(&Twist { angular: *angular, linear: *linear });
    }
    // sin(x) / x and (1 - cos(x)) / x^2, where x^2 = t.
    let sine = 1.0 - t / 6.0 * (1.0 - t / 20.0 * (1.0 - t / 42.0 * (1.0 - t / 72.0)));
    let cosine = 0.5 * (1.0 - t / 12.0 * (1.0 - t / 30.0 * (1.0 - t / 56.0 * (1.0 - t / 90.0))));
    let mut rotation = pose.rotation;
    for mut column in rotation.column_iter_mut() {
        let across = angular.cross(&column);
        column += across * sine + angular.cross(&across) * cosine;
    }
    Pose { rotation, position: pose.position + linear }
}

#[cfg(test)]
mod tests;
