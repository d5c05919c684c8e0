//! The measured message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use crate::control::controller::Measurement;

message! {
    /// Measured leg lengths and rates, and optionally a measured pose.
    MeasuredMessage = "hexad_measured" on "measured" schema 6 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// L.
        length_m: [f64; 6] ["m"],
        /// L'; used if `rates_valid`.
        length_rate_m_s: [f64; 6] ["m/s"],
        /// 1 if `x` and `twist` are filled in (a simulator, an external tracker), else 0. The control loop does not use
        /// them.
        pose_valid: u32,
        /// 1 if `length_rate_m_s` is filled in by a sensor of its own, else 0. The daemon then estimates the rates: it does so
        /// better than a driver that takes differences of lengths.
        rates_valid: u32,
        /// X.
        x: [f64; 6] ["rad, m"],
        /// omega, then v, base axes.
        twist: [f64; 6] ["rad/s, m/s"],
    }
}

impl From<&MeasuredMessage> for Measurement {
    fn from(message: &MeasuredMessage) -> Self {
        Self {
            time_ns: message.header.time_ns,
            length: message.length_m,
            rate: (message.rates_valid == 1).then_some(message.length_rate_m_s),
        }
    }
}

impl From<&Measurement> for MeasuredMessage {
    fn from(measurement: &Measurement) -> Self {
        Self {
            length_m: measurement.length,
            length_rate_m_s: measurement.rate.unwrap_or_default(),
            rates_valid: u32::from(measurement.rate.is_some()),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measurement_contains_the_numbers_of_the_message() {
        for rate in [None, Some([7.0, 8.0, 9.0, 10.0, 11.0, 12.0])] {
            let measurement = Measurement { time_ns: 42, length: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], rate };
            let mut message = MeasuredMessage::from(&measurement);
            message.header.time_ns = 42;
            assert_eq!(Measurement::from(&message), measurement);
        }
    }
}
