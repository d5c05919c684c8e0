//! Samples of a recorded motion: pose, twist, acceleration and commands at the same instants, smoothed alike.
//!
//! Around an instant t a polynomial of fourth degree is fitted to the measured poses and to the commands, weighted by
//! `(1 - ((t_k - t) / H)^2)^2`. Its value and derivatives at t are the sample. A command acts a delay after its release and
//! is held until the next, so it belongs to the middle of that time. H is short, so that motions of 3 Hz pass to 1e-4; what noise
//! that leaves, 35 mm/s^2 in the acceleration for 2 um at 1 kHz, averages out in the equations.
//!
//! Poses are displacements from the pose in the middle. Near zero the rotation vector's derivatives are angular velocity
//! and acceleration.

use nalgebra::{SMatrix, SVector, Vector6};

use crate::analysis::drive_delay::RecordedStretch;
use hexad_core::model::LEGS;
use hexad_core::model::rigid::{Acceleration, Motion, Twist};

/// Half of the width of the weights, H \[s\], and least number of periods in it.
const HALF_WIDTH_S: f64 = 0.02;
const MIN_PERIODS: f64 = 8.0;
/// Samples within H.
const SAMPLES_PER_HALF_WIDTH: f64 = 4.0;
/// Most samples of a stretch. In a longer stretch the samples are farther apart.
const MAX_SAMPLES: f64 = 100_000.0;
/// Least number of values for a polynomial, and least distance of the outermost from its centre, over H.
const MIN_VALUES: usize = 10;
const MIN_REACH: f64 = 0.8;

/// Coefficients of a polynomial.
const COEFFICIENTS: usize = 5;

/// One instant of a recorded motion.
#[derive(Clone, Copy, Debug)]
pub struct MotionSample {
    /// Since the first release of the stretch \[s\].
    pub time_s: f64,
    /// Measured motion of the platform.
    pub motion: Motion,
    /// Commands of the drives \[N\].
    pub command_n: [f64; LEGS],
}

/// Samples of consecutive cycles, evenly spaced. `delay_s` is the time from the release of a cycle to the instant at which
/// its command acts.
pub fn samples(stretch: &RecordedStretch, delay_s: f64) -> Vec<MotionSample> {
    let RecordedStretch { sent, measured } = stretch;
    let (Some(zero), Some(last)) = (sent.first(), measured.last()) else { return vec![] };
    let seconds = |time_ns: u64| time_ns as i64 as f64 * 1e-9 - zero.release_ns as i64 as f64 * 1e-9;
    let duration_s = seconds(last.time_ns);
    let period_s = duration_s / measured.len() as f64;
    let half_s = HALF_WIDTH_S.max(MIN_PERIODS * period_s);
    let step_s = (half_s / SAMPLES_PER_HALF_WIDTH).max(duration_s / MAX_SAMPLES);
    let held: Vec<_> = sent
        .windows(2)
        .filter_map(|pair| {
            let [now, next] = pair else { return None };
            let [begin, end] = [now, next].map(|sent| seconds(sent.release_ns) + delay_s);
            Some((0.5 * (begin + end), Vector6::from(now.force_n)))
        })
        .collect();
    let poses: Vec<_> = measured.iter().map(|measured| (seconds(measured.time_ns), measured.pose)).collect();
    let at = |index: u32| {
        let time_s = half_s + step_s * f64::from(index);
        let near = within(&poses, time_s, half_s);
        let (_, middle) = near.get(near.len() / 2)?;
        let displacements = near.iter().map(|(t, pose)| (*t, middle.displacement_to(pose).vector()));
        let [displacement, rate, accel] = LocalPolynomial::fit(displacements, time_s, half_s)?;
        let commands = within(&held, time_s, half_s).iter().copied();
        let [command, ..] = LocalPolynomial::fit(commands, time_s, half_s)?;
        Some(MotionSample {
            time_s,
            motion: Motion {
                pose: middle.displaced(&Twist::from_vector(&displacement)),
                twist: Twist::from_vector(&rate),
                acceleration: Acceleration::from_vector(&accel),
            },
            command_n: command.into(),
        })
    };
    let count = ((duration_s - 2.0 * half_s) / step_s).max(0.0) as u32;
    (0..=count).filter_map(at).collect()
}

/// The values less than H from an instant.
fn within<T>(values: &[(f64, T)], time_s: f64, half_s: f64) -> &[(f64, T)] {
    let first = values.partition_point(|(t, _)| *t <= time_s - half_s);
    let end = values.partition_point(|(t, _)| *t < time_s + half_s);
    values.get(first..end).unwrap_or_default()
}

/// Sums of a weighted polynomial fit.
#[derive(Default)]
struct LocalPolynomial {
    normal: SMatrix<f64, COEFFICIENTS, COEFFICIENTS>,
    right: SMatrix<f64, COEFFICIENTS, LEGS>,
}

impl LocalPolynomial {
    /// Value, first and second derivative at the centre; `None` if the values do not surround it.
    fn fit(
        values: impl Iterator<Item = (f64, Vector6<f64>)>,
        center_s: f64,
        half_s: f64,
    ) -> Option<[Vector6<f64>; 3]> {
        let mut sums = Self::default();
        let (mut count, mut lowest, mut highest) = (0, 0.0_f64, 0.0_f64);
        for (time_s, value) in values {
            let x = (time_s - center_s) / half_s;
            let weight = (1.0 - x * x).powi(2);
            let powers = SVector::<f64, COEFFICIENTS>::from_fn(|power, _| x.powi(power as i32));
            sums.normal += powers * powers.transpose() * weight;
            sums.right += powers * value.transpose() * weight;
            (count, lowest, highest) = (count + 1, lowest.min(x), highest.max(x));
        }
        if count < MIN_VALUES || lowest > -MIN_REACH || highest < MIN_REACH {
            return None;
        }
        let coefficients = sums.normal.cholesky()?.solve(&sums.right);
        let row = |power: usize| coefficients.row(power).transpose();
        Some([row(0), row(1) / half_s, row(2) * (2.0 / (half_s * half_s))])
    }
}
