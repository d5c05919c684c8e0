use core::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use crate::control::setpoint::pose_samples::*;
use crate::model::rigid::exp;

const MS: u64 = 1_000_000;

/// Pose and twist of a sine: 0.1 m along one axis and 0.1 rad about a skew axis.
fn sine(frequency_hz: f64, time_ns: u64) -> (Pose, Twist) {
    let omega = TAU * frequency_hz;
    let (sin, cos) = (omega * time_ns as f64 * 1e-9).sin_cos();
    let axis = Vector3::new(2.0, -1.0, 2.0) / 3.0;
    let pose = Pose { rotation: exp(&(axis * (0.1 * sin))), position: Vector3::x() * (0.1 * sin) };
    let rate = 0.1 * omega * cos;
    (pose, Twist { angular: axis * rate, linear: Vector3::x() * rate })
}

/// Numbers between 0 and 1: a linear congruential generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1_u64 << 24) as f64
    }
}

/// A source of poses.
#[derive(Clone, Copy)]
struct Source {
    frequency_hz: f64,
    rate_hz: u64,
    jitter_ms: f64,
    loss: f64,
    /// Location of the jitter: the instant of sampling with its stamp, the arrival alone, or the stamp alone.
    jitter_of: JitterOf,
}

#[derive(Clone, Copy, Debug)]
enum JitterOf {
    Sampling,
    Arrival,
    Stamp,
}

const SOURCE: Source =
    Source { frequency_hz: 1.0, rate_hz: 60, jitter_ms: 10.0, loss: 0.1, jitter_of: JitterOf::Sampling };

/// Errors of the target relative to the delayed motion, in cycles of 1 ms from the third second on.
#[derive(Debug, Default)]
struct Errors {
    rms_m: f64,
    max_m: f64,
    rms_rad: f64,
    rms_m_s: f64,
    delay_s: f64,
    /// Largest difference of the target's twist from the change of its pose in a cycle.
    twist_m_s: f64,
}

impl Source {
    /// Arrival, stamp, instant of sampling.
    fn samples(&self) -> Vec<(u64, u64, u64)> {
        let mut random = Random(7);
        let mut samples: Vec<_> = (0..20 * self.rate_hz)
            .filter_map(|k| {
                let (lost, jitter) = (random.next() < self.loss, random.next() * self.jitter_ms * 1e6);
                let (grid, late) = (k * 1_000_000_000 / self.rate_hz, jitter as u64);
                let sample = match self.jitter_of {
                    JitterOf::Sampling => (grid + late, grid + late, grid + late),
                    JitterOf::Arrival => (grid + late, grid, grid),
                    JitterOf::Stamp => (grid + late, grid + late, grid),
                };
                (!lost).then_some(sample)
            })
            .collect();
        samples.sort_unstable();
        samples
    }

    fn errors(&self) -> Errors {
        // If stamps alone are late by a random time, they are late by half the jitter on average.
        let mean_stamp_error_ns = match self.jitter_of {
            JitterOf::Stamp => (0.5e6 * self.jitter_ms) as u64,
            _ => 0,
        };
        let (mut poses, mut errors, mut count) = (PoseSamples::default(), Errors::default(), 0.0);
        let (mut samples, mut before) = (self.samples().into_iter().peekable(), None::<Motion>);
        for now_ns in (0..19_500).map(|cycle| cycle * MS) {
            while let Some((arrival, stamp, sampled)) = samples.next_if(|sample| sample.0 <= now_ns) {
                poses.push(arrival, stamp, &sine(self.frequency_hz, sampled).0);
            }
            let (Some(target), delay) = (poses.target(now_ns), poses.delay_s(now_ns)) else { continue };
            if now_ns > 3000 * MS {
                let instant = now_ns - (delay * 1e9) as u64 - mean_stamp_error_ns;
                let (pose, twist) = sine(self.frequency_hz, instant);
                let error = target.pose.displacement_to(&pose);
                errors.rms_m += error.linear.norm_squared();
                errors.rms_rad += error.angular.norm_squared();
                errors.rms_m_s += (target.twist.linear - twist.linear).norm_squared();
                errors.max_m = errors.max_m.max(error.linear.norm());
                errors.delay_s += delay;
                let mean = before.map(|b| (target.pose.position - b.pose.position) * 1e3);
                let twist = before.map(|b| (target.twist.linear + b.twist.linear) * 0.5);
                let difference = mean.zip(twist).map_or(0.0, |(mean, twist)| (mean - twist).norm());
                errors.twist_m_s = errors.twist_m_s.max(difference);
                count += 1.0;
            }
            before = Some(target);
        }
        errors.delay_s /= count;
        for square in [&mut errors.rms_m, &mut errors.rms_rad, &mut errors.rms_m_s] {
            *square = (*square / count).sqrt();
        }
        errors
    }
}

#[test]
fn sines_at_60_hz_with_jitter_and_losses_are_met_within_half_a_millimetre_after_45_ms() {
    // With jitter in the arrival alone, messages wait after their stamps: the delay is longer.
    for (jitter_of, delays) in [(JitterOf::Sampling, 0.043..0.046), (JitterOf::Arrival, 0.045..0.049)] {
        for (frequency_hz, bound_m) in [(0.3, 0.00002), (1.0, 0.0001), (2.3, 0.0005)] {
            let errors = Source { frequency_hz, jitter_of, ..SOURCE }.errors();
            assert!(delays.contains(&errors.delay_s), "{frequency_hz} Hz: {errors:?}");
            assert!(errors.rms_m < bound_m && errors.rms_rad < bound_m, "{frequency_hz} Hz: {errors:?}");
            // The largest error follows four lost samples in a row.
            assert!(errors.max_m < 50.0 * bound_m, "{frequency_hz} Hz: {errors:?}");
            assert!(errors.rms_m_s < 0.025 * frequency_hz, "{frequency_hz} Hz: {errors:?}");
        }
    }
}

#[test]
fn errors_of_stamps_are_errors_of_the_target_times_velocity_and_no_more() {
    // Stamps evenly distributed over 10 ms err by 2.9 ms RMS. At 0.44 m/s RMS this is 1.28 mm. At higher
    // rates stamps lie within fractions of a millisecond of each other: slopes between such samples could
    // have any size.
    for rate_hz in [60, 100, 150, 200] {
        let errors = Source { rate_hz, jitter_of: JitterOf::Stamp, ..SOURCE }.errors();
        assert!(errors.rms_m < 0.00129 && errors.max_m < 0.006, "{rate_hz} Hz: {errors:?}");
        assert!(errors.rms_m_s < 0.15, "{rate_hz} Hz: {errors:?}");
    }
}

#[test]
fn the_delay_follows_rate_and_jitter() {
    // Sources with 10 ms of jitter and losses, and regular ones.
    for (rate_hz, with_jitter, regular) in
        [(30, 0.0815, 0.0667), (60, 0.0445, 0.0333), (100, 0.0345, 0.020), (200, 0.027, 0.0175)]
    {
        let errors = Source { rate_hz, ..SOURCE }.errors();
        assert!((errors.delay_s - with_jitter).abs() < 0.0015 && errors.rms_m < 0.0004, "{errors:?}");
        let errors = Source { rate_hz, jitter_ms: 0.0, loss: 0.0, ..SOURCE }.errors();
        assert!((errors.delay_s - regular).abs() < 0.0001 && errors.rms_m < 0.00005, "{rate_hz}: {errors:?}");
        // Regular samples: pose and twist have no steps, and the twist is the derivative of the pose.
        assert!(errors.twist_m_s < 0.006, "{rate_hz}: {errors:?}");
    }
}

#[test]
fn a_change_of_rate_changes_the_delay_slowly_and_the_pose_without_a_step() {
    let mut samples = PoseSamples::default();
    let (mut last, mut next_ns) = (None::<(f64, f64, f64)>, 0);
    for now_ns in (0..20_000).map(|cycle| cycle * MS) {
        if now_ns >= next_ns {
            samples.push(now_ns, now_ns, &at(0.2e-9 * now_ns as f64));
            next_ns += if (5000 * MS..12_000 * MS).contains(&now_ns) { 33 * MS } else { 10 * MS };
        }
        let target = samples.target(now_ns).unwrap();
        let (x, velocity) = (target.pose.position.x, target.twist.linear.x);
        let delay = samples.delay_s(now_ns);
        if let Some((x_before, velocity_before, delay_before)) = last.filter(|_| now_ns > 200 * MS) {
            assert!((delay - delay_before).abs() < 0.1001e-3, "{now_ns}: {delay} after {delay_before}");
            // 0.2 m/s; late samples of the slower rate are extrapolated.
            assert!((x - x_before - 0.0002).abs() < 0.00003, "{now_ns}: {x} after {x_before}");
            // The twist is the derivative of the pose, including the change of the delay.
            let difference = (x - x_before) * 1e3 - 0.5 * (velocity + velocity_before);
            assert!(difference.abs() < 0.002, "{now_ns}: {difference}");
        }
        last = Some((x, velocity, delay));
        if now_ns == 11_900 * MS {
            assert!((delay - 0.066).abs() < 0.001, "{delay}");
        }
    }
    assert!((last.unwrap().2 - 0.020).abs() < 0.0005, "{last:?}");
}

fn at(x: f64) -> Pose {
    Pose { rotation: Matrix3::identity(), position: Vector3::x() * x }
}

fn rests_at(samples: &PoseSamples, instant_ns: u64, x: f64) {
    let target = samples.target(instant_ns).unwrap();
    let at_rest = Motion { pose: at(x), twist: Twist::default(), acceleration: Acceleration::default() };
    assert_eq!(target, at_rest, "{instant_ns}");
}

#[test]
fn without_a_sample_there_is_no_target() {
    let mut samples = PoseSamples::default();
    assert!(samples.target(7).is_none());
    samples.push(1000 * MS, 995 * MS, &at(0.1));
    samples.clear();
    assert!(samples.target(1000 * MS).is_none());
}

#[test]
fn one_sample_is_a_pose_at_rest_at_every_instant() {
    let mut samples = PoseSamples::default();
    samples.push(1000 * MS, 995 * MS, &at(0.1));
    for instant_ns in [0, 995 * MS, 1000 * MS, 90_000 * MS] {
        rests_at(&samples, instant_ns, 0.1);
    }
}

#[test]
fn between_two_samples_the_target_moves_straight_and_returns_to_the_second() {
    let mut samples = PoseSamples::default();
    samples.push(1000 * MS, 1000 * MS, &at(0.0));
    samples.push(1020 * MS, 1020 * MS, &at(0.010));
    let end_ns = 1020 * MS + 40 * MS;
    rests_at(&samples, 1039 * MS, 0.0);
    let middle = samples.target(end_ns - 10 * MS).unwrap();
    assert!((middle.pose.position.x - 0.005).abs() < 1e-9 && (middle.twist.linear.x - 0.5).abs() < 1e-9);
    // The motion continues for one and a half intervals, then returns in four.
    let onward = samples.target(end_ns + 30 * MS).unwrap();
    assert!((onward.pose.position.x - 0.025).abs() < 1e-9 && (onward.twist.linear.x - 0.5).abs() < 1e-9);
    rests_at(&samples, end_ns + 110 * MS, 0.010);
    // Pose and twist have no step anywhere.
    let mut last = samples.target(1000 * MS).unwrap();
    for instant_ns in (1041 * MS..1200 * MS).step_by(MS as usize) {
        let target = samples.target(instant_ns).unwrap();
        let mean = 0.5 * (target.twist.linear.x + last.twist.linear.x);
        let is_start = instant_ns == 1041 * MS;
        assert!(is_start || (target.pose.position.x - last.pose.position.x - mean * 1e-3).abs() < 1e-6);
        assert!(is_start || (target.twist.linear.x - last.twist.linear.x).abs() < 0.045, "{instant_ns}");
        last = target;
    }
}

#[test]
fn samples_that_are_not_newer_are_dropped() {
    let mut samples = PoseSamples::default();
    for k in 0..40 {
        samples.push(k * 20 * MS, k * 20 * MS, &at(0.001 * k as f64));
    }
    let before = (samples.target(790 * MS), samples.delay_s(790 * MS));
    for stamp_ns in [780 * MS, 779 * MS, 100 * MS, 0] {
        samples.push(785 * MS, stamp_ns, &at(7.0));
    }
    assert_eq!((samples.target(790 * MS), samples.delay_s(790 * MS)), before);
    // An average, too, is as new as its last sample.
    samples.push(786 * MS, 786 * MS, &at(0.0393));
    let before = samples.target(820 * MS);
    for stamp_ns in [786 * MS, 785 * MS] {
        samples.push(787 * MS, stamp_ns, &at(7.0));
    }
    assert_eq!(samples.target(820 * MS), before);
}

#[test]
fn a_source_that_stops_and_begins_elsewhere_is_held_and_then_taken_from_rest() {
    let mut samples = PoseSamples::default();
    for k in 0..60 {
        samples.push(k * 16 * MS, k * 16 * MS, &at(0.005 * k as f64));
    }
    let (end, delay) = (0.005 * 59.0, samples.delay_s(59 * 16 * MS));
    let overshoot = (944..1200).map(|ms| samples.target(ms * MS).unwrap().pose.position.x - end);
    let overshoot = overshoot.fold(0.0, f64::max);
    // 0.31 m/s times one and a half intervals is 7.5 mm.
    assert!((0.0075..0.0105).contains(&overshoot), "{overshoot}");
    rests_at(&samples, 1100 * MS, end);
    rests_at(&samples, 5000 * MS, end);
    for k in 0..60 {
        let now_ns = (5000 + k * 16) * MS;
        samples.push(now_ns, now_ns, &at(-0.1));
        for ms in 0..16 {
            rests_at(&samples, now_ns + ms * MS, -0.1);
        }
        assert!((samples.delay_s(now_ns) - delay).abs() < 1e-6);
    }
}

#[test]
fn half_turns_between_samples_and_extreme_stamps_give_finite_targets() {
    let mut samples = PoseSamples::default();
    for (k, time_ns) in
        [0, 1, 9 * MS, 30 * MS, 31 * MS, u64::MAX / 2, u64::MAX - 1, u64::MAX].iter().enumerate()
    {
        let rotation = exp(&(Vector3::z() * (3.1 * k as f64)));
        samples.push(*time_ns, *time_ns, &Pose { rotation, position: Vector3::zeros() });
        for instant_ns in [0, 10 * MS, 50 * MS, u64::MAX / 2, u64::MAX] {
            let target = samples.target(instant_ns).unwrap();
            assert!(target.pose.rotation.iter().chain(target.twist.angular.iter()).all(|x| x.is_finite()));
        }
    }
}

#[test]
fn angular_velocity_is_continuous_where_the_axis_of_rotation_turns() {
    // Rotation at 3.1 rad/s about an axis that turns once per second: 0.1 rad between samples. Without the
    // turn of the axis between two samples the angular velocity would jump by 0.015 rad/s from one cubic to
    // the next.
    let cone = |time_ns: u64| {
        let (sin, cos) = (TAU * time_ns as f64 * 1e-9).sin_cos();
        Pose { rotation: exp(&(Vector3::new(cos, sin, 0.0) * 0.5)), position: Vector3::zeros() }
    };
    let (mut samples, mut last) = (PoseSamples::default(), None::<Motion>);
    let step_ns = MS / 10;
    for now_ns in (0..2000 * MS).step_by(step_ns as usize) {
        if now_ns % (33 * MS) == 0 {
            samples.push(now_ns, now_ns, &cone(now_ns));
        }
        let target = samples.target(now_ns).unwrap();
        if let Some(last) = last.filter(|_| now_ns > 200 * MS) {
            let change = (target.twist.angular - last.twist.angular).norm();
            assert!(change < 0.004, "{now_ns}: {change} rad/s");
            let rate = last.pose.displacement_to(&target.pose).angular / (step_ns as f64 * 1e-9);
            let difference = (rate - target.twist.angular).norm();
            assert!(difference < 0.005, "{now_ns}: {difference} rad/s");
        }
        last = Some(target);
    }
}

#[test]
fn the_series_displace_as_the_exponential_does() {
    let start = sine(1.0, 123 * MS).0;
    for angle in [0.0, 1e-9, 0.01, 0.2, 0.499, 0.501, 3.0] {
        let angular = Vector3::new(0.3, -0.9, 0.2).normalize() * angle;
        let displacement = Twist { angular, linear: Vector3::new(1.0, 2.0, 3.0) };
        let (ours, exact) = (displaced(&start, &displacement), start.displaced(&displacement));
        assert!((ours.rotation - exact.rotation).amax() < 3e-11 && ours.position == exact.position);
    }
}
