//! `[measured]` and `[drive]`: noise of the sensors, and time from a force message to the force.

use crate::config::bound::Bound;
use crate::config::reader::SectionReader;

/// Default of `length_noise_m`: a good encoder, with its cable and its filter.
const DEFAULT_LENGTH_NOISE_M: f64 = 1e-6;
/// Standard deviation of the error of rounding to steps, over the step: `1 / sqrt(12)`.
const STEP_DEVIATION: f64 = 0.288_675_134_594_812_9;
/// Default of `pose_tolerance_m`: half of a homing error that matters, several times the noise of a good tracker.
const DEFAULT_POSE_TOLERANCE_M: f64 = 5e-4;
/// Default of `ready_timeout_ms`: a drive that enables and a brake that opens take 50 to 200 ms.
const DEFAULT_READY_TIMEOUT_MS: f64 = 500.0;
/// Largest value of the key \[ms\]: during a longer wait an operator would think that the machine does not respond.
const MAX_READY_TIMEOUT_MS: f64 = 10_000.0;
/// Longest delay of drives \[us\]: with more, a platform a tenth lighter than modelled is unstable.
const MAX_DELAY_US: f64 = 15_000.0;

/// Section `[measured]`: errors of the sensors, as standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorNoise {
    /// Standard deviation of a length.
    pub length_m: f64,
    /// Resolution of a length; 0 if unknown.
    pub length_step_m: f64,
    /// Largest difference between a length and the length at a pose from another sensor; no standard deviation.
    pub pose_tolerance_m: f64,
    /// Standard deviation of a rate; `None` if the driver's rates are only checked.
    pub rate_m_s: Option<f64>,
}

/// Section `[drive]`: time from the release of a cycle to the instant at which its force acts.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Dead time; `None` if unknown.
    pub delay_s: Option<f64>,
    /// Time constant of the force.
    pub lag_s: f64,
    /// Longest wait for drives that report that they are not enabled, or their brakes not open.
    pub ready_timeout_s: f64,
}

impl Drive {
    /// Delay that the estimator takes into account: a lag is nearly a delay for errors much slower than it.
    pub fn total_delay_s(&self) -> f64 {
        self.delay_s.unwrap_or_default() + self.lag_s
    }
}

pub(super) fn read_noise(mut section: SectionReader) -> SensorNoise {
    let step = section.number_or("length_step_m", 0.0, Bound::NotNegative);
    let default = if step > 0.0 { STEP_DEVIATION * step } else { DEFAULT_LENGTH_NOISE_M };
    SensorNoise {
        length_step_m: step,
        length_m: section.number_or("length_noise_m", default, Bound::Positive),
        pose_tolerance_m: section.number_or("pose_tolerance_m", DEFAULT_POSE_TOLERANCE_M, Bound::Positive),
        rate_m_s: section.optional_number("rate_noise_m_s", Bound::Positive),
    }
}

pub(super) fn read_drive(mut section: SectionReader) -> Drive {
    let bound = Bound::Within(0.0, MAX_DELAY_US);
    let delay_us = section.optional_number("delay_us", bound);
    let lag_us = section.number_or("lag_us", 0.0, bound);
    let longest = Bound::PositiveUpTo(MAX_READY_TIMEOUT_MS);
    let ready_timeout_s = section.number_or("ready_timeout_ms", DEFAULT_READY_TIMEOUT_MS, longest) / 1e3;
    Drive { delay_s: delay_us.map(|delay_us| delay_us / 1e6), lag_s: lag_us / 1e6, ready_timeout_s }
}
